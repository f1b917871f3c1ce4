"""The file of cameras: read as --cameras, it holds the cameras where they were found."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cameras.lens_entries import lens_entry

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
        Of each picture that was used, by its name: K in px of the full picture, `distortion`, `lens` where it
        has another one, and `R`, `t` in the frame of the first one, unless the geometry knows no pose; and the `unit`
        of t.
    """
    posed = all(np.isfinite(view.R).all() and np.isfinite(view.t).all() for view in result.views)
    table = {}
    for picture, view, size in zip(result.pictures, result.views, result.full_sizes, strict=True):
        full = replace(view.camera, K=view.K).resized(size)
        pose = {"R": view.R, "t": view.t * result.scale.factor} if posed else {}
        lens = {} if full.lens is None else {"lens": lens_entry(full)}
        table[picture.name] = {"K": full.K, "distortion": full.distortion, **lens, **pose}
    return {"cameras": table, "unit": result.scale.unit}
