"""How sure inverse depth of a pair is: by how far matches may be off, and how far a match moves for a change of depth.

Where the viewpoint lies s of the way from the reference's place to the target's, c, the reference sees a canvas point p
at p + d s K c, and the target at H_inf p + d (1 − s) e'. With d they move in opposite directions along their epipolar
lines; d is found by how far apart that is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...cameras.view import View
from ...dense.sphere.options import SWEEP
from ...raster.arrays import Array, Part, Plane, small_strips
from ...system.threads import each

if TYPE_CHECKING:
    from ...pipeline import StitchResult


def pair_deviation(result: StitchResult) -> Plane:
    """The standard deviation of a pair's inverse depth, to first order, its cameras taken as they are: what is wrong
    with these is wrong with all of depth.

    Where dense refinement is sure, matches are as good as those of rendered sets; where it is not, depth is the smooth
    field's, which misses matches that it was not fitted to by what the report calls `held_out_px`.

    Parameters
    ----------
    result : StitchResult
        Of a pair, with depth.

    Returns
    -------
    (H, W) float32 array
        On the canvas of its warp; NaN where not both pictures see what is shown, for there depth is continued from
        elsewhere, and nothing tells how far it is off.
    """
    warp, field_px = result.warp, result.pair_field.fit.held_out_px
    width, height = warp.canvas.width, warp.canvas.height
    out = np.full((height, width), np.nan, np.float32)
    both = np.logical_and.reduce([one.inside() for one in warp.maps]) & ~np.logical_or.reduce(result.occluded)

    def put(rows: slice) -> None:
        part = rows, slice(0, width)
        sure = 0.0 if warp.lazy_confidence is None else warp.lazy_confidence[part]
        off = np.hypot(sure * SWEEP.noise_px, (1 - sure) * field_px)
        with np.errstate(divide="ignore", invalid="ignore"):
            np.copyto(out[rows], (off / _px_per_depth(result, part)).astype(np.float32), where=both[rows])

    each(put, small_strips(out.shape))
    return out


def _px_per_depth(result: StitchResult, part: Part) -> Array:
    """px (h, w) by which a pair's points move together for a change of inverse depth by 1, in rows and columns."""
    warp, (reference, target) = result.warp, result.views
    d = np.asarray(warp.depth[part], np.float64)
    slide = np.zeros_like(d) if warp.slide is None else np.asarray(warp.slide[part], np.float64)
    towards = reference.K @ (-target.R.T @ target.t)
    of_reference = _px_of(result, part, reference, d, [slide * step for step in towards])
    return of_reference + _px_of(result, part, target, d, [(1 - slide) * step for step in target.e_prime])


def _px_of(result: StitchResult, part: Part, view: View, d: Array, g: list[Array]) -> Array:
    """The same of one picture that sees points at H_inf p + d g, three (h, w) arrays, before its lens."""
    canvas = result.warp.canvas
    infinite = canvas.project_rows(view.H_inf, canvas.xs[part[1]], canvas.ys[part[0]], result.views[0].camera)
    a, b, c = (far + d * step for far, step in zip(infinite, g, strict=True))
    moves: Array = np.hypot(g[0] - a / c * g[2], g[1] - b / c * g[2]) / np.abs(c)
    return moves
