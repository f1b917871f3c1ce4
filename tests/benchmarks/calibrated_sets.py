"""A table of docs/validation.md of cameras of many pictures: all of a folder at once, against their known cameras.

    calibrated_sets.py [--data DIR]

Folders as in calibrated.py. Each is registered twice: with K given, and with a focal length that is 3 % too long and
known to 5 %, as EXIF data tell it. Rotations are compared between all pairs; places after the similarity that fits
best, in % of the largest distance of a place from the middle.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np
from edf_stitch.core.cameras.bodies import Bodies
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.rig.from_pictures import content_order, matched_pictures, registered
from edf_stitch.core.system.cache import Cache
from edf_stitch.synthetic_scenes.sets.set_measures import nearest_rotation, onto

ROOT = Path(__file__).resolve().parents[2]
TOO_LONG, SIGMA = 1.03, 0.05


def main() -> None:
    """Prints a table in Markdown: a row for each folder and way."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=data / "calibrated")
    print("| set | known | pictures | rotation °, median (worst) | place %, median (worst) | focal length | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for folder in sorted(parser.parse_args().data.glob("*/")):
        paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".png"))
        pictures = [load_picture(path) for path in paths]
        known = json.loads((folder / "cameras.json").read_text())["cameras"]
        true = [known[path.name] for path in paths]
        order = content_order(pictures)
        began = time.process_time()
        alone = Bodies.alone(len(pictures))
        matched = matched_pictures(pictures, order, alone, False, Cache(None), lambda stage, share: None)
        matching = time.process_time() - began
        for way in ("K", "f to 5 %"):
            began = time.process_time()
            shapes = [picture.view.shape for picture in pictures]
            cameras = [camera_of(one, shape, way == "K") for one, shape in zip(true, shapes, strict=True)]
            found = registered(pictures, order, cameras, matched, 0, Cache(None), lambda stage, share: None)
            cpu = matching + time.process_time() - began
            row(folder.name, way, len(paths), errors(found.rig, [true[number] for number in found.numbers]), cpu)


def camera_of(true: dict, shape: tuple[int, ...], given: bool) -> Camera:
    """What is known of a picture (H, W, …)."""
    height, width = shape[:2]
    K = np.array(true["K"], float)
    if given:
        return Camera(K, (width, height), "given", 0.0)
    f = TOO_LONG * K[0, 0]
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    return Camera(K, (width, height), "EXIF", SIGMA, principal_sigma=0.01, knowledge=Knowledge.EXIF)


def errors(rig: Rig, true: list[dict]) -> dict[str, np.ndarray]:
    """Of rotations between pictures, °; of places, %; of focal lengths, %."""
    R, t = (np.array([one[key] for one in true], float) for key in ("R", "t"))
    R = np.array([nearest_rotation(one) for one in R])
    places = -np.einsum("nji,nj->ni", R, t.reshape(len(R), 3))
    turns = [
        rotation_angle(rig.R[j] @ rig.R[i].T, R[j] @ R[i].T) for i in range(len(R)) for j in range(i + 1, len(R))
    ]
    off = np.linalg.norm(onto(rig.centres, places)[0] - places, axis=1)
    extent = np.linalg.norm(places - places.mean(axis=0), axis=1).max()
    focal = [100 * (camera.focal / one["K"][0][0] - 1) for camera, one in zip(rig.cameras, true, strict=True)]
    return {"turn": np.array(turns), "place": 100 * off / extent, "focal": np.array(focal)}


def row(name: str, way: str, asked: int, error: dict[str, np.ndarray], cpu: float) -> None:
    turn, place, focal = error["turn"], error["place"], error["focal"]
    print(
        f"| {name} | {way} | {len(place)} of {asked} | {np.median(turn):.3f} ({turn.max():.3f}) | "
        f"{np.median(place):.3f} ({place.max():.3f}) | {focal[np.abs(focal).argmax()]:+.2f} % | {cpu:.0f} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
