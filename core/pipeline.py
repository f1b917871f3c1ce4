"""From pictures to a panorama: `stitch()`, and its three stages for those who need them apart.

`read_frame` reads the pictures, `alignment.align` finds how they lie on the reference, `compose` makes one picture of
them. A clip aligns many frames at once and composes each; a comparison composes one frame by several fields.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .alignment import Alignment, Geometry, estimate_geometry, fit_and_warp
from .compose.composition import Composition, composed
from .compose.crop import crop_box
from .compose.decided import Decided
from .compose.enlarging.draft import draft_times
from .compose.enlarging.enlarged import EnlargedPanorama
from .frames.frame import Frame, size_of
from .frames.reading import Source, read_frame
from .full_set import FullSet
from .measure.fallback import first_usable
from .measure.look import look_at
from .measure.metrics import appearance
from .measure.report import make_report
from .measure.rig_report import make_rig_report
from .measure.verdict import judge
from .options import StitchOptions
from .panorama.canvas import Canvas
from .panorama.layers import Layer, layer_of
from .pictures.masks import has_shape, painted_over
from .pictures.picture import Picture
from .raster.arrays import Box, box_of, common, cut
from .raster.enlarging import enlarged_box, reduced_box
from .stitch_result import StitchResult
from .system.errors import BadRequest
from .system.progress import Progress, stages_of
from .system.threads import ask, asking


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
        if geometry.rig is not None:
            return _of_many(frame, geometry, options, stopwatch)
        return first_usable(
            lambda by: compose(frame, fit_and_warp(geometry, [frame], by, stopwatch), by, stopwatch), options
        )


def _of_many(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of more than two pictures: of large ones by what is decided on small ones."""
    times = draft_times([size_of(picture) for picture in frame.pictures], options)
    small = frame.reduced(times)
    geometry_of_small = geometry.of_resized([size_of(picture) for picture in small.pictures])
    alignment = fit_and_warp(geometry_of_small, [small], options, progress)
    full = None if times == 1 else FullSet(frame, geometry, times)
    return compose(small, alignment, options, progress, full=full)


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
    layers = tuple(layer_of(picture, one, by_root) for picture, one in zip(pictures, whole.maps, strict=True))

    floats = [picture.bits == 32 for picture in pictures]

    def composed_with(painted: NDArray[np.int8] | None) -> tuple[Composition, EnlargedPanorama | None, Layer, Box]:
        made = composed(layers, whole, alignment.views, options, floats, painted, progress, decided, keep)
        ask()
        enlarged = None if full is None else full.enlarged(made, whole)
        panorama = made.panorama if enlarged is None else Layer(enlarged, enlarged.alpha())
        own = whole.maps[0].inside()
        reference = enlarged_box(box_of(own), times) if own.any() else None
        box = crop_box(options.kept, canvas.whole, panorama.alpha > 0, reference, len(pictures))
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
        pictures, alignment = full.frame.pictures, full.alignment(alignment)

    progress("write", 0.0)
    hidden = np.logical_or.reduce([one.hidden for one in made.decided])
    told = (
        options, pictures, alignment, canvas, made.decided, looks, panorama.alpha > 0, int(made.filled.sum()),
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
