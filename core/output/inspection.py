"""What a window shows of a finished stitch: each match with its error, the difference of the pictures in the overlap,
how far parallax moves each pixel, and the inverse depth on a coarse grid. Points are in px of the full pictures.

Results with a whole sphere are to be passed through `StitchResult.spread_out` before, so that all arrays have the
panorama's size.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.projective import homogeneous
from ..cameras.view import View
from ..field.transfer import transfer
from ..measure.metrics import look_up
from ..panorama.rig_viewpoint import RigViewpoint
from ..panorama.viewpoint import Viewpoint
from ..panorama.warp import Warp
from ..raster.arrays import Array, strips
from ..raster.colour import encode
from ..raster.lazy import whole
from ..raster.resizing import size_change
from .match_table import match_file
from .options import INSPECTION

if TYPE_CHECKING:
    from ..pipeline import StitchResult

# What the window is told of each match: the field stands on it, or it contradicts the others.
USED, LEFT_OUT = "USED", "LEFT_OUT"


def scales(result: StitchResult) -> list[Array]:
    """For each picture the matrix S (3, 3) from px of the full picture to px of the one that was worked on."""
    out = []
    for full, camera in zip(result.full_sizes, result.cameras, strict=True):
        factor, shift = size_change(full, camera.size)
        S = np.diag([*factor, 1.0])
        S[:2, 2] = shift
        out.append(S)
    return out


def full_geometry(result: StitchResult) -> dict[str, Any]:
    """Cameras and canvas in px of the full upright pictures.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    dict
        JSON-ready but for arrays. `full_sizes`: (W, H) of each picture. `F`, `K`, `K_prime`, `R`, `t`, `model`: the
        geometry of the pair. `distortion`, `distortion_prime` (5,). `canvas`: (W, H) px. `S` (3, 3): from px of the
        reference to the canvas. `K_canvas` (3, 3): intrinsics of the canvas. S and K_canvas are NaN unless the canvas
        is the reference's own plane; the report's `canvas.projection` says what it shows. `viewpoint`: the attributes
        of a `Viewpoint` that slides, None where all is seen from the reference's place.
    """
    edge = result.edges[0]
    view, (S, S_prime) = edge.two_view, edge.pair(scales(result))
    return {
        "F": S_prime.T @ view.F @ S, "K": np.linalg.inv(S) @ view.K,
        "K_prime": np.linalg.inv(S_prime) @ view.K_prime, "R": view.R, "t": view.t, "model": view.model,
        "distortion": result.cameras[edge.i].distortion, "distortion_prime": result.cameras[edge.j].distortion,
        "viewpoint": asdict(result.warp.viewpoint) if isinstance(result.warp.viewpoint, Viewpoint) else None,
        **canvas_geometry(result, S, view.K),
    }  # fmt: skip


def canvas_geometry(result: StitchResult, S: Array, K: Array) -> dict[str, Any]:
    """The entries of `full_geometry` that say how the canvas lies.

    S (3, 3): from px of the full first picture to px of the one that was worked on, whose intrinsics are K."""
    canvas = result.canvas
    shift = np.eye(3) if canvas.projection is None else np.full((3, 3), np.nan)
    shift[:2, 2] += canvas.offset
    return {
        "full_sizes": result.full_sizes, "S": shift @ S, "canvas": (canvas.width, canvas.height), "K_canvas": shift @ K,
    }  # fmt: skip


def match_errors(result: StitchResult, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (N,), in px of the full target, between where the map sees x and its match x'; rows (N, ≥ 4): x, y, x',
    y' in px of the full pictures. NaN where the panorama does not show x."""
    edge = result.edges[0]
    S, S_prime = edge.pair(scales(result))
    x, y = homogeneous(rows[:, :2]) @ S.T, homogeneous(rows[:, 2:4]) @ S_prime.T
    error = look_up(result.warp, x[:, :2], result.cameras[edge.i], edge.j) - y[:, :2]
    distance: Array = np.linalg.norm(error / np.diag(S_prime)[:2], axis=1)
    return distance


def match_rows(result: StitchResult) -> dict[str, Any]:
    """All matches that were found, for the window's list.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    dict
        `rows` (N, 4): x, y, x', y' in px of the full pictures, to a thousandth. `weights` (N,). `states`: USED or
        LEFT_OUT, for each. `errors` (N,): see `match_errors`. `file`: see `match_file`, as text.
    """
    found = result.full_matches
    rows = np.column_stack([found.x, found.y])
    return {
        "rows": rows.round(3), "weights": found.weights, "states": _states(result.used),
        "errors": match_errors(result, rows).round(3), "file": match_file(result).decode(),
    }  # fmt: skip


def given_rows(result: StitchResult, rows: NDArray[np.float64]) -> dict[str, Any]:
    """As `match_rows`, without `file`, of matches that were given: rows (N, 5) x, y, x', y', weight, in their order."""
    used = result.used_matches
    places = {_place(row) for row in np.column_stack([used.x, used.y])}
    is_used = np.array([_place(row) in places for row in rows[:, :4]]) & (rows[:, 4] > 0)
    return {
        "rows": rows[:, :4], "weights": rows[:, 4], "states": _states(is_used),
        "errors": match_errors(result, rows).round(3),
    }  # fmt: skip


def _place(row: NDArray[np.float64]) -> tuple[float, ...]:
    """A match's points to a thousandth px, by which it is found again after it went through other sizes."""
    return tuple(np.round(row, 3).tolist())


def _states(used: NDArray[np.bool_]) -> list[str]:
    return [USED if one else LEFT_OUT for one in used]


def displacement_px(result: StitchResult) -> NDArray[np.float32]:
    """Distance (H, W), in px of the full target, between where each canvas pixel is seen and where it would be seen if
    what the reference shows there were infinitely far; 0 for a model without depth, NaN behind the camera."""
    warp, number = result.warp, result.edges[0].j
    view, picture_map = result.views[number], warp.maps[number].arrays()
    if not view.e_prime.any():
        return np.zeros(picture_map.shape, np.float32)
    infinite = warp.canvas.project_rows(view.H_inf, warp.canvas.xs, warp.canvas.ys, result.cameras[0])
    if warp.slide is not None and isinstance(warp.viewpoint, Viewpoint):
        away = whole(warp.slide) * warp.inverse_depth
        towards = view.H_inf @ result.views[0].K @ warp.viewpoint.c
        infinite = [part + away * step for part, step in zip(infinite, towards, strict=True)]
    elif isinstance(warp.viewpoint, RigViewpoint):
        _slide_along(infinite, warp, warp.viewpoint, view.H_inf @ result.views[0].K, result.views[0])
    far = distort(np.stack(transfer(view, infinite, np.zeros(1)), axis=-1), view.camera)
    moved = np.hypot(picture_map.x - far[..., 0], picture_map.y - far[..., 1])
    in_full_px: NDArray[np.float32] = (moved / scales(result)[number][0, 0]).astype(np.float32)
    return in_full_px


def _slide_along(infinite: list[Array], warp: Warp, viewpoint: RigViewpoint, matrix: Array, first: View) -> None:
    """Adds to canvas points that were brought to infinity (three (H, W) arrays) by what their viewpoint's place moves
    them: a matrix (3, 3) times d C."""
    canvas = warp.canvas
    for rows in strips((canvas.height, canvas.width)):
        rays, _ = canvas.rays_at(first.K, canvas.xs, canvas.ys[rows], first.camera)
        away = np.asarray(warp.depth[rows, :])[..., None] * viewpoint.place(rays)
        for part, row in zip(infinite, matrix, strict=True):
            part[rows] += away @ row


def heat_map(result: StitchResult) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """`displacement_px` as a reduced picture (h, w, 4) uint8 RGBA, transparent where the target shows nothing; and the
    px that the blue and the red end of its scale stand for."""
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
    """|reference − warped target| of the display-encoded layers as a reduced picture (h, w, 4) uint8 RGBA, opaque where
    both show something."""
    edge = result.edges[0]
    pair = result.layers[edge.i], result.layers[edge.j]
    layers = [encode(_reduced(layer.pixels), 8) for layer in pair]
    both = (pair[0].alpha > INSPECTION.shown) & (pair[1].alpha > INSPECTION.shown)
    shows = _reduced(both.astype(np.float32)) > INSPECTION.compared
    apart = cv2.absdiff(*layers).reshape(*shows.shape, -1)
    return np.dstack([np.repeat(apart, 3 // apart.shape[2], axis=2), np.where(shows, 255, 0).astype(np.uint8)])


def depth_grid(result: StitchResult) -> dict[str, Any]:
    """The inverse depth d (docs/method.md) at nodes of a grid from corner to corner of the canvas.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    dict
        `columns`, `rows`: nodes in either direction. `inverse_depth` and `shows` (1 where the panorama is not
        transparent): one value for each node, row by row from the top. `slide` likewise where the viewpoint slides: a
        node's depth is measured from s times the target's place.
    """
    x, y = grid_nodes(result.panorama.alpha.shape)
    depth = result.warp.inverse_depth[np.ix_(y, x)].ravel()
    slide = {}
    if result.warp.slide is not None:
        slide["slide"] = [round(float(s), 4) for s in whole(result.warp.slide)[np.ix_(y, x)].ravel()]
    return {
        "columns": len(x), "rows": len(y), "inverse_depth": [float(f"{d:.5g}") for d in depth],
        "shows": (result.panorama.alpha[np.ix_(y, x)] > 0).astype(int).ravel(), **slide,
    }  # fmt: skip


def grid_nodes(shape: tuple[int, ...]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """The columns and rows of a canvas (H, W) that nodes from corner to corner lie in."""
    height, width = shape[:2]
    counts = (max(2, round(INSPECTION.longest_grid * side / max(width, height))) for side in (width, height))
    x, y = (np.rint(np.linspace(0, side - 1, n)).astype(int) for side, n in zip((width, height), counts, strict=True))
    return x, y


def has_depth(result: StitchResult) -> bool:
    """Whether inverse depth means something: the cameras' positions are known and differ."""
    t = np.stack([view.t for view in result.views])
    return bool(np.isfinite(t).all() and t.any())


def _reduced(values: NDArray[Any]) -> NDArray[Any]:
    """An image (H, W, …) averaged down to `InspectionOptions.longest_side`; as it is where it is no larger."""
    height, width = values.shape[:2]
    factor = INSPECTION.longest_side / max(width, height)
    if factor >= 1:
        return values
    size = max(1, round(width * factor)), max(1, round(height * factor))
    reduced: NDArray[Any] = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    return reduced.reshape(size[1], size[0], *values.shape[2:])
