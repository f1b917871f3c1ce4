"""From pictures to a panorama: `stitch()`, and its three stages for those who need them apart.

`read_frame` reads the pictures, `alignment.align` finds how they lie on the reference, `compose` makes one picture of
them. A clip aligns many frames at once and composes each; a comparison composes one frame by several fields.
"""

from __future__ import annotations

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
from .cameras.rig import Rig
from .cameras.view import View
from .compose.composition import Composition, composed
from .compose.crop import crop_box
from .compose.decided import Decided
from .compose.enlarging.draft import draft_times
from .compose.enlarging.enlarged import EnlargedPanorama, enlarged_map
from .compose.enlarging.full_set import FullSet
from .compose.enlarging.memory_need import threads_that_fit
from .field.field import Field
from .field.sphere_field import SphereField
from .frames.frame import Frame, size_of
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
from .raster.enlarging import enlarged_box, reduced_box
from .raster.picture_map import CanvasMap
from .raster.resizing import resized_points
from .system.errors import BadRequest
from .system.memory import give_back
from .system.progress import Progress, Stopwatch, stages_of
from .system.threads import ask, asking, at_most


@dataclass(frozen=True)
class StitchResult:
    """A finished panorama and everything it was made of.

    Tuples hold one entry for each picture that is used, the reference first: of many, the viewpoint's. Scale and crop
    are done: px are those of the panorama, and of the pictures as they were worked on. `warp`, `layers`, `occluded`,
    `labels`, `inpainted` and `decided` lie on `warp.canvas` (H, W). That is `canvas`, but of a whole sphere only the
    part that the pictures cover (see `spread`), and of a large set a draft of it: one of its px is `times` px of the
    panorama a side, and `full_layer`, `full_map` and `full_labels` enlarge what lies on it.

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
    warnings : tuple of str
        In plain words.
    report : dict
        What was measured and decided, JSON-ready (docs/formats.md).
    seconds : dict of float
        Wall time of each stage, s.
    full_sizes : tuple of (W, H)
        px of the pictures as they came.
    enlarged : EnlargedPanorama or None
        Of a large set: what makes a full panorama of what was decided on small pictures.
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
    enlarged: EnlargedPanorama | None = None

    @property
    def times(self) -> int:
        """How many px of the panorama lie along one of `warp.canvas`."""
        return 1 if self.enlarged is None else self.enlarged.draft.times

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
        """The panorama's box on the canvas of warp and layers, in px of the panorama; it may reach beyond that."""
        (x, y), (left, top) = self.warp.canvas.offset, self.canvas.offset
        return self.times * x - left, self.times * y - top, self.canvas.width, self.canvas.height

    def full_map(self, number: int) -> CanvasMap:
        """Where the canvas of `warp`, in px of the panorama, shows a picture."""
        one = self.warp.maps[number]
        return one if self.enlarged is None else enlarged_map(one, self.times, size_of(self.pictures[number]))

    def full_layer(self, number: int) -> Layer:
        """A picture on the canvas of `warp`, in px of the panorama."""
        if self.enlarged is None:
            return self.layers[number]
        return layer_of(self.pictures[number], self.full_map(number), by_root=True)

    def full_labels(self) -> NDArray[np.int16] | None:
        """Which picture each pixel of the panorama comes from, −1 for none; None without a seam."""
        if self.labels is None:
            return None
        if self.enlarged is None:
            return cut(self.labels, self.spread, -1)
        x, y = np.subtract(self.enlarged.canvas.offset, self.canvas.offset).tolist()
        return cut(self.enlarged.labels(), (x, y, self.canvas.width, self.canvas.height), -1)

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

    with asking(cancelled), at_most(threads_that_fit(pictures, options)):
        stopwatch("read")
        frame = read_frame(pictures, options)
        geometry = estimate_geometry([frame], options, stopwatch)
        frame = frame.only(geometry.numbers)
        if geometry.rig is not None:
            return _of_many(frame, geometry, options, stopwatch)
        return first_usable(
            lambda by: compose(frame, fit_and_warp(geometry, [frame], by, stopwatch), by, stopwatch), options
        )


def _of_many(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of more than two pictures: of large ones by what is decided on small ones."""
    give_back()  # what features took lies between what stays
    times = draft_times([size_of(picture) for picture in frame.pictures], options)
    small = frame.reduced(times)
    geometry_of_small = geometry.of_resized([size_of(picture) for picture in small.pictures])
    alignment = fit_and_warp(geometry_of_small, [small], options, progress)
    full = None if times == 1 or geometry.rig is None else FullSet(frame.pictures, geometry.rig, times)
    give_back()
    result = compose(small, alignment, options, progress, full=full)
    give_back()
    return result


def compose(
    frame: Frame, alignment: Alignment, options: StitchOptions, progress: Stopwatch,
    decided: Sequence[Decided] | None = None, keep: bool = False, full: FullSet | None = None,
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
    full : FullSet, optional
        What the pictures of the frame are small copies of: the panorama is made of these.

    Returns
    -------
    StitchResult

    Raises
    ------
    BadRequest
        A crop that the panorama does not hold, or a painted mask that does not fit.
    """
    pictures, whole = frame.pictures, alignment.warp
    times, canvas = (1, whole.canvas) if full is None else (full.times, full.canvas_of(whole))
    progress("warp", 0.5)
    # two pictures keep what earlier releases made of them
    by_root = len(pictures) > 2
    hold = full is None  # of a large set, all together are no longer small
    layers = tuple(layer_of(picture, one, by_root, hold) for picture, one in zip(pictures, whole.maps, strict=True))

    floats = [picture.bits == 32 for picture in pictures]

    def composed_with(painted: NDArray[np.int8] | None) -> tuple[Composition, EnlargedPanorama | None, Layer, Box]:
        made = composed(layers, whole, alignment.views, options, floats, painted, progress, decided, keep)
        ask()
        enlarged = None if full is None else full.enlarged(made, whole)
        panorama = made.panorama if enlarged is None else Layer(enlarged, enlarged.alpha())
        own = whole.maps[0].inside()
        reference = enlarged_box(box_of(own), times) if own.any() else None
        box = crop_box(options.kept, canvas.whole, panorama.shows, reference, len(pictures))
        return made, enlarged, panorama, box

    painted = frame.painted
    if painted is not None:
        place = whole.canvas.whole
        if options.kept != "full" and painted.shape[::-1] != place[2:]:
            # it may have been painted over the panorama as it is cropped
            cropped = composed_with(None)[3]
            place = cropped if has_shape(painted, cropped[2:]) else place
        painted = _on_canvas(painted, whole.canvas, place)
    made, enlarged, panorama, box = composed_with(painted)
    labels = made.labels
    ask()
    looks = appearance(made.panorama, made.exposed, labels, any(floats)) if options.measure else {}
    panorama, canvas = panorama.within(box), canvas.within(box)
    # of a whole sphere, layers and maps exist only where the pictures lie
    box = common(reduced_box(box, times), (0, 0, whole.canvas.width, whole.canvas.height))
    if full is not None:
        rig, pictures = full.rig, full.pictures
        alignment = replace(alignment, cameras=rig.cameras, views=rig.views, rig=rig)

    progress("write", 0.0)
    hidden = np.logical_or.reduce([one.hidden for one in made.decided])
    told = (
        options, pictures, alignment, canvas, made.decided, looks, panorama.shows, int(made.filled.sum()),
        int((hidden & (made.panorama.alpha == 0)).sum()),
    )  # fmt: skip
    report, more = make_report(*told) if alignment.rig is None else make_rig_report(*told, labels, times)
    named = (line for picture in pictures for line in _named(picture))
    warnings = (*frame.warnings, *named, *alignment.warnings, *more)
    report["warnings"] = list(warnings)
    warp, occluded = whole.within(box), tuple(cut(one.hidden, box) for one in made.decided)
    labels = None if labels is None else cut(labels, box, -1)
    look = look_at(frame.pictures, warp.maps, [one.exposure for one in made.decided], occluded, labels)
    look = replace(look, step=look.step * times)
    x, y = np.subtract(canvas.offset, times * np.array(warp.canvas.offset)).tolist()
    report["verdict"] = judge(look, (x, y), report).entry
    progress("write", 0.5)
    return StitchResult(
        panorama=panorama, canvas=canvas, pictures=pictures, layers=tuple(layer.within(box) for layer in layers),
        warp=warp, occluded=occluded, labels=labels, inpainted=cut(made.filled, box),
        decided=made.decided, edges=alignment.edges, views=alignment.views, field=alignment.field,
        cameras=alignment.cameras, warnings=warnings, report=report, seconds=progress.seconds,
        full_sizes=frame.full_sizes, rig=alignment.rig, enlarged=enlarged,
    )  # fmt: skip


def _on_canvas(painted: NDArray[np.int8], canvas: Canvas, place: Box) -> NDArray[np.int8]:
    """What was painted over a box of the canvas, on the canvas: of a sphere the part that the pictures cover."""
    left, top, width, height = place
    return cut(painted_over(painted, (width, height)), (-left, -top, canvas.width, canvas.height))


def _named(picture: Picture) -> list[str]:
    """The warnings about a picture, each with its name."""
    return [f"{picture.name}: {warning}" for warning in picture.warnings]
