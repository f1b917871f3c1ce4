"""Finished panoramas with a depth that is known, without a stitch: as much of a StitchResult as depth is made of."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.scale import Scale
from edf_stitch.core.cameras.view import View
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pipeline import StitchResult

WIDTH, HEIGHT = 360, 180
FOCAL = WIDTH / (2 * np.pi)
K = np.array([[FOCAL, 0, 99.5], [0, FOCAL, 49.5], [0, 0, 1.0]])
CAMERA = Camera(K, (200, 100), "test", 0.0)


def sphere() -> Canvas:
    """A whole sphere, turned, 360 × 180."""
    turn = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    projection = Projection("equirectangular", FOCAL, (-0.5, -0.5), turn, K)
    return Canvas(WIDTH, HEIGHT, (WIDTH // 2, HEIGHT // 2), projection=projection)


def plane() -> Canvas:
    """The first picture's own plane."""
    return Canvas(200, 100, (0, 0))


def rays_of(canvas: Canvas) -> np.ndarray:
    """Unit rays (H, W, 3) in the first picture's frame."""
    return canvas.rays_at(K, canvas.xs, canvas.ys, CAMERA)[0]


class Finished(SimpleNamespace):
    """Of a set that is made at once."""

    times, rig = 1, "a rig"
    in_full = StitchResult.in_full


def finished(canvas: Canvas, ranges: np.ndarray, shows: np.ndarray | None = None, **more: Any) -> Finished:
    """The panorama of a canvas with ranges (H, W), gray noise; more: `scale`, and what its Warp has."""
    length = 1.0
    if canvas.projection is None:
        length = canvas.rays_at(K, canvas.xs, canvas.ys, CAMERA)[1]
    scale = more.pop("scale", Scale())
    with np.errstate(divide="ignore"):
        d = (length / ranges).astype(np.float32)
    light = np.random.default_rng(0).random((*ranges.shape, 3)).astype(np.float32)
    alpha = np.ones(ranges.shape, bool) if shows is None else shows
    other = View(CAMERA, K, np.eye(3), np.array([1.0, 0, 0]), np.eye(3), K[:, 0])
    first = View(CAMERA, K, np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    return Finished(
        panorama=Layer(light, alpha), canvas=canvas, warp=Warp(canvas, (), d, **more), views=(first, other),
        spread=(0, 0, canvas.width, canvas.height), scale=scale, pictures=(SimpleNamespace(icc=None),),
    )  # fmt: skip
