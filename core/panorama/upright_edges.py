"""Straight edges in a picture. Those of walls, doors and trunks are upright, and so tell which way is down."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import cv2
import numpy as np

from ..cameras.camera import Camera
from ..cameras.lens import undistort
from ..cameras.projective import homogeneous
from ..pictures.picture import Picture
from ..raster.arrays import Array
from ..raster.resizing import resized_points
from .options import EDGES

# What was found in pictures that are still held: the focal length asks for it, and so do level and frame.
_found: WeakKeyDictionary[Picture, tuple[Array, Array]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class StraightEdges:
    """Straight edges that one camera sees.

    Attributes
    ----------
    rays : (N, 2, 3) array
        To both ends of each, of any length; the longest edges first.
    lengths : (N,) array
        Shares of the picture's longer side.
    """

    rays: Array
    lengths: Array

    @property
    def normals(self) -> Array:
        """Unit normals (N, 3) of the planes through the camera and each edge."""
        normals = np.cross(self.rays[:, 0], self.rays[:, 1])
        unit: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return unit

    def in_reference(self, R: Array) -> StraightEdges:
        """The same in the reference's frame; R (3, 3): from that to the camera's."""
        return StraightEdges(self.rays @ R, self.lengths)


def straight_edges(picture: Picture, camera: Camera, K: Array) -> StraightEdges:
    """Detect straight edges away from what is transparent.

    Parameters
    ----------
    picture : Picture
    camera : Camera
        Its lens counts.
    K : (3, 3) array
        px, as the pose was estimated.

    Returns
    -------
    StraightEdges
        In the camera's frame.

    References
    ----------
    von Gioi et al., LSD: a Line Segment Detector, IPOL 2012.
    """
    rays = homogeneous(ideal_ends(picture, camera).reshape(-1, 2)) @ np.linalg.inv(K).T
    return StraightEdges(rays.reshape(-1, 2, 3), edge_ends(picture)[1])


def ideal_ends(picture: Picture, camera: Camera) -> Array:
    """Ends (N, 2, 2) of the straight edges of a picture, ideal px, the longest first."""
    return undistort(edge_ends(picture)[0].reshape(-1, 2), camera).reshape(-1, 2, 2)


def edge_ends(picture: Picture) -> tuple[Array, Array]:
    """Ends (N, 2, 2) px of the straight edges of a picture, the longest first, and lengths (N,) in shares of its longer
    side."""
    if picture not in _found:
        _found[picture] = _detected(picture)
    return _found[picture]


def _detected(picture: Picture) -> tuple[Array, Array]:
    """See `edge_ends`."""
    height, width = picture.view.shape[:2]
    scale = min(1.0, EDGES.side_px / max(width, height))
    size = (max(1, round(scale * width)), max(1, round(scale * height)))
    small = cv2.resize(picture.view, size, interpolation=cv2.INTER_AREA)
    gray = small if small.ndim == 2 or small.shape[2] == 1 else cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
    found = cv2.createLineSegmentDetector().detect(np.ascontiguousarray(gray.reshape(size[::-1])))[0]
    ends = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / max(size)
    used = lengths >= EDGES.min_length
    if picture.alpha is not None:
        opaque = (picture.alpha > 0).astype(np.uint8)
        side = 2 * EDGES.alpha_margin_px + 1
        opaque = cv2.erode(cv2.resize(opaque, size, interpolation=cv2.INTER_AREA), np.ones((side, side), np.uint8))
        columns, rows = (np.clip(np.rint(ends.mean(axis=1)[:, k]).astype(int), 0, size[k] - 1) for k in (0, 1))
        used &= opaque[rows, columns] > 0
    longest = np.flatnonzero(used)[np.argsort(-lengths[used], kind="stable")[:EDGES.max_edges]]
    full = resized_points(ends[longest].reshape(-1, 2), size, (width, height))
    return full.reshape(-1, 2, 2), lengths[longest]


def agreement(down: Array, normals: Array, lengths: Array, sigma: float) -> Array:
    """Evidence (M,) of edges for each direction down (M, 3): a log-likelihood ratio, weighted by length.

    Some edges are upright to within sigma (rad) and the rest have any direction, against all having any direction.
    """
    # float32: ten times as fast, and the sums are right to six digits
    off = np.square(down.astype(np.float32) @ normals.T.astype(np.float32))
    off *= np.float32(-0.5 / sigma**2)
    np.exp(off, out=off)
    off *= np.float32(EDGES.upright_share / sigma)
    off += 1
    evidence: Array = np.log(off, out=off) @ lengths
    return evidence
