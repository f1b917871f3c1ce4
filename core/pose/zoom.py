"""Two focal lengths, where the matches contradict a common one."""

from __future__ import annotations

import numpy as np

from ..cameras.camera import Camera
from ..cameras.matches import Matches
from ..cameras.projective import sampson_residuals
from ..raster.arrays import Array
from .options import ZOOM
from .refinement import Pose, pose_of_fundamental, refine_pose


def with_two_focals(
    matches: Matches, pose: Pose, F: Array, camera: Camera, camera_prime: Camera, sigma: float
) -> Pose | None:
    """The pose with two focal lengths if it is clearly better, else None.

    pose: with a common one, sigma px the noise it leaves; F: of the matches alone. Given focal lengths are not changed.
    F has as many unknowns as a pose with two focal lengths: if F leaves too much of the residuals, so would they.
    """
    if camera.fixed or camera_prime.fixed:
        return None
    few = matches.thinned(ZOOM.matches)
    common = sampson_residuals(pose.F, few.x, few.y)

    def left(other: Array) -> float:
        """The share of the robust residuals of `pose` that another F leaves, over matches that either explains."""
        residuals = common, sampson_residuals(other, few.x, few.y)
        explained = np.minimum(*np.abs(residuals)) < ZOOM.explained_px * few.scale
        before, after = (float(np.log1p((r[explained] / sigma) ** 2).sum()) for r in residuals)
        return after / max(before, 1e-12)

    if left(F) > ZOOM.max_residual_share:
        return None
    near = ZOOM.explained_px * few.scale
    starts = [
        pose_of_fundamental(few, F, camera.scaled(f), camera_prime.scaled(f * ratio), near)
        for f in ZOOM.focal_starts for ratio in ZOOM.ratio_starts
    ]  # fmt: skip
    refined = [
        refine_pose(few, start, camera, camera_prime, sigma, zoom=True, iterations=ZOOM.iterations) for start in starts
    ]
    best, _ = min(refined, key=lambda item: item[1])
    return best if left(best.F) <= ZOOM.max_residual_share else None
