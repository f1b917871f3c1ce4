"""One stitch for a program that watches, as a process of its own: `python -m edf_stitch.core.commands.worker FOLDER`.

FOLDER/job.json says what to do; with a second argument `wait` it may come later, and ahead.json may say of which set a
small panorama is to be composed meanwhile. Everything made lies in FOLDER afterwards, with result.json as its index.
stdout carries one JSON object a line: {"stage", "share"} while working, at the end {"done": true} or {"error", "kind",
"exit_code"}. The work ends on SIGINT (Windows: CTRL_BREAK) and when stdin closes, so that it never outlives whoever
started it; FOLDER goes then too. Exit status as the command's.

job.json: `pictures`, of two the reference first: {"name"} and {"path"} of a file, or {"array"} of an .npy, rows as
shown; "exif_of": a file whose EXIF (orientation included) belongs to the array; "digest": whether result.json is to
tell its content. `options`: fields of StitchOptions, their `camera` those of CameraRequest. `cameras` of two pictures:
{"lens": fields of BlenderLens but the resolution, "matrix_world"} each. `masks`: for each picture an .npy, rows as
shown, or null; `shown`: the same of what is to be shown of them, and `places`: {"picture": its number, "circles": x, y,
radius in px of it upright}; `guides`: [number of a picture, one of GUIDES, [x, y, x', y'] in px of it upright]; `seam`:
an .npy over the whole panorama. `matches`: .npy (N, 5) x, y, x2, y2, weight; weight 0 leaves a match out; or .csv, as
result.json had it in matches.file. `take`: which of "layers", "masks", "depth" to leave as pictures. `exr`: fields of
ExrForm, for panorama and layers. `fill`: whether what no picture shows of a whole sphere is filled. `kept`: under which
name what a set's stitch found is kept for small panoramas; with `small`, make such a one of it. Relative paths start at
FOLDER. Or `clip` with `options` (see `clip_job`), or `try` alone: load the libraries, and no more.
"""

from __future__ import annotations

import _thread
import json
import os
import shutil
import signal
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from .options import WORKER

# All that a stitch may load sooner or later, besides the standard library.
LIBRARIES = ("numpy", "cv2", "scipy.linalg", "scipy.optimize", "poselib", "OpenEXR", "exifread")


def main(folder: Path, waits: bool = False) -> int:
    """Does the job in a folder, or loads what it takes and waits for it; returns the exit status."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy loads: the same bytes for any number of cores
    stop = _Stop()
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):  # whatever the parent had them set to
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), stop)
    try:
        return _status(folder, stop, waits)
    except BrokenPipeError:  # the parent has ended, and the thread has not seen stdin close yet
        stop.orphaned = True
        return 130
    finally:
        # here and not in the thread that noticed: only now is the folder no longer in use
        if stop.orphaned:
            shutil.rmtree(folder, ignore_errors=True)


class _Stop:
    """The handler of signals that ask to stop. It interrupts the work once, and never the cleaning up after it."""

    def __init__(self) -> None:
        self.asked = self.orphaned = False
        self.may_break_in = True

    def __call__(self, _number: int, _frame: object) -> None:
        self.asked = True
        if self.may_break_in:
            self.may_break_in = False
            raise KeyboardInterrupt


def _status(folder: Path, stop: _Stop, waits: bool) -> int:
    """Does the job and reports its end; returns the exit status."""
    try:
        threading.Thread(target=_end_with_parent, args=(stop,), daemon=True).start()
        try:
            _work(folder, stop, waits)
        finally:
            stop.may_break_in = False
    except (KeyboardInterrupt, Exception) as error:
        # a library that is interrupted while it loads raises ImportError instead
        return _report_error(KeyboardInterrupt() if stop.asked else error)
    _say({"done": True})
    return 0


def _report_error(error: BaseException) -> int:
    """Says why there is no result; returns the exit status."""
    if isinstance(error, KeyboardInterrupt):
        return _fail("Cancelled", "cancelled", 130)
    if isinstance(error, ImportError):
        return _fail("Broken", f"a library of EDF Stitch cannot be loaded ({error}); reinstall EDF Stitch", 3)
    if isinstance(error, MemoryError):
        return _fail("OutOfMemory", "not enough memory for pictures of this size; stitch them at a smaller scale", 3)
    if isinstance(error, OSError):
        place = error.filename or "the folder for temporary files"
        return _fail(
            "UnwritableOutput", f"{place} cannot be read or written: {error.strerror or error}; free some space on its "
            "disk, or choose another folder for temporary files in Blender's preferences, File Paths", 4,
        )  # fmt: skip
    exit_code = getattr(error, "exit_code", None)
    if exit_code is None:
        return _fail("Bug", f"internal error, please report it: {type(error).__name__}: {error}", 3)
    return _fail(type(error).__name__, str(error), exit_code)


def _work(folder: Path, stop: _Stop, waits: bool) -> None:
    """Reads the job, stitches, and writes everything asked for."""
    from ..system.memory import check_address_space
    from ..system.output_files import undisturbed

    check_address_space()
    with undisturbed():  # interrupted while it loads, NumPy prints a traceback
        from ..pipeline import stitch  # noqa: F401 (so that all is loaded here)
        from ..system.memory import use_again
        from .handed_over import hand_over

    use_again()
    _say({"stage": "read", "share": 0.0})
    if waits:
        _await(folder, stop)
    job = json.loads((folder / "job.json").read_text("utf-8"))
    if job.get("try"):
        for name in LIBRARIES:
            import_module(name)
        (folder / "result.json").write_text("{}")
        return
    if job.get("show"):
        _show(folder, job["show"])
        return
    if job.get("clip"):
        from ..options import StitchOptions
        from ..system.cache import default_folder
        from .clip_job import stitch_clip

        options = StitchOptions(**_plain_options(job["options"]), cache=default_folder())
        stitch_clip(folder, job["clip"], options, _say_of_clip, lambda: stop.asked)
        return
    result, turns, rows = _small(folder, job, stop) if job.get("small") else _stitched(folder, job, stop)
    hand_over(folder, result, rows, job, turns, _say_written)


def _stitched(folder: Path, job: dict[str, Any], stop: _Stop) -> tuple[Any, tuple[int, ...], Any]:
    """The result of a job, the orientations of its pictures, and the matches that were given as rows."""
    from ..pipeline import stitch
    from .digests import digests_of

    job["digests"] = digests_of(folder, job)  # as they are when they are read
    pictures, turns = _pictures(folder, job)
    sizes = {number: picture.view.shape[1::-1] for number, picture in enumerate(pictures)}
    options, rows = _options(folder, job, pictures, turns, sizes)
    # asked for too, since Python swallows a KeyboardInterrupt inside a finalizer
    result = stitch(pictures, options, _say_share, lambda: stop.asked)
    if job.get("kept") and result.rig is not None:
        from ..system.cache import Cache
        from .recomposing import kept_of

        _say({"stage": "write", "share": WORKER.stitch_share})
        Cache(options.cache).remember("kept", (job["kept"],), lambda: kept_of(result, pictures, options, turns))
    return result, turns, rows


def _small(folder: Path, job: dict[str, Any], stop: _Stop) -> tuple[Any, tuple[int, ...], None]:
    """The same of a small panorama, of what is kept of a set."""
    from ..system.cache import Cache, default_folder
    from .recomposing import Kept, kept_anew, recomposed

    def anew() -> Kept:
        pictures, turns = _pictures(folder, job)
        without = {**job, "masks": None, "shown": None, "places": (), "guides": ()}
        options, _ = _options(folder, without, pictures, turns, {})
        return kept_anew(pictures, options, turns, _say_share)

    kept = Cache(default_folder()).remember("kept", (job["kept"],), anew)
    options, _ = _options(folder, job, (), kept.turns, kept.sizes)
    return recomposed(kept, options, _say_share, lambda: stop.asked), kept.turns, None


def _pictures(folder: Path, job: dict[str, Any]) -> tuple[tuple[Any, ...], tuple[int, ...]]:
    """The pictures of a job, and the orientations that their arrays and masks are turned by."""
    from ..pictures.raw_development import exposure_of_first

    given = job["pictures"]
    exposure = exposure_of_first(folder / entry["path"] for entry in given if "path" in entry)
    pictures, turns = zip(*(_picture(folder, entry, exposure) for entry in given), strict=True)
    return pictures, turns


def _options(
    folder: Path, job: dict[str, Any], pictures: tuple[Any, ...], turns: tuple[int, ...],
    sizes: dict[int, tuple[int, int]],
) -> tuple[Any, Any]:  # fmt: skip
    """The StitchOptions of a job, and the matches that are given as rows; sizes: (W, H) of the pictures by number."""
    from ..cameras.sources import CameraRequest
    from ..options import StitchOptions
    from ..system.cache import default_folder
    from .drawn_places import with_circles

    plain = _plain_options(job["options"])
    if job.get("cameras"):
        plain["camera"] = CameraRequest(cameras=cameras_of(job["cameras"], pictures))
    masks = job.get("masks") or [None] * len(turns)
    files = job.get("shown") or [None] * len(turns)
    shown = {number: _mask(folder, file, turns[number]) for number, file in enumerate(files) if file is not None}
    for place in job.get("places", ()):
        if (number := place["picture"]) in sizes:
            name = job["pictures"][number]["name"]
            shown[number] = with_circles(shown.get(number), place["circles"], sizes[number], name)
    matches = folder / job["matches"] if job.get("matches") else None
    rows = _array(matches) if matches is not None and matches.suffix == ".npy" else None
    options = StitchOptions(
        **plain,
        matches=matches if rows is None else rows[rows[:, 4] > 0],
        ignore=tuple(_mask(folder, mask, turn) for mask, turn in zip(masks, turns, strict=True)),
        show=tuple((number + 1, shown[number]) for number in sorted(shown)),
        guides=tuple((number + 1, kind, tuple(ends)) for number, kind, ends in job.get("guides", ())),
        mask=_mask(folder, job.get("seam"), 1),
        cache=default_folder(),
    )  # fmt: skip
    return options, rows


def _say_share(stage: str, share: float) -> None:
    """How far a stitch is."""
    _say({"stage": stage, "share": share * WORKER.stitch_share})


def _say_nothing(_stage: str, _share: float) -> None:
    """Of work that is done beside."""


def _plain_options(told: dict[str, Any]) -> dict[str, Any]:
    """Fields of StitchOptions as a job has them, with the request for cameras in its place."""
    from ..cameras.sources import CameraRequest

    fields = {key: _tuples(value) for key, value in told.items() if key != "camera"}
    asked = {key: _tuples(value) for key, value in told.get("camera", {}).items()}
    return {**fields, "camera": CameraRequest(**asked)}


def _say_of_clip(stage: str, share: float) -> None:
    _say({"stage": stage, "share": share})


def _say_written(files: int) -> None:
    """That so many files were begun."""
    _say({"stage": "write", "share": min(WORKER.max_share, WORKER.stitch_share + WORKER.file_share * files)})


def _show(folder: Path, paths: list[str]) -> None:
    """Pictures of photographs that Blender cannot open, upright; result.json names a file for each path."""
    import cv2

    from ..pictures.picture import load_picture

    files = {}
    for number, path in enumerate(paths):
        view = load_picture(path).view
        files[path] = f"{number}.jpg"
        stored = cv2.cvtColor(view, cv2.COLOR_RGB2BGR) if view.shape[2] == 3 else view
        (folder / files[path]).write_bytes(cv2.imencode(".jpg", stored)[1].tobytes())
        _say({"stage": "read", "share": (number + 1) / len(paths)})
    (folder / "result.json").write_text(json.dumps({"files": files}), "utf-8")


def _await(folder: Path, stop: _Stop) -> None:
    """Loads what a stitch loads sooner or later, does what is to be done ahead, and returns when the job is there. Ends
    as if asked to stop where none comes."""
    for name in (*LIBRARIES, f"{__package__}.handed_over", f"{__package__}.recomposing"):
        import_module(name)
    if (folder / "ahead.json").exists():
        _compose_ahead(folder, stop)
    until = time.monotonic() + WORKER.longest_wait
    while not (folder / "job.json").exists():
        if stop.asked or time.monotonic() > until:
            raise KeyboardInterrupt
        time.sleep(0.01)


def _compose_ahead(folder: Path, stop: _Stop) -> None:
    """Composes a small panorama of what is kept of a set, for the field and the depth that the cache then has."""
    from ..system.cache import Cache, default_folder
    from .recomposing import Kept, recomposed

    def anew() -> Kept:
        raise LookupError("it is no longer kept")

    job = json.loads((folder / "ahead.json").read_text("utf-8"))
    with suppress(LookupError):
        kept = Cache(default_folder()).remember("kept", (job["kept"],), anew)
        options, _ = _options(folder, job, (), kept.turns, kept.sizes)
        recomposed(kept, options, _say_nothing, lambda: stop.asked)


def cameras_of(entries: list[dict[str, Any]], pictures: tuple[Any, ...]) -> dict[str, Any]:
    """Blender's cameras in the form that `CameraRequest.cameras` takes.

    Parameters
    ----------
    entries : list of dict
        `cameras` of job.json.
    pictures : tuple of Picture
        The upright pictures that they took, reference and target.

    Returns
    -------
    dict
        K, R and t by the pictures' names; by side where both have the same name.
    """
    import numpy as np

    from ..cameras.blender_camera import BlenderLens, pose_of
    from ..frames.frame import size_of
    from .handed_over import SIDES

    tables = []
    for entry, picture in zip(entries, pictures, strict=True):
        lens = BlenderLens(**{**entry["lens"], "resolution": size_of(picture)})
        R, t = pose_of(np.array(entry["matrix_world"], np.float64))
        tables.append({"K": lens.intrinsics, "R": R, "t": t})
    # names are looked up before sides, and a reference may well be called "target"
    names = [picture.name for picture in pictures]
    return dict(zip(SIDES if names[0] == names[1] else names, tables, strict=True))


def _picture(folder: Path, entry: dict[str, Any], exposure: Any = None) -> tuple[Any, int]:
    """The upright picture of a job's entry, and the orientation that its arrays and masks are turned by; exposure: what
    camera RAW is developed with."""
    from ..pictures.containers import read_structure
    from ..pictures.decoding import read_file, turn
    from ..pictures.metadata import Exif, read_exif
    from ..pictures.picture import load_picture, picture_from_array

    if "path" in entry:
        path = folder / entry["path"]  # an absolute path stays as it is
        picture = load_picture(path, exposure=exposure)
        return replace(picture, name=entry["name"]), picture.exif.orientation
    exif = Exif()
    if entry.get("exif_of"):
        structure = read_structure(read_file(folder / entry["exif_of"]))
        exif = read_exif(structure.exif) if structure is not None else exif
    picture = picture_from_array(turn(_array(folder / entry["array"]), exif.orientation), entry["name"])
    return replace(picture, exif=exif.upright()), exif.orientation


def _mask(folder: Path, name: str | None, orientation: int) -> Any:
    """A job's mask (H, W), turned upright; None without a name."""
    from ..pictures.decoding import turn

    return None if name is None else turn(_array(folder / name)[..., None], orientation)[..., 0]


def _array(path: Path) -> Any:
    import numpy as np

    return np.load(path, allow_pickle=False)


def _tuples(value: Any) -> Any:
    """A value of JSON, which has lists where options have tuples."""
    return tuple(value) if isinstance(value, list) else value


def _say(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def _fail(kind: str, words: str, exit_code: int) -> int:
    _say({"error": words, "kind": kind, "exit_code": exit_code})
    return exit_code


def _end_with_parent(stop: _Stop) -> None:
    """Waits for stdin to close, which it does when the parent ends, and interrupts the work then."""
    # not sys.stdin.buffer: Python aborts at exit if a thread still holds the lock of that one
    while os.read(0, 4096):
        pass
    stop.orphaned = True
    _thread.interrupt_main()


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:] == ["wait"]))
