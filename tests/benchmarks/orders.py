"""A table of docs/validation.md: the cameras of a set in shuffled orders, with nothing that sorts its pictures first.

    orders.py [--data DIR] [--orders N] [--matched-once] [NAME ...]

Each set is registered in the order of its names, then in N others; the program itself sorts pictures by what they show,
so that its users never see these differences. A pair's matches depend a little on which of its pictures comes first:
with --matched-once all orders have those of the first. Rotations are compared between all pairs of pictures; places
after the similarity that fits best, in % of the largest distance of a place from the middle.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from edf_stitch.core.cameras.bodies import Bodies
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.raster.arrays import Array
from edf_stitch.core.rig.from_pictures import matched_pictures, registered, renumbered
from edf_stitch.core.rig.matching import Matched
from edf_stitch.core.system.cache import Cache
from edf_stitch.synthetic_scenes.sets.set_measures import onto

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Found:
    """Cameras of pictures in the order of their names: which of them were registered, R (N, 3, 3), places (N, 3), focal
    lengths (N,), px, and the cost, px² a match."""

    numbers: tuple[int, ...]
    R: Array
    places: Array
    focals: Array
    cost: float


def main() -> None:
    """Prints a table in Markdown: a row for each order."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=data / "sets")
    parser.add_argument("--orders", type=int, default=20)
    parser.add_argument("--matched-once", action="store_true")
    parser.add_argument("names", nargs="*", default=[])
    asked = parser.parse_args()
    print("| set | order | registered | rotation ° | focal length % | place % | cost | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    for folder in sorted(asked.data.glob("*/")):
        if asked.names and folder.name not in asked.names:
            continue
        paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".png"))
        pictures = [load_picture(path) for path in paths]
        with tempfile.TemporaryDirectory() as kept:
            cache = Cache(Path(kept))
            names = range(len(pictures))
            once = matched_in(pictures, cache) if asked.matched_once else None
            first = row(folder.name, pictures, names, None, cache, once)
            for seed in range(asked.orders):
                order = np.random.default_rng(seed).permutation(len(pictures)).tolist()
                row(folder.name, pictures, order, first, cache, once)


def matched_in(pictures: Sequence[Picture], cache: Cache) -> Matched:
    """The matches of pictures in the order given; cache: of features, and of matches from one picture to another."""
    return matched_pictures(
        pictures, range(len(pictures)), Bodies.alone(len(pictures)), False, cache, lambda *_: None
    )  # fmt: skip


def row(
    name: str, pictures: Sequence[Picture], order: Sequence[int], first: Found | None, cache: Cache,
    once: Matched | None,
) -> Found:  # fmt: skip
    """Registers pictures in an order, and prints by how much they differ from what was found first; once: matches of
    the pictures as they are numbered, instead of those of this order."""
    began = time.process_time()
    shown = [pictures[number] for number in order]
    matched = matched_in(shown, cache) if once is None else renumbered(once, np.argsort(order).tolist())
    found = registered_in(shown, order, matched)
    off = "–", "–", "–"
    if first is not None and first.numbers == found.numbers:
        off = tuple(f"{one:.4f}" for one in differences(found, first))
    told = " | ".join((*off, f"{found.cost:.4f}", f"{time.process_time() - began:.0f}"))
    print(f"| {name} | {' '.join(map(str, order))} | {len(found.numbers)} of {len(pictures)} | {told} |", flush=True)
    return found


def registered_in(pictures: Sequence[Picture], numbers: Sequence[int], matched: Matched) -> Found:
    """The cameras of pictures in the order given; numbers: what each one's number is in the order of their names."""
    names, sizes = [one.name for one in pictures], [one.view.shape[1::-1] for one in pictures]
    cameras, _ = cameras_for(CameraRequest(), names, sizes, [one.exif for one in pictures])
    found = registered(pictures, range(len(pictures)), cameras, matched, 0, Cache(None), lambda *_: None)
    rig, own = found.rig, [numbers[number] for number in found.numbers]
    by_name = np.argsort(own)
    return Found(
        tuple(sorted(own)), rig.R[by_name], rig.centres[by_name],
        np.array([camera.focal for camera in rig.cameras])[by_name], rig.guesses[0].cost,
    )  # fmt: skip


def differences(found: Found, first: Found) -> tuple[float, float, float]:
    """The largest: of a rotation between two pictures, °; of a focal length, %; of a place, % of the extent."""
    count = len(found.numbers)
    turn = max(
        rotation_angle(found.R[j] @ found.R[i].T, first.R[j] @ first.R[i].T)
        for i in range(count) for j in range(i + 1, count)
    )  # fmt: skip
    focal = 100 * np.abs(found.focals / first.focals - 1).max()
    extent = np.linalg.norm(first.places - first.places.mean(axis=0), axis=1).max()
    off = np.linalg.norm(onto(found.places, first.places)[0] - first.places, axis=1).max()
    return turn, float(focal), float(100 * off / extent) if extent else 0.0


if __name__ == "__main__":
    main()
