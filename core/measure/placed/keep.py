"""Whether somebody would keep a panorama: figures that alignment does not see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compose.inpaint import closed_holes
from ...raster.arrays import Array, box_of, cut, eroded
from ...raster.picture_map import PictureMap
from ...raster.rectangle import largest_rectangle
from .options import PLACED
from .placed import PlacedPicture, PlacedSet


def keep_figures(panorama: PlacedSet) -> dict[str, float]:
    """What of a panorama can be kept.

    Returns
    -------
    dict
        Of the smallest box that holds all that is shown: fill, the share that is shown; inscribed, that of the largest
        rectangle without gaps; holes, that of holes which are closed on all sides. far_enlarged: in what one picture
        alone shows, the 99th percentile of how much more it is enlarged there than its median. turned_over: the share
        of the pictures' px on the canvas whose map turns over, in percent of what is shown. The last two NaN without
        maps.
    """
    shows = cut(panorama.alpha, box_of(panorama.alpha)) if panorama.alpha.any() else panorama.alpha
    area = max(1, shows.size)
    _, _, width, height = largest_rectangle(shows)
    holes, _ = closed_holes(np.ascontiguousarray(shows), None)
    far: list[Array] = []
    turned = counted = 0
    for picture in panorama.pictures:
        if picture.map is None or not picture.shows.any():
            continue
        scale = _area(picture.map)
        inner = eroded(picture.shows, 1) & np.isfinite(scale)
        if not inner.any():
            continue
        way = np.sign(np.median(scale[inner]))
        turned, counted = turned + int((scale[inner] * way < 0).sum()), counted + int(inner.sum())
        alone = inner & eroded(_alone(panorama, picture), PLACED.inner_margin_px)
        enlarged = 1 / np.sqrt(np.abs(scale) + 1e-9)
        far.append(enlarged[alone] / np.median(enlarged[inner]))
    beyond = np.concatenate(far) if far else np.zeros(0)
    return {
        "fill": float(shows.mean()), "inscribed": width * height / area, "holes": float(holes.sum()) / area,
        "far_enlarged": float(np.percentile(beyond, 99)) if beyond.size else float("nan"),
        "turned_over": turned / counted if counted else float("nan"),
    }  # fmt: skip


def _area(found: PictureMap) -> Array:
    """px² of the picture for each of the canvas (h, w), below 0 where the map turns over."""
    if min(found.shape) < 2:
        return np.full(found.shape, np.nan)
    down, across = (np.gradient(values.astype(np.float64)) for values in (found.x, found.y))
    area: Array = down[1] * across[0] - down[0] * across[1]
    return area


def _alone(panorama: PlacedSet, picture: PlacedPicture) -> NDArray[np.bool_]:
    """Where (h, w) in its box nothing but this picture shows something."""
    only: NDArray[np.bool_] = picture.shows & (panorama.views_at[picture.box] == 1)
    return only
