"""A table of docs/validation.md of cameras: estimated geometry against the known cameras of calibrated photographs.

    calibrated.py [--data DIR]

Every folder under --data ($EDF_DATA/calibrated, else ../shared/data/calibrated beside the checkout) holds pictures and
a cameras.json (K, R, t of each, x ~ K (R X + t)). Each picture is the reference of the next, three times: with K given;
with the focal length alone; and with nothing, on crops to the central 60 %, where the focal length cannot be guessed.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from edf_stitch.core.cameras.projective import homogeneous, infinite_homography, project, rotation_angle
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchOptions, stitch

ROOT = Path(__file__).resolve().parents[2]
CROP = 0.6
GIVEN = ("K given", "focal length given", f"nothing given, central {CROP:.0%}")


@dataclass(frozen=True)
class Errors:
    """rotation in degrees, H_inf in px (median over the target), focal length and the reported spread of H_inf."""

    rotation: float
    H_inf: float
    focal: float
    spread: float


def main() -> None:
    """Prints a table in Markdown: a row for each pair and way, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=data / "calibrated")
    args = parser.parse_args()
    print("| pair | known | rotation ° | H_inf px | focal length | reported spread of H_inf px |")
    print("|---|---|---|---|---|---|")
    for way in GIVEN:
        found = []
        for folder in sorted(args.data.glob("*/")):
            pictures = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".png"))
            cameras = json.loads((folder / "cameras.json").read_text())["cameras"]
            for first, second in zip(pictures, pictures[1:], strict=False):
                error = measure(first, second, cameras[first.name], cameras[second.name], way)
                row(f"{folder.name} {first.stem}-{second.stem}", way, error)
                found.append((error.rotation, error.H_inf, abs(error.focal), error.spread))
        middle, worst = np.median(found, axis=0), np.max(found, axis=0)
        row("**median**", way, Errors(*middle))
        row("**worst**", way, Errors(*worst))


def row(name: str, way: str, error: Errors) -> None:
    print(
        f"| {name} | {way} | {error.rotation:.3f} | {error.H_inf:.2f} | {error.focal:+.1%} | {error.spread:.1f} |",
        flush=True,
    )


def measure(first: Path, second: Path, camera: dict, camera_prime: dict, way: str) -> Errors:
    """Errors of one pair; the pictures are cropped where nothing is given."""
    K, K_prime = (np.array(c["K"], float) for c in (camera, camera_prime))
    views = [load_picture(path).view for path in (first, second)]
    request = CameraRequest(focal_px=(K[0, 0], K_prime[0, 0]))
    if way == GIVEN[0]:
        entries = {name: {"K": value.tolist()} for name, value in (("reference", K), ("target", K_prime))}
        request = CameraRequest(cameras={"cameras": entries})
    if way == GIVEN[2]:
        request = CameraRequest()
        for index, matrix in enumerate((K, K_prime)):
            height, width = views[index].shape[:2]
            w, h = int(CROP * width), int(CROP * height)
            left, top = (width - w) // 2, (height - h) // 2
            views[index] = np.ascontiguousarray(views[index][top : top + h, left : left + w])
            matrix[:2, 2] -= (left, top)
    view = stitch(views, StitchOptions(camera=request, projection="reference", measure=False)).edges[0].two_view
    R = nearest_rotation(np.array(camera_prime["R"]) @ np.array(camera["R"]).T)
    height, width = views[1].shape[:2]
    grid = np.stack(np.meshgrid(np.linspace(0, width - 1, 20), np.linspace(0, height - 1, 20)), -1).reshape(-1, 2)
    back = homogeneous(grid) @ np.linalg.inv(infinite_homography(K, K_prime, R)).T
    away = np.linalg.norm(project(back @ view.H_inf.T) - grid, axis=1)
    return Errors(
        rotation_angle(view.R, R), float(np.median(away)), view.K[0, 0] / K[0, 0] - 1, view.h_inf_spread
    )


def nearest_rotation(M: np.ndarray) -> np.ndarray:
    """Published rotations are rounded; the nearest true one is meant."""
    U, _, Vt = np.linalg.svd(M)
    return U @ Vt


if __name__ == "__main__":
    main()
