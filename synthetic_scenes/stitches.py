"""Every way in which a scene is stitched for the validation, the plainest rival among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.alignment import align
from ..core.camera import CameraRequest
from ..core.displacement import fit_strict
from ..core.fundamental import fit_homography
from ..core.options import StitchOptions
from ..core.pipeline import StitchResult, Stopwatch, compose, read_frame, stitch
from ..core.progress import Progress
from ..core.warp import build_warp
from .rendered import RenderedPair

# What is told of the cameras / the field. `homography` is a rival and no field of core's.
WAYS = ("known/strict", "known/slack", "known/paper", "known/homography", "unknown/strict", "unknown/slack")


def stitched(pair: RenderedPair, way: str) -> StitchResult:
    """The pair stitched in one of WAYS. Raises StitchError."""
    told, field = way.split("/")
    focal = tuple(float(pair.cameras[name].K[0, 0]) for name in ("reference", "target"))
    camera = CameraRequest(focal_px=focal) if told == "known" else CameraRequest()
    if field == "homography":
        return _by_one_homography(pair, StitchOptions(camera=camera, measure=False))
    return stitch(pair.reference, pair.target, StitchOptions(field=field, camera=camera, measure=False))


def _by_one_homography(pair: RenderedPair, options: StitchOptions) -> StitchResult:
    """What stitchers without parallax do: the same features, one robust homography, the same blending."""
    steps = Stopwatch(Progress(None, None))
    frame = read_frame(pair.reference, pair.target, options)
    found = align([frame], options, steps)
    homography = fit_homography(found.matches, options.seed)
    nothing = np.full((3, 3), np.nan)
    view = replace(
        found.two_view, R=nothing, t=np.zeros(3), F=nothing, H_inf=homography.H, e_prime=np.zeros(3),
        inliers=homography.inliers, sigma=homography.sigma, model="plane",
    )  # fmt: skip
    first, second = found.cameras
    field = fit_strict(view, found.matches.subset(view.inliers), first.size, second.size, options.fade)
    warp = build_warp(field, view, first, second)
    return compose(frame, replace(found, two_view=view, field=field, warp=warp), options, steps)
