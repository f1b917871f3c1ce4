"""The arguments that say which files a stitch and a batch leave."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..choices import EXR_COMPRESSIONS, EXR_DEPTHS

if TYPE_CHECKING:
    from ..pictures.exr import ExrForm


def add_files(parser: argparse.ArgumentParser) -> None:
    """Adds the files that one stitch may leave beside its panorama."""
    files = parser.add_argument_group("files")
    files.add_argument(
        "--report", type=Path, metavar="FILE.json",
        help="everything that was measured and decided; FILE.matches.csv: all matches, as --matches takes them",
    )  # fmt: skip
    files.add_argument(
        "--layers", type=Path, metavar="DIR",
        help="each picture on the canvas before blending, with alpha; what it cannot see; which is shown where",
    )
    files.add_argument("--warp", type=Path, metavar="FILE.npz", help="the maps, the inverse depth and the geometry")
    files.add_argument(
        "--depth", type=Path, metavar="FILE.exr",
        help="the range of each pixel from its viewpoint, its deviation and confidence, as float channels",
    )
    files.add_argument(
        "--mesh", type=Path, metavar="FILE.glb",
        help="the panorama as a surface that stands as far away as it was found to be (glTF, which Blender imports)",
    )
    files.add_argument(
        "--cameras-out", type=Path, metavar="NAME",
        help="the cameras that were found: .json as --cameras takes them, transforms.json, .pto (Hugin), .chan (Nuke), "
        "or a folder (a COLMAP model)",
    )  # fmt: skip
    _add_exr(files)
    files.add_argument("--overwrite", action="store_true", help="replace files that exist")


def add_batch_files(parser: argparse.ArgumentParser) -> None:
    """Adds what a batch leaves of each item, and what it makes again."""
    files = parser.add_argument_group("files")
    files.add_argument("--format", default=".png", metavar="SUFFIX", help=".png (default), .jpg, .tif, .exr or .hdr")
    files.add_argument("--layers", action="store_true", help="NAME.layers: each picture on the canvas, with alpha")
    files.add_argument("--warp", action="store_true", help="NAME.warp.npz: maps, inverse depth and geometry")
    files.add_argument("--depth", action="store_true", help="NAME.depth.exr: ranges, their deviation and confidence")
    files.add_argument("--mesh", action="store_true", help="NAME.mesh.glb: the panorama as a surface with depth")
    _add_exr(files)
    files.add_argument("--resume", action="store_true", help="make only what is missing, or was made otherwise")
    files.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_farm(parser)


def _add_farm(parser: argparse.ArgumentParser) -> None:
    """What runs of a batch on several machines need."""
    farm = parser.add_argument_group("farm", "docs/farm.md shows how engines of farms call these.")
    farm.add_argument(
        "--keep-going", action="store_true",
        help="go on past what cannot be made, end with a table of it and exit code 1 (by default the first failure "
        "stops)",
    )  # fmt: skip
    farm.add_argument(
        "--retry-failed", action="store_true", help="of an earlier run make only what failed, as far as it is due"
    )
    farm.add_argument("--shard", type=shard, default=(1, 1), metavar="I/N", help="the I-th of N runs that share LIST")
    farm.add_argument(
        "--plan", type=Path, metavar="FILE.json",
        help="make nothing, but say which units there are (a pair, a set, or some frames of a clip), the memory and "
        "cores that each takes, and its command; - prints it",
    )  # fmt: skip
    farm.add_argument(
        "--unit", type=unit, metavar="K[/N]",
        help="make only the K-th unit of a plan; with N, that of all units, only if the list still makes so many",
    )  # fmt: skip


def _add_exr(files: argparse._ArgumentGroup) -> None:
    """How panoramas and layers are written as .exr."""
    files.add_argument(
        "--exr-depth", default="float", choices=EXR_DEPTHS, metavar="DEPTH",
        help="of .exr: float (default: 32 bits) or half (16: three digits, light up to 65504)",
    )  # fmt: skip
    files.add_argument(
        "--exr-compression", default="zip", choices=EXR_COMPRESSIONS, metavar="COMPRESSION",
        help="of .exr: zip (default: without loss) or dwab (much smaller, with a loss that is not seen)",
    )  # fmt: skip


def exr_form(args: argparse.Namespace) -> ExrForm:
    """What the parsed arguments ask for of EXR files."""
    from ..pictures.exr import ExrForm

    return ExrForm(args.exr_depth, args.exr_compression)


def shard(text: str) -> tuple[int, int]:
    """I and N of I/N."""
    try:
        index, count = map(int, text.split("/"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like 2/3: which of how many runs") from None
    return index, count


def unit(text: str) -> tuple[int, int]:
    """K and N of K/N, or K and 0."""
    number, _, count = text.partition("/")
    if not all(part.isascii() and part.isdigit() for part in (number, count or "0")):
        raise argparse.ArgumentTypeError(f"{text!r} is not like 12 or 12/200: which unit of how many")
    return int(number), int(count or 0)


def without_plan(given: Sequence[str]) -> list[str]:
    """Arguments of a batch but for `--plan FILE`, however that is written."""
    left: list[str] = []
    skip = False
    for one in given:
        name, mark, _ = one.partition("=")
        if not skip and len(name) > 3 and "--plan".startswith(name):
            skip = not mark
        elif skip:
            skip = False
        else:
            left.append(one)
    return left


def outside(text: str) -> tuple[str, Path]:
    """NAME=FOLDER of --outside."""
    name, found, folder = text.partition("=")
    if not (found and folder) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 ._+-]{0,30}", name):
        raise argparse.ArgumentTypeError(
            f"{text!r}: it is NAME=FOLDER, NAME of letters, digits, spaces, and . _ + -"
        )
    return name, Path(folder)
