"""What the worker leaves of a stitch in its folder: pictures, and result.json as their index."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..output import inspection, inspection_of_many
from ..output.depth.nodes import depth_nodes, is_whole_sphere
from ..output.depth.options import MESH
from ..output.filled_sphere import filled_sphere
from ..output.json_file import json_bytes
from ..output.sphere_part import sphere_part_of
from ..panorama.layers import Layer
from ..pictures.encoding import encode_into, encode_picture
from ..pictures.exr import ExrForm
from ..raster.lazy import whole

if TYPE_CHECKING:
    from ..pipeline import StitchResult

# What the pictures of a pair are called.
SIDES = ("reference", "target")


class Folder:
    """Where the files go. `names`: of each file by what it is; told: called with how many there are by now; exr: how
    floats are written."""

    def __init__(self, path: Path, result: StitchResult, exr: ExrForm, told: Callable[[int], None]) -> None:
        self._path, self._result, self._exr, self._told = path, result, exr, told
        self.names: dict[str, str] = {}

    def add_mask(self, what: str, values: NDArray[Any]) -> None:
        """A PNG of uint8 values (H, W) or RGBA (H, W, 4) that are no light: without a profile or a display curve."""
        stored = values if values.ndim == 2 else cv2.cvtColor(values, cv2.COLOR_RGBA2BGRA)
        self._named(what, ".png").write_bytes(cv2.imencode(".png", stored)[1].tobytes())

    def add_depth(self, depth: NDArray[Any]) -> None:
        """The inverse depth (H, W)."""
        data = encode_picture(depth[..., None], None, 32, ".exr")[0]
        self._named("inverse depth", ".exr").write_bytes(data)

    def add_layer(self, what: str, layer: Layer, is_panorama: bool = False) -> None:
        """A picture on the panorama's canvas, or the panorama, as the first picture's file has its colours."""
        result = self._result
        is_opaque = is_panorama and layer.alpha.min() >= 1.0
        alpha = None if is_opaque else layer.alpha  # where it is 1 everywhere it need not be stored
        sphere = sphere_part_of(result) if is_panorama else None
        kind = ".png" if result.bits == 8 else ".exr"
        with open(self._named(what, kind), "wb") as file:
            icc, exif = result.pictures[0].icc, result.pictures[0].exif
            encode_into(file.write, layer.light, alpha, result.bits, kind, icc, exif, self._exr, sphere)

    def _named(self, what: str, suffix: str) -> Path:
        self.names[what] = f"{len(self.names)}{suffix}"
        self._told(len(self.names))
        return self._path / self.names[what]


def hand_over(
    folder: Path, result: StitchResult, rows: NDArray[np.float64] | None, job: dict[str, Any], turns: tuple[int, ...],
    told: Callable[[int], None],
) -> None:  # fmt: skip
    """Writes everything that the window may ask for, depth.npz (see `DepthNodes`) among it where there is depth.

    Parameters
    ----------
    folder : Path
    result : StitchResult
    rows : (N, 5) array, optional
        The matches that were given.
    job : dict
        job.json, of which `take`, `exr`, `fill` and `digests` (see there) are read.
    turns : tuple of int
        EXIF's orientation of each picture that was given.
    told : callable
        Called with the number of files that were begun.
    """
    files = Folder(folder, result, ExrForm(**job.get("exr", {})), told)
    shown = filled_sphere(result.panorama) if job.get("fill") and is_whole_sphere(result) else result.panorama
    files.add_layer("panorama", shown, is_panorama=True)
    take = job.get("take", [])
    about = _of_pair(result.spread_out(), rows, take, files) if result.rig is None else _of_many(result, take, files)
    share = max(result.cameras[0].size) / max(result.full_sizes[0])  # small pictures give a small panorama
    index = {
        "files": files.names, "report": result.report, "warnings": result.warnings, "bits": result.bits,
        "digests": job.get("digests"), "orientations": turns,
        "has_depth": inspection.has_depth(result), "seconds": result.seconds, "share": share, **about,
    }  # fmt: skip
    if index["has_depth"]:
        (folder / "depth.npz").write_bytes(depth_nodes(result, MESH.editable_nodes).to_bytes())
    (folder / "result.json").write_bytes(json_bytes(index))


def _of_pair(
    result: StitchResult, rows: NDArray[np.float64] | None, take: list[str], files: Folder
) -> dict[str, Any]:
    """What is known of two pictures only; arrays as large as the panorama."""
    for side, layer in zip(SIDES, result.layers, strict=True):
        _add_picture(side, layer, take, files)
    if "masks" in take:
        files.add_mask("occluded", result.occluded[1].astype(np.uint8) * 255)
        if result.inpainted.any():
            files.add_mask("inpainted", result.inpainted.astype(np.uint8) * 255)
        if result.labels is not None:
            files.add_mask("seam", _painted(result.labels > 0, result.panorama.alpha > 0))
        if result.warp.confidence is not None:
            files.add_mask("confidence", _levels(result.warp.confidence))
    if "depth" in take and inspection.has_depth(result):
        files.add_depth(result.warp.inverse_depth)
    heat, heat_range = inspection.heat_map(result)
    files.add_mask("heat", heat)
    files.add_mask("difference", inspection.difference(result))
    matches = inspection.match_rows(result) if rows is None else inspection.given_rows(result, rows)
    return {
        "heat_range": heat_range, "geometry": inspection.full_geometry(result),
        "depth": inspection.depth_grid(result), "matches": matches,
    }  # fmt: skip


def _of_many(result: StitchResult, take: list[str], files: Folder) -> dict[str, Any]:
    """The same of more than two pictures; their layers one at a time."""
    for number, picture in enumerate(result.pictures):
        if {"layers", "masks"} & set(take):
            _add_picture(picture.name, result.full_layer(number).within(result.spread), take, files)
    if "masks" in take:
        labels = result.full_labels()
        if labels is not None:
            files.add_mask("labels", (labels + 1).astype(np.uint8))
        if result.inpainted.any():
            files.add_mask("inpainted", _levels(whole(result.in_full(result.inpainted.astype(np.float32), 0.0))))
        files.add_mask("confidence", _levels(whole(result.in_full(result.confidence, 0.0))))
    if "depth" in take and inspection.has_depth(result):
        files.add_depth(whole(result.in_full(result.warp.depth, 0.0)))
    return {
        "geometry": inspection_of_many.full_geometry(result), "depth": inspection_of_many.depth_grid(result),
    }  # fmt: skip


def _add_picture(name: str, layer: Layer, take: list[str], files: Folder) -> None:
    if "layers" in take:
        files.add_layer(f"{name} layer", layer)
    if "masks" in take:
        files.add_mask(f"{name} mask", _levels(layer.alpha))


def _levels(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Values from 0 to 1 in 255 steps."""
    levels: NDArray[np.uint8] = np.rint(np.asarray(values, np.float32) * 255).astype(np.uint8)
    return levels


def _painted(further: NDArray[np.bool_], shows: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """A seam in the form that a painted one has: RGBA (H, W, 4), white where the target is shown, transparent where
    nothing is."""
    gray, alpha = (np.where(mask, 255, 0).astype(np.uint8) for mask in (further, shows))
    return np.dstack([gray, gray, gray, alpha])
