"""What a window shows of more than two pictures: their cameras, and the inverse depth on a coarse grid.

Points are in px of the full pictures, lengths in the distance of the picture that was taken farthest from the first.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from .camera_file import found_cameras
from .inspection import canvas_geometry, grid_nodes, scales

if TYPE_CHECKING:
    from ..pipeline import StitchResult


def full_geometry(result: StitchResult) -> dict[str, Any]:
    """Cameras and canvas in px of the full upright pictures.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    dict
        JSON-ready but for arrays. `cameras`: of each picture that was used, the first one first, `name`, `K`, and `R`,
        `t` in the frame of the first one. `K`: of the first one. `full_sizes`, `canvas`, `S`, `K_canvas`: as of a pair
        (see `inspection.full_geometry`). `viewpoint`: the attributes of a `RigViewpoint`, None where all is seen from
        the first picture's place.
    """
    viewpoint = result.warp.viewpoint
    cameras = [
        {"name": found.name, "K": found.camera.K, "R": view.R, "t": view.t}
        for found, view in zip(found_cameras(result), result.views, strict=True)
    ]
    return {
        "cameras": cameras, "K": cameras[0]["K"], "viewpoint": None if viewpoint is None else asdict(viewpoint),
        **canvas_geometry(result, scales(result)[0], result.views[0].K),
    }  # fmt: skip


def depth_grid(result: StitchResult) -> dict[str, Any]:
    """The inverse range d (docs/method.md), from where each is seen, at nodes of a grid from corner to corner of the
    canvas; NaN where it is not known. Entries: see `inspection.depth_grid`, but for `slide`."""
    alpha = result.panorama.alpha
    x, y = grid_nodes(alpha.shape)
    depth = result.in_full(result.warp.depth, np.nan)
    nodes = np.stack([np.asarray(depth[row : row + 1, 0 : alpha.shape[1]])[0, x] for row in y])
    return {
        "columns": len(x), "rows": len(y), "inverse_depth": [float(f"{d:.5g}") for d in nodes.ravel()],
        "shows": (alpha[np.ix_(y, x)] > 0).astype(int).ravel(),
    }  # fmt: skip
