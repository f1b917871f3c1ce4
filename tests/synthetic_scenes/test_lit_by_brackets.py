"""A sphere of brackets as Blender's World lights a ball as what it was taken of does."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.blender_camera import lens_for, matrix_world_of
from edf_stitch.core.cameras.blender_world import world_rotation
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pipeline import stitch
from edf_stitch.synthetic_scenes.rendered import expose
from scipy.ndimage import map_coordinates

from .test_round_truth import rendered_by_blender

pytestmark = pytest.mark.slow
SIDE, FOCAL = 400, 168.0
K = np.array([[FOCAL, 0, (SIDE - 1) / 2], [0, FOCAL, (SIDE - 1) / 2], [0, 0, 1.0]])
# Degrees to the right and up: a ring, and both poles.
LOOKS = (*((turn, 0) for turn in range(0, 360, 60)), (0, 90), (0, -90))
STOPS = (0.0, -3.0, -6.0)
LATTICES = [(size, np.random.default_rng(size).standard_normal((size,) * 3)) for size in (12, 30, 80)]


def radiance(rays: np.ndarray) -> np.ndarray:
    """What comes from directions (…, 3): a spotted room, a window of 8 to 20 times white and a lamp of 50."""
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    spots = sum(
        map_coordinates(lattice, np.moveaxis((rays + 1) / 2 * (size - 1), -1, 0), order=1)
        for size, lattice in LATTICES
    )
    light = 0.15 * 2.0 ** (0.9 * spots)
    for toward, degrees, strength in (((0.5, -0.4, 0.8), 14, 12.0), ((-0.7, -0.6, -0.3), 4, 50.0)):
        angle = np.degrees(np.arccos(np.clip(rays @ (np.array(toward) / np.linalg.norm(toward)), -1, 1)))
        light = light + np.clip(degrees - angle, 0, 1) * strength * 2.0 ** (0.25 * spots)
    return (light[..., None] * [1.0, 0.85, 0.7]).astype(np.float32)


def taken(turn: float, up: float) -> list[Picture]:
    """Three exposures of what a camera at the middle sees; each pixel is the mean of nine."""
    tall = rotation_from_vector(np.radians([-up, 0, 0])) @ rotation_from_vector(np.radians([0, -turn, 0]))
    y, x = (np.mgrid[: 3 * SIDE, : 3 * SIDE] - 1) / 3
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(K).T @ tall
    light = cv2.resize(radiance(rays), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    random = np.random.default_rng([int(turn), int(up + 90)])
    return [
        picture_from_array(expose(light, (2.0**stops,) * 3, 0.7, False, random), f"{turn}_{up}_{stops:+g}.png")
        for stops in STOPS
    ]


def test_a_ball_is_lit_as_by_the_truth(tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="nothing to render with: bpy is not installed")
    pictures = [one for turn, up in LOOKS for one in taken(turn, up)]
    options = StitchOptions(
        brackets=3, projection="equirectangular", level="none", crop="full", dense=False, measure=False,
        camera=CameraRequest(focal_px=(FOCAL,)),
    )  # fmt: skip
    result = stitch(pictures, options)
    height, width = result.alpha.shape
    assert len(result.pictures) == len(LOOKS) and width == 2 * height and result.alpha.min() > 0
    rotation = np.array(result.report["canvas"]["projection"]["rotation"])
    longitude = (np.arange(width) + 0.5) / width * 2 * np.pi - np.pi
    latitude = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * np.pi
    rays = np.stack(np.broadcast_arrays(
        np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)), axis=-1)
    true = radiance(rays @ rotation.T) * np.float32(2.0 ** STOPS[1])  # a bracket has the light of its middle exposure
    assert np.median(np.abs(result.pixels / true - 1)) < 0.03, "rays are those of the canvas"
    assert result.pixels.max() > 40 * 2.0 ** STOPS[1] and true.max() > 40 * true.mean()
    upright = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    matrix = matrix_world_of(upright, np.zeros(3))
    ball = upright.T @ [0, 0, 3.0]
    lens = np.array([[150.0, 0, 31.5], [0, 150.0, 31.5], [0, 0, 1]])
    seen = []
    for name, light in (("true", true), ("ours", result.pixels)):
        (tmp_path / name).mkdir()
        image = tmp_path / f"{name}.exr"
        image.write_bytes(encode_picture(light, None, 32, ".exr")[0])
        seen.append(rendered_by_blender({
            "image": str(image), "size": [64, 64], "matrix_world": matrix.tolist(), "ball": ball.tolist(),
            "samples": 512, "rotation": world_rotation(matrix, rotation).tolist(), **asdict(lens_for(lens, (64, 64))),
        }, tmp_path / name))  # fmt: skip
    y, x = np.mgrid[:64, :64] - 31.5
    inside = cv2.resize((np.hypot(x, y) < 44).astype(np.float32), (16, 16), interpolation=cv2.INTER_AREA) == 1
    truth, found = (cv2.resize(one, (16, 16), interpolation=cv2.INTER_AREA)[inside] for one in seen)
    off = np.abs(found / truth - 1)
    assert len(off) > 100 and off.max() < 0.03, f"{off.mean():.2%} on average, {off.max():.2%} at most"
