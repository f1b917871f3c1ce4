"""Our own panorama, as any program's is measured."""

from __future__ import annotations

import numpy as np

from ...cameras.projective import homogeneous, inverse_intrinsics
from ...compose.stitch_result import StitchResult
from ...panorama.projection import focal_of
from ...raster.arrays import Array, cut
from ...raster.colour import encode
from .placed import PlacedPicture, PlacedSet, shrinking, shrunk


def placed(result: StitchResult) -> PlacedSet:
    """A result's pictures on the canvas of its maps; of a large set those of its draft, unless that is coarser than all
    are compared at."""
    K, projection = result.views[0].K, result.canvas.projection
    focal = focal_of(K) if projection is None else projection.focal
    full = result.enlarged is not None and shrinking(focal / result.times) == 1
    times = 1 if full else result.times  # px of the panorama along one of the canvas
    canvas = result.warp.canvas.enlarged(result.times, K) if full else result.warp.canvas
    focal, shrink = focal / times, shrinking(focal / times)
    size = max(1, round(shrink * canvas.width)), max(1, round(shrink * canvas.height))
    pictures = []
    for number, picture in enumerate(result.pictures):
        layer = result.full_layer(number) if full else result.layers[number]
        found = (result.full_map(number) if full else result.warp.maps[number]).arrays()
        colours = encode(layer.pixels, 8)
        colours = np.repeat(colours, 3, axis=2) if colours.shape[2] == 1 else colours
        parts = shrunk(colours, layer.alpha > 0.99, found, size)
        pictures.append(PlacedPicture.cut_out(picture.name, *parts))
    left, top, _, _ = result.spread
    shows = cut(result.panorama.shows, (-left, -top, times * canvas.width, times * canvas.height))
    shows = shows[times // 2 :: times, times // 2 :: times]
    _, alpha, _ = shrunk(np.zeros((*shows.shape, 3), np.uint8), shows, None, size)
    step = np.array([canvas.width / size[0], canvas.height / size[1]])

    def rays_at(at: Array) -> Array:
        points = (at + 0.5) * step - 0.5 - np.array(canvas.offset)
        if canvas.projection is not None:
            return canvas.projection.rays(points)
        rays = homogeneous(points) @ inverse_intrinsics(K).T
        unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit

    return PlacedSet(size, tuple(pictures), rays_at, alpha, focal * shrink)
