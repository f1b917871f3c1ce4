"""Two focal lengths, where the matches contradict a common one."""

from __future__ import annotations

import numpy as np

from ..cameras.camera import Camera
from ..cameras.matches import Matches
from ..cameras.projective import sampson_residuals
from ..raster.arrays import Array
from .refinement import Pose, pose_of_fundamental, refine_pose

# Matches that are looked at, and px (in units of their scale) within which one counts as explained.
FEW, EXPLAINED_PX = 400, 3.0
# A second focal length also soaks up lens distortion, and then leads astray outside the overlap: it must leave no more
# than this share of what a common one leaves of the matches' robust residuals. F, whatever the cameras, has as many
# unknowns as a pose with two focal lengths: where F leaves more, so would they.
LEFT = 0.4
# Where a pose with two begins: the first in units of the assumed one, the second in units of the first. From the pose
# with a common one it would not get out of its valley.
FOCALS, RATIOS = (0.7, 1.0, 1.4), (0.55, 0.75, 1.33, 1.8)


def with_two_focals(
    matches: Matches, pose: Pose, F: Array, camera: Camera, camera_prime: Camera, sigma: float
) -> Pose | None:
    """The pose with two focal lengths where they are evident, else None.

    pose: with a common one, sigma px the noise it leaves; F: of the matches, free of any camera. A focal length that is
    given is not doubted.
    """
    if camera.fixed or camera_prime.fixed:
        return None
    few = matches.thinned(FEW)
    common = sampson_residuals(pose.F, few.x, few.y)

    def left(other: Array) -> float:
        """The share of its robust residuals that another F leaves, over the matches that either explains."""
        residuals = common, sampson_residuals(other, few.x, few.y)
        explained = np.minimum(*np.abs(residuals)) < EXPLAINED_PX * few.scale
        before, after = (float(np.log1p((r[explained] / sigma) ** 2).sum()) for r in residuals)
        return after / max(before, 1e-12)

    if left(F) > LEFT:
        return None
    starts = [
        pose_of_fundamental(few, F, camera.scaled(f), camera_prime.scaled(f * ratio), EXPLAINED_PX * few.scale)
        for f in FOCALS for ratio in RATIOS
    ]  # fmt: skip
    refined = [refine_pose(few, start, camera, camera_prime, sigma, zoom=True, iterations=20) for start in starts]
    best, _ = min(refined, key=lambda item: item[1])
    return best if left(best.F) <= LEFT else None
