"""What a set's panorama is where its viewpoint slides: whether its pictures show what lies on its rays, and whether
what is straight and upright in the world still is."""

from __future__ import annotations

import numpy as np

from ..sliding import CanvasRays, beside_rays, sees
from .set_lines import line_figures
from .set_measures import Found, percentile

# Of the lines' figures those that are told of a viewpoint that slides too: the others are each picture's own.
_OF_LINES = ("line_px", "line_p90_px", "upright_deg", "upright_p90_deg")


def sliding_figures(still: Found, slid: Found) -> dict[str, float]:
    """Of a stitch from one place and one whose viewpoint slides: s1, how far; still_ and slid_beside_px and
    _beside_p95_px (see `beside_figures`); slid_line_px, slid_line_p90_px, slid_upright_deg and slid_upright_p90_deg
    (see `line_figures`, which has those from one place)."""
    viewpoint, lines = slid.result.warp.viewpoint, line_figures(slid)
    return {
        "s1": 0.0 if viewpoint is None else viewpoint.s1,
        **{f"still_{name}": value for name, value in beside_figures(still).items()},
        **{f"slid_{name}": value for name, value in beside_figures(slid).items()},
        **{f"slid_{name}": lines[name] for name in _OF_LINES},
    }


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
