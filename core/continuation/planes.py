"""The planes that lie next to the overlap's border: on a plane n of the scene, δ = n · r' in the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array
from ..system.threads import ask
from .options import PLANES
from .samples import Samples
from .target_grid import TargetGrid


@dataclass(frozen=True)
class ScenePlane:
    """A plane δ = normal · r'.

    Attributes
    ----------
    normal : (3,) array
        0 at infinity.
    kind : {"upright", "level", "free"}
        How it stands to gravity.
    share : float
        Of the samples that lie on it, those near the border counting more.
    """

    normal: Array
    kind: str
    share: float


def find_planes(grid: TargetGrid, samples: Samples, to_border: Array) -> list[ScenePlane]:
    """The planes that hold most samples near the border, one after the other.

    Each is the best of many through a few random samples (RANSAC, Fischler and Bolles 1981; scored as MSAC, Torr and
    Zisserman 2000), upright and level ones first, since these need fewer samples and are met more often.

    Parameters
    ----------
    grid : TargetGrid
    samples : Samples
    to_border : (N,) array
        px of the target from each sample to what only the target sees.

    Returns
    -------
    list of ScenePlane
        At most `PlanesOptions.most`.
    """
    random = np.random.default_rng(0)
    weight = np.exp(-to_border / (PLANES.nearby * max(grid.view.size))) * samples.trust
    count = min(PLANES.samples, int(np.count_nonzero(weight)))
    chosen = random.choice(len(weight), count, replace=False, p=weight / weight.sum())
    rays = grid.rays_of(samples.points[chosen])
    search = _Search(grid.down, rays, samples.inverse_depth[chosen], grid.sensitivity_of(rays))
    left = np.ones(count, bool)
    found: list[ScenePlane] = []
    while len(found) < PLANES.most and left.sum() >= PLANES.min_share * count:
        ask()
        plane, inliers = search.best(np.flatnonzero(left), random)
        if inliers.sum() < PLANES.min_share * count:
            break
        found.append(ScenePlane(plane.normal, plane.kind, float(inliers.sum() / count)))
        left &= ~inliers
    return found


@dataclass(frozen=True)
class _Search:
    """Samples among which planes are sought: gravity (3,), rays (n, 3), δ (n,), px per unit of δ (n,)."""

    down: Array
    rays: Array
    inverse_depth: Array
    sensitivity: Array

    def best(
        self, left: NDArray[np.intp], random: np.random.Generator
    ) -> tuple[ScenePlane, NDArray[np.bool_]]:
        """The best plane among the samples `left` (indices), fitted to its inliers; and which of all samples (n,)
        these are."""
        normals, kinds = self._candidates(left, random)
        rays, d, s = self.rays[left], self.inverse_depth[left], self.sensitivity[left]
        error = np.square((normals @ rays.T - d) * (s / PLANES.tolerance_px))
        score = (1 - np.minimum(error, 1)).sum(axis=1) * np.where(kinds == "free", PLANES.free_factor, 1.0)
        first = int(np.argmax(score))
        normal, kind = normals[first], str(kinds[first])
        among = np.zeros(len(self.rays), bool)
        among[left] = True
        inliers = among & (self._off(normal) < PLANES.inlier_factor)
        for _ in range(PLANES.refits):
            if inliers.sum() < 3:
                break
            normal = self._fitted(kind, inliers)
            inliers = among & (self._off(normal) < PLANES.inlier_factor)
        if kind == "free" and inliers.sum() >= 3:
            normal, kind = self._snapped(normal, inliers)
            inliers = among & (self._off(normal) < PLANES.inlier_factor)
        return ScenePlane(normal, kind, 0.0), inliers

    def _candidates(self, left: NDArray[np.intp], random: np.random.Generator) -> tuple[Array, NDArray[np.str_]]:
        """Normals (m, 3) of planes through random samples, and their kinds (m,); the first is at infinity."""
        basis = self._basis("upright")
        singles, pairs, triples = (random.choice(left, (n, k)) for k, n in enumerate(PLANES.draws, 1))
        triples = triples[np.abs(np.linalg.det(self.rays[triples])) > 1e-3]
        pairs = pairs[np.abs(np.linalg.det(self.rays[pairs] @ basis)) > 1e-2]
        below = self.rays[singles[:, 0]] @ self.down
        d = self.inverse_depth
        level = self.down * (d[singles[:, 0]] / np.where(np.abs(below) > 0.02, below, np.inf))[:, None]
        upright = np.linalg.solve(self.rays[pairs] @ basis, d[pairs][..., None])[..., 0] @ basis.T
        free = np.linalg.solve(self.rays[triples], d[triples][..., None])[..., 0]
        normals = np.vstack([np.zeros((1, 3)), upright, level, free])
        return normals, np.repeat(["upright", "level", "free"], [1 + len(upright), len(level), len(free)])

    def _off(self, normal: Array) -> Array:
        """Errors (n,) of a plane in tolerances."""
        result: Array = np.abs(self.rays @ normal - self.inverse_depth) * self.sensitivity / PLANES.tolerance_px
        return result

    def _basis(self, kind: str) -> Array:
        """Directions (3, k) that the normal of a kind of plane is composed of."""
        if kind == "free":
            return np.eye(3)
        if kind == "level":
            return self.down[:, None]
        across: Array = np.linalg.svd(self.down[None])[2][1:].T
        return across

    def _fitted(self, kind: str, inliers: NDArray[np.bool_]) -> Array:
        """The normal (3,) of a kind of plane that fits samples best, in px."""
        basis, s = self._basis(kind), self.sensitivity[inliers]
        design = (self.rays[inliers] @ basis) * s[:, None]
        normal: Array = basis @ np.linalg.lstsq(design, self.inverse_depth[inliers] * s, rcond=None)[0]
        return normal

    def _snapped(self, normal: Array, inliers: NDArray[np.bool_]) -> tuple[Array, str]:
        """A free plane's normal and kind; made level or upright where it nearly is and then fits about as well."""
        length = float(np.linalg.norm(normal))
        steep = abs(float(normal @ self.down)) / max(length, 1e-12)
        limit = np.radians(PLANES.snap_deg)
        kind = "level" if steep > np.cos(limit) else "upright" if steep < np.sin(limit) else "free"
        if kind == "free":
            return normal, kind
        other = self._fitted(kind, inliers)
        most = PLANES.snap_factor * np.median(self._off(normal)[inliers]) + PLANES.snap_slack
        return (other, kind) if np.median(self._off(other)[inliers]) < most else (normal, "free")
