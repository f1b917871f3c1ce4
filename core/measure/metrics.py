"""How well a stitch holds: alignment and epipolar exactness in px, folds, and the overlap's PSNR and SSIM."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.lens import undistort
from ..cameras.projective import distance_to_line
from ..panorama.canvas import MAX_REACH
from ..panorama.layers import Layer
from ..panorama.warp import Warp
from ..pictures.picture import Picture
from ..raster.arrays import Array, Part, beside, bounds, strips
from ..raster.colour import encode
from ..raster.lazy import AnyImage
from ..raster.log_encoding import log_encode
from ..raster.sampling import fetch
from ..system.threads import each, in_order
from .options import QUALITY


def psnr(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    """Peak signal-to-noise ratio in dB of two 8-bit pictures (H, W, C) over a mask (H, W); inf where they are equal."""

    def total(rows: slice) -> float:
        first, second = (picture[rows][mask[rows]].astype(np.float32) for picture in (a, b))
        return float(np.square(first - second).sum(dtype=np.float64))

    error = sum(in_order(total, strips(mask.shape))) / (int(mask.sum()) * a.shape[2])
    return float("inf") if error == 0 else float(10 * np.log10(255.0**2 / error))


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    """Mean structural similarity of two 8-bit pictures (H, W, C) as gray, 11×11 Gaussian of σ 1.5, where the whole
    window lies in the mask.

    NaN where no window fits (Wang et al. 2004).
    """
    inner = cv2.erode(np.pad(mask.astype(np.uint8), 5), np.ones((11, 11), np.uint8))[5:-5, 5:-5] > 0
    if not inner.any():
        return float("nan")

    def smooth(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return cv2.GaussianBlur(values, (11, 11), 1.5)

    def total(rows: slice) -> float:
        near, here = beside(rows, 5, len(mask))
        x, y = (_gray(picture[near]).astype(np.float32) for picture in (a, b))
        return float(_similarity(x, y, smooth)[here][inner[rows]].sum(dtype=np.float64))

    return sum(in_order(total, strips(mask.shape))) / int(inner.sum())


def _gray(picture: NDArray) -> NDArray:
    return picture[..., 0] if picture.shape[2] == 1 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def overlap_views(
    reference: Picture, target: Picture, warp: Warp
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.bool_]]:
    """The 8-bit views (H, W, C) of the reference and, on its pixels, of the warped target; and where (H, W) both show
    something whole; by a flat warp."""
    height, width = reference.view.shape[:2]
    x, y = warp.canvas.offset
    box = (slice(y, y + height), slice(x, x + width))
    inside = warp.inside((target.view.shape[1], target.view.shape[0]))[box]
    if reference.alpha is not None:
        inside = inside & (reference.alpha > 0)
    if target.alpha is not None:
        # whole, where the colours are fetched from: what is hidden has no colour to compare
        alpha = fetch(target.alpha[..., None], warp.map_x[box], warp.map_y[box], cv2.INTER_LINEAR)
        inside = inside & (alpha[..., 0] > 1 - 1 / 255)
    map_x, map_y = (np.where(inside, m[box], -1).astype(np.float32) for m in (warp.map_x, warp.map_y))
    return reference.view, fetch(target.view, map_x, map_y, cv2.INTER_LINEAR), inside


def overlap_quality(reference: Picture, target: Picture, warp: Warp) -> dict[str, float]:
    """PSNR (dB), SSIM and size of the overlap, between the 8-bit views of the reference and of the warped target.

    Exposure differences are in it; it is what a reader of the literature calls alignment quality on the overlap.
    """
    view, fetched, inside = overlap_views(reference, target, warp)
    if not inside.any():
        return {"overlap_px": 0, "overlap_psnr_db": float("nan"), "overlap_ssim": float("nan")}
    return {
        "overlap_px": int(inside.sum()),
        "overlap_psnr_db": psnr(view, fetched, inside),
        "overlap_ssim": ssim(view, fetched, inside),
    }


def canvas_quality(reference: Picture, target: Picture, warp: Warp) -> dict[str, float]:
    """The same as published tables have it: both pictures black outside the overlap, averaged over the whole canvas.

    For comparison with them only: black counts as perfect, so a larger canvas looks better.
    """
    view, fetched, inside = overlap_views(reference, target, warp)
    if not inside.any():
        return {"canvas_psnr_db": float("nan"), "canvas_ssim": float("nan")}
    share = float(inside.sum()) / (warp.canvas.width * warp.canvas.height)
    bare = [np.where(inside[..., None], part, 0).astype(np.uint8) for part in (view, fetched)]
    # a window's width of black around it holds all that is not perfect
    first, second = (np.pad(part, ((6, 6), (6, 6), (0, 0))) for part in bare)
    similar = ssim(first, second, np.ones(first.shape[:2], bool))
    pixels = (first.shape[0] - 10) * (first.shape[1] - 10)
    return {
        "canvas_psnr_db": psnr(view, fetched, inside) - 10 * float(np.log10(share)),
        "canvas_ssim": 1 - (1 - similar) * pixels / (warp.canvas.width * warp.canvas.height),
    }


def appearance(
    panorama: Layer, reference: Layer, target: Layer, from_target: NDArray[np.bool_] | None, floats: tuple[bool, bool]
) -> dict[str, float]:
    """How much of a panorama's overlap looks as one of its pictures does, and how much its seam shows.

    source_fidelity_mean, source_fidelity_p5: for every pixel of the overlap the better of the structural similarities
    (gray, 7×7) to the reference and to the target, which is exposed as it is in the panorama: mean and 5th percentile;
    a ghost looks like neither. seam_visibility: by how many levels (of 255) the step from pixel to pixel across the
    seam differs from the same step in the picture that is nearer to it, mean over the seam. NaN where there is none.
    """
    box = bounds((reference.alpha > 0) & (target.alpha > 0))
    if box is None:
        return {"source_fidelity_mean": math.nan, "source_fidelity_p5": math.nan, "seam_visibility": math.nan}
    # what else is there may be missing for want of room in 8 bit: light beyond white is looked at as tones
    levels = [_levels(part.light, box, any(floats)) for part in (panorama, reference, target)]
    both = ((reference.alpha > 0) & (target.alpha > 0))[box]

    def smooth(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return cv2.blur(values, (7, 7), borderType=cv2.BORDER_REFLECT_101)

    def better(rows: slice) -> NDArray[np.float32]:
        near, here = beside(rows, 3, len(both))
        whole, first, second = (_gray(part[near].astype(np.float32)) for part in levels)
        return np.maximum(*(_similarity(whole, part, smooth)[here][both[rows]] for part in (first, second)))

    fidelity = np.concatenate(list(in_order(better, strips(both.shape))))
    seam = math.nan if from_target is None else _seam_visibility(levels, from_target[box], both)
    return {
        "source_fidelity_mean": float(fidelity.mean(dtype=np.float64)),
        "source_fidelity_p5": float(np.percentile(fidelity, 5)), "seam_visibility": seam,
    }  # fmt: skip


def _levels(light: AnyImage, box: Part, floats: bool) -> NDArray:
    """Levels (h, w, C) of a part: uint8, or float32 on the same scale."""
    rows, columns = box
    shape = (rows.stop - rows.start, columns.stop - columns.start, light.shape[2])
    out = np.empty(shape, np.float32 if floats else np.uint8)

    def put(strip: slice) -> None:
        part = light[rows.start + strip.start : rows.start + strip.stop, columns]
        out[strip] = np.float32(255) * log_encode(part) if floats else encode(part, 8)

    each(put, strips(shape))
    return out


def _similarity(
    x: NDArray[np.float32], y: NDArray[np.float32], smooth: Callable[[NDArray[np.float32]], NDArray[np.float32]]
) -> NDArray:
    """The structural similarity (H, W) of two gray pictures in windows that `smooth` takes means over."""
    mx, my = smooth(x), smooth(y)
    vx, vy, vxy = smooth(x * x) - mx * mx, smooth(y * y) - my * my, smooth(x * y) - mx * my
    c1, c2 = QUALITY.ssim_c1, QUALITY.ssim_c2
    return (2 * mx * my + c1) * (2 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))


def _seam_visibility(
    levels: list[NDArray], from_target: NDArray[np.bool_], both: NDArray[np.bool_]
) -> float:
    beyond = []
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        across = (from_target[here] != from_target[there]) & both[here] & both[there]
        steps = [part[here][across].astype(np.float32) - part[there][across] for part in levels]
        beyond.append(np.minimum(*(np.abs(steps[0] - step).mean(axis=1) for step in steps[1:])))
    every = np.concatenate(beyond)
    return float(every.mean(dtype=np.float64)) if every.size else math.nan


def look_up(warp: Warp, x: Array, camera: Camera | None = None) -> Array:
    """The map (N, 2) at raw points (N, 2) of the reference, bilinear between canvas pixels; NaN outside.
    camera: the reference's, if its lens matters."""
    at = warp.canvas.of_reference(x, camera)
    limit = np.array([warp.canvas.width, warp.canvas.height]) - 1
    outside = ((at < 0) | (at > limit)).any(axis=1)
    corner = np.clip(np.floor(at).astype(int), 0, np.maximum(limit - 1, 0))
    (u, v), (column, row) = (at - corner).T, corner.T
    next_column, next_row = np.minimum(column + 1, limit[0]), np.minimum(row + 1, limit[1])
    out = []
    for values in (warp.map_x, warp.map_y):
        upper = values[row, column] * (1 - u) + values[row, next_column] * u
        lower = values[next_row, column] * (1 - u) + values[next_row, next_column] * u
        out.append(np.where(outside, np.nan, upper * (1 - v) + lower * v))
    return np.column_stack(out)


@dataclass(frozen=True)
class CoverageSamples:
    """Canvas pixels that show the target, evenly spread, and where they show it, in ideal (undistorted) px of both.

    points (N, 2) of the reference's plane; target (N, 2); overlap (N,): which of them lie in the reference.
    """

    points: Array
    target: Array
    overlap: NDArray[np.bool_]


def coverage_samples(warp: Warp, cameras: tuple[Camera, Camera], samples: int = QUALITY.map_samples) -> CoverageSamples:
    """What a warp shows of the target at about `samples` pixels of the whole canvas, on an even grid.

    Of a round panorama no more than a flat one would show: beyond, pixels of the reference's plane mean nothing.
    """
    canvas = warp.canvas
    step = max(1, int(np.sqrt(canvas.width * canvas.height / samples)))
    nodes = np.s_[step // 2 :: step, step // 2 :: step]
    shows = warp.inside(cameras[1].size)[nodes]
    raw = np.stack([warp.map_x[nodes][shows], warp.map_y[nodes][shows]], axis=-1).astype(np.float64)
    if canvas.projection is None:
        points = np.argwhere(shows)[:, ::-1] * float(step) + step // 2 - np.array(canvas.offset)
    else:
        points = canvas.on_reference(canvas.xs[nodes[1]], canvas.ys[nodes[0]], cameras[0])[0][shows]
        far = MAX_REACH * max(*cameras[0].size, *cameras[1].size)
        with np.errstate(invalid="ignore"):
            flat = ((points >= -far) & (points <= np.array(cameras[0].size) + far)).all(axis=1)
        points, raw = points[flat], raw[flat]
    overlap = (points >= 0).all(axis=1) & (points <= np.array(cameras[0].size) - 1).all(axis=1)
    return CoverageSamples(undistort(points, cameras[0]), undistort(raw, cameras[1]), overlap)


def off_line_mean(F: Array, shown: CoverageSamples) -> float:
    """Mean distance in target px of the map from its epipolar lines over the overlap; NaN without overlap or F."""
    if not (np.isfinite(F).all() and shown.overlap.any()):
        return float("nan")
    return float(distance_to_line(F, shown.points[shown.overlap], shown.target[shown.overlap]).mean())
