"""Straight edges that a picture shows: those of walls, doors and trunks tell where down is, however it was taken."""

from __future__ import annotations

import cv2
import numpy as np

from ..cameras.camera import Camera
from ..cameras.lens import undistort
from ..cameras.projective import homogeneous
from ..pictures.picture import Picture
from ..raster.arrays import Array
from ..raster.resizing import resized_points
from .options import EDGES


def edges(picture: Picture, camera: Camera, K: Array) -> tuple[Array, Array]:
    """The planes through the camera and each straight edge: normals (N, 3), of length 1, in the camera's frame; and
    the edges' lengths (N,) as shares of the picture's longer side.

    Line segments by von Gioi et al. (IPOL 2012), away from what is transparent. K (3, 3) px as the geometry took it.
    """
    height, width = picture.view.shape[:2]
    scale = min(1.0, EDGES.side_px / max(width, height))
    size = (max(1, round(scale * width)), max(1, round(scale * height)))
    small = cv2.resize(picture.view, size, interpolation=cv2.INTER_AREA)
    gray = small if small.ndim == 2 or small.shape[2] == 1 else cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
    found = cv2.createLineSegmentDetector().detect(np.ascontiguousarray(gray.reshape(size[::-1])))[0]
    ends = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / max(size)
    kept = lengths >= EDGES.min_length
    if picture.alpha is not None:
        whole = (picture.alpha > 0).astype(np.uint8)
        side = 2 * EDGES.alpha_margin_px + 1
        whole = cv2.erode(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.ones((side, side), np.uint8))
        columns, rows = (np.clip(np.rint(ends.mean(axis=1)[:, k]).astype(int), 0, size[k] - 1) for k in (0, 1))
        kept &= whole[rows, columns] > 0
    longest = np.flatnonzero(kept)[np.argsort(-lengths[kept], kind="stable")[:EDGES.max_edges]]
    ends, lengths = ends[longest], lengths[longest]
    full = resized_points(ends.reshape(-1, 2), size, (width, height))
    rays = homogeneous(undistort(full, camera)) @ np.linalg.inv(K).T
    normals = np.cross(rays[::2], rays[1::2])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True), lengths


def agreement(down: Array, normals: Array, lengths: Array, sigma: float) -> Array:
    """By how much (M,) edges speak for each direction down (M, 3): the logarithm of how much likelier they are if some
    are upright to within sigma (rad) and the rest anything, than if all are anything."""
    off = np.square(down @ normals.T)
    off *= -0.5 / sigma**2
    evidence: Array = np.log1p(EDGES.upright_share * np.exp(off, out=off) / sigma) @ lengths
    return evidence
