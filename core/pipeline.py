"""`stitch()`: the one way in. The stages stand here in the order of the data."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .alignment import Alignment, Frame, align, prepare, size_of
from .cameras.camera import Camera
from .cameras.matches import Matches
from .cameras.two_view import TwoView
from .compose.composition import Decided, composed
from .compose.crop import crop_box
from .compose.inpaint import holes_of
from .field.field import Field
from .measure.metrics import appearance
from .measure.report import make_report
from .options import StitchOptions
from .panorama.canvas import Canvas
from .panorama.layers import Layer, reference_layer, target_layer
from .panorama.warp import Warp, reference_box
from .pictures.masks import painted_over
from .pictures.picture import Picture, in_same_colour_space, load_picture, picture_from_array
from .raster.arrays import Box, common, cut
from .system.errors import NoOverlap
from .system.progress import Progress
from .system.threads import in_order

# What can be stitched: a file's name, an array, or a Picture that was read already.
Source = str | Path | np.ndarray | Picture


@dataclass(frozen=True)
class StitchResult:
    """A finished panorama and everything it was made of.

    panorama: what is shown on `canvas`, its light worked out where it is asked for (see `lazy`), as arrays `pixels`
    (H, W, C) float32 scene-linear and alpha (H, W), straight; the two layers, the warp, occluded
    (H, W) bool (what the target cannot see though the map falls inside it) and from_target (H, W) bool (which side of
    the seam a pixel lies on, None without a seam) on `warp.canvas`, which is the same, but of a whole sphere the part
    that the pictures cover (see `spread`); what was decided on the whole canvas; the geometry, the field, the matches
    (all, before inlier choice), the cameras as known before; `report`: a JSON-ready dict; `seconds` by stage. Scale and
    crop are done: pixels are those of the panorama and of the pictures as they were worked on; `full_sizes` (W, H): of
    the pictures as they came.
    """

    panorama: Layer
    canvas: Canvas
    reference: Picture
    target: Picture
    reference_layer: Layer
    target_layer: Layer
    warp: Warp
    occluded: np.ndarray
    from_target: np.ndarray | None
    decided: Decided
    two_view: TwoView
    field: Field
    matches: Matches
    cameras: tuple[Camera, Camera]
    warnings: tuple[str, ...]
    report: dict[str, Any]
    seconds: dict[str, float]
    full_sizes: tuple[tuple[int, int], tuple[int, int]]

    @property
    def pixels(self) -> np.ndarray:
        """The panorama's light (H, W, C) float32, scene-linear."""
        return self.panorama.pixels

    @property
    def alpha(self) -> np.ndarray:
        """The panorama's alpha (H, W) float32, straight."""
        return self.panorama.alpha.astype(np.float32)

    @property
    def used_matches(self) -> Matches:
        """The matches that the field stands on, in px of the full pictures."""
        used = self.matches.subset(np.flatnonzero(self.two_view.inliers)[self.field.fit.inliers_used])
        x, y = (
            (points + 0.5) * (np.array(full) / np.array(camera.size)) - 0.5
            for points, full, camera in zip((used.x, used.y), self.full_sizes, self.cameras, strict=True)
        )
        return Matches(x, y, used.scale, used.weights)

    @property
    def spread(self) -> Box:
        """The panorama's place on the canvas of warp and layers: `within` this they have its size."""
        (x, y), (left, top) = self.warp.canvas.offset, self.canvas.offset
        return x - left, y - top, self.canvas.width, self.canvas.height

    def spread_out(self) -> StitchResult:
        """The same with warp, layers and masks as large as the panorama."""
        if (self.canvas.width, self.canvas.height) == (self.warp.canvas.width, self.warp.canvas.height):
            return self
        box = self.spread
        from_target = None if self.from_target is None else cut(self.from_target, box)
        return replace(
            self, warp=self.warp.within(box), occluded=cut(self.occluded, box), from_target=from_target,
            reference_layer=self.reference_layer.within(box), target_layer=self.target_layer.within(box),
        )  # fmt: skip

    @property
    def confidence(self) -> np.ndarray:
        """(H, W) float32, 0..1: how sure dense refinement is of a pixel of the warp's canvas; 0 where it said
        nothing."""
        confidence = self.warp.confidence
        return np.zeros(self.warp.map_x.shape, np.float32) if confidence is None else confidence

    @property
    def inpainted(self) -> np.ndarray:
        """(H, W) bool: what neither picture saw and was filled because that was asked for."""
        asked = self.report["options"]
        if asked["holes"] != "inpaint" or asked["blend"] == "linear":
            return np.zeros(self.occluded.shape, bool)
        return holes_of(self.occluded, self.reference_layer, self.target_layer)

    @property
    def bits(self) -> int:
        """Bits per channel of the deeper input (32: float)."""
        return max(self.reference.bits, self.target.bits)


def stitch(
    reference: Source,
    target: Source,
    options: StitchOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> StitchResult:
    """Stitches the target into the reference's plane.

    reference, target: files, arrays (see `picture_from_array`: 8 and 16 bit display-encoded, float scene-linear; RGB(A)
    or gray), or Pictures. progress(stage, share of everything done) and cancelled() are called between the steps of the
    work.
    Raises StitchError and its kinds; Cancelled where asked to stop.
    """
    options = options or StitchOptions()
    steps = Stopwatch(Progress(progress, cancelled))

    steps("read")
    frame = read_frame(reference, target, options)
    return compose(frame, align([frame], options, steps), options, steps)


def read_frame(reference: Source, target: Source, options: StitchOptions) -> Frame:
    """Both pictures, in the same colour space. Raises UnreadableImage, BadRequest, NoOverlap (one picture twice)."""
    first, second = in_same_colour_space(*in_order(_picture, (reference, target)))
    if first.view.shape == second.view.shape and np.array_equal(first.view, second.view):
        raise NoOverlap("the two pictures are the same picture: choose two photographs taken from different places")
    return prepare(first, second, options)


def compose(
    frame: Frame, alignment: Alignment, options: StitchOptions, steps: Stopwatch, decided: Decided | None = None,
    keep: bool = False,
) -> StitchResult:
    """The panorama of two pictures by an alignment, which may come from other frames of the same two cameras, as may
    what was decided about exposure and seam. decided, keep: see `composed`."""
    first, second, whole = frame.reference, frame.target, alignment.warp
    steps("warp", 0.5)
    base, layer = reference_layer(first, whole.canvas, alignment.cameras[0]), target_layer(second, whole)

    painted = None if frame.painted is None else _on_canvas(frame.painted, whole.canvas)
    floats = (first.bits == 32, second.bits == 32)
    panorama, exposed, found = composed(
        base, layer, whole, alignment.two_view, size_of(second), options, floats, painted, steps, decided, keep,
        alignment.cameras[0],
    )
    seen = appearance(panorama, base, exposed, found.from_target, floats) if options.measure else {}
    place = reference_box(whole.canvas, alignment.cameras[0])
    box = crop_box(options.crop, whole.canvas.whole, panorama.alpha > 0, place)
    panorama, shown = panorama.within(box), whole.canvas.within(box)
    box = common(box, (0, 0, whole.canvas.width, whole.canvas.height))
    base, layer, warp, hidden = base.within(box), layer.within(box), whole.within(box), cut(found.hidden, box)
    from_target = None if found.from_target is None else cut(found.from_target, box)

    steps("write", 0.0)
    report, more = make_report(options, (first, second), alignment, shown, found, seen)
    warnings = (*_named(first), *_named(second), *alignment.warnings, *more)
    report["warnings"] = list(warnings)
    steps("write", 0.5)
    return StitchResult(
        panorama, shown, first, second, base, layer, warp, hidden, from_target, found,
        alignment.two_view, alignment.field, alignment.matches, alignment.cameras, warnings, report, steps.seconds,
        frame.full_sizes,
    )  # fmt: skip


class Stopwatch:
    """Reports each stage, lets it be cancelled, and keeps its seconds."""

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


def _picture(source: Source) -> Picture:
    if isinstance(source, Picture):
        return source
    return picture_from_array(source) if isinstance(source, np.ndarray) else load_picture(source)


def _on_canvas(painted: np.ndarray, canvas: Canvas) -> np.ndarray:
    """What was painted over the whole panorama, on the canvas: of a sphere the part that the pictures cover."""
    left, top, width, height = canvas.whole
    return cut(painted_over(painted, (width, height)), (-left, -top, canvas.width, canvas.height))


def _named(picture: Picture) -> list[str]:
    return [f"{picture.name}: {warning}" for warning in picture.warnings]
