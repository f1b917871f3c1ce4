"""Hugin's command line, where it is installed: one place for all pictures, seams around what does not fit."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ...cameras.camera import Camera
from ...cameras.lens import distort
from ...cameras.projective import ahead_of_camera, project
from ...cameras.sources import read_camera_file
from ...measure.placed.options import PLACED
from ...measure.placed.placed import PlacedPicture, PlacedSet, union
from ...panorama.projection import Projection
from ...pictures.picture import Picture
from ...raster.arrays import Array, Part
from ...raster.picture_map import PictureMap
from ...system.errors import StitchError

PROGRAMS = ("pto_gen", "cpfind", "autooptimiser", "pano_modify", "hugin_executor", "nona")
# Seconds after which a program of theirs is given up.
PATIENCE = 900


class HuginFailed(StitchError):
    """Hugin made no panorama."""


def installed() -> bool:
    """Whether all its programs are there."""
    return all(shutil.which(program) for program in PROGRAMS)


def hugin_version() -> str:
    """Its version; empty where it is not installed."""
    if not installed():
        return ""
    try:
        done = subprocess.run(["nona", "--help"], capture_output=True, text=True, errors="replace", timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    found = re.search(r"version (\d+\.\d+\.\d+)", done.stdout + done.stderr)
    return found[1] if found else ""


def run(folder: Path, *command: str) -> None:
    """Runs a program of theirs in a folder. Raises HuginFailed with what it said last."""
    try:
        done = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise HuginFailed(f"{command[0]} took more than {PATIENCE} s") from None
    except OSError as error:
        raise HuginFailed(f"{command[0]} cannot be run: {error.strerror or error}; install Hugin") from None
    if done.returncode:
        said = (done.stdout + done.stderr).strip().splitlines()
        raise HuginFailed(f"{command[0]} ended with {done.returncode}: {said[-1] if said else 'it said nothing'}")


def optimised(folder: Path, pictures: Sequence[Path], told: Callable[[str], str] = str) -> Path:
    """A project in a folder, with all that Hugin finds by itself: control points, lenses, rotations, exposures.

    told: changes the text of the project that the search begins with. Raises HuginFailed.
    """
    start, end = folder / "a.pto", folder / "c.pto"
    run(folder, "pto_gen", "-o", "a.pto", "-f", "50", *(str(path.absolute()) for path in pictures))
    start.write_text(told(start.read_text("utf-8")), "utf-8")
    run(folder, "cpfind", "--multirow", "-o", "b.pto", "a.pto")
    run(folder, "autooptimiser", "-a", "-m", "-o", end.name, "b.pto")
    return end


def hugin_panorama(paths: Sequence[Path], pictures: Sequence[Picture]) -> PlacedSet:
    """What Hugin makes of pictures, on a sphere; those without control points lie anywhere, as it leaves them.

    Raises HuginFailed, or another StitchError where its project cannot be read.
    """
    width = 2 * round(np.pi * PLACED.px_per_radian)
    with tempfile.TemporaryDirectory(prefix="edf-hugin-") as temporary:
        folder = Path(temporary)
        # short names of their own: a project names its pictures, and two may have the same
        names = [f"{number:02d}{path.suffix}" for number, path in enumerate(paths)]
        for name, path in zip(names, paths, strict=True):
            shutil.copyfile(path, folder / name)
        found = optimised(folder, [folder / name for name in names])
        run(folder, "pano_modify", "--projection=2", "--fov=360x180", f"--canvas={width}x{width // 2}",
            f"--crop=0,{width},0,{width // 2}", "-o", "d.pto", found.name)  # fmt: skip
        project = (folder / "d.pto").read_text("utf-8")
        # layers as large as the whole sphere: nona writes their corners in a form that OpenCV does not read
        (folder / "d.pto").write_text(project.replace(" r:CROP", ""), "utf-8")
        run(folder, "nona", "-m", "TIFF_m", "-z", "NONE", "-o", "layer", "d.pto")
        size = size_of(project)
        sizes = [(picture.view.shape[1], picture.view.shape[0]) for picture in pictures]
        bare = [str(folder / name) for name in names]
        cameras = read_camera_file(folder / "d.pto", _named(project, bare, names), sizes)
        middle = (size[0] - 1) / 2, (size[1] - 1) / 2
        projection = Projection("equirectangular", size[0] / (2 * np.pi), middle, np.eye(3), np.eye(3))
        placed = []
        for number, (camera, picture) in enumerate(zip(cameras, pictures, strict=True)):
            layer = cv2.imread(str(folder / f"layer{number:04d}.tif"), cv2.IMREAD_UNCHANGED)
            if layer is None or camera is None or layer.shape[2:] != (4,):
                continue
            layer = np.rint(layer / 257).astype(np.uint8) if layer.dtype == np.uint16 else layer.astype(np.uint8)
            one = PlacedPicture.cut_out(
                picture.name, np.ascontiguousarray(layer[..., 2::-1]), layer[..., 3] > 250, None
            )
            placed.append(replace(one, map=_map(camera, projection, one.box)))
    return PlacedSet(size, tuple(placed), projection.rays, union(size, placed), projection.focal)


def size_of(project: str) -> tuple[int, int]:
    """The (W, H) px of a project file's panorama."""
    found = re.search(r"^p .*?w(\d+) h(\d+)", project, re.MULTILINE)
    if found is None:
        raise HuginFailed("Hugin's project has no panorama")
    return int(found[1]), int(found[2])


def _named(project: str, paths: Sequence[str], names: Sequence[str]) -> list[str]:
    """What the project calls its pictures: by path, or by name alone."""
    return [path if f'"{path}"' in project else name for path, name in zip(paths, names, strict=True)]


def _map(camera: Camera, projection: Projection, box: Part) -> PictureMap:
    """Which px of a picture each of a box of the canvas shows, by the camera that Hugin has found."""
    rows, columns = np.mgrid[box].astype(np.float64)
    R = np.eye(3) if camera.start is None else camera.start
    rays = projection.rays(np.stack([columns, rows], axis=-1)) @ (camera.K @ R).T
    ahead = ahead_of_camera(*np.moveaxis(rays, -1, 0))[..., None]
    at: Array = np.where(ahead, distort(project(np.where(ahead, rays, 1.0)), camera), np.nan)
    x, y = np.moveaxis(at.astype(np.float32), -1, 0)
    return PictureMap(x, y, camera.size)
