"""Where the frame that is chosen now lies in what is shown: over the panorama that was made before, and over its
pictures. From what a result keeps, without a stitch. No bpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.cameras.camera import Camera
from ...core.cameras.lens import distort, undistort
from ...core.cameras.projective import homogeneous
from ...core.cameras.view import View
from ...core.compose.outline import border_of, frame_outline
from ...core.panorama.canvas import border
from ...core.panorama.framing import FrameRequest
from ...core.raster.arrays import Array
from ..scene.scene_geometry import matrix, projection_of, viewpoint_of
from . import overlay_geometry as geometry_of
from .overlay_geometry import TARGET
from .picture_points import posed_cameras


def frame_border(known: dict[str, Any], frame: dict[str, Any], then: dict[str, Any]) -> Array | None:
    """Rays (N, 3) around the frame that options ask for, closed; None where it cannot be told.

    known: a result's `geometry`, `report` and `depth`; frame: see `engine_options.frame_of`; then: the same of what the
    result was made with, of which all that was chosen and is asked for again is kept.
    """
    views = [_view(*one) for one in posed_cameras(known["geometry"])]
    if not all(np.isfinite(view.R).all() and np.isfinite(view.t).all() for view in views):
        return None
    found = frame_outline(_request(known, frame, then), _crop(frame["crop"]), views, _outlines(known, views))
    return None if found is None else border_of(*found)


def on_panorama(known: dict[str, Any], rays: Array) -> Array:
    """px (N, 2) of a result's panorama that show rays (N, 3) of the reference's frame, NaN where it cannot."""
    projection = projection_of(known)
    if projection is not None:
        points = projection.points(rays)
        return np.where(np.isfinite(points), points, np.nan)
    return _pinhole(rays, matrix(known["geometry"]["K_canvas"]))


def on_picture(known: dict[str, Any], rays: Array, side: str) -> Array:
    """px (N, 2) of a picture where it shows what a result's panorama shows along rays (N, 3); NaN behind its camera."""
    geometry, camera = known["geometry"], geometry_of.cameras_of(known["geometry"])[side]
    viewpoint = viewpoint_of(known)
    places = np.zeros_like(rays) if viewpoint is None else viewpoint.place(rays)
    d = geometry_of.depth_at(known, np.nan_to_num(on_panorama(known, rays), posinf=1e6, neginf=-1e6))
    if projection_of(known) is None:  # there d is that of points with z = 1
        d = d * np.maximum(rays[:, 2], 0)
    seen = rays + d[:, None] * places
    if side == TARGET:
        seen = seen @ matrix(geometry["R"]).T + d[:, None] * matrix(geometry["t"])
    return distort(_pinhole(seen, camera.K), camera)


def closed_pieces(points: Array, width: float) -> Array:
    """A polyline (N, 2) as line segments (2·M, 2), without those that are not known or go right across a sphere."""
    pieces = geometry_of.segments(points).reshape(-1, 2, 2)
    known = np.isfinite(pieces).all(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        known &= np.abs(pieces[:, 1, 0] - pieces[:, 0, 0]) < max(width, 1.0)
    kept: Array = pieces[known].reshape(-1, 2)
    return kept


def _request(known: dict[str, Any], frame: dict[str, Any], then: dict[str, Any]) -> FrameRequest:
    """What is asked for; what was chosen by itself before, and is to be chosen so again, stays."""
    told = known["report"]["canvas"]["projection"]
    if frame["projection"] == "reference":
        return FrameRequest("perspective", level="none")
    kind, _, words = frame["projection"].partition(":")
    distance = float(words) if words else None
    if kind == "auto" and then["projection"] == "auto":
        kind, distance = told["kind"], told.get("distance")
    level = frame["level"]
    if level == "auto" and then["level"] == "auto" and then["projection"] != "reference":
        level = told["level"]
    level = level if isinstance(level, str) else tuple(float(angle) for angle in level)
    centre = frame["centre"]
    return FrameRequest(kind, distance, level, None if centre is None else (centre[0], centre[1]), frame["fov"])


def _crop(crop: Any) -> Any:
    return crop if isinstance(crop, str) else tuple(crop)


def _view(camera: Camera, R: Array, t: Array) -> View:
    nothing = np.full((3, 3), np.nan)  # what framing does not ask for
    return View(camera, camera.K, R, t, nothing, nothing[0])


def _outlines(known: dict[str, Any], views: Sequence[View]) -> list[Array]:
    """Rays around each picture as a panorama shows them, at its usual depth."""
    viewpoint = viewpoint_of(known)
    depths = matrix(known["depth"]["inverse_depth"])
    near = depths[np.isfinite(depths) & (depths > 0)]
    usual = float(np.median(near)) if near.size else 0.0
    found = []
    for view in views:
        own = homogeneous(undistort(border(view.size), view.camera)) @ np.linalg.inv(view.K).T
        own = own / np.linalg.norm(own, axis=1, keepdims=True)
        # a point at x and inverse depth d along its ray r lies at (Rᵀ r − d Rᵀ t) / d
        seen = own @ view.R - usual * (view.R.T @ view.t)
        found.append(seen if viewpoint is None else viewpoint.seen_from(seen, np.full(len(seen), usual))[0])
    return found


def _pinhole(seen: Array, K: Array) -> Array:
    """px (N, 2) of directions (N, 3) in a camera's own axes, NaN behind it."""
    ahead = np.where(seen[:, 2:] > 1e-6, seen[:, 2:], np.nan)
    points: Array = (seen / ahead @ K.T)[:, :2]
    return points
