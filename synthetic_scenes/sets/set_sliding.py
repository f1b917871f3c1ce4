"""Whether the pictures of a set show what lies on the panorama's rays, from wherever its viewpoint slides to."""

from __future__ import annotations

import numpy as np

from ..sliding import CanvasRays, beside_rays, sees
from .set_measures import Found, percentile


def beside_figures(found: Found) -> dict[str, float]:
    """beside_px, beside_p95_px: how far beside its ray lies what a picture shows at a pixel of the panorama, px of that
    picture, where another camera sees it too (median, 95th percentile over all pictures)."""
    cameras, depths = found.cameras, [found.truth.rendered.depths[number] for number in found.numbers]
    canvas = CanvasRays.of(found.result, found.gauge, cameras[0].place, found.places[1])
    apart = []
    for number, (camera, depth) in enumerate(zip(cameras, depths, strict=True)):
        off = beside_rays(found.result, number, camera, depth, canvas)
        others = [k for k in range(len(cameras)) if k != number]
        together = np.logical_or.reduce([sees(cameras[k], depths[k], off.things) for k in others])
        apart.append(off.px[together & np.isfinite(off.px)])
    px = np.concatenate(apart)
    return {"beside_px": percentile(px, 50), "beside_p95_px": percentile(px, 95)}
