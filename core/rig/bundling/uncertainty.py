"""How sure a bundled rig is, by its normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...raster.arrays import Array
from .bundle import Normal, Settings, Structure, normal_equations, scale_direction, schur_complement
from .bundle_options import BUNDLE
from .polishing import Polished
from .reprojection import CAMERA, reproject, tangents

# Parameters of one point: two of its ray and ρ.
POINT = 3


@dataclass(frozen=True, eq=False)
class Deviations:
    """Standard deviations, pose of the first picture and scale held: log_focal (N,); places (N,), the root of the sum
    over the three axes; inverse_ranges (P,), 1 where all pictures were taken from one place and nothing is known."""

    log_focal: Array
    places: Array
    inverse_ranges: Array


def deviations(found: Polished, noise_px: float) -> Deviations:
    """Of a solution in the frame of its first picture; noise_px: what is left of one coordinate of an observation."""
    problem, solution = found.problem, found.solution
    settings = Settings(depths=not found.one_place)
    structure = Structure(problem, solution, settings, 0)
    seen = reproject(problem, solution, structure.chosen)
    bases = tangents(solution.rays)
    normal = normal_equations(problem, solution, structure, seen, settings, found.prior, bases)
    # points follow their observations: what is left of the noise is less than it was
    equations, unknowns = 2 * len(structure.chosen), POINT * len(structure.points) + structure.unknowns
    noise_px *= float(np.sqrt(equations / max(equations - unknowns, 1)))
    inverses = np.linalg.inv(normal.points + 1e-12 * np.eye(POINT))
    covariance = _of_unknowns(structure, normal, inverses, scale_direction(structure, solution)) * noise_px**2
    variance = np.einsum("cu,uv,cv->c", structure.chooser, covariance, structure.chooser, optimize=True)
    variance = variance.reshape(-1, CAMERA)
    depth = np.ones(len(solution.solved))
    if not found.one_place:
        depth[structure.points] = np.sqrt(_of_depths(structure, normal, inverses, covariance, noise_px))
    return Deviations(np.sqrt(variance[:, 6]), np.sqrt(variance[:, 3:6].sum(axis=1)), depth)


def _of_unknowns(structure: Structure, normal: Normal, inverses: Array, scale: Array) -> Array:
    """Covariance (C, C) of the cameras' unknowns in units of the noise's variance."""
    fill, _ = schur_complement(structure, normal, inverses)
    information = normal.cameras - fill
    size = len(information)
    usual = np.trace(information) / max(size, 1)
    information += usual * BUNDLE.scale_stiffness * np.outer(scale, scale)
    # Unknowns have units of their own: in those of their deviations alone, rounding is the same for all. What the
    # observations do not tell has a large variance then, never a negative one.
    units = 1 / np.sqrt(np.maximum(np.diag(normal.cameras), BUNDLE.regular * usual))
    values, vectors = np.linalg.eigh(information * np.outer(units, units))
    least = size * np.finfo(np.float64).eps * max(float(values.max(initial=0.0)), 1.0)
    half = units[:, None] * vectors / np.sqrt(np.maximum(values, least))
    covariance: Array = half @ half.T
    return covariance


def _of_depths(structure: Structure, normal: Normal, inverses: Array, covariance: Array, noise_px: float) -> Array:
    """Variance (P,) of ρ: its own with the cameras held, and what theirs adds."""
    by_camera = np.matmul(normal.between.transpose(0, 2, 1), inverses[structure.point][:, :, 2:])[:, :, 0]
    by_camera[:, :3] = np.einsum("oi,oij->oj", by_camera[:, :3], structure.turns[structure.picture])
    points = len(structure.points)
    flat = structure.columns[structure.picture]
    pulled = np.zeros((points, structure.unknowns + 1))
    np.add.at(pulled, (structure.point[:, None], flat), by_camera)  # held parameters fall into the last column
    pulled = pulled[:, :-1]
    variance: Array = inverses[:, 2, 2] * noise_px**2 + ((pulled @ covariance) * pulled).sum(axis=1)
    return variance
