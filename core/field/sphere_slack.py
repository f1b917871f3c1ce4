"""What the points of one picture leave across its epipolar lines: a smooth two-vector of its px.

It stands for lenses and errors of a pose. Along the lines d explains what is left: an edge of depth that the spline
smooths away is no error of the lens, and slack that followed it would bend both sides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..cameras.lens import undistort
from ..cameras.rig import Rig
from ..raster.arrays import Array
from .sphere_options import SPHERE, SPHERE_SLACK
from .sphere_points import px_scale
from .sphere_spline import SphereSpline, problem_on_sphere, share_near, solved_on_sphere
from .spline import spread_points
from .strict import robust_mean
from .transfer import transfer


@dataclass(frozen=True, eq=False)
class SphereSlack:
    """px (before the lens) that are added to where a picture sees a ray.

    spline: before it is bounded; own (N, 3): rays of the picture's points; max_px: the longest; reach, width: radians
    from the nearest point where it begins to fade, and over which it fades to nothing.
    """

    spline: SphereSpline
    own: Array
    max_px: float
    reach: float
    width: float

    def at(self, rays: Array) -> Array:
        """px (…, 2) at unit rays (…, 3)."""
        flat = rays.reshape(-1, 3)
        share = share_near(self.own, flat, self.reach, self.width)
        out = np.zeros((len(flat), 2))
        near = share > 0
        values = self.spline.at(flat[near])
        length = np.linalg.norm(values, axis=1)
        out[near] = values * (share[near] * np.minimum(1, self.max_px / np.maximum(length, 1e-300)))[:, None]
        return out.reshape(*rays.shape[:-1], 2)


def fit_sphere_slack(rig: Rig, number: int, field: Callable[[Array], Array], unit: float) -> SphereSlack | None:
    """Fit what the points of picture `number` of a rig leave.

    Parameters
    ----------
    rig : Rig
    number : int
    field : callable
        Inverse range (N,) on unit rays (N, 3).
    unit : float
        Radians.

    Returns
    -------
    SphereSlack or None
        None if there are too few points, or they are off by chance alone; and for a view of a sphere, which has no lens
        to stand for, and whose neighbours agree with it exactly as it is.
    """
    if rig.cameras[number].view_of is not None:
        return None
    scale, view, seen = px_scale(rig), rig.views[number], rig.observations
    here = seen.used & (seen.picture == number)
    rays = rig.rays[seen.point[here]]
    infinite = list(view.H_inf @ rig.cameras[0].K @ rays.T)
    predicted = np.stack(transfer(view, infinite, field(rays)), axis=-1)
    rest = _across(undistort(seen.pixels[here], view.camera) - predicted, predicted, view.e_prime)
    length = np.linalg.norm(rest, axis=1)
    usable = np.flatnonzero(length < SPHERE_SLACK.gross_error_px * scale)
    chosen = usable[spread_points(rays[usable], 0 * length[usable], SPHERE_SLACK.max_centres, SPHERE.spacing * unit)]
    if len(chosen) < SPHERE_SLACK.min_centres:
        return None
    rays, rest, ones = rays[chosen], rest[chosen], np.ones(len(chosen))
    problem = problem_on_sphere(rays, ones, unit)
    errors = np.linalg.norm(problem.held_out(rest, SPHERE_SLACK.smoothing_ladder), axis=-1)
    *scores, without = robust_mean(np.vstack([errors, np.linalg.norm(rest, axis=1)]))
    best = int(np.argmin(scores))
    if scores[best] >= (1 - SPHERE_SLACK.min_gain) * without:
        return None
    smoothing = float(SPHERE_SLACK.smoothing_ladder[best])
    spline, residual = solved_on_sphere(problem, rest, smoothing)
    error = np.linalg.norm(residual, axis=1)
    sigma = float(np.sqrt(np.mean(error**2)))
    keep = error <= max(SPHERE_SLACK.outlier_sigmas * sigma, SPHERE_SLACK.outlier_floor_px * scale)
    if SPHERE_SLACK.min_centres <= keep.sum() < len(keep):
        spline, _ = solved_on_sphere(problem.subset(keep), rest[keep], smoothing)
        rays = rays[keep]
    reach, width = SPHERE_SLACK.reach * unit, SPHERE_SLACK.fade * unit
    return SphereSlack(spline, rays, SPHERE_SLACK.max_px * scale, reach, width)


def _across(rest: Array, predicted: Array, epipole: Array) -> Array:
    """The part of what is left (N, 2) px that lies across the epipolar lines through predicted px (N, 2); all of it in
    a picture from the viewpoint itself, whose `epipole` K t (3,) is 0."""
    if not epipole.any():
        return rest
    along = epipole[:2] - epipole[2] * predicted
    normal = along[:, ::-1] * (1.0, -1.0) / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across: Array = np.sum(rest * normal, axis=1, keepdims=True) * normal
    return across
