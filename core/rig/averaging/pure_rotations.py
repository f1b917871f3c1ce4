"""Whether pure rotations explain pairs, by Torr's criterion (GRIC): a pose always fits better, and has to by much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...raster.arrays import Array
from .candidates import Candidates, noise_of
from .matched_rays import MatchedRays, SharedLens
from .options import PAIR_FIT
from .pair_models import EpipolarModel, Poses, RotationModel
from .pair_refinement import LensPrior, Together, refine_each, refine_together


def gric_of_poses(rays: MatchedRays, squares: Array, noise: float) -> Array:
    """Criterion (P,) of poses with squared Sampson distances (O,), px²: structure of three dimensions, five
    parameters."""
    return _gric(rays, squares, noise, codimension=1, parameters=5)


def gric_of_rotations(rays: MatchedRays, squares: Array, noise: float) -> Array:
    """Criterion (P,) of rotations with squared distances (O,), px²: structure of two dimensions, three parameters."""
    return _gric(rays, squares, noise, codimension=2, parameters=3)


def _gric(rays: MatchedRays, squares: Array, noise: float, codimension: int, parameters: int) -> Array:
    fit = rays.sums(np.minimum(squares / noise**2, 2.0 * codimension))
    out: Array = fit + (4 - codimension) * rays.counts * np.log(4) + parameters * np.log(4 * rays.counts)
    return out


@dataclass(frozen=True)
class AllRotations:
    """All pairs as rotations by one lens: share of the matches in pairs that these explain better than poses do."""

    share: float
    lens: SharedLens


def as_rotations(
    found: Candidates, together: Together, prior: LensPrior, start: SharedLens, scale: float
) -> AllRotations:
    """Fit all pairs as pure rotations with a shared lens: from the poses' focal length, the start's, and what was known
    before."""
    rays, width = found.rays.thinned(PAIR_FIT.rotation_test_matches), PAIR_FIT.cauchy_px * scale
    residual = EpipolarModel(rays, width).residuals(together.poses, together.lens)
    noise = noise_of(residual, scale)
    of_poses = gric_of_poses(rays, residual**2, noise)
    model = RotationModel(rays, width)
    poses = Poses(found.turned, np.zeros((len(rays), 3)))
    tried: list[float] = []
    best = AllRotations(0.0, together.lens)
    for factor in (together.lens.factor, start.factor, 1.0):
        if any(abs(np.log(factor / other)) < PAIR_FIT.rotation_same_focal for other in tried):
            continue
        tried.append(factor)
        fitted = refine_together(model, poses, SharedLens(factor), prior, noise, PAIR_FIT.rotation_iterations)
        better = gric_of_rotations(rays, model.squares(fitted.poses, fitted.lens), noise) < of_poses
        share = float(found.rays.counts[better].sum() / found.rays.counts.sum())
        if share > best.share:
            best = AllRotations(share, fitted.lens)
    return best


@dataclass(frozen=True, eq=False)
class PairRotations:
    """Each pair by itself as a pure rotation: R (P, 3, 3); gain (P,): by how much that is the better model (GRIC);
    parallax (P,): median distance from it, px."""

    R: Array
    gain: Array
    parallax: Array


def each_as_rotation(rays: MatchedRays, turned: Array, lens: SharedLens, squares: Array, noise: float) -> PairRotations:
    """Fit each pair as a pure rotation, from `turned` (P, 3, 3) on; squares (O,): of its pose's Sampson distances."""
    model = RotationModel(rays, 3 * noise)
    poses = refine_each(model, Poses(turned, np.zeros((len(rays), 3))), lens, PAIR_FIT.rotation_iterations)
    off = model.squares(poses, lens)
    gain = gric_of_poses(rays, squares, noise) - gric_of_rotations(rays, off, noise)
    distance = np.sqrt(2 * off)
    parallax = [float(np.median(part)) for part in np.split(distance, rays.starts[1:-1])]
    return PairRotations(poses.R, gain, np.array(parallax))
