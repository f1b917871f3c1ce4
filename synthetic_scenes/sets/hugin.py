"""Hugin's command line as a rival on sets, where it is installed: one place for all, seams around what does not fit."""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ...core.compare.elsewhere.hugin import HuginFailed, optimised, run
from ...core.raster.arrays import Array
from ...core.raster.colour import decode
from ..recipes import View
from ..scene_camera import SceneCamera
from .rendered_set import RenderedSet
from .rival_panorama import RivalPanorama
from .set_stitches import told_lens
from .sphere_camera import SphereCamera


def hugin_panorama(rendered: RenderedSet, numbers: Sequence[int]) -> RivalPanorama:
    """Its panorama of a set, to be turned by those of its pictures that have these numbers. Raises HuginFailed."""
    size = rendered.sphere.size
    with tempfile.TemporaryDirectory(prefix="edf-hugin-") as temporary:
        folder = Path(temporary)
        found = optimised(folder, rendered.pictures, lambda project: with_lenses(project, rendered.cameras))
        run(folder, "pano_modify", "--projection=2", "--fov=360x180", f"--canvas={size[0]}x{size[1]}",
             "--crop=0,{},0,{}".format(*size), "-o", "d.pto", found.name)  # fmt: skip
        run(folder, "hugin_executor", "--stitching", "--prefix=out", "d.pto")
        made = cv2.imread(str(folder / "out.tif"), cv2.IMREAD_UNCHANGED)
        rotations = rotations_of((folder / "d.pto").read_text("utf-8"))
    if made is None or made.shape != (size[1], size[0], 4):
        raise HuginFailed("Hugin left no whole sphere")
    light, alpha = decode(np.ascontiguousarray(made[..., 2::-1])), (made[..., 3] > 250).astype(np.float32)
    sphere = SphereCamera(rendered.sphere.place, size)
    return RivalPanorama(light, alpha, sphere.pixels, {number: rotations[number] for number in numbers})


def with_lenses(project: str, cameras: Sequence[SceneCamera]) -> str:
    """A project file whose pictures have the fields of view that cameras tell, but those tied to another's."""
    lines, number = project.split("\n"), 0
    for k, line in enumerate(lines):
        if line.startswith("i "):
            view = 2 * math.degrees(math.atan(cameras[number].size[0] / 2 / told_lens(cameras[number])))
            lines[k], number = re.sub(r" v[\d.]+", f" v{view:.3f}", line), number + 1
    return "\n".join(lines)


def rotations_of(project: str) -> Array:
    """The rotations (N, 3, 3) of the pictures of a project file, from the panorama's axes (x right, y ahead, z up)."""
    lines = [line for line in project.splitlines() if line.startswith("i ")]
    return np.array([
        View(yaw=_value(line, "y"), pitch=-_value(line, "p"), roll=_value(line, "r")).camera((640, 480)).R
        for line in lines
    ])  # fmt: skip


def _value(line: str, name: str) -> float:
    found = re.search(rf" {name}([-+.\deE]+)", line)
    if found is None:
        raise HuginFailed(f"Hugin's project names no {name}")
    return float(found[1])
