"""A panorama's depth as a mesh with the panorama for its texture, seen from the origin: a binary glTF file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...panorama.rig_viewpoint import RigViewpoint
from ...panorama.viewpoint import Viewpoint
from ...pictures.encoding import encode_picture, in_srgb
from ...raster.arrays import Array
from ...raster.lazy import whole
from .glb import glb_bytes
from .nodes import is_whole_sphere, nodes_of
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
    is_sphere = is_whole_sphere(result)

    def inverse(rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
        with np.errstate(divide="ignore"):
            d: Array = 1 / ranges.range[np.ix_(rows, columns)].astype(np.float64)
        return d

    known = int(np.isfinite(1 / ranges.range).sum())
    nodes = nodes_of(inverse, result.panorama.alpha, known, MESH.most_nodes, is_sphere)
    x, y = nodes.x, nodes.y
    rays, _ = canvas.rays_at(view.K, x - canvas.offset[0], y - canvas.offset[1], view.camera)
    if is_sphere:
        rays[:, -1] = rays[:, 0]
        for pole in (0, -1):
            rays[pole] = rays[pole].mean(axis=0)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    turn = np.eye(3) if canvas.projection is None else canvas.projection.rotation
    places = None
    if isinstance(result.warp.viewpoint, Viewpoint | RigViewpoint) and result.warp.viewpoint.s1 > 0:
        places = result.warp.viewpoint.place(rays) @ turn * _TO_GLTF * ranges.scale.factor
    uvs = np.stack(np.meshgrid((x + 0.5) / canvas.width, (y + 0.5) / canvas.height), axis=-1)
    return DepthGrid(rays @ turn * _TO_GLTF, nodes.inverse_depth, nodes.shows, uvs, places, nodes.middles)


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


