"""How straight a panorama keeps what is straight, and how upright what is upright.

A straight line lies in a plane through any place that it is seen from. So it is straight in a panorama, whatever that
is projected onto, where all rays that show it lie in one plane, and upright where gravity lies in that plane too.
"""

from __future__ import annotations

import numpy as np

from ..raster.arrays import Array
from .options import STRAIGHTNESS
from .upright_edges import StraightEdges


def along(edges: StraightEdges) -> Array:
    """Unit rays (N, points, 3) to places along each edge, as its camera sees them."""
    share = np.linspace(STRAIGHTNESS.end_margin, 1 - STRAIGHTNESS.end_margin, STRAIGHTNESS.points)[:, None]
    first, second = edges.rays[:, :1], edges.rays[:, 1:]
    rays = first + share * (second - first)
    unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return unit


def planes_through(rays: Array) -> tuple[Array, Array]:
    """Fit a plane through the viewpoint to each set of rays.

    Parameters
    ----------
    rays : (…, n, 3) array
        Unit rays in which the panorama shows places along a straight edge.

    Returns
    -------
    normals : (…, 3) array
        Unit normals of the planes from which the rays are least away, in the mean of squares.
    bends : (…,) array
        How far off most of an edge is at worst, rad (see `StraightnessOptions.percentile`).
    """
    normals = np.linalg.eigh(np.swapaxes(rays, -1, -2) @ rays)[1][..., 0]
    off = np.abs(rays @ normals[..., None])[..., 0]
    return normals, np.percentile(off, STRAIGHTNESS.percentile, axis=-1)


def leans(normals: Array, down: Array) -> Array:
    """Angles (…,), rad, between planes through the viewpoint, given by their normals (…, 3), and down (3,)."""
    angles: Array = np.arcsin(np.minimum(1, np.abs(normals @ down)))
    return angles
