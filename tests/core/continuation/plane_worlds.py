"""Worlds of a few planes that two known cameras see, drawn in NumPy: all of their geometry is true."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import (
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    rotation_from_vector,
)
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.continuation.continuation import Continuation, continue_beyond
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.raster.grid import Grid

SIZE, FOCAL = (400, 300), 330.0
DOWN = np.array([0.0, 1.0, 0.0])
Depths = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Field:
    """A displacement field that is a function of reference pixels (…, 2)."""

    depth: Depths

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        return FieldValues(self.depth(grid.points if ideal is None else ideal))


@dataclass(frozen=True)
class World:
    """Planes N · X = 1 in the reference's frame, in baselines; the nearest of them is seen in every direction."""

    planes: np.ndarray
    views: tuple[View, View]

    def nearness(self, rays: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """1 / t of the first plane met at place + t · ray along rays (…, 3), 0 if none is; and its number (…)."""
        met = rays @ self.planes.T / (1 - self.planes @ place)
        return np.maximum(met.max(axis=-1), 0), np.where(met.max(axis=-1) > 0, met.argmax(axis=-1), len(self.planes))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """True inverse depth of reference pixels (…, 2)."""
        rays = homogeneous(points) @ np.linalg.inv(self.views[0].K).T
        return self.nearness(rays, np.zeros(3))[0]

    @property
    def target_rays(self) -> np.ndarray:
        """Rays (H, W, 3) of the target's pixels in the reference's frame."""
        x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
        return homogeneous(np.stack([x, y], axis=-1)) @ np.linalg.inv(self.views[1].K).T @ self.views[1].R

    @property
    def picture(self) -> np.ndarray:
        """The target, a colour a plane with a little noise."""
        view = self.views[1]
        number = self.nearness(self.target_rays, -view.R.T @ view.t)[1]
        colours = np.array([[180, 90, 60], [60, 150, 90], [90, 90, 200], [200, 200, 60], [220, 220, 220]])
        noise = np.random.default_rng(0).normal(0, 4, (*number.shape, 3))
        return np.clip(colours[number] + noise, 0, 255).astype(np.uint8)

    def continued(
        self, depth: Depths | None = None, edges: np.ndarray | None = None, confirmed: bool = True,
        down: np.ndarray = DOWN,
    ) -> Continuation:  # fmt: skip
        """What is continued from the true depth, or from another."""
        lines = np.zeros((0, 2, 3)) if edges is None else edges
        found = continue_beyond(
            Field(depth or self.depth), self.views, None, self.picture, lines, down, confirmed
        )
        assert found is not None
        return found

    def error(self, continuation: Continuation) -> np.ndarray:
        """px (N,) by which a continuation misses the target in what that alone sees."""
        reference, view = self.views
        rays = self.target_rays[::3, ::3].reshape(-1, 3)
        place = -view.R.T @ view.t
        nearness, _ = self.nearness(rays, place)
        seen = rays + nearness[:, None] * place
        range_ = np.linalg.norm(seen, axis=1)
        unit = seen / range_[:, None]
        shown = unit @ reference.K.T
        x = shown[:, :2] / shown[:, 2:]
        inside = (shown[:, 2] > 0) & (x >= 0).all(axis=1) & (x <= np.array(SIZE) - 1).all(axis=1)
        # the point must not lie behind another plane as the reference sees it
        clear = (nearness > 1e-6) & (self.nearness(unit, np.zeros(3))[0] <= 1.001 * nearness / range_)
        alone = ~inside & clear
        there = unit[alone] @ view.R.T + continuation.at(unit[alone])[:, None] * view.t
        found = (there @ view.K.T)[:, :2] / there[:, 2:]
        true = (rays[alone] @ view.R.T @ view.K.T)[:, :2]
        assert alone.sum() > 200
        return np.linalg.norm(found - true, axis=1)


def world(
    planes: Sequence[tuple[float, float, float]], yaw: float = 18.0, t: tuple[float, ...] = (-1, 0.05, 0.1)
) -> World:
    """The world of planes, seen from the origin and by a target that is turned to the right by yaw degrees."""
    camera = Camera(np.array([[FOCAL, 0, 199.5], [0, FOCAL, 149.5], [0, 0, 1.0]]), SIZE, "test", 0.0, np.zeros(5))
    R = rotation_from_vector(np.radians([0.0, -yaw, 0.0]))
    unit = np.array(t) / np.linalg.norm(t)
    two_view = TwoView(
        camera.K, camera.K, R, unit, fundamental_from_pose(camera.K, camera.K, R, unit),
        infinite_homography(camera.K, camera.K, R), camera.K @ unit, np.ones(0, bool), 0.1, "general", "", "", 0.0, 0.0,
    )  # fmt: skip
    return World(np.array(planes, float), views_of(two_view, (camera, camera)))


# Ground 1.5 baselines below; a wall ahead; a wall to the right, whose corner with it both pictures see.
GROUND, AHEAD, RIGHT = (0.0, 1 / 1.5, 0.0), (0.0, 0.0, 1 / 8), (1 / 5, 0.0, 0.03)
