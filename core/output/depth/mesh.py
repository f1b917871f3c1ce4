"""A panorama's depth as a mesh with the panorama for its texture, seen from the origin: a binary glTF file."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ...panorama.layers import Layer
from ...panorama.rig_viewpoint import RigViewpoint
from ...panorama.viewpoint import Viewpoint
from ...pictures.encoding import encode_picture, in_srgb
from ...raster.arrays import Array
from ...raster.lazy import whole
from .glb import glb_bytes
from .options import MESH
from .range_image import RangeImage
from .surface import DepthGrid, cut_surface

if TYPE_CHECKING:
    from ...pipeline import StitchResult

# From a panorama's axes (x right, y down, z ahead) to glTF's (x right, y up, z back).
_TO_GLTF = np.array([1.0, -1.0, -1.0])


def mesh_bytes(result: StitchResult, ranges: RangeImage) -> tuple[bytes, tuple[str, ...]]:
    """The mesh of a panorama as a file.

    The origin is the place of the first picture, which is the viewpoint where that does not slide; the panorama's axes
    are those of the file: ahead is −z, up is y.

    Parameters
    ----------
    result : StitchResult
    ranges : RangeImage
        Of it.

    Returns
    -------
    data : bytes
        A .glb file.
    warnings : tuple of str
        For the user.
    """
    surface = cut_surface(depth_grid(result, ranges))
    texture, opaque, warnings = _texture(result)
    if result.warp.viewpoint is not None and result.warp.viewpoint.s1 > 0:
        warnings = (
            "the viewpoint slides, so that no single place sees the mesh as the panorama does: with --slide 0 its "
            "origin does", *warnings,
        )  # fmt: skip
    about = {"unit": ranges.scale.unit, "source": ranges.scale.source}
    return glb_bytes(surface, texture, opaque, about), warnings


def depth_grid(result: StitchResult, ranges: RangeImage) -> DepthGrid:
    """Nodes over all of a panorama, from border to border, in the axes of the file; a whole sphere is closed.

    Parameters
    ----------
    result : StitchResult
    ranges : RangeImage
        Of it.

    Returns
    -------
    DepthGrid
        In the unit of the ranges.
    """
    canvas, view = result.canvas, result.views[0]
    width, height = canvas.width, canvas.height
    step = max(1.0, float(np.sqrt(np.isfinite(1 / ranges.range).sum() / MESH.most_nodes)))
    x, y = (np.linspace(-0.5, side - 0.5, max(1, int(side / step)) + 1) for side in (width, height))
    rays, _ = canvas.rays_at(view.K, x - canvas.offset[0], y - canvas.offset[1], view.camera)
    at = np.ix_(_nearest(y, height), _nearest(x, width))
    between = np.ix_(_nearest((y[1:] + y[:-1]) / 2, height), _nearest((x[1:] + x[:-1]) / 2, width))
    with np.errstate(divide="ignore"):
        d, middles = (1 / ranges.range[one].astype(np.float64) for one in (at, between))
    d = _beside_unknown(d, middles)
    sphere = None if canvas.projection is None else canvas.projection.sphere
    if sphere is not None and sphere[2:] == (width, height):
        rays[:, -1], d[:, -1] = rays[:, 0], d[:, 0]
        for pole in (0, -1):
            if np.isfinite(d[pole]).any():
                rays[pole], d[pole] = rays[pole].mean(axis=0), np.nanmean(d[pole])
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    turn = np.eye(3) if canvas.projection is None else canvas.projection.rotation
    places = None
    if isinstance(result.warp.viewpoint, Viewpoint | RigViewpoint) and result.warp.viewpoint.s1 > 0:
        places = result.warp.viewpoint.place(rays) @ turn * _TO_GLTF * ranges.scale.factor
    uvs = np.stack(np.meshgrid((x + 0.5) / width, (y + 0.5) / height), axis=-1)
    return DepthGrid(rays @ turn * _TO_GLTF, d, result.panorama.alpha[at] > 0, uvs, places, middles)


def _nearest(at: Array, side: int) -> Array:
    """The px nearest to places along a side."""
    return np.clip(np.rint(at), 0, side - 1).astype(np.intp)


def _beside_unknown(d: Array, middles: Array) -> Array:
    """Inverse range (rows, columns), where a node knows none that of the middle of a cell beside it."""
    out = d.copy()
    for rows, columns in product((slice(1, None), slice(0, -1)), repeat=2):
        here = out[rows, columns]
        np.copyto(here, middles, where=np.isnan(here))
    return out


def _texture(result: StitchResult) -> tuple[bytes, bool, tuple[str, ...]]:
    """The panorama as a PNG of 8 bits in sRGB, which is what glTF takes, whether it is opaque, and warnings."""
    panorama = result.panorama
    height, width = panorama.alpha.shape
    if max(width, height) > MESH.texture_px:
        factor = MESH.texture_px / max(width, height)
        size = max(1, round(width * factor)), max(1, round(height * factor))
        light = cv2.resize(whole(panorama.light), size, interpolation=cv2.INTER_AREA)
        alpha = cv2.resize(panorama.alpha.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        panorama = Layer(light.reshape(size[1], size[0], -1), alpha)
    opaque = bool(panorama.alpha.min() >= 1)
    data, warnings = encode_picture(
        in_srgb(panorama.light, result.pictures[0].icc), None if opaque else panorama.alpha, 8, ".png"
    )
    return data, opaque, warnings


