"""How far a focal length may be off, and how much uprights would lean for that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..cameras.camera import Camera
from ..cameras.edge import Edge
from ..cameras.projective import homogeneous
from ..panorama.canvas import Canvas
from ..panorama.levelling import gravity
from ..pose.options import EDGE_FOCAL
from ..pose.refinement import Pose, pose_at_focal
from ..raster.arrays import Array
from .options import FOCAL_DOUBT, WARNING


@dataclass(frozen=True)
class FocalDoubt:
    """off: share that the focal length may be off by; lean_deg: degrees that uprights which only the target shows lean
    then, the worst places left out. Both NaN where no pose is known."""

    off: float
    lean_deg: float

    def warnings(self, cameras: Sequence[Camera], edge: Edge) -> list[str]:
        """In plain words, where that would be seen and the user may know better."""
        camera, focal = cameras[edge.i], edge.two_view.K[0, 0]
        if not camera.assumed or not self.lean_deg >= WARNING.lean_deg:
            return []
        source = edge.two_view.focal_source.partition(", ")[0]
        known = source if source.startswith("not ") else f"from {source}"
        on_film = focal * math.hypot(36, 24) / math.hypot(*camera.size)
        return [
            f"the focal length ({focal:.0f} px, {on_film:.0f} mm on 35 mm film, {known}) may "
            f"be off by {self.off:.0%}: uprights may lean by {self.lean_deg:.1f}° beside the reference; give it "
            "(--focal35, --focal-px) if you know it"
        ]


def focal_doubt(cameras: Sequence[Camera], edge: Edge, canvas: Canvas) -> FocalDoubt:
    """What is not known of the focal length of a pair, and what it does to a panorama on a canvas.

    Parameters
    ----------
    cameras : sequence of Camera
        As they were known before estimation.
    edge : Edge
        The pair.
    canvas : Canvas
        Which way is down is taken from how it is levelled, or from how the cameras were held.

    Returns
    -------
    FocalDoubt
    """
    view, pair = edge.two_view, edge.pair(cameras)
    # a rival knows the pair's lines, but no pose
    if view.model != "general" or not np.isfinite(view.focal_deviation) or not np.isfinite(view.R).all():
        return FocalDoubt(math.nan, math.nan)
    by_matches = pair[0].assumed and view.focal_source != EDGE_FOCAL.source
    off = max(view.focal_deviation, FOCAL_DOUBT.by_matches) if by_matches else view.focal_deviation
    if not off:
        return FocalDoubt(0.0, 0.0)
    down = gravity([np.eye(3), view.R]) if canvas.projection is None else canvas.projection.rotation[:, 1]
    few = edge.inliers.thinned(FOCAL_DOUBT.matches)
    found = Pose(view.K, view.K_prime, view.R, view.t)
    upright = _turns(found, down, pair[1].size)
    leans = []
    for factor in (math.exp(-off), math.exp(off)):
        other, _ = pose_at_focal(few, found, pair, factor, view.sigma)
        # the reference's uprights meet in the same pixel as before
        still_down = np.linalg.inv(other.K) @ view.K @ down
        lean = np.abs(_turns(other, still_down / np.linalg.norm(still_down), pair[1].size) - upright)
        leans.append(float(np.percentile(np.minimum(lean, 360 - lean), FOCAL_DOUBT.percentile)))
    return FocalDoubt(off, max(leans))


def _turns(pose: Pose, down: Array, size: tuple[int, int]) -> Array:
    """By how many degrees (N,) columns of the target are turned from plumb lines at places all over it; down (3,) in
    the reference's frame."""
    columns, rows = (np.linspace(0, side - 1, count) for side, count in
                     zip(size, (FOCAL_DOUBT.columns, FOCAL_DOUBT.rows), strict=True))  # fmt: skip
    places = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    above, below = (
        homogeneous(places + [0.0, step]) @ np.linalg.inv(pose.K_prime).T @ pose.R
        for step in (-FOCAL_DOUBT.step_px, FOCAL_DOUBT.step_px)
    )
    plane, middle = np.cross(above, below), above + below
    plumb = np.cross(middle, down)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    turns: Array = np.degrees(np.arctan2((np.cross(plumb, plane) * middle).sum(axis=1), (plumb * plane).sum(axis=1)))
    return turns
