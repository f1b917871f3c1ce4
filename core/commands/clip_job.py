"""Clips of cameras that stand still, for a program that watches (see `worker`): frames are laid out by their numbers,
movies as pictures, and stitched as a batch, which goes on where an earlier run was stopped.

`clip` of job.json: `cameras`: of each {"path": a movie, or one frame of a sequence; "start": the number in the program
of the frame that the path names, or of a movie's first one}; `first`, `last`: numbers of the frames that are wanted;
`folder`, `name`, `suffix`: of what is made, FOLDER/NAME/NAME_000001.png and so on. result.json: `frames`: their
numbers; `path`: of the first one; `done`, `skipped`: how many were made and were there; `failed`: a sentence, or
nothing; `warnings`; `seconds` that it took.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2

from ..batch.list import BatchItem, find_frames
from ..batch.outcomes import Outcome
from ..batch.pieces import BatchRequest
from ..batch.run import run_batch
from ..options import StitchOptions
from ..pictures.listing import SUFFIXES
from ..system.errors import BadRequest, StitchError, UnreadableImage, UnwritableOutput
from ..system.output_files import OutputFiles, temporary_folder

# How the laid out frames of a camera are called.
_FRAME = "frame_%06d"
# The number of a frame in its file's name: the last digits before the ending, as Blender counts.
_NUMBER = re.compile(r"(\d+)(\D*)$")
# zlib's fastest: a movie's frames live as long as the job.
_PNG_LEVEL = 1


def stitch_clip(
    folder: Path, clip: dict[str, Any], options: StitchOptions, say: Callable[[str, float], None],
    stopped: Callable[[], bool],
) -> None:  # fmt: skip
    """Makes the panoramas of a clip and leaves result.json.

    Parameters
    ----------
    folder : Path
        Of the job.
    clip : dict
        See above.
    options : StitchOptions
    say : callable
        say(what is being done, share of everything).
    stopped : callable
        stopped() -> bool, asked between steps.

    Raises
    ------
    StitchError
        There is no panorama; BadRequest where there are fewer than two clips, or they have no frame in common.
    """
    began = time.monotonic()
    if len(clip["cameras"]) < 2:
        raise BadRequest("a clip is stitched of two clips or more: add those of the other cameras")
    out = Path(clip["folder"])
    with OutputFiles() as files:
        files.check_folder(out)
        files.make_folder(out)
    numbers = range(clip["first"], clip["last"] + 1)
    # beside what is made: no other temporary folder is sure to be large enough
    with temporary_folder(out) as laid_out:
        patterns = [
            lay_out(camera, numbers, laid_out / str(at), say) for at, camera in enumerate(clip["cameras"])
        ]  # fmt: skip
        frames, missing = find_frames(patterns, clip["first"], clip["last"])
        if not frames:
            raise BadRequest(f"no frame from {clip['first']} to {clip['last']} is in all clips")
        item = BatchItem(clip["name"], patterns[0], patterns[1], frames, missing, more=tuple(patterns[2:]))
        request = BatchRequest(out, clip["suffix"], resume=True)
        (outcome,) = run_batch(
            [item], options, request, lambda what, share: say(what.removeprefix("[1/1] "), share), stopped
        ).outcomes
    outcome = replace(outcome, message=_by_source(outcome.message, laid_out, clip["cameras"]))
    made = outcome.frames
    if made is None or made.done + made.skipped == 0:
        raise StitchError(outcome.message)
    (folder / "result.json").write_text(json.dumps(_result(item, outcome, request, time.monotonic() - began)), "utf-8")


def _by_source(message: str, laid_out: Path, cameras: Sequence[dict[str, Any]]) -> str:
    """A message that names laid out frames, which are gone when it is read, by the clips that they are of."""
    named = re.escape(str(laid_out)) + r"[/\\](\d+)[/\\]frame_(\d+)\.\w+"
    return re.sub(named, lambda found: f"frame {int(found[2])} of {Path(cameras[int(found[1])]['path']).name}", message)


def _result(item: BatchItem, outcome: Outcome, request: BatchRequest, seconds: float) -> dict[str, Any]:
    assert outcome.frames is not None and item.frames is not None
    bad = {trouble.frame for trouble in outcome.frames.failed}
    frames = [frame for frame in item.frames if frame not in bad]
    first = request.folder / item.name / f"{item.numbered(frames[0])}{request.suffix}"
    return {
        "frames": frames, "path": str(first), "done": outcome.frames.done, "skipped": outcome.frames.skipped,
        "failed": outcome.message, "warnings": list(outcome.warnings), "seconds": seconds,
    }  # fmt: skip


def lay_out(camera: dict[str, Any], numbers: range, folder: Path, say: Callable[[str, float], None]) -> Path:
    """Puts the frames of a camera into a folder under the numbers that the program counts them by.

    Parameters
    ----------
    camera : dict
        `path` and `start`, see above.
    numbers : range
        Which.
    folder : Path
        Made; files of a sequence are linked into it where the system can.
    say : callable
        say(what is being done, share of everything).

    Returns
    -------
    Path
        The pattern of what lies there now. Frames that there are not are left out.
    """
    path = Path(camera["path"])
    folder.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() not in SUFFIXES:
        return _frames_of_movie(path, camera["start"], numbers, folder, say)
    found = _NUMBER.search(path.stem)
    if found is None:
        raise BadRequest(f"{path.name} has no number in its name: choose a frame of a sequence, or a movie")
    digits, at = len(found[1]), path.stem[: found.start()]
    for number in numbers:
        own = int(found[1]) + number - camera["start"]
        source = path.with_name(f"{at}{own:0{digits}d}{found[2]}{path.suffix}")
        if own >= 0 and source.is_file():
            _link(source.resolve(), folder / f"{_FRAME % number}{path.suffix}")
    return folder / f"{_FRAME}{path.suffix}"


def _frames_of_movie(
    path: Path, start: int, numbers: range, folder: Path, say: Callable[[str, float], None]
) -> Path:
    """The same of a movie, as PNG files. They are as old as the movie, so that a later run finds them unchanged."""
    movie = cv2.VideoCapture(str(path))
    if not movie.isOpened():
        raise UnreadableImage(f"{path} cannot be read: it is no movie, or has a codec that OpenCV lacks")
    age = path.stat().st_mtime_ns
    try:
        for number in range(start, numbers.stop):  # one after the other: seeking is not exact in every codec
            if not movie.grab():
                break
            if number not in numbers:
                continue
            whole, frame = movie.retrieve()
            if not whole:  # a damaged frame is one that is missing
                continue
            file = folder / f"{_FRAME % number}.png"
            file.write_bytes(cv2.imencode(".png", frame, [cv2.IMWRITE_PNG_COMPRESSION, _PNG_LEVEL])[1].tobytes())
            os.utime(file, ns=(age, age))
            say(f"frame {number} of {path.name}", 0.0)
    except OSError as error:
        raise UnwritableOutput(f"{folder}: {path.name} cannot be laid out there: {error.strerror}") from error
    finally:
        movie.release()
    return folder / f"{_FRAME}.png"


def _link(source: Path, target: Path) -> None:
    """A file under another name, copied where the system has no links; with its age in any case."""
    for make in (os.link, os.symlink, shutil.copy2):
        try:
            make(source, target)
            return
        except OSError as error:
            trouble = error
    raise UnreadableImage(f"{source} cannot be laid out in {target.parent}: {trouble}") from trouble
