"""The ground truth proves itself on every pair: each of its figures by a road of its own."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import distance_to_line, project
from ..core.measure.metrics import psnr
from ..core.raster.colour import encode
from ..core.raster.sampling import fetch
from .ground_truth import TrueGeometry, flat, seen_from, steepness, visible
from .passes import Passes
from .scene_camera import SceneCamera

# Relative change of depth per pixel from which 0.002 px are worth more than the 1e-5 that are asked for.
STEEP = 5e-3


def prove(
    passes: dict[str, Passes], cameras: dict[str, SceneCamera], rays: dict[str, NDArray], corner: tuple[int, int]
) -> dict[str, float]:
    """How far the truth is from the renders it is made of; every figure by a road of its own.

    Edges of objects and surfaces seen edge-on are left out: where rays graze, single precision moves Cycles' hits by up
    to 0.1 px, and the 0.002 px to which it meets a pixel's centre change the depth by more than is asked for.
    position_px: the Position pass through our K, R, t, from its pixel's centre (worst); depth_relative: the same
    points' depth against the Depth pass (worst); ray_cast_relative: rays cast in Blender against the Depth pass
    (worst); f_px: F against matches made of the reference's Position (worst); warp_psnr_db: the target
    fetched by the true map, against the reference, where both see the same smooth surface; half_pixel_psnr_db: the same
    with the map half a pixel off; wide_psnr_db: the wide render against the reference, rims of lamps apart.
    """
    own = [prove_camera(passes[name], camera, rays[name]) for name, camera in cameras.items()]
    geometry = TrueGeometry.of(cameras["reference"], cameras["target"])
    view, target = passes["reference"], cameras["target"]
    mapped, depths = seen_from(cameras["reference"], view.depth, target)
    shared = visible(mapped, depths, passes["target"].depth)
    rows, columns = (index[::37] for index in np.nonzero(shared & gentle(view.depth)))
    by_position = project((view.position[rows, columns] @ target.R.T + target.t) @ target.K.T)
    has_lines = bool(geometry.t.any())
    points = np.column_stack([columns, rows]).astype(np.float64)
    off_line = distance_to_line(geometry.F, points, by_position).max() if has_lines and len(points) else 0.0

    smooth = shared & flat(view.depth) & flat_there(mapped, passes["target"].depth)
    light = encode(passes["target"].light, 8)
    there_too = encode(view.light, 8)
    maps = [[np.where(shared, mapped[..., k] + shift, -1).astype(np.float32) for k in range(2)] for shift in (0.0, 0.5)]
    warped = [fetch(light, x, y) for x, y in maps]
    left, top = -corner[0], -corner[1]
    width, height = cameras["reference"].size
    crop = encode(passes["wide"].light[top : top + height, left : left + width], 8)
    return {
        **worst_of(own), "f_px": float(off_line),
        "warp_psnr_db": psnr(there_too, warped[0], smooth), "half_pixel_psnr_db": psnr(there_too, warped[1], smooth),
        "wide_psnr_db": psnr(there_too, crop, _no_glare(view.light)),
    }  # fmt: skip


def prove_camera(passes: Passes, camera: SceneCamera, rays: NDArray) -> dict[str, float]:
    """position_px, depth_relative and ray_cast_relative (see `prove`) of one camera; rays: [x, y, depth] that were cast
    through its pixels."""
    smooth = gentle(passes.depth)
    seen = passes.position[smooth].astype(np.float64) @ camera.R.T + camera.t
    rows, columns = np.nonzero(smooth)
    off = project(seen @ camera.K.T) - np.column_stack([columns, rows])
    x, y, hit = rays[:, 0].astype(int), rays[:, 1].astype(int), rays[:, 2]
    some = smooth[y, x]
    return {
        "position_px": float(np.linalg.norm(off, axis=1).max(initial=0.0)),
        "depth_relative": float(np.abs(seen[:, 2] / passes.depth[smooth] - 1).max(initial=0.0)),
        "ray_cast_relative": float(np.abs(hit[some] / passes.depth[y, x][some] - 1).max(initial=0.0)),
    }


def worst_of(proofs: Sequence[dict[str, float]]) -> dict[str, float]:
    """The largest of each figure."""
    return {name: max(proof[name] for proof in proofs) for name in proofs[0]}


def _no_glare(light: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Where nothing brighter than white is within 2 px: a lamp's rim depends on a pixel's few samples."""
    return cv2.dilate((light.max(axis=-1) > 1).astype(np.uint8), np.ones((5, 5), np.uint8)) == 0


def gentle(depth: NDArray) -> NDArray[np.bool_]:
    """Where a surface (H, W) is neither about to end nor seen edge-on."""
    return flat(depth, 1) & (steepness(depth) < STEEP) & np.isfinite(depth)


def flat_there(pixels: NDArray, other_depth: NDArray) -> NDArray[np.bool_]:
    """Which points (H, W, 2) of another picture lie away from the edges of its objects."""
    smooth = flat(other_depth).astype(np.float32)[..., None]
    x, y = (np.nan_to_num(pixels[..., k], nan=-1).astype(np.float32) for k in range(2))
    return fetch(smooth, x, y, cv2.INTER_LINEAR)[..., 0] > 0.99
