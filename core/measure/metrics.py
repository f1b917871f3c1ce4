"""Figures of a stitch: alignment and distance from epipolar lines in px, PSNR and SSIM of the overlap, its seam."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..cameras.camera import Camera
from ..cameras.lens import undistort
from ..cameras.projective import distance_to_line
from ..panorama.layers import Layer
from ..panorama.options import CANVAS
from ..panorama.warp import Warp
from ..pictures.picture import Picture
from ..raster.arrays import NEIGHBOURS, Array, Part, beside, bounds, eroded, small_strips, strips
from ..raster.colour import encode
from ..raster.lazy import AnyImage
from ..raster.log_encoding import log_encode
from ..raster.picture_map import PictureMap, falls_inside
from ..raster.sampling import fetch
from ..system.threads import each, in_order
from .options import QUALITY


def psnr(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    """Peak signal-to-noise ratio in dB of two 8-bit pictures (H, W, C) over a mask (H, W), not empty; inf if equal."""

    def total(rows: slice) -> float:
        first, second = (picture[rows][mask[rows]].astype(np.float32) for picture in (a, b))
        return float(np.square(first - second).sum(dtype=np.float64))

    error = sum(in_order(total, strips(mask.shape))) / (int(mask.sum()) * a.shape[2])
    return float("inf") if error == 0 else float(10 * np.log10(255.0**2 / error))


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    """Mean structural similarity (Wang et al., IEEE TIP 2004) of two 8-bit pictures.

    Parameters
    ----------
    a, b : (H, W, C) uint8 array
        Compared as gray, in 11×11 Gaussian windows of σ 1.5.
    mask : (H, W) bool array
        Only windows that lie in it entirely count.

    Returns
    -------
    float
        NaN if no window fits.
    """
    inner = eroded(mask, 5)
    if not inner.any():
        return float("nan")

    def smooth(values: NDArray[np.float32]) -> NDArray[np.float32]:
        result: NDArray[np.float32] = cv2.GaussianBlur(values, (11, 11), 1.5)
        return result

    def total(rows: slice) -> float:
        near, here = beside(rows, 5, len(mask))
        x, y = (_gray(picture[near]).astype(np.float32) for picture in (a, b))
        return float(_similarity(x, y, smooth)[here][inner[rows]].sum(dtype=np.float64))

    return sum(in_order(total, strips(mask.shape))) / int(inner.sum())


def _gray(picture: NDArray[Any]) -> NDArray[Any]:
    """Gray levels (H, W) of a picture (H, W, 1 or 3)."""
    return picture[..., 0] if picture.shape[2] == 1 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def overlap_views(
    pictures: Sequence[Picture], warp: Warp, number: int = 1
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.bool_]]:
    """Views (H, W, C) uint8 of the reference and of picture `number` warped onto its pixels, and the mask (H, W) of
    pixels where both are opaque; for a flat warp."""
    reference, picture = pictures[0], pictures[number]
    height, width = reference.view.shape[:2]
    x, y = warp.canvas.offset
    box = (slice(y, y + height), slice(x, x + width))
    picture_map = warp.maps[number].arrays()
    map_x, map_y = picture_map.x[box], picture_map.y[box]
    inside = falls_inside(map_x, map_y, (picture.view.shape[1], picture.view.shape[0]))
    if reference.alpha is not None:
        inside = inside & (reference.alpha > 0)
    if picture.alpha is not None:
        # opaque where the colours are interpolated from: a transparent pixel has no colour to compare
        alpha = fetch(picture.alpha[..., None], map_x, map_y, cv2.INTER_LINEAR)
        inside = inside & (alpha[..., 0] > 1 - 1 / 255)
    map_x, map_y = (np.where(inside, values, -1).astype(np.float32) for values in (map_x, map_y))
    return reference.view, fetch(picture.view, map_x, map_y, cv2.INTER_LINEAR), inside


def overlap_quality(pictures: Sequence[Picture], warp: Warp, number: int = 1) -> dict[str, float]:
    """PSNR (dB), SSIM and pixels of the overlap, between the 8-bit views of the reference and of warped picture
    `number`.


    Differences in exposure lower it. The literature calls it alignment quality on the overlap.
    """
    view, fetched, inside = overlap_views(pictures, warp, number)
    if not inside.any():
        return {"overlap_px": 0, "overlap_psnr_db": float("nan"), "overlap_ssim": float("nan")}
    return {
        "overlap_px": int(inside.sum()),
        "overlap_psnr_db": psnr(view, fetched, inside),
        "overlap_ssim": ssim(view, fetched, inside),
    }


def canvas_quality(pictures: Sequence[Picture], warp: Warp, number: int = 1) -> dict[str, float]:
    """The same as in published tables: both pictures black outside the overlap, averaged over the whole canvas.


    Only for comparison with them: black counts as perfect, so a larger canvas scores higher.
    """
    view, fetched, inside = overlap_views(pictures, warp, number)
    if not inside.any():
        return {"canvas_psnr_db": float("nan"), "canvas_ssim": float("nan")}
    share = float(inside.sum()) / (warp.canvas.width * warp.canvas.height)
    bare = [np.where(inside[..., None], part, 0).astype(np.uint8) for part in (view, fetched)]
    # black around the pictures, so that every window that touches them counts
    first, second = (np.pad(part, ((6, 6), (6, 6), (0, 0))) for part in bare)
    similar = ssim(first, second, np.ones(first.shape[:2], bool))
    pixels = (first.shape[0] - 10) * (first.shape[1] - 10)
    return {
        "canvas_psnr_db": psnr(view, fetched, inside) - 10 * float(np.log10(share)),
        "canvas_ssim": 1 - (1 - similar) * pixels / (warp.canvas.width * warp.canvas.height),
    }


def appearance(
    panorama: Layer, layers: Sequence[Layer], labels: NDArray[np.int16] | None, floats: bool
) -> dict[str, float]:
    """Whether the panorama's overlaps look like one of its pictures, and how visible its seams are.

    Parameters
    ----------
    panorama : Layer
        On the canvas.
    layers : sequence of Layer
        The pictures on the canvas, with the exposure they have in the panorama.
    labels : (H, W) int array, optional
        The layer that each pixel of the panorama comes from; None if there is no seam.
    floats : bool
        Whether any picture is float, and so may be brighter than white.

    Returns
    -------
    dict
        source_fidelity_mean and source_fidelity_p5: mean and 5th percentile, over all that several layers show, of the
        best structural similarity (gray, 7×7) to one of them: a ghost looks like none. seam_visibility: levels of 255
        by which the step between neighbours across a seam differs from the same step in the picture where it differs
        least, mean over the seams. NaN where undefined.
    """
    several = np.sum([layer.alpha > 0 for layer in layers], axis=0, dtype=np.int16) > 1
    box = bounds(several)
    if box is None:
        return {"source_fidelity_mean": math.nan, "source_fidelity_p5": math.nan, "seam_visibility": math.nan}
    # with floats there may be light brighter than white, which 8 bits cannot hold: compared in log encoding
    levels = [_levels(part.light, box, floats) for part in (panorama, *layers)]
    several = several[box]

    def best(rows: slice) -> NDArray[np.float32]:
        with_margin, own = beside(rows, 3, len(several))
        stitched, *others = (_gray(part[with_margin].astype(np.float32)) for part in levels)
        similarities = [_similarity(stitched, part, _averaged)[own][several[rows]] for part in others]
        return np.asarray(np.max(similarities, axis=0))

    fidelity = np.concatenate(list(in_order(best, small_strips(several.shape))))
    seam = math.nan if labels is None else _seam_visibility(levels, labels[box], several)
    return {
        "source_fidelity_mean": float(fidelity.mean(dtype=np.float64)),
        "source_fidelity_p5": float(np.percentile(fidelity, 5)), "seam_visibility": seam,
    }  # fmt: skip


def box_similarity(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The structural similarity (H, W) of two pictures (H, W, C), gray, in plain 7×7 windows."""
    return np.asarray(_similarity(_gray(a).astype(np.float32), _gray(b).astype(np.float32), _averaged))


def _averaged(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over 7×7 windows."""
    result: NDArray[np.float32] = cv2.blur(values, (7, 7), borderType=cv2.BORDER_REFLECT_101)
    return result


def _levels(light: AnyImage, box: Part, floats: bool) -> NDArray[Any]:
    """Levels (h, w, C), 0 to 255, of a part of linear light: uint8, or log-encoded float32."""
    rows, columns = box
    shape = (rows.stop - rows.start, columns.stop - columns.start, light.shape[2])
    out = np.empty(shape, np.float32 if floats else np.uint8)

    def put(strip: slice) -> None:
        part = light[rows.start + strip.start : rows.start + strip.stop, columns]
        out[strip] = np.float32(255) * log_encode(part) if floats else encode(part, 8)

    each(put, small_strips(shape))
    return out


def _similarity(
    x: NDArray[np.float32], y: NDArray[np.float32], smooth: Callable[[NDArray[np.float32]], NDArray[np.float32]]
) -> NDArray[Any]:
    """The structural similarity (H, W) of gray pictures x, y (H, W); `smooth` averages over a window."""
    mx, my = smooth(x), smooth(y)
    vx, vy, vxy = smooth(x * x) - mx * mx, smooth(y * y) - my * my, smooth(x * y) - mx * my
    c1, c2 = QUALITY.ssim_c1, QUALITY.ssim_c2
    return (2 * mx * my + c1) * (2 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))


def _seam_visibility(
    levels: list[NDArray[Any]], labels: NDArray[np.int16], several: NDArray[np.bool_]
) -> float:
    """See `appearance`; levels (h, w, C) of the panorama and of each layer; several (h, w): where more
    than one shows something."""
    excess = []
    for here, there in NEIGHBOURS:
        across = (labels[here] != labels[there]) & several[here] & several[there]
        steps = [part[here][across].astype(np.float32) - part[there][across] for part in levels]
        excess.append(np.min([np.abs(steps[0] - step).mean(axis=1) for step in steps[1:]], axis=0))
    every = np.concatenate(excess)
    return float(every.mean(dtype=np.float64)) if every.size else math.nan


def look_up(warp: Warp, x: Array, camera: Camera | None = None, number: int = 1) -> Array:
    """The map of picture `number` where the canvas shows points of the reference, bilinear between canvas pixels.

    Parameters
    ----------
    warp : Warp
    x : (N, 2) array
        Raw (distorted) reference px.
    camera : Camera, optional
        The reference's, where its lens matters.
    number : int
        The picture whose map it is.

    Returns
    -------
    (N, 2) array
        Raw px of that picture; NaN where the canvas does not show the point.
    """
    at = warp.canvas.of_reference(x, camera) if warp.slide is None else shown_at(warp.maps[0].arrays(), x)
    return warp.maps[number].arrays().between(at)


def shown_at(picture_map: PictureMap, x: Array) -> Array:
    """Where a canvas shows points (N, 2) px of a picture: px (N, 2) of the canvas, NaN where it does not.

    The pixel of a coarse grid that shows the nearest point, and Newton's steps from there.
    """
    step = QUALITY.inverse_step
    nodes = np.stack([values[::step, ::step] for values in (picture_map.x, picture_map.y)], axis=-1)
    rows, columns = np.nonzero(np.isfinite(nodes).all(axis=-1))
    if not rows.size:
        return np.full(x.shape, np.nan)
    nearest = cKDTree(nodes[rows, columns]).query(x)[1]
    at = np.column_stack([columns[nearest], rows[nearest]]).astype(np.float64) * step
    limit = np.array(picture_map.shape[::-1]) - 1.0
    for _ in range(QUALITY.inverse_steps):
        here, right, below = (picture_map.between(np.minimum(at, limit - 1) + by) for by in np.eye(3, 2, -1))
        off, across, down = x - picture_map.between(at), right - here, below - here
        area = across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]
        area = np.where(np.abs(area) > QUALITY.least_area, area, np.nan)
        move = np.column_stack([
            (off[:, 0] * down[:, 1] - off[:, 1] * down[:, 0]) / area,
            (across[:, 0] * off[:, 1] - across[:, 1] * off[:, 0]) / area,
        ])  # fmt: skip
        at = np.clip(at + np.clip(move, -2 * step, 2 * step), 0, limit)
    missed = ~(np.linalg.norm(picture_map.between(at) - x, axis=1) <= QUALITY.inverse_error_px)
    at[missed] = np.nan
    return at


@dataclass(frozen=True)
class CoverageSamples:
    """An even sample of the canvas pixels that show the target, in ideal (undistorted) px.

    points (N, 2): on the reference's plane; target (N, 2): what they show; overlap (N,): which lie in the reference.
    """

    points: Array
    target: Array
    overlap: NDArray[np.bool_]


def coverage_samples(
    warp: Warp, cameras: Sequence[Camera], number: int = 1, samples: int = QUALITY.map_samples
) -> CoverageSamples:
    """Samples what a warp shows of picture `number` on an even grid of about `samples` pixels over the whole canvas.

    Parameters
    ----------
    warp : Warp
    cameras : (Camera, Camera)
        Of reference and target.
    samples : int

    Returns
    -------
    CoverageSamples
        Of a cylindrical or spherical panorama only what a flat one would show: elsewhere the reference's plane has no
        pixels.
    """
    canvas = warp.canvas
    step = max(1, int(np.sqrt(canvas.width * canvas.height / samples)))
    nodes = np.s_[step // 2 :: step, step // 2 :: step]
    picture_map = warp.maps[number].arrays()
    x, y = picture_map.x[nodes], picture_map.y[nodes]
    reference, camera = cameras[0], cameras[number]
    shows = falls_inside(x, y, camera.size)
    raw = np.stack([x[shows], y[shows]], axis=-1).astype(np.float64)
    if canvas.projection is None:
        points = np.argwhere(shows)[:, ::-1] * float(step) + step // 2 - np.array(canvas.offset)
    else:
        if warp.slide is None:
            points = canvas.on_reference(canvas.xs[nodes[1]], canvas.ys[nodes[0]], reference)[0][shows]
        else:
            seen = warp.maps[0].arrays()
            points = np.stack([seen.x[nodes], seen.y[nodes]], axis=-1)[shows].astype(np.float64)
        far = CANVAS.max_reach * max(*reference.size, *camera.size)
        with np.errstate(invalid="ignore"):
            flat = ((points >= -far) & (points <= np.array(reference.size) + far)).all(axis=1)
        points, raw = points[flat], raw[flat]
    overlap = (points >= 0).all(axis=1) & (points <= np.array(reference.size) - 1).all(axis=1)
    return CoverageSamples(undistort(points, reference), undistort(raw, camera), overlap)


def off_line_mean(F: Array, shown: CoverageSamples) -> float:
    """Mean distance (target px) of the map from the epipolar lines of F over the overlap; NaN without overlap or F."""
    if not (np.isfinite(F).all() and shown.overlap.any()):
        return float("nan")
    return float(distance_to_line(F, shown.points[shown.overlap], shown.target[shown.overlap]).mean())
