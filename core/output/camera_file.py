"""The file of cameras: read as --cameras, it holds the cameras where they were found."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..pipeline import StitchResult


def camera_table(result: StitchResult) -> dict[str, Any]:
    """The content of a camera file (see `read_camera_file`), JSON-ready but for arrays.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    dict
        Of each picture that was used, by its name: K in px of the full picture, `distortion`, and `R`, `t` in the frame
        of the first one, unless the geometry knows no pose.
    """
    posed = all(np.isfinite(view.R).all() and np.isfinite(view.t).all() for view in result.views)
    table = {}
    for picture, view, size in zip(result.pictures, result.views, result.full_sizes, strict=True):
        full = replace(view.camera, K=view.K).resized(size)
        pose = {"R": view.R, "t": view.t} if posed else {}
        table[picture.name] = {"K": full.K, "distortion": full.distortion, **pose}
    return {"cameras": table}
