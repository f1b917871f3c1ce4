"""Whether two checkouts make the same panorama, layers, warp and report of the same pictures, byte for byte.

    python tests/benchmarks/same_bytes.py OLD NEW [FOLDER ...]

OLD, NEW: checkouts that `make setup` was run in. Both stitch on the reference's own plane, which was the default before
it had a name. FOLDER: two pictures each, the reference's name first in the alphabet; without any, two generated pairs.
Files and arrays that have other names in OLD are compared by the tables below. Exit code 1 where anything differs.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from edf_stitch.synthetic_scenes.two_planes import make_pair

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".exr")
# Names in format 1 and in format 2, with the entry of the stacks of format 2.
ARRAYS = (
    ("map_x", "map_x_01", None), ("map_y", "map_y_01", None), ("offset", "offset", None),
    ("inverse_depth", "inverse_depth", None), ("F", "F", 0), ("H_inf", "H_inf", 1), ("e_prime", "e_prime", 1),
    ("K", "K", 0), ("K_prime", "K", 1), ("R", "R", 1), ("t", "t", 1), ("dist", "dist", 0), ("dist_prime", "dist", 1),
)  # fmt: skip
ON_REFERENCE = ("--projection", "reference", "--fade", "plane", "--crop", "full", "--holes", "transparent")
LAYERS = (("reference.png", "00_*.png"), ("target.png", "01_*.png"), ("occluded.png", "occluded_01.png"))


def stitched(checkout: Path, pictures: list[Path], folder: Path) -> Path:
    """The folder with all files of a stitch by a checkout."""
    folder.mkdir()
    command = [str(checkout / ".venv" / "bin" / "edf"), "stitch", *map(str, pictures), "-o", str(folder / "out.png")]
    files = ["--report", "report.json", "--layers", "layers", "--warp", "warp.npz"]
    command += [part if part.startswith("--") else str(folder / part) for part in files]
    command += ["--no-cache", "--quiet"]
    done = subprocess.run([*command, *ON_REFERENCE], capture_output=True)
    if done.returncode == 2:  # a checkout that has no name for that plane
        done = subprocess.run(command, capture_output=True)
    done.check_returncode()
    return folder


def differences(old: Path, new: Path) -> Iterator[str]:
    """What differs between the files of two stitches."""
    if (old / "out.png").read_bytes() != (new / "out.png").read_bytes():
        yield "panorama"
    reports = [json.loads((folder / "report.json").read_text("utf-8")) for folder in (old, new)]
    yield from (f"report: {key}" for key in reports[0] if reports[0][key] != reports[1].get(key))
    for name in ("confidence.png", "seam.png"):
        if (old / "layers" / name).read_bytes() != (new / "layers" / name).read_bytes():
            yield name
    for name, pattern in LAYERS:
        if _only(old / "layers", name, pattern).read_bytes() != _only(new / "layers", name, pattern).read_bytes():
            yield pattern
    arrays = [np.load(folder / "warp.npz") for folder in (old, new)]
    for row in ARRAYS:
        values = [_array(one, *row) for one in arrays]
        if values[0].dtype != values[1].dtype or not np.array_equal(*values, equal_nan=True):
            yield f"warp: {row[0]}"


def _only(folder: Path, *patterns: str) -> Path:
    return next(path for pattern in patterns for path in folder.glob(pattern))


def _array(arrays: dict[str, np.ndarray], name: str, stack: str, entry: int | None) -> np.ndarray:
    if "format" not in arrays:
        return arrays[name]
    return arrays[stack] if entry is None else arrays[stack][entry]


def pairs(folders: list[Path], there: Path) -> Iterator[tuple[str, list[Path]]]:
    """Names and pictures of the folders, or of generated pairs."""
    for folder in folders:
        yield folder.name, sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)[:2]
    for seed in () if folders else (0, 1):
        pair = make_pair(400, 300, seed=seed)
        files = [there / f"{seed}_{name}.png" for name in ("a", "b")]
        for path, pixels in zip(files, (pair.reference, pair.target), strict=True):
            cv2.imwrite(str(path), pixels[..., ::-1])
        yield f"generated {seed}", files


def main() -> int:
    old, new, *folders = map(Path, sys.argv[1:])
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        there = Path(name)
        for number, (title, pictures) in enumerate(pairs(folders, there)):
            made = (
                stitched(checkout, pictures, there / f"{side}{number}")
                for side, checkout in (("old", old), ("new", new))
            )
            found = list(differences(*made))
            failed += bool(found)
            print(f"{title}: {'differs: ' + ', '.join(found) if found else 'the same'}", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
