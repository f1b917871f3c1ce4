"""One stitch for a program that watches, as a process of its own: `python -m edf_stitch.core.commands.worker FOLDER`.

FOLDER/job.json says what to do; with a second argument `wait` it may come later. Everything made lies in FOLDER
afterwards, with result.json as its index. stdout carries one JSON object a line: {"stage", "share"} while working, at
the end {"done": true} or {"error", "kind", "exit_code"}. The work ends on SIGINT (Windows: CTRL_BREAK) and when stdin
closes, so that it never outlives whoever started it; FOLDER goes then too. Exit status as the command's.

job.json: `reference`, `target`: {"name"} and {"path"} of a file, or {"array"} of an .npy, rows as shown; "exif_of": a
file whose EXIF (orientation included) belongs to the array. `options`: fields of StitchOptions, their `camera` those of
CameraRequest. `cameras`: {"reference", "target"}: {"lens": fields of BlenderLens but the resolution, "matrix_world"}.
`masks`: {"reference", "target"}: .npy of pictures, rows as shown; {"seam"}: over the whole panorama. `matches`: .npy
(N, 5) x, y, x2, y2, weight; weight 0 leaves a match out; or .csv, as result.json had it in matches.file. `take`:
which of "layers", "masks", "depth" to leave as pictures. `exr`: fields of ExrForm, for panorama and layers. Relative
paths start at FOLDER. Or `try` alone: load the libraries, and no more.
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
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from .options import WORKER

SIDES = ("reference", "target")
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
    exit_code = getattr(error, "exit_code", None)
    if exit_code is None:
        return _fail("Bug", f"internal error, please report it: {type(error).__name__}: {error}", 3)
    return _fail(type(error).__name__, str(error), exit_code)


def _work(folder: Path, stop: _Stop, waits: bool) -> None:
    """Reads the job, stitches, and writes everything asked for."""
    from ..system.output_files import undisturbed

    with undisturbed():  # interrupted while it loads, NumPy prints a traceback
        from ..cameras.sources import CameraRequest
        from ..options import StitchOptions
        from ..pictures.raw_development import exposure_of_first
        from ..pipeline import stitch
        from ..system.cache import default_folder
        from ..system.memory import use_again

    use_again()
    _say({"stage": "read", "share": 0.0})
    if waits:
        _await(folder / "job.json", stop)
    job = json.loads((folder / "job.json").read_text("utf-8"))
    if job.get("try"):
        for name in LIBRARIES:
            import_module(name)
        (folder / "result.json").write_text("{}")
        return
    if job.get("show"):
        _show(folder, job["show"])
        return
    exposure = exposure_of_first(folder / job[side]["path"] for side in SIDES if "path" in job[side])
    pictures, turns = zip(*(_picture(folder, job[side], exposure) for side in SIDES), strict=True)
    camera = {key: _tuples(value) for key, value in job["options"].pop("camera", {}).items()}
    if job.get("cameras"):
        camera = {"cameras": cameras_of(job["cameras"], pictures)}
    masks = job.get("masks", {})
    matches = folder / job["matches"] if job.get("matches") else None
    rows = _array(matches) if matches is not None and matches.suffix == ".npy" else None
    options = StitchOptions(
        **{key: _tuples(value) for key, value in job["options"].items()}, camera=CameraRequest(**camera),
        matches=matches if rows is None else rows[rows[:, 4] > 0],
        ignore=tuple(_mask(folder, masks.get(side), turn) for side, turn in zip(SIDES, turns, strict=True)),
        mask=_mask(folder, masks.get("seam"), 1),
        cache=default_folder(),
    )  # fmt: skip
    result = stitch(
        pictures, options, lambda stage, share: _say({"stage": stage, "share": share * WORKER.stitch_share}),
        lambda: stop.asked,  # Python swallows a KeyboardInterrupt inside a finalizer
    )  # fmt: skip
    _write(folder, result.spread_out(), rows, job, turns)


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


def _await(job: Path, stop: _Stop) -> None:
    """Loads what a stitch loads sooner or later, and returns when the job is there."""
    for name in (*LIBRARIES, f"{__package__.rpartition('.')[0]}.output.inspection"):
        import_module(name)
    while not job.exists():
        if stop.asked:
            raise KeyboardInterrupt
        time.sleep(0.01)


def cameras_of(entries: dict[str, Any], pictures: tuple[Any, ...]) -> dict[str, Any]:
    """Blender's cameras in the form that `CameraRequest.cameras` takes.

    Parameters
    ----------
    entries : dict
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

    table = {}
    for side, picture in zip(SIDES, pictures, strict=True):
        lens = BlenderLens(**{**entries[side]["lens"], "resolution": size_of(picture)})
        R, t = pose_of(np.array(entries[side]["matrix_world"], np.float64))
        table[side] = {"K": lens.intrinsics, "R": R, "t": t}
    # names are looked up before sides, and a reference may well be called "target"
    names = [picture.name for picture in pictures]
    return table if names[0] == names[1] else dict(zip(names, table.values(), strict=True))


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


def _write(folder: Path, result: Any, rows: Any, job: dict[str, Any], turns: tuple[int, ...]) -> None:
    """Everything the window may ask for, with result.json as the index."""
    from ..output import inspection as seen
    from ..output.json_file import json_bytes
    from ..output.sphere_part import sphere_part_of
    from ..pictures.encoding import encode_picture
    from ..pictures.exr import ExrForm

    take, exr = job.get("take", []), ExrForm(**job.get("exr", {}))
    kind = ".png" if result.bits == 8 else ".exr"
    files: dict[str, str] = {}

    def add(name: str, data: bytes, suffix: str = kind) -> None:
        files[name] = f"{name.replace(' ', '_')}{suffix}"
        (folder / files[name]).write_bytes(data)
        share = min(WORKER.max_share, WORKER.stitch_share + WORKER.file_share * len(files))
        _say({"stage": "write", "share": share})

    def picture(pixels: Any, alpha: Any, sphere: Any = None) -> bytes:
        icc, exif = result.pictures[0].icc, result.pictures[0].exif
        return encode_picture(pixels, alpha, result.bits, kind, icc, exif, exr, sphere)[0]

    alpha = _unless_opaque(result.panorama.alpha)
    add("panorama", picture(result.panorama.light, alpha, sphere_part_of(result)))
    for side, layer in zip(SIDES, result.layers, strict=True):
        if "layers" in take:
            add(f"{side} layer", picture(layer.light, layer.alpha))
        if "masks" in take:
            add(f"{side} mask", _png((layer.alpha.astype("float32") * 255).round().astype("uint8")), ".png")
    if "masks" in take:
        add("occluded", _png(result.occluded[1].astype("uint8") * 255), ".png")
        if result.inpainted.any():
            add("inpainted", _png(result.inpainted.astype("uint8") * 255), ".png")
        if result.labels is not None:
            add("seam", _png(_painted(result.labels > 0, result.panorama.alpha > 0)), ".png")
        if result.warp.confidence is not None:
            add("confidence", _png((result.warp.confidence * 255).round().astype("uint8")), ".png")
    if "depth" in take and seen.has_depth(result):
        add("inverse depth", encode_picture(result.warp.inverse_depth[..., None], None, 32, ".exr")[0], ".exr")
    heat, heat_range = seen.heat_map(result)
    add("heat", _png(heat), ".png")
    add("difference", _png(seen.difference(result)), ".png")
    matches = seen.match_rows(result) if rows is None else seen.given_rows(result, rows)
    index = {
        "files": files, "report": result.report, "warnings": result.warnings, "bits": result.bits,
        "heat_range": heat_range, "geometry": seen.full_geometry(result), "orientations": turns,
        "has_depth": seen.has_depth(result), "depth": seen.depth_grid(result), "matches": matches,
        "seconds": result.seconds,
    }  # fmt: skip
    (folder / "result.json").write_bytes(json_bytes(index))


def _png(values: Any) -> bytes:
    """A PNG of uint8 values (H, W) or RGBA (H, W, 4) that are no light: without a profile or a display curve."""
    import cv2

    stored = values if values.ndim == 2 else cv2.cvtColor(values, cv2.COLOR_RGBA2BGRA)
    png: bytes = cv2.imencode(".png", stored)[1].tobytes()
    return png


def _painted(further: Any, shows: Any) -> Any:
    """A seam in the form that a painted one has: RGBA (H, W, 4), white where the target is shown, transparent where
    nothing is."""
    import numpy as np

    gray, alpha = (np.where(mask, 255, 0).astype(np.uint8) for mask in (further, shows))
    return np.dstack([gray, gray, gray, alpha])


def _unless_opaque(alpha: Any) -> Any:
    """Alpha (H, W), or None where it is 1 everywhere and need not be stored."""
    return None if alpha.min() >= 1.0 else alpha


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
