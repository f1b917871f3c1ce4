"""From pictures to a panorama: `stitch()`, and its three stages for those who need them apart.

`read_frame` reads the pictures, `alignment.align` finds how they lie on the reference, `compose` makes one picture of
them. A clip aligns many frames at once and composes each; a comparison composes one frame by several fields.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .alignment import Alignment, Geometry, estimate_geometry, fit_and_warp
from .compose.burnt_in import shown_where_alone
from .compose.composition import Composition, composed
from .compose.crop import crop_box
from .compose.decided import Decided
from .compose.enlarging.draft import draft_times
from .compose.enlarging.enlarged import EnlargedPanorama
from .compose.enlarging.full_set import FullSet
from .compose.enlarging.memory_need import threads_that_fit, threads_that_fit_merged
from .compose.stitch_result import StitchResult
from .compose.wanted import wanted_on
from .frames.frame import Frame
from .frames.options import PREVIEW
from .frames.preview import first_share, next_share
from .frames.reading import Source, read_frame
from .mapping import map_pictures
from .measure.fallback import first_usable, least_torn
from .measure.look import look_at
from .measure.metrics import appearance
from .measure.report import make_report
from .measure.rig_report import make_rig_report
from .measure.verdict import judge
from .options import StitchOptions
from .panorama.canvas import Canvas
from .panorama.choosing_slide import SlideChoice
from .panorama.layers import Layer, layer_of
from .pictures.masks import has_shape, painted_over
from .pictures.picture import Picture
from .raster.arrays import Box, box_of, common, cut
from .raster.enlarging import enlarged_box, reduced_box
from .system.errors import BadRequest
from .system.memory import give_back
from .system.progress import Progress, Stopwatch, stages_of
from .system.threads import ask, asking, at_most, count

__all__ = ["StitchResult", "compose", "stitch"]


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
        stopwatch.expect(len(frame.pictures))  # exposures are one picture by now, and spheres several
        with at_most(threads_that_fit_merged(frame.full_sizes, options) if frame.brackets else count()):
            geometry = estimate_geometry([frame], options, stopwatch)
            frame = frame.only(geometry.numbers)
            if options.preview:
                return _preview(frame, geometry, options, stopwatch)
            return panorama_of(frame, geometry, options, stopwatch)


def panorama_of(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of pictures whose geometry is known, as `stitch` makes it: of a pair the first that is usable, of a
    large set by what is decided on small pictures. frame: the pictures of the geometry. Raises as `stitch` does."""
    give_back()  # what features took lies between what stays
    return (_made if geometry.rig is None else _of_many)(frame, geometry, options, progress)


def _made(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of a geometry, of a pair the first that is usable."""

    def made(by: StitchOptions) -> StitchResult:
        alignment = fit_and_warp(geometry, [frame], by, progress)
        result = compose(frame, alignment, by, progress)
        if by.slide != "auto":
            return result
        aside = progress.untold()
        others = (_slid_by(choice, alignment, frame, by, aside) for choice in alignment.slide.others())
        return least_torn(result, (partial(compose, frame, one, by, aside) for one in others))

    return first_usable(made, options) if geometry.rig is None else made(options)


def _slid_by(
    choice: SlideChoice, alignment: Alignment, frame: Frame, options: StitchOptions, progress: Stopwatch
) -> Alignment:
    """The alignment of a pair with another slide."""
    refined = None if alignment.dense is None else alignment.dense.refined
    by = replace(options, slide=(choice.s1, *choice.part))
    mapped = map_pictures(alignment.pair_field, alignment.views, refined, frame.pictures, by, progress)
    return replace(alignment, warp=mapped.warp, continuation=mapped.continuation, slide=choice)


def _of_many(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """The panorama of more than two pictures: of large ones by what is decided on small ones."""
    times = draft_times(frame.sizes, options)
    small = frame.resized(1 / times)
    alignment = fit_and_warp(geometry.of_resized(small.sizes), [small], options, progress)
    full = None if geometry.rig is None or times == 1 else FullSet(frame.pictures, geometry.edges, geometry.rig, times)
    give_back()
    result = compose(small, alignment, options, progress, full=full)
    give_back()
    return result


def _preview(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> StitchResult:
    """A small panorama of a geometry that was found on the full pictures: of small ones, which need no drafts."""
    turns = [np.eye(3), geometry.edges[0].two_view.R] if geometry.rig is None else geometry.rig.R
    share = first_share(geometry.cameras, list(turns))
    for _ in range(PREVIEW.tries):
        share, guessed = next_share(share, _px_shown(frame.resized(share), geometry, options, progress)), share
        if share == guessed:
            break
    small = frame.resized(share)
    return _made(small, geometry.of_resized(small.sizes), options, progress)


def _px_shown(frame: Frame, geometry: Geometry, options: StitchOptions, progress: Stopwatch) -> int:
    """How many px a panorama of small pictures has, by the smooth field: framed and cropped, but not made."""
    smooth = replace(options, dense=False)
    warp = fit_and_warp(geometry.of_resized(frame.sizes), [frame], smooth, progress.untold()).warp
    if not isinstance(options.kept, str):
        return warp.canvas.width * warp.canvas.height
    shows = np.logical_or.reduce([one.inside() for one in warp.maps])
    reference = box_of(warp.maps[0].inside()) if warp.maps[0].inside().any() else None
    width, height = crop_box(options.kept, warp.canvas.whole, shows, reference, len(frame.pictures))[2:]
    return width * height


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
    shown = shown_where_alone(pictures, whole.maps) if full is None else pictures
    layers = tuple(layer_of(picture, one, by_root, hold) for picture, one in zip(shown, whole.maps, strict=True))

    wanted = wanted_on(pictures, whole.maps)
    floats = [picture.bits == 32 for picture in pictures]

    def composed_with(painted: NDArray[np.int8] | None) -> tuple[Composition, EnlargedPanorama | None, Layer, Box]:
        made = composed(layers, whole, alignment.views, options, floats, painted, progress, decided, keep, wanted)
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
    left, top, *uncropped = canvas.whole
    where = {"box": [box[0] - left, box[1] - top, *box[2:]], "whole": uncropped}
    panorama, canvas = panorama.within(box), canvas.within(box)
    # of a whole sphere, layers and maps exist only where the pictures lie
    box = common(reduced_box(box, times), (0, 0, whole.canvas.width, whole.canvas.height))
    if full is not None:
        rig, pictures = full.rig, full.pictures
        alignment = replace(alignment, cameras=rig.cameras, edges=full.edges, views=rig.views, rig=rig)

    progress("write", 0.0)
    told = (
        options, pictures, alignment, canvas, made.decided, looks, panorama.shows, int(made.filled.sum()),
    )  # fmt: skip
    if alignment.rig is None:
        hidden = np.logical_or.reduce([one.hidden for one in made.decided])
        report, more = make_report(*told, int((hidden & (made.panorama.alpha == 0)).sum()))
    else:
        report, more = make_rig_report(*told, labels, times)
    report["canvas"] |= where
    named = (line for picture in pictures for line in _named(picture))
    warnings = (*frame.warnings, *named, *alignment.warnings, *more)
    report["warnings"] = list(warnings)
    if frame.brackets:
        report["brackets"] = [asdict(bracket) for bracket in frame.brackets]
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
        full_sizes=frame.full_sizes, rig=alignment.rig, scale=alignment.scale, enlarged=enlarged,
    )  # fmt: skip


def _on_canvas(painted: NDArray[np.int8], canvas: Canvas, place: Box) -> NDArray[np.int8]:
    """What was painted over a box of the canvas, on the canvas: of a sphere the part that the pictures cover."""
    left, top, width, height = place
    return cut(painted_over(painted, (width, height)), (-left, -top, canvas.width, canvas.height))


def _named(picture: Picture) -> list[str]:
    """The warnings about a picture, each with its name."""
    return [f"{picture.name}: {warning}" for warning in picture.warnings]
