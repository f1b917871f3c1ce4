"""`edf info`: what was understood of each picture file, a line each, or a document."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..system.errors import StitchError, UnreadableImage
from ..system.text_files import printable

if TYPE_CHECKING:
    from ..pictures.picture import Picture

INFO = """Say what was understood of each picture: size, depth, colour, camera, lens, focal length and where that comes
from, orientation, and what is wrong with it. A line for each on stdout, or a document with --json. Exit codes: 0 all
can be used, 2 the call is wrong, 4 one can't be read or is no flat photograph, 130 interrupted."""


def add_info(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `edf info`."""
    parser.add_argument(
        "pictures", metavar="PICTURE", type=Path, nargs="+", help="files, folders, or patterns like IMG_*.jpg"
    )
    parser.add_argument("--json", action="store_true", help="a document instead of lines (docs/formats.md)")


def run_info(args: argparse.Namespace) -> int:
    """Says what was understood; returns the exit code."""
    from ..pictures.listing import listed

    entries: list[dict[str, Any]] = []
    for given in args.pictures:
        try:
            entries += [entry_of(path) for path in listed([given])]
        except UnreadableImage as error:  # there is no such file; the others are wanted all the same
            entries.append({"file": str(given), "error": str(error).removeprefix(f"{given}: ")})
    if args.json:
        print(json.dumps({"schema": 1, "pictures": entries}, indent=1))
    else:
        for entry in entries:
            print(printable(line_of(entry)))
    if sys.stdout is not None:  # closed by whoever called
        sys.stdout.flush()
    return UnreadableImage.exit_code if any(entry["error"] for entry in entries) else 0


def entry_of(path: Path) -> dict[str, Any]:
    """What was understood of a file; `error` says why it cannot be used, "" if it can."""
    from ..cameras.from_circle import camera_of_circle
    from ..cameras.sources import CameraRequest, cameras_for
    from ..frames.flatness import usable
    from ..frames.frame import size_of
    from ..pictures.picture import load_picture

    try:
        picture = load_picture(path)
    except StitchError as error:
        return {"file": str(path), "error": str(error).removeprefix(f"{path}: ")}
    try:
        picture, why_not = usable(picture), ""
    except UnreadableImage as why:
        why_not = str(why).removeprefix(f"{picture.name}: ")
    size, exif = size_of(picture), picture.exif
    known = None if picture.circle is None else camera_of_circle(picture.circle, size)
    (camera,), problems = cameras_for(CameraRequest(), [path.name], [size], [exif], [known])
    round_all = picture.part is not None
    focal = None if camera.assumed or round_all else round(camera.focal, 2)
    return {
        "file": str(path), "error": why_not, "shows": "" if why_not else _shown(picture),
        "kind": _kind(path, picture), "width": size[0], "height": size[1], "bits": picture.bits,
        "channels": picture.light.shape[2], "alpha": picture.alpha is not None, "colours": _colours(picture),
        "make": exif.make, "model": exif.model, "lens": exif.lens, "taken": exif.text(36867) or exif.text(306),
        "focal_px": focal, "focal_source": "none: it is a sphere" if round_all else camera.source,
        "focal_mm": exif.focal_mm, "focal35_mm": exif.focal35_mm, "undistorted": exif.undistorted,
        "orientation": exif.orientation, "problems": [*picture.warnings, *problems],
    }  # fmt: skip


def _shown(picture: Picture) -> str:
    """What kind of picture it is, in words."""
    part = picture.part
    if part is not None:
        return "whole sphere" if part.is_whole else f"part of a sphere of {part.full[0]}×{part.full[1]}"
    return "flat picture" if picture.circle is None else "circle of a fisheye"


def _kind(path: Path, picture: Picture) -> str:
    """The kind of file by its content; its ending where that is none of the plain kinds."""
    if picture.is_raw:
        return "RAW"
    from ..pictures.containers import read_structure
    from ..pictures.decoding import read_file

    structure = read_structure(read_file(path))
    return structure.kind.upper() if structure is not None else path.suffix.lstrip(".").upper()


def _colours(picture: Picture) -> str:
    if picture.bits == 32:
        return "scene-linear"
    return "its own profile" if picture.icc is not None else "sRGB"


def line_of(entry: dict[str, Any]) -> str:
    """The same in a line."""
    if "kind" not in entry:
        return f"{entry['file']}: cannot be used: {entry['error']}"
    depth = "float" if entry["bits"] == 32 else f"{entry['bits']} bit"
    channels = ("gray" if entry["channels"] == 1 else "colour") + (" and alpha" if entry["alpha"] else "")
    make, model = entry["make"], entry["model"]
    camera = model if make and model.startswith(make) else " ".join(filter(None, (make, model))) or "camera unknown"
    lens = f", {entry['lens']}" if entry["lens"] else ""
    focal = f"f {entry['focal_px']:.0f} px ({entry['focal_source']})" if entry["focal_px"] else "f unknown"
    focal = "no f" if "sphere" in entry["shows"] else focal
    turned = "upright" if entry["orientation"] == 1 else f"turned upright (orientation {entry['orientation']})"
    parts = [f"{entry['width']}×{entry['height']} {entry['kind']}, {depth}, {channels}, {entry['colours']}"]
    parts += [entry["shows"]] if entry["shows"] not in ("", "flat picture") else []
    parts += [camera + lens, focal, turned]
    parts += ["distortion removed already"] if entry["undistorted"] else []
    parts += [f"problem: {problem}" for problem in entry["problems"]]
    parts += [f"cannot be used: {entry['error']}"] if entry["error"] else []
    return f"{entry['file']}: {'; '.join(parts)}"
