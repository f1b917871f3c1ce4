"""What the tests of dense refinement's parts share: a wall and a floor seen from two places, with the true depth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import fundamental_from_pose, infinite_homography
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.matching import ComparedPicture
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.raster.grid import Grid
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.two_planes import Textures, depth_at, render

from .point_scenes import turned_by

SIZE, MARGIN = (200, 150), 24
# how far the target camera stands (m), and how it is turned (degrees)
MOTIONS = {
    "sideways": ((0.5, -0.05, 0.1), (1.0, -8.0, 1.5)),
    "aslant": ((0.3, -0.3, 0.0), (0.0, -5.0, 25.0)),
    "forward": ((0.05, 0.05, 0.8), (0.0, -1.0, 0.0)),
}


@dataclass(frozen=True)
class Field:
    """A displacement field that is a function of ideal reference px (…, 2); shift: the same everywhere, px."""

    depth: object
    shift: tuple[float, float] = (0.0, 0.0)

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        points = grid.points if ideal is None else ideal
        return FieldValues(self.depth(points), np.broadcast_to(self.shift, points.shape))


@dataclass(frozen=True)
class Scene:
    """What both cameras see, uint8 RGB, and their geometry."""

    first: SceneCamera
    second: SceneCamera
    reference: np.ndarray
    target: np.ndarray

    @cached_property
    def view(self) -> TwoView:
        R = self.second.R @ self.first.R.T
        t = self.second.t - R @ self.first.t
        t, K, K_prime = t / np.linalg.norm(t), self.first.K, self.second.K
        return TwoView(
            K, K_prime, R, t, fundamental_from_pose(K, K_prime, R, t), infinite_homography(K, K_prime, R), K_prime @ t,
            np.ones(0, bool), 0.1, "general", "by hand", "test", 0.0, 0.0,
        )  # fmt: skip

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        return tuple(Camera(c.K, c.size, "test", 0.0, np.zeros(5)) for c in (self.first, self.second))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """The true inverse depth of reference px (…, 2), in units of the baseline."""
        baseline = np.linalg.norm(self.second.place - self.first.place)
        return baseline / depth_at(self.first, points)

    @cached_property
    def plane(self) -> np.ndarray:
        """The plane (3,) that is nearest to the true depth: a field that is wrong by some px nearly everywhere."""
        x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
        rows = np.stack([x, y, 1 + 0 * x], axis=-1).reshape(-1, 3).astype(float)
        return np.linalg.lstsq(rows, self.depth(rows[:, :2]), rcond=None)[0]

    def field(self, truth: bool = False, shift: tuple[float, float] = (0.0, 0.0)) -> SparseMap:
        """The true field, or the plane."""
        depth = self.depth if truth else (lambda points: points @ self.plane[:2] + self.plane[2])
        return SparseMap.over_reference(Field(depth, shift), self.view, *self.cameras, MARGIN)

    def lines(self, field: SparseMap, step: float = 1.0) -> EpipolarLines:
        """Of the whole reference."""
        return EpipolarLines.over(field, (0, 0, *SIZE), step)

    def views(self, step: float = 1.0) -> tuple[ComparedPicture, ComparedPicture]:
        return ComparedPicture.of(self.reference, None, step), ComparedPicture.of(self.target, None, step)

    def truth(self, lines: EpipolarLines) -> np.ndarray:
        """The moves (h, w) that are right."""
        return (self.depth(lines.ideal) - lines.inverse_depth) / lines.depth_per_px

    def visible(self, lines: EpipolarLines) -> np.ndarray:
        """Where (h, w) the target shows what the nodes show, some px from its border: the wall hides none of the
        floor, nor the floor of the wall."""
        x, y = lines.target(self.truth(lines).astype(np.float32))
        with np.errstate(invalid="ignore"):
            return (x >= 4) & (y >= 4) & (x <= SIZE[0] - 5) & (y <= SIZE[1] - 5)


@lru_cache
def scene(motion: str) -> Scene:
    """Shared: read it, never write to it."""
    place, turn = MOTIONS[motion]
    focal = 190.0
    K = np.array([[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
    level = turned_by(9.0, 0, 0)
    R = turned_by(*turn) @ level
    first, second = SceneCamera(K, level, np.zeros(3), SIZE), SceneCamera(K, R, -R @ np.array(place), SIZE)
    textures = Textures(1)
    return Scene(first, second, render(first, textures), render(second, textures))
