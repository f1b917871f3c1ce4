"""Whether cameras that are given with their poses fit what the pictures show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..cameras.camera import Camera
from ..cameras.projective import fundamental_from_pose, homogeneous, infinite_homography, project, sampson_residuals
from ..cameras.rig import PictureMatches
from ..pose.options import ESTIMATION
from ..raster.arrays import Array
from ..system.errors import DegenerateGeometry
from .averaging.averaged import Verified


def check_given_poses(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, names: Sequence[str]
) -> None:
    """Refuse given cameras that contradict the matches.

    Parameters
    ----------
    cameras : sequence of Camera
        Those whose pose or focal length is not given are not looked at.
    points : sequence of (M_i, 2)
        px without distortion.
    verified : Verified
    names : sequence of str
        What the pictures are called.

    Raises
    ------
    DegenerateGeometry
        With the pictures whose cameras explain too few of their matches with the others.
    """
    given = {k for k, camera in enumerate(cameras) if camera.pose is not None and camera.fixed}
    pairs = [pair for pair in verified.pairs if given.issuperset((pair.i, pair.j))]
    explained = [_explained(cameras, points, pair, ESTIMATION.given_camera_px * verified.scale) for pair in pairs]
    wrong: set[int] = set()
    while True:
        left = [number for number, pair in enumerate(pairs) if wrong.isdisjoint((pair.i, pair.j))]
        shares = {}
        for k in sorted(given - wrong):
            own = [number for number in left if k in (pairs[number].i, pairs[number].j)]
            if own:
                shares[k] = sum(explained[number] for number in own) / sum(len(pairs[number]) for number in own)
        worst = min(shares, key=lambda k: shares[k], default=None)
        if worst is None or shares[worst] >= ESTIMATION.given_camera_share:
            break
        wrong.add(worst)
    if wrong:
        raise DegenerateGeometry(
            f"these cameras do not fit the matches: they explain only {sum(explained)} of {sum(map(len, pairs))}, and "
            f"hardly any of {' and '.join(names[k] for k in sorted(wrong))}: check that K, R and t belong to the "
            "pictures of these names, with R and t taking world points into the camera (x ~ K (R X + t))"
        )


def _explained(cameras: Sequence[Camera], points: Sequence[Array], pair: PictureMatches, px: float) -> int:
    """How many matches of a pair two given cameras explain: within so many px of their lines."""
    first, second = cameras[pair.i], cameras[pair.j]
    assert first.pose is not None and second.pose is not None
    (R1, t1), (R2, t2) = first.pose, second.pose
    R = R2 @ R1.T
    t = t2 - R @ t1
    x, y = points[pair.i][pair.index[:, 0]], points[pair.j][pair.index[:, 1]]
    if np.linalg.norm(t) <= 1e-9 * (np.linalg.norm(t1) + np.linalg.norm(t2)):  # rounding far from the origin
        seen = homogeneous(x) @ infinite_homography(first.K, second.K, R).T
        ahead = seen[:, 2] > 0
        off = np.linalg.norm(project(seen[ahead]) - y[ahead], axis=1)
        px = max(px, ESTIMATION.given_place_share * max(second.size))
    else:
        off = np.abs(sampson_residuals(fundamental_from_pose(first.K, second.K, R, t), x, y))
    return int((off < px).sum())
