"""Pictures on a whole sphere, made of one wall: for what is composed of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.composition import Composition, composed
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.picture_map import PictureMap

from ...pairs import ON_REFERENCE

WIDTH, HEIGHT = 720, 360
FOCAL = WIDTH / (2 * np.pi)
SPHERE = Projection("equirectangular", FOCAL, (-0.5, -0.5), np.eye(3), np.diag([FOCAL, FOCAL, 1.0]))
CANVAS = Canvas(WIDTH, HEIGHT, (WIDTH // 2, HEIGHT // 2), projection=SPHERE)
# Columns (first, width) of seven pictures all around; each shares about 50 with either neighbour.
RING = tuple((k * WIDTH // 7, 153) for k in range(7))
ROWS = slice(110, 250)


def wall(seed: int = 0) -> np.ndarray:
    """Smooth light (H, W, 3) that goes on across ±180°."""
    rough = np.random.default_rng(seed).random((24, 49, 3))
    rough[:, -1] = rough[:, 0]
    light = cv2.resize(rough, (WIDTH + 16, HEIGHT), interpolation=cv2.INTER_LINEAR)[:, 8:-8]
    return (0.12 + 0.25 * light).astype(np.float32)


def shown(columns: tuple[int, int], rows: slice = ROWS) -> np.ndarray:
    """Where (H, W) a picture of these columns shows something."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[rows, np.arange(columns[0], columns[0] + columns[1]) % WIDTH] = True
    return mask


def layers_of(lights: Sequence[np.ndarray], places: Sequence[tuple[int, int]] = RING) -> list[Layer]:
    """Layers that show lights (H, W, 3) in places."""
    masks = [shown(place) for place in places]
    return [
        Layer(np.where(mask[..., None], light, 0).astype(np.float32), mask)
        for light, mask in zip(lights, masks, strict=True)
    ]


def maps_of(places: Sequence[tuple[int, int]] = RING) -> tuple[PictureMap, ...]:
    """Maps of such pictures: a pixel of the canvas is one of the picture."""
    row = np.arange(HEIGHT, dtype=np.float32)[:, None] - ROWS.start + np.zeros((1, WIDTH), np.float32)
    maps = []
    for first, width in places:
        column = (np.arange(WIDTH) - first) % WIDTH
        away = np.where(column < (WIDTH + width) // 2, column, column - WIDTH).astype(np.float32)
        maps.append(PictureMap(away + np.zeros((HEIGHT, 1), np.float32), row, (width, ROWS.stop - ROWS.start)))
    return tuple(maps)


def views_at(centres: Sequence[Any], places: Sequence[tuple[int, int]] = RING) -> tuple[View, ...]:
    """Views from these places (3,), none of them turned; all with one lens."""
    camera = Camera(np.diag([FOCAL, FOCAL, 1.0]), (places[0][1], ROWS.stop - ROWS.start), "test", 0.0)
    return tuple(
        View(camera, camera.K, np.eye(3), -np.asarray(c, float), np.eye(3), camera.K @ -np.asarray(c, float))
        for c in centres
    )


def warp_of(places: Sequence[tuple[int, int]] = RING, depth: float = 0.0, deviation: float | None = None) -> Warp:
    """The warp of such pictures; deviation: of inverse range, if anything knows it."""
    plane = np.full((HEIGHT, WIDTH), depth, np.float32)
    spread = None if deviation is None else np.full((HEIGHT, WIDTH), deviation, np.float32)
    return Warp(CANVAS, maps_of(places), plane, deviation=spread)


def compose(
    layers: Sequence[Layer], warp: Warp, centres: Sequence[Any] | None = None, decided: Any = None, keep: bool = False,
    painted: np.ndarray | None = None, floats: bool = True, shown_from: np.ndarray | None = None, **options: Any,
) -> Composition:  # fmt: skip
    """A panorama of float pictures, taken from one place unless told."""
    views = views_at(centres or [np.zeros(3)] * len(layers), RING)
    wanted = replace(ON_REFERENCE, **options)
    return composed(
        layers, warp, views, wanted, [floats] * len(layers), painted, lambda *_: None, decided, keep, shown_from
    )
