"""The pictures of a scene in the report: what went in, what came out, what should have, and where they differ."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import homogeneous
from ..core.pipeline import StitchResult
from ..core.raster.arrays import Array
from ..core.raster.colour import encode
from .measures import Truth
from .rendered import RenderedPair

Rgb = NDArray[np.uint8]

# Enough to judge by; the full pictures lie in the cache.
LONGEST = 960
# px of error that are shown as the brightest colour.
WORST_PX = 4.0
LINES = 9
TRUE_COLOUR, ESTIMATED_COLOUR = (90, 255, 120), (255, 60, 200)


def scene_pictures(pair: RenderedPair, truth: Truth, result: StitchResult, panorama: Rgb) -> dict[str, bytes]:
    """JPEG files by name: reference, target, stitch, truth, difference, lines, error_map.

    panorama: the stitch on the true panorama's canvas (see `measures.on_the_wide_canvas`).
    """
    apart = np.abs(panorama.astype(int) - truth.picture).astype(np.uint8)
    seen = truth.in_target | truth.in_reference
    apart[~seen] = 0
    pictures = {
        "reference": _display(pair.reference), "target": _display(pair.target), "stitch": panorama,
        "truth": np.where(seen[..., None], truth.picture, truth.picture // 4).astype(np.uint8),
        "difference": np.minimum(4 * apart.astype(int), 255).astype(np.uint8),
        "lines": _lines(_display(pair.target), truth, result), "error_map": _error_map(truth, result),
    }  # fmt: skip
    return {name: jpeg(picture) for name, picture in pictures.items()}


def _display(picture: NDArray) -> Rgb:
    return picture if picture.dtype == np.uint8 else encode(picture, 8)


def _lines(target: Rgb, truth: Truth, result: StitchResult) -> Rgb:
    """Epipolar lines of a few reference points in the target: the true ones, and thinner the estimated ones."""
    out = (target * 0.6).astype(np.uint8)
    if not truth.geometry.baseline:
        return out
    rows, columns = np.nonzero(truth.overlap)
    height, width = target.shape[:2]
    chosen = np.random.default_rng(0).choice(len(rows), LINES, replace=False) if len(rows) > LINES else np.arange(0)
    points = np.column_stack([columns, rows])[chosen] + np.array(truth.corner, float)
    thick = max(1, round(max(width, height) / 400))
    estimated = result.edges[0].two_view.F
    for F, colour, wide in ((truth.geometry.F, TRUE_COLOUR, 3 * thick), (estimated, ESTIMATED_COLOUR, thick)):
        if np.isfinite(F).all():
            for line in homogeneous(points) @ F.T:
                a, b = _ends(line, max(width, height))
                cv2.line(out, a, b, colour, wide, cv2.LINE_AA)
    for x, y in truth.target[rows[chosen], columns[chosen]]:
        cv2.circle(out, (round(float(x)), round(float(y))), 4 * thick, (255, 255, 255), thick, cv2.LINE_AA)
    return out


def _ends(line: Array, reach: float) -> tuple[tuple[int, int], tuple[int, int]]:
    """Two points of a line a x + b y + c = 0 far outside the picture."""
    a, b, c = line / max(float(np.hypot(line[0], line[1])), 1e-300)
    ends = [np.array([-a * c, -b * c]) + sign * 3 * reach * np.array([-b, a]) for sign in (-1, 1)]
    first, second = (tuple(int(v) for v in np.clip(end, -(10**6), 10**6)) for end in ends)
    return (first[0], first[1]), (second[0], second[1])


def _error_map(truth: Truth, result: StitchResult) -> Rgb:
    """How far the map is from the true one, dark to bright up to WORST_PX; gray where there is no truth to compare."""
    shape = truth.in_target.shape
    picture_map = result.warp.maps[1].arrays()
    maps = []
    for values in (picture_map.x, picture_map.y):
        x, y = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
        x, y = (x + truth.corner[0] + result.warp.canvas.offset[0], y + truth.corner[1] + result.warp.canvas.offset[1])
        inside = (x >= 0) & (y >= 0) & (x < values.shape[1]) & (y < values.shape[0])
        maps.append(np.where(inside, values[np.where(inside, y, 0), np.where(inside, x, 0)], np.nan))
    apart = np.hypot(maps[0] - truth.target[..., 0], maps[1] - truth.target[..., 1])
    known = truth.in_target & np.isfinite(apart)
    return error_colours(apart, known)


def error_colours(apart: Array, known: NDArray[np.bool_]) -> Rgb:
    """Distances (H, W) px, dark to bright up to WORST_PX, gray where they are not known."""
    level = np.rint(255 * np.clip(np.where(known, apart, 0) / WORST_PX, 0, 1)).astype(np.uint8)
    out = np.ascontiguousarray(cv2.applyColorMap(level, cv2.COLORMAP_INFERNO)[..., ::-1])
    out[~known] = 96
    return out


def jpeg(picture: Rgb) -> bytes:
    """A JPEG file of a picture, no larger than is needed to judge it."""
    scale = min(1.0, LONGEST / max(picture.shape[:2]))
    if scale < 1:
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes()
