"""What a window shows of a finished stitch: each match with its error, the overlap's difference, how far points slide,
and the inverse depth on a coarse grid. Small beside the panorama, and in px of the full pictures.

A whole sphere's warp and layers are to be spread over it before (`StitchResult.spread_out`).
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.projective import homogeneous
from ..field.transfer import transfer
from ..measure.metrics import look_up
from ..pipeline import StitchResult
from ..raster.arrays import Array
from ..raster.colour import encode
from ..raster.resizing import size_change
from .match_table import match_file
from .options import INSPECTION

# What the window is told of each match: the field stands on it, or it contradicts the others.
USED, LEFT_OUT = "USED", "LEFT_OUT"


def scales(result: StitchResult) -> list[Array]:
    """For each picture the matrix S (3, 3) that brings px of the full picture to px of the one that was worked on."""
    out = []
    for full, camera in zip(result.full_sizes, result.cameras, strict=True):
        factor, shift = size_change(full, camera.size)
        S = np.diag([*factor, 1.0])
        S[:2, 2] = shift
        out.append(S)
    return out


def full_geometry(result: StitchResult) -> dict[str, Any]:
    """Where things lie, JSON-ready up to arrays: `full_sizes` (W, H); `F`, `K`, `K_prime`, `R`, `t`, `distortion`,
    `distortion_prime` (5,) in px of the full upright pictures; `S` (3, 3): from those of the reference to the canvas;
    `canvas` (W, H) px; `K_canvas` (3, 3). The canvas of a round panorama is none of a pinhole camera: S and K_canvas
    are NaN there, and the report's `canvas.projection` says what it shows."""
    edge, canvas = result.edges[0], result.canvas
    view, scale = edge.two_view, scales(result)
    S, S_prime = scale[edge.i], scale[edge.j]
    shift = np.eye(3) if canvas.projection is None else np.full((3, 3), np.nan)
    shift[:2, 2] += canvas.offset
    return {
        "full_sizes": result.full_sizes, "F": S_prime.T @ view.F @ S, "K": np.linalg.inv(S) @ view.K,
        "K_prime": np.linalg.inv(S_prime) @ view.K_prime, "R": view.R, "t": view.t, "model": view.model,
        "distortion": result.cameras[edge.i].distortion, "distortion_prime": result.cameras[edge.j].distortion,
        "S": shift @ S, "canvas": (canvas.width, canvas.height), "K_canvas": shift @ view.K,
    }  # fmt: skip


def match_errors(result: StitchResult, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far (N,) in full target px the map leads from x', for rows (N, ≥ 4) x, y, x', y' of full px; NaN where the
    panorama does not show x."""
    edge, scale = result.edges[0], scales(result)
    x, y = homogeneous(rows[:, :2]) @ scale[edge.i].T, homogeneous(rows[:, 2:4]) @ scale[edge.j].T
    error = look_up(result.warp, x[:, :2], result.cameras[edge.i], edge.j) - y[:, :2]
    distance: Array = np.linalg.norm(error / np.diag(scale[edge.j])[:2], axis=1)
    return distance


def match_rows(result: StitchResult) -> dict[str, Any]:
    """All matches that were found: `rows` (N, 4) full px to a thousandth, `weights`, `states` (USED: the field stands
    on it, LEFT_OUT: it contradicts the others), `errors` as `match_errors`; `file`: see `match_file`, as text."""
    edge, back = result.edges[0], [np.linalg.inv(S) for S in scales(result)]
    found = edge.matches
    x, y = homogeneous(found.x) @ back[edge.i].T, homogeneous(found.y) @ back[edge.j].T
    rows = np.column_stack([x[:, :2], y[:, :2]])
    used = np.zeros(len(found), bool)
    used[np.flatnonzero(edge.two_view.inliers)[result.field.fit.inliers_used]] = True
    return {
        "rows": rows.round(3), "weights": np.ones(len(found)) if found.weights is None else found.weights,
        "states": _states(used), "errors": match_errors(result, rows).round(3), "file": match_file(result).decode(),
    }  # fmt: skip


def given_rows(result: StitchResult, rows: NDArray[np.float64]) -> dict[str, Any]:
    """The same, but no `file`, of the matches (N, 5) that were given, all of them and in their order."""
    used = result.used_matches
    places = {_place(row) for row in np.column_stack([used.x, used.y])}
    is_used = np.array([_place(row) in places for row in rows[:, :4]]) & (rows[:, 4] > 0)
    return {
        "rows": rows[:, :4], "weights": rows[:, 4], "states": _states(is_used),
        "errors": match_errors(result, rows).round(3),
    }  # fmt: skip


def _place(row: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(np.round(row, 3).tolist())


def _states(used: NDArray[np.bool_]) -> list[str]:
    return [USED if one else LEFT_OUT for one in used]


def displacement_px(result: StitchResult) -> NDArray[np.float32]:
    """How far (H, W) in full px of a further picture each canvas pixel lies from where it would be seen if it were
    infinitely far; 0 where the model knows no depth, NaN behind its camera."""
    warp, number = result.warp, result.edges[0].j
    view, picture_map = result.views[number], warp.maps[number].arrays()
    if not view.e_prime.any():
        return np.zeros(picture_map.shape, np.float32)
    infinite = warp.canvas.project_rows(view.H_inf, warp.canvas.xs, warp.canvas.ys, result.cameras[0])
    far = distort(np.stack(transfer(view, infinite, np.zeros(1)), axis=-1), view.camera)
    moved = np.hypot(picture_map.x - far[..., 0], picture_map.y - far[..., 1])
    in_full_px: NDArray[np.float32] = (moved / scales(result)[number][0, 0]).astype(np.float32)
    return in_full_px


def heat_map(result: StitchResult) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """The slide as a picture (h, w, 4) uint8 RGBA, reduced, transparent where the target shows nothing; and the px that
    its blue and its red end stand for."""
    layer = result.layers[result.edges[0].j]
    far, shows = _reduced(displacement_px(result)), _reduced((layer.alpha > 0).astype(np.float32)) > INSPECTION.shown
    shows &= np.isfinite(far)
    if not shows.any():
        return np.zeros((*far.shape, 4), np.uint8), (0.0, 0.0)
    low, high = (float(value) for value in np.percentile(far[shows], INSPECTION.colour_range))
    share = np.clip((np.nan_to_num(far) - low) / max(high - low, INSPECTION.min_range_px), 0, 1)
    colours = cv2.applyColorMap(np.rint(share * 255).astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1]
    return np.dstack([colours, np.where(shows, 255, 0).astype(np.uint8)]), (low, high)


def difference(result: StitchResult) -> NDArray[np.uint8]:
    """|reference − warped target| of the display-encoded layers, (h, w, 4) uint8 RGBA, reduced; opaque where both
    show."""
    edge = result.edges[0]
    pair = result.layers[edge.i], result.layers[edge.j]
    layers = [encode(_reduced(layer.pixels), 8) for layer in pair]
    both = (pair[0].alpha > INSPECTION.shown) & (pair[1].alpha > INSPECTION.shown)
    shows = _reduced(both.astype(np.float32)) > INSPECTION.compared
    apart = cv2.absdiff(*layers).reshape(*shows.shape, -1)
    return np.dstack([np.repeat(apart, 3 // apart.shape[2], axis=2), np.where(shows, 255, 0).astype(np.uint8)])


def depth_grid(result: StitchResult) -> dict[str, Any]:
    """The inverse depth at nodes over the canvas, corner to corner: `columns`, `rows`, `inverse_depth` and `shows`
    (whether the panorama shows something there), both row by row from the top."""
    height, width = result.panorama.alpha.shape
    longest = max(width, height)
    columns, rows = (max(2, round(INSPECTION.longest_grid * side / longest)) for side in (width, height))
    x, y = (np.rint(np.linspace(0, side - 1, n)).astype(int) for side, n in ((width, columns), (height, rows)))
    depth = result.warp.inverse_depth[np.ix_(y, x)].ravel()
    return {
        "columns": columns, "rows": rows, "inverse_depth": [float(f"{d:.5g}") for d in depth],
        "shows": (result.panorama.alpha[np.ix_(y, x)] > 0).astype(int).ravel(),
    }  # fmt: skip


def has_depth(result: StitchResult) -> bool:
    """Whether the model says where things stand: the cameras' places are known and differ."""
    t = np.stack([view.t for view in result.views])
    return bool(np.isfinite(t).all() and t.any())


def _reduced(values: NDArray[Any]) -> NDArray[Any]:
    height, width = values.shape[:2]
    factor = INSPECTION.longest_side / max(width, height)
    if factor >= 1:
        return values
    size = max(1, round(width * factor)), max(1, round(height * factor))
    reduced: NDArray[Any] = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    return reduced.reshape(size[1], size[0], *values.shape[2:])
