"""Runs a batch of pairs, sets and clips of fixed cameras, resumable and in shards; the first failure stops it, or none.

A clip has one alignment, one exposure and one seam, estimated over frames spread evenly through it: every frame gets
the same map on the same canvas with the same seam, so that nothing moves or flickers between frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..alignment import Alignment, align
from ..compose.decided import Decided
from ..compose.pooling import pooled_decision
from ..frames.frame import Frame
from ..frames.reading import read_frame
from ..options import StitchOptions
from ..output.json_file import json_bytes
from ..pictures.picture import Picture
from ..pipeline import StitchResult, compose, stitch
from ..system.errors import BadRequest, Cancelled, StitchError, UnreadableImage
from ..system.progress import Progress, Stopwatch, stages_of
from ..system.threads import asking
from .list import BatchItem
from .options import CLIP
from .outcomes import BatchSummary, Frames, FrameTrouble, Outcome, trouble_of, worst
from .pieces import BatchRequest, Piece, PieceFiles, read_json
from .units import Job, plan

Tell = Callable[[str, float], None]


def run_batch(
    items: Sequence[BatchItem],
    options: StitchOptions,
    request: BatchRequest,
    progress: Tell | None = None,
    cancelled: Callable[[], bool] | None = None,
    finished: Callable[[Outcome, int, int], None] | None = None,
) -> BatchSummary:
    """Stitches the items of this shard or unit into the request's folder and writes a summary there after each.

    Parameters
    ----------
    items : sequence of BatchItem
    options : StitchOptions
        Of every stitch.
    request : BatchRequest
    progress : callable, optional
        progress(what is being done, share of everything), called between steps.
    cancelled : callable, optional
        cancelled() -> bool, called between steps.
    finished : callable, optional
        finished(outcome, number from 1, count), called after each item.

    Returns
    -------
    BatchSummary
        With what went wrong in the outcome of each item; without `request.keep_going` the first failure is the last
        outcome.

    Raises
    ------
    StitchError
        Before the work: see `plan`.
    UnwritableOutput
        The summary cannot be written.
    Cancelled, KeyboardInterrupt
        What is finished stays, nothing is left of what is not.
    """
    jobs = plan(items, options, request)
    weights = [_weight(job) for job in jobs]
    meter = _Meter(progress, cancelled, sum(weights))
    outcomes: list[Outcome] = []

    def summed_up(interrupted: bool = False) -> BatchSummary:
        summary = BatchSummary(tuple(outcomes), len(jobs), interrupted, request.keep_going)
        if request.summary:
            with PieceFiles(overwrite=True) as files:
                files.add(request.summary, json_bytes(summary.as_dict()))
        return summary

    summary = summed_up()
    try:
        for number, job in enumerate(jobs, 1):
            meter.begin(f"[{number}/{len(jobs)}]", sum(weights[: number - 1]), len(job.item.files()))
            with asking(cancelled):
                outcomes.append(_outcome(job, meter))
            summary = summed_up()
            if finished is not None:
                finished(outcomes[-1], number, len(jobs))
            if outcomes[-1].exit_code and not request.keep_going:
                break
    except (KeyboardInterrupt, Cancelled):
        summed_up(interrupted=True)
        raise
    return summary


class _Meter:
    """Turns the progress of each piece of the work into progress of the whole."""

    def __init__(self, progress: Tell | None, cancelled: Callable[[], bool] | None, total: float) -> None:
        self.cancelled = cancelled
        self._progress, self._total = progress, total
        self._label, self._done, self.pictures = "", 0.0, 2

    def begin(self, label: str, done: float, pictures: int) -> None:
        """Begins an item of so many pictures, after `done` of the total weight."""
        self._label, self._done, self.pictures = label, done, pictures

    def piece(self, weight: float, what: str = "") -> Tell:
        """The progress callback of the item's next piece, which has this weight in the total; what: it is."""
        start = self._done
        self._done += weight

        def tell(stage: str, share: float) -> None:
            if self._progress is not None:
                self._progress(f"{self._label} {what}{stage}", min(1.0, (start + weight * share) / self._total))

        return tell

    def stopwatch(self, weight: float, what: str = "") -> Stopwatch:
        """The same for work that has steps of its own."""
        return Stopwatch(Progress(self.piece(weight, what), self.cancelled, stages_of(self.pictures)))


def _weight(job: Job) -> float:
    if job.item.frames is None:
        return float(len(job.todo))
    frames = len(job.todo) + len(job.item.aligned_on)
    return CLIP.alignment_weight + CLIP.frame_weight * frames if job.todo else 0.0


def _outcome(job: Job, meter: _Meter) -> Outcome:
    """Processes an item. Raises Cancelled only: any other failure becomes its outcome."""
    try:
        if job.item.trouble is not None:
            raise job.item.trouble
        return _pair(job, meter) if job.item.frames is None else _clip(job, meter)
    except Cancelled:
        raise
    except Exception as error:
        code, message = trouble_of(error)
        for piece in job.todo[:1]:
            piece.record_failure(message, code)
        frames = None if job.item.frames is None else Frames(missing=job.item.missing)
        return Outcome(job.item.name, "failed", message, code, frames=frames)


def _pair(job: Job, meter: _Meter) -> Outcome:
    due = [piece for piece in job.todo if not piece.is_made()]
    for piece in due:
        piece.write(stitch(piece.pictures, piece.options, meter.piece(1.0), meter.cancelled))
    return _with_report(job, Outcome(job.item.name, "done" if due else "skipped"))


def _with_report(job: Job, outcome: Outcome) -> Outcome:
    """The outcome with figures from the item's report, which another shard may not have written yet."""
    for piece in job.pieces:
        if piece.panorama is not None:
            outcome = replace(outcome, panorama=piece.panorama.relative_to(piece.request.folder).as_posix())
            break
    report = next((read_json(piece.report) for piece in job.pieces if piece.report), {})
    if report:
        canvas, warnings = report["canvas"], dict.fromkeys((*report["warnings"], *outcome.warnings))
        size = canvas["width"], canvas["height"]
        outcome = replace(
            outcome, size=size, measured=report["measured"], verdict=report.get("verdict", {}), warnings=tuple(warnings)
        )
    return outcome


@dataclass(frozen=True)
class _Locked:
    """What all frames of a clip share; sizes: (W, H) px of the full pictures; options: with a definite crop."""

    alignment: Alignment
    decided: tuple[Decided, ...]
    sizes: tuple[tuple[int, int], ...]
    options: StitchOptions


def _clip(job: Job, meter: _Meter) -> Outcome:
    item = job.item
    if not item.frames:
        others = " and ".join(map(str, (item.target, *item.more)))
        raise UnreadableImage(f"no frame of {item.reference} has its like in {others}; check names and numbers")
    if job.options.preview:
        raise BadRequest("a clip has no preview: leave out --preview, or give a smaller --scale")
    warnings: dict[str, None] = {}
    if item.missing:
        warnings[f"frames {_listed(item.missing)} are missing of some cameras and were left out"] = None
    failed: list[FrameTrouble] = []
    frames = [piece for piece in job.todo if piece.frame is not None]
    if job.todo:
        locked = _lock(job, meter)
    count = sum(piece.frame is not None for piece in job.pieces)
    size, done, skipped = None, 0, count - len(frames)
    for at, piece in enumerate(frames, 1):
        try:
            if piece.is_made():
                skipped += 1
                continue
            what = f"frame {at} of {len(frames)}: "
            size, more = _frame(piece, locked, meter.stopwatch(CLIP.frame_weight, what))
            warnings |= dict.fromkeys(more)
            done += 1
        except Cancelled:
            raise
        except Exception as error:
            code, message = trouble_of(error)
            failed.append(FrameTrouble(piece.frame or 0, message, code))
            piece.record_failure(message, code)
            if not piece.request.keep_going:
                break
    outcome = Outcome(
        item.name,
        "failed" if failed else "done" if job.todo else "skipped",
        f"{len(failed)} of {count} frames; frame {failed[0].frame}: {failed[0].message}" if failed else "",
        worst(trouble.exit_code for trouble in failed),
        tuple(warnings),
        size=size,
        frames=Frames(done, skipped, tuple(failed), item.missing),
    )
    return _with_report(job, outcome)


def _lock(job: Job, meter: _Meter) -> _Locked:
    """Estimates what the frames of a clip share, and writes its report, if due, from the first frame used for it."""
    item, options, progress = job.item, job.options, meter.stopwatch(CLIP.alignment_weight)
    used = _readable(item, options, progress)
    first = next(iter(used))
    meter.pictures = len(used[first].pictures)  # a sphere is several
    progress.expect(meter.pictures)
    alignment = align(list(used.values()), options, progress)
    quick = replace(options, crop="full", measure=False)
    decided = pooled_decision([
        compose(
            _used(item, number, options, alignment), alignment, quick, meter.stopwatch(CLIP.frame_weight), keep=True
        ).decided
        for number in used
    ])
    reports = [piece for piece in job.todo if piece.frame is None]
    crop = options.crop
    if reports or crop == "inscribed":
        frame = _used(item, first, options, alignment)
        result = compose(frame, alignment, options, meter.stopwatch(CLIP.frame_weight), decided)
        if crop == "inscribed":  # one frame decides for all: the frames of a clip have one size
            whole, (x, y), (left, top) = alignment.warp.canvas.whole, alignment.warp.canvas.offset, result.canvas.offset
            crop = (x - left - whole[0], y - top - whole[1], result.canvas.width, result.canvas.height)
        about = {"frames": list(item.frames or ()), "aligned_on": list(used), "shown": first}
        for piece in reports:
            piece.write(replace(result, report={**result.report, "clip": about}))
    return _Locked(alignment, decided, used[first].full_sizes, replace(options, crop=crop, measure=False))


def _used(item: BatchItem, number: int, options: StitchOptions, alignment: Alignment) -> Frame:
    """A frame of a clip, with those pictures that connect with others."""
    return read_frame(item.files(number), options).only(alignment.numbers)


def _readable(item: BatchItem, options: StitchOptions, progress: Stopwatch) -> dict[int, Frame]:
    """The frames that a clip is aligned on: those that can be read and have the size of the first of them."""
    used: dict[int, Frame] = {}
    troubles: list[StitchError] = []
    for at, number in enumerate(item.aligned_on):
        progress("read", at / len(item.aligned_on))
        try:
            frame = _without_light(read_frame(item.files(number), options))
        except StitchError as trouble:  # reported when it is the frame's turn
            troubles.append(trouble)
            continue
        if not used or frame.full_sizes == next(iter(used.values())).full_sizes:
            used[number] = frame
    if not used:
        frames = _listed(item.aligned_on)
        raise type(troubles[0])(f"none of the frames {frames} can be used to align the clip: {troubles[0]}")
    return used


def _without_light(frame: Frame) -> Frame:
    """The frame without its float pixels, most of its memory: alignment needs the 8-bit views only."""

    def bare(picture: Picture) -> Picture:
        return replace(picture, light=np.broadcast_to(np.float32(np.nan), picture.light.shape))

    return replace(frame, pictures=tuple(bare(picture) for picture in frame.pictures))


def _frame(piece: Piece, locked: _Locked, progress: Stopwatch) -> tuple[tuple[int, int], list[str]]:
    """Stitches one frame; returns the panorama's (W, H) and warnings."""
    progress("read")
    frame = read_frame(piece.pictures, locked.options)
    if frame.full_sizes != locked.sizes:
        found, needed = (" and ".join(f"{w}×{h}" for w, h in sizes) for sizes in (frame.full_sizes, locked.sizes))
        raise BadRequest(f"the pictures have {found} pixels, the clip {needed}: one alignment is for one camera each")
    frame = frame.only(locked.alignment.numbers)
    result: StitchResult = compose(frame, locked.alignment, locked.options, progress, locked.decided)
    height, width = result.panorama.alpha.shape
    return (width, height), piece.write(result)


def _listed(numbers: Sequence[int]) -> str:
    """Numbers in words, runs shortened: 3, 7–9."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1][1:] = [number]
        else:
            runs.append([number])
    words = ["–".join(map(str, run)) for run in runs]
    return ", ".join(words[:10]) + (", …" if len(words) > 10 else "")
