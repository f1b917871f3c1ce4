"""From pictures to a panorama: `stitch()`, and its three stages for those who need them apart.

`read_frame` reads the pictures, `alignment.align` finds how they lie on the reference, `compose` makes one picture of
them. A clip aligns many frames at once and composes each; a comparison composes one frame by several fields.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .alignment import Alignment, Geometry, estimate_geometry, fit_and_warp
from .cameras.camera import Camera
from .cameras.edge import Edge
from .cameras.matches import Matches
from .cameras.resized import resized_edge, resized_rig
from .cameras.rig import Rig
from .cameras.scale import Scale
from .cameras.view import View
from .compose.composition import Composition, composed
from .compose.crop import crop_box
from .compose.decided import Decided
from .field.field import Field
from .field.sphere_field import SphereField
from .frames.frame import Frame, size_of
from .frames.options import PREVIEW
from .frames.preview import first_share, next_share
from .frames.reading import Source, read_frame
from .measure.fallback import first_usable
from .measure.look import look_at
from .measure.metrics import appearance
from .measure.report import make_report
from .measure.rig_report import make_rig_report
from .measure.verdict import judge
from .options import StitchOptions
from .panorama.canvas import Canvas
from .panorama.layers import Layer, layer_of
from .panorama.warp import Warp
from .pictures.masks import has_shape, painted_over
from .pictures.picture import Picture
from .raster.arrays import Box, box_of, common, cut
from .raster.resizing import resized_points
from .system.errors import BadRequest
from .system.progress import Progress, stages_of
from .system.threads import ask, asking


@dataclass(frozen=True)
class StitchResult:
    """A finished panorama and everything it was made of.

    Tuples hold one entry for each picture that is used, the reference first: of many, the viewpoint's. Scale and crop
    are done: px are those of the panorama, and of the pictures as they were worked on. `warp`, `layers`, `occluded` and
    `labels` lie on `warp.canvas` (H, W). That is `canvas`, but of a whole sphere only the part that the pictures cover
    (see `spread`).

    Attributes
    ----------
    panorama : Layer
        What `canvas` shows. Its light is a lazy image, worked out where it is asked for.
    canvas : Canvas
        Size and place of the panorama.
    pictures : tuple of Picture
        As they were worked on: scaled, and without what was masked.
    layers : tuple of Layer
        Each picture on the canvas, before exposure and blending.
    warp : Warp
        The maps from the canvas to each picture, with inverse depth and confidence.
    occluded : tuple of ndarray (H, W) bool
        What a picture cannot see though its map falls inside it.
    labels : ndarray (H, W) int16 or None
        Which picture a pixel comes from, −1 for none; None without a seam.
    inpainted : ndarray (H, W) bool
        What no picture shows and was filled.
    decided : tuple of Decided
        What was decided about each picture, on the uncropped canvas.
    edges : tuple of Edge
        Pairs of pictures with their geometry and all matches, before inliers were chosen.
    views : tuple of View
        Each picture's place relative to the reference.
    field : Field or SphereField
        The displacement field.
    cameras : tuple of Camera
        As they were known before estimation; of more than two pictures, as they were estimated.
    rig : Rig or None
        The cameras and points of more than two pictures.
    scale : Scale
        How long a baseline is, the unit of depth.
    warnings : tuple of str
        In plain words.
    report : dict
        What was measured and decided, JSON-ready (docs/formats.md).
    seconds : dict of float
        Wall time of each stage, s.
    full_sizes : tuple of (W, H)
        px of the pictures as they came.
    """

    panorama: Layer
    canvas: Canvas
    pictures: tuple[Picture, ...]
    layers: tuple[Layer, ...]
    warp: Warp
    occluded: tuple[NDArray[np.bool_], ...]
    labels: NDArray[np.int16] | None
    inpainted: NDArray[np.bool_]
    decided: tuple[Decided, ...]
    edges: tuple[Edge, ...]
    views: tuple[View, ...]
    field: Field | SphereField
    cameras: tuple[Camera, ...]
    warnings: tuple[str, ...]
    report: dict[str, Any]
    seconds: dict[str, float]
    full_sizes: tuple[tuple[int, int], ...]
    rig: Rig | None = None
    scale: Scale = Scale()

    @property
    def pixels(self) -> NDArray[np.float32]:
        """The panorama's colours (H, W, C) float32, scene-linear."""
        return self.panorama.pixels

    @property
    def alpha(self) -> NDArray[np.float32]:
        """The panorama's alpha (H, W) float32, straight."""
        return self.panorama.alpha.astype(np.float32)

    @property
    def pair_field(self) -> Field:
        """The displacement field of a pair."""
        assert not isinstance(self.field, SphereField)
        return self.field

    @property
    def full_matches(self) -> Matches:
        """All matches of a pair, before any was left out, in px of the full pictures."""
        return self.matches_of(self.edges[0])

    def matches_of(self, edge: Edge) -> Matches:
        """The same of one of its edges."""
        matches = edge.matches
        sides = zip((matches.x, matches.y), edge.pair(self.cameras), edge.pair(self.full_sizes), strict=True)
        x, y = (resized_points(points, camera.size, full) for points, camera, full in sides)
        return replace(matches, x=x, y=y)

    @property
    def used_matches(self) -> Matches:
        """The matches of a pair that the field stands on, in px of the full pictures."""
        return self.full_matches.subset(self.used)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which of all matches of a pair the field stands on (N,), bool."""
        return self.used_of(self.edges[0])

    def used_of(self, edge: Edge) -> NDArray[np.bool_]:
        """The same of one of its edges; of more than two pictures, which are points of the rig."""
        inliers = edge.two_view.inliers
        if isinstance(self.field, SphereField):
            return inliers
        used = np.zeros(len(inliers), bool)
        used[np.flatnonzero(inliers)[self.field.fit.inliers_used]] = True
        return used

    @property
    def spread(self) -> Box:
        """The panorama's box on the canvas of warp and layers, px; it may reach beyond that."""
        (x, y), (left, top) = self.warp.canvas.offset, self.canvas.offset
        return x - left, y - top, self.canvas.width, self.canvas.height

    def spread_out(self) -> StitchResult:
        """The same with warp, layers and masks as large as the panorama."""
        if (self.canvas.width, self.canvas.height) == (self.warp.canvas.width, self.warp.canvas.height):
            return self
        box = self.spread
        return replace(
            self, warp=self.warp.within(box), layers=tuple(layer.within(box) for layer in self.layers),
            occluded=tuple(cut(mask, box) for mask in self.occluded),
            labels=None if self.labels is None else cut(self.labels, box, -1), inpainted=cut(self.inpainted, box),
        )  # fmt: skip

    @property
    def confidence(self) -> NDArray[np.float32]:
        """Confidence (H, W) float32 of dense refinement on the warp's canvas, 0 to 1; 0 where nothing was refined."""
        confidence = self.warp.confidence
        shape = self.warp.canvas.height, self.warp.canvas.width
        return np.zeros(shape, np.float32) if confidence is None else confidence

    @property
    def bits(self) -> int:
        """Bits per channel of the deepest input (32: float)."""
        return max(picture.bits for picture in self.pictures)


def stitch(
    pictures: Sequence[Source],
    options: StitchOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> StitchResult:
    """Stitches pictures into one panorama, seen from where the first of them was taken, or from there on (see `slide`
    and `viewpoint`). Of more than two, those that connect with no others are left out, and named in the warnings.

    Where a pair's is not usable (see `measure.verdict`) and something simpler is, the simpler one is the result.

    Parameters
    ----------
    pictures
        2 to 60 files, arrays (see `picture_from_array`: 8 and 16 bit display-encoded, float scene-linear; RGB(A) or
        gray), or Pictures. Of two the first is the reference; more may come in any order.
    options
        What may be chosen; the defaults are right for photographs of one camera.
    progress
        Called with a stage's name and the share (0..1) of everything that is done.
    cancelled
        Called between the steps of the work; says whether to stop.

    Returns
    -------
    StitchResult
        The panorama, its layers and maps, and the report.

    Raises
    ------
    StitchError
        And its kinds: what is wrong with the pictures or the options, and what would help; Cancelled where asked to
        stop.
    """
    if isinstance(pictures, (str, Path, np.ndarray, Picture)):
        raise BadRequest("stitch() takes its pictures as a list: stitch([left, right], options)")
    options = options or StitchOptions()
    stopwatch = Stopwatch(Progress(progress, cancelled, stages_of(len(pictures))))

    with asking(cancelled):
        stopwatch("read")
        frame = read_frame(pictures, options)
        geometry = estimate_geometry([frame], options, stopwatch)
        frame = frame.only(geometry.numbers)
        return (_preview if options.preview else _made)(frame, geometry, options, stopwatch)


def _made(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of a geometry, of a pair the first that is usable."""

    def made(by: StitchOptions) -> StitchResult:
        return compose(frame, fit_and_warp(geometry, [frame], by, progress), by, progress)

    return first_usable(made, options) if geometry.rig is None else made(options)


def _preview(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """A small panorama of a geometry that was found on the full pictures."""
    turns = [np.eye(3), geometry.edges[0].two_view.R] if geometry.rig is None else geometry.rig.R
    share = first_share(geometry.cameras, list(turns))
    for tries_left in range(PREVIEW.tries - 1, -1, -1):
        small = frame.resized(share)
        sizes = [size_of(picture) for picture in small.pictures]
        edges = tuple(resized_edge(edge, geometry.cameras, sizes) for edge in geometry.edges)
        rig = None if geometry.rig is None else resized_rig(geometry.rig, sizes)
        cameras = tuple(camera.resized(size) for camera, size in zip(geometry.cameras, sizes, strict=True))
        result = _made(small, replace(geometry, cameras=cameras, edges=edges, rig=rig), options, progress)
        better = next_share(share, result.canvas.width * result.canvas.height)
        if better == share or not tries_left:
            break
        share = better
    return result


def compose(
    frame: Frame, alignment: Alignment, options: StitchOptions, progress: Stopwatch,
    decided: Sequence[Decided] | None = None, keep: bool = False,
) -> StitchResult:  # fmt: skip
    """Makes one panorama of aligned pictures.

    Parameters
    ----------
    frame : Frame
    alignment : Alignment
        Of these pictures, or of other frames of the same cameras.
    options : StitchOptions
    progress : Stopwatch
    decided : sequence of Decided, optional
        Exposure and seam that were decided about other frames of the same cameras, to be kept to.
    keep : bool
        Whether to keep what the seams were cut by, for `pooled_decision`.

    Returns
    -------
    StitchResult

    Raises
    ------
    BadRequest
        A crop that the panorama does not hold, or a painted mask that does not fit.
    """
    pictures, whole = frame.pictures, alignment.warp
    progress("warp", 0.5)
    # two pictures keep what earlier releases made of them
    by_root = len(pictures) > 2
    layers = tuple(layer_of(picture, one, by_root) for picture, one in zip(pictures, whole.maps, strict=True))

    floats = [picture.bits == 32 for picture in pictures]

    def composed_with(painted: NDArray[np.int8] | None) -> tuple[Composition, Box]:
        made = composed(layers, whole, alignment.views, options, floats, painted, progress, decided, keep)
        ask()
        own = whole.maps[0].inside()
        shown = made.panorama.alpha > 0
        reference = box_of(own) if own.any() else None
        return made, crop_box(options.kept, whole.canvas.whole, shown, reference, len(pictures))

    painted = frame.painted
    if painted is not None:
        place = whole.canvas.whole
        if options.kept != "full" and painted.shape[::-1] != place[2:]:
            # it may have been painted over the panorama as it is cropped
            cropped = composed_with(None)[1]
            place = cropped if has_shape(painted, cropped[2:]) else place
        painted = _on_canvas(painted, whole.canvas, place)
    made, box = composed_with(painted)
    panorama, labels = made.panorama, made.labels
    ask()
    looks = appearance(panorama, made.exposed, labels, any(floats)) if options.measure else {}
    panorama, canvas = panorama.within(box), whole.canvas.within(box)
    # of a whole sphere, layers and maps exist only where the pictures lie
    box = common(box, (0, 0, whole.canvas.width, whole.canvas.height))

    progress("write", 0.0)
    told = (
        options, pictures, alignment, canvas, made.decided, looks, panorama.alpha > 0, int(made.filled.sum()),
    )  # fmt: skip
    if alignment.rig is None:
        hidden = np.logical_or.reduce([one.hidden for one in made.decided])
        report, more = make_report(*told, int((hidden & (made.panorama.alpha == 0)).sum()))
    else:
        report, more = make_rig_report(*told, labels)
    named = (line for picture in pictures for line in _named(picture))
    warnings = (*frame.warnings, *named, *alignment.warnings, *more)
    report["warnings"] = list(warnings)
    warp, occluded = whole.within(box), tuple(cut(one.hidden, box) for one in made.decided)
    labels = None if labels is None else cut(labels, box, -1)
    look = look_at(pictures, warp.maps, [one.exposure for one in made.decided], occluded, labels)
    x, y = np.subtract(canvas.offset, warp.canvas.offset).tolist()
    report["verdict"] = judge(look, (x, y), report).entry
    progress("write", 0.5)
    return StitchResult(
        panorama=panorama, canvas=canvas, pictures=pictures, layers=tuple(layer.within(box) for layer in layers),
        warp=warp, occluded=occluded, labels=labels, inpainted=cut(made.filled, box),
        decided=made.decided, edges=alignment.edges, views=alignment.views, field=alignment.field,
        cameras=alignment.cameras, warnings=warnings, report=report, seconds=progress.seconds,
        full_sizes=frame.full_sizes, rig=alignment.rig, scale=alignment.scale,
    )  # fmt: skip


class Stopwatch:
    """A progress callable that also keeps the seconds of each stage (`seconds`), and raises Cancelled where asked."""

    def __init__(self, progress: Progress) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress
        self._stage, self._since = "", time.perf_counter()

    def __call__(self, stage: str, fraction: float = 0.0) -> None:
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._stage, self._since = stage, now
        self._progress(stage, fraction)


def _on_canvas(painted: NDArray[np.int8], canvas: Canvas, place: Box) -> NDArray[np.int8]:
    """What was painted over a box of the canvas, on the canvas: of a sphere the part that the pictures cover."""
    left, top, width, height = place
    return cut(painted_over(painted, (width, height)), (-left, -top, canvas.width, canvas.height))


def _named(picture: Picture) -> list[str]:
    """The warnings about a picture, each with its name."""
    return [f"{picture.name}: {warning}" for warning in picture.warnings]
