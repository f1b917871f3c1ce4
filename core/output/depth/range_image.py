"""How far away what each pixel of a panorama shows is, and how sure that is: an image of ranges, and its EXR file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...cameras.scale import Scale
from ...pictures.exr import exr_of_channels
from ...pictures.metadata import SOFTWARE
from ...raster.arrays import Plane, strips
from ...raster.lazy import whole
from ...system.errors import DegenerateGeometry
from ..inspection import has_depth
from .pair_deviation import pair_deviation

if TYPE_CHECKING:
    from ...pipeline import StitchResult

_COMMENTS = (
    "Z and Y: range along the ray of each pixel from its viewpoint, in the unit that rangeUnit says; inf: infinitely "
    "far; nan: no depth. deviation: its standard deviation. confidence: of dense matching, 0 to 1."
)


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Of a finished panorama.

    Attributes
    ----------
    range : (H, W) float32 array
        Along the ray of each pixel, from its viewpoint; infinity where d ≤ 0, NaN where the panorama shows nothing or
        knows no depth.
    deviation : (H, W) float32 array or None
        Its standard deviation, to first order; of a pair NaN where not both pictures see what is shown. None if nothing
        tells it.
    confidence : (H, W) float32 array or None
        Of dense refinement, 0 to 1, 0 where it said nothing; None without it.
    scale : Scale
        The unit of both.
    """

    range: Plane
    deviation: Plane | None
    confidence: Plane | None
    scale: Scale


def range_image(result: StitchResult) -> RangeImage:
    """The ranges of what a panorama shows, of a whole sphere's every pixel. Of a large set inverse depth is known at
    each px of its draft, and bilinear between.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    RangeImage

    Raises
    ------
    DegenerateGeometry
        The panorama has no depth.
    """
    warp, alpha = result.warp, result.panorama.alpha
    canvas, reference = result.canvas, result.views[0]
    known = pair_deviation(result) if result.rig is None and has_depth(result) else warp.deviation
    depth, confidence, off_depth = (
        None if values is None else result.in_full(values, beyond)
        for values, beyond in ((warp.depth, np.nan), (warp.lazy_confidence, 0.0), (known, 0.0))
    )
    assert depth is not None
    out = np.empty(alpha.shape, np.float32)
    deviation = None if off_depth is None else np.empty(alpha.shape, np.float32)
    for rows in strips(alpha.shape):
        d = np.asarray(depth[rows, 0 : canvas.width], np.float64)
        length: Any = 1.0
        if canvas.projection is None:
            length = canvas.rays_at(reference.K, canvas.xs, canvas.ys[rows], reference.camera)[1]
        shown = np.isfinite(d) & (alpha[rows] > 0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ranges = np.where(d > 0, result.scale.factor * length / d, np.inf)
            out[rows] = np.where(shown, ranges, np.nan)
            if deviation is not None and off_depth is not None:
                off = np.asarray(off_depth[rows, 0 : canvas.width], np.float64)
                deviation[rows] = np.where(shown, np.where(d > 0, ranges * off / d, np.inf), np.nan)
    if not has_depth(result) or not np.isfinite(out).any():
        raise DegenerateGeometry(
            "the panorama has no depth: its pictures were taken from one place, show one plane, or are shown without "
            "depth; leave out --depth and --mesh, or take pictures from different places"
        )
    return RangeImage(out, deviation, None if confidence is None else whole(confidence), result.scale)


def range_bytes(image: RangeImage) -> bytes:
    """An EXR file of ranges: Z, the same as Y, which is what programs show that know gray pictures only; deviation and
    confidence, where they are known. No name of a channel ends like one of a colour: Blender would take it for that."""
    known: dict[str, NDArray[Any] | None] = {
        "Y": image.range, "Z": image.range, "deviation": image.deviation, "confidence": image.confidence,
    }  # fmt: skip
    header = {"rangeUnit": image.scale.unit, "comments": _COMMENTS, "software": SOFTWARE}
    if image.scale.metres is not None:
        header["metresPerBaseline"] = f"{image.scale.metres:.9g}"
    return exr_of_channels({name: values for name, values in known.items() if values is not None}, header)
