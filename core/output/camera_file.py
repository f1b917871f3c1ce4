"""The file of cameras: read as --cameras, it holds the cameras where they were found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cameras.camera import Camera
from ..cameras.lens_entries import lens_entry
from ..raster.arrays import Array

if TYPE_CHECKING:
    from ..pipeline import StitchResult


@dataclass(frozen=True, eq=False)
class FoundCamera:
    """A picture's name; its camera, px of the full picture; R (3, 3), t (3,): x ~ K (R X + t) in the frame of the first
    picture, None where the geometry knows no pose."""

    name: str
    camera: Camera
    R: Array | None
    t: Array | None


def found_cameras(result: StitchResult) -> list[FoundCamera]:
    """The cameras of the pictures that were used, in their order; t in `result.scale.unit`."""
    posed = all(np.isfinite(view.R).all() and np.isfinite(view.t).all() for view in result.views)
    return [
        FoundCamera(
            picture.name, replace(view.camera, K=view.K).resized(size),
            view.R if posed else None, view.t * result.scale.factor if posed else None,
        )
        for picture, view, size in zip(result.pictures, result.views, result.full_sizes, strict=True)
    ]  # fmt: skip


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
    table = {}
    for found in found_cameras(result):
        lens = {} if found.camera.lens is None else {"lens": lens_entry(found.camera)}
        pose = {} if found.R is None else {"R": found.R, "t": found.t}
        table[found.name] = {"K": found.camera.K, "distortion": found.camera.distortion, **lens, **pose}
    return {"cameras": table, "unit": result.scale.unit}
