"""An equirectangular picture as flat views of one place, whose rotations between each other are known exactly.

Axes of a sphere: x to the right and y down as its middle sees them, z to its middle. A pixel (u, v) of a whole sphere
of W × H px shows the direction 2π ((u + ½) / W − ½) to the right and π ((v + ½) / H − ½) below the horizon.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera, ViewOf
from ..cameras.lens_models import Lens
from ..pictures.gpano import SpherePart
from ..pictures.naming import VIEWS, view_name
from ..pictures.picture import Picture
from ..raster.arrays import Array, Part, bounds, dilated, larger_parts, small_strips
from ..raster.lazy import Coded, whole
from ..raster.log_encoding import log_decode, log_encode
from ..raster.sampling import fetch
from ..system.errors import UnreadableImage
from .options import SPHERES

# Where views look: degrees to the right of the middle of what the sphere shows, and upwards.
_LOOKS = (*((60.0 * number, 0.0) for number in range(6)), (0.0, 90.0), (0.0, -90.0))


def views_of_sphere(picture: Picture, part: SpherePart, number: int) -> Iterator[tuple[Picture, Camera]]:
    """The views that a sphere, or a part of one, is worked with as; those in which it shows nothing are left out.

    Parameters
    ----------
    picture : Picture
    part : SpherePart
        What of a sphere it shows.
    number : int
        Of the picture among all that are given, by which its views are known to belong together.

    Yields
    ------
    Picture
        At the sphere's own resolution, transparent where the sphere shows nothing.
    Camera
        Known exactly, but for how the sphere was held.

    Raises
    ------
    UnreadableImage
        The sphere is absurdly larger than the picture, or no view shows anything.
    """
    if part.full[0] > SPHERES.most_times * max(part.box[2:]):
        raise _too_large(picture, part)
    sphere, nothing = _Sphere.of(picture, part), True
    middle = 360 * ((part.box[0] + part.box[2] / 2) / part.full[0] - 0.5)
    for name, (heading, pitch) in zip(VIEWS, _LOOKS, strict=True):
        turn = _rotation(middle + heading, pitch)
        across, down = SPHERES.pole_deg if pitch else SPHERES.ring_deg
        found = _cut_out(sphere, turn, across, down)
        if found is None:
            continue
        nothing = False
        view, K = found
        height, width = view.view.shape[:2]
        camera = Camera(
            K, (width, height), "its sphere", 0.0, lens=Lens(), view_of=ViewOf(number, picture.name, turn)
        )
        yield replace(view, name=view_name(picture.name, name)), camera
    if nothing:
        raise UnreadableImage(
            f"{picture.name}: as a sphere it shows nothing, or next to nothing: it is black, transparent or ignored as "
            "good as everywhere, or GPano's numbers put it at a pole; leave it out, or export it again"
        )


def _too_large(picture: Picture, part: SpherePart) -> UnreadableImage:
    (width, height), own = part.full, part.box[2:]
    return UnreadableImage(
        f"{picture.name}: it says that its {own[0]}×{own[1]} px are a part of a sphere of {width:.7g}×{height:.7g} px, "
        "whose views would be too large for what it shows: write GPano's numbers of the right sphere into it, or "
        "remove them"
    )


def _rotation(heading: float, pitch: float) -> Array:
    """From a sphere's axes to those of a view that looks so many degrees to the right and up."""
    yaw, rise = np.radians([heading, pitch])
    right = [np.cos(yaw), 0, -np.sin(yaw)]
    ahead = [np.sin(yaw) * np.cos(rise), -np.sin(rise), np.cos(yaw) * np.cos(rise)]
    return np.array([right, np.cross(ahead, right), ahead])


@dataclass(frozen=True, eq=False)
class _Sphere:
    """A picture and what of a sphere it shows; values: its levels, or its light log-encoded, view: what features see of
    it where that is something else, opaque: where it shows something (H, W) float32; all with a margin of `margin` px
    (`_padded`)."""

    picture: Picture
    part: SpherePart
    values: NDArray[Any]
    view: NDArray[Any] | None
    opaque: NDArray[np.float32]
    margin: int

    @staticmethod
    def of(picture: Picture, part: SpherePart) -> _Sphere:
        light = picture.light
        coded = isinstance(light, Coded)
        values = light.levels if isinstance(light, Coded) else log_encode(whole(light))
        margin = SPHERES.margin_px
        shown = ~_missing(picture)
        # the four pixels a side that cubic interpolation takes have to show something
        opaque = (~dilated(~shown, 1)).astype(np.float32)
        view = None if coded and values.dtype == np.uint8 else picture.view
        return _Sphere(
            picture, part, _padded(values, part, margin), None if view is None else _padded(view, part, margin),
            _padded(opaque, part, margin), margin,
        )  # fmt: skip


def _missing(picture: Picture) -> NDArray[np.bool_]:
    """Where a sphere shows nothing (H, W): where it is transparent, and where it is black from a pole on, as files
    without transparency are."""
    hidden = np.zeros(picture.view.shape[:2], bool) if picture.alpha is None else picture.alpha < 1
    black = picture.view.max(axis=2) <= SPHERES.black
    if not (black[0].any() or black[-1].any()):
        return hidden
    _, number = cv2.connectedComponents(black.astype(np.uint8), connectivity=4)
    at_pole = np.setdiff1d(np.concatenate([number[0], number[-1]]), 0)
    missing = larger_parts(np.isin(number, at_pole), round(SPHERES.least_missing * black.size))
    return hidden | dilated(missing, SPHERES.missing_margin_px) if missing.any() else hidden


def _padded(values: NDArray[Any], part: SpherePart, margin: int) -> NDArray[Any]:
    """Values (H, W[, C]) of a sphere with a margin: at the ends of a whole turn the other end, else the border."""
    flat = values.reshape(*values.shape[:2], -1)
    higher = np.pad(flat, [(margin, margin), (0, 0), (0, 0)], mode="edge")
    return np.pad(higher, [(0, 0), (margin, margin), (0, 0)], mode="wrap" if part.box[2] == part.full[0] else "edge")


def _cut_out(sphere: _Sphere, turn: Array, across: float, down: float) -> tuple[Picture, Array] | None:
    """A view of so many degrees, as large as what it shows of the sphere, and its intrinsics; None where that is next
    to nothing that its neighbours do not show."""
    focal = sphere.part.full[0] / (2 * np.pi)
    width, height = (2 * int(np.ceil(focal * np.tan(np.radians(degrees) / 2))) for degrees in (across, down))
    K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    around = _with_margin(sphere.part, turn, K, (width, height))
    if around is None:
        return None
    top, left = around[0].start, around[1].start
    shown = np.zeros((around[0].stop - top, around[1].stop - left), bool)
    own = sphere.part.box[2] * sphere.part.box[3]
    if shown.size > max(SPHERES.most_empty * own, SPHERES.small_px):
        raise _too_large(sphere.picture, sphere.part)
    K[:2, 2] -= left, top
    for rows in small_strips(shown.shape):
        maps = _map(sphere, turn, K, rows, slice(0, shown.shape[1]))
        shown[rows] = fetch(sphere.opaque, *maps, cv2.INTER_LINEAR)[..., 0] >= 1
    part = bounds(shown)
    aside = round((1 - SPHERES.own_share) / 2 * width)
    alone = shown[:, max(0, aside - left) : max(0, width - aside - left)].sum()
    if part is None or alone < min(SPHERES.least_shown * width * height, SPHERES.least_of_own * own):
        return None
    K[:2, 2] -= part[1].start, part[0].start
    return _picture_of(sphere, turn, K, shown[part]), K


def _with_margin(part: SpherePart, turn: Array, K: Array, size: tuple[int, int]) -> Part | None:
    """Rows and columns of a view of (W, H) px beyond which it shows nothing of a part of a sphere, by a grid of points
    of that; None where it shows nothing at all."""
    (left, top, width, height), full = part.box, part.full
    u, v = (np.linspace(-0.5, side - 0.5, SPHERES.grid) for side in (width, height))
    heading = 2 * np.pi * ((u + left + 0.5) / full[0] - 0.5)
    fall = np.pi * ((v + top + 0.5) / full[1] - 0.5)[:, None]
    rays = np.stack(np.broadcast_arrays(np.cos(fall) * np.sin(heading), np.sin(fall), np.cos(fall) * np.cos(heading)))
    x, y, z = turn @ rays.reshape(3, -1)
    ahead = z > SPHERES.least_ahead
    points = np.stack([x, y])[:, ahead] / z[ahead] * K[0, 0] + K[:2, 2:]
    # what lies between the points is not further from one, as a view stretches it
    margin = SPHERES.grid_margin * max(width, height) / (SPHERES.grid - 1) + SPHERES.margin_px
    near = np.all((points > -margin) & (points.T < np.array(size) + margin).T, axis=0)
    if not near.any():
        return None
    first = np.maximum(np.floor(points[:, near].min(axis=1) - margin), 0).astype(int)
    last = np.minimum(np.ceil(points[:, near].max(axis=1) + margin) + 1, size).astype(int)
    return (slice(first[1], last[1]), slice(first[0], last[0])) if np.all(first < last) else None


def _picture_of(sphere: _Sphere, turn: Array, K: Array, shown: NDArray[np.bool_]) -> Picture:
    height, width = shown.shape
    picture, values = sphere.picture, sphere.values
    out = np.empty((height, width, values.shape[2]), values.dtype)
    view = None if sphere.view is None else np.empty((height, width, sphere.view.shape[2]), np.uint8)
    for rows in small_strips(out.shape):
        maps = _map(sphere, turn, K, rows, slice(0, width))
        out[rows] = fetch(values, *maps)
        if view is not None and sphere.view is not None:
            view[rows] = fetch(sphere.view, *maps)
    light = Coded(out, picture.light.curves) if isinstance(picture.light, Coded) else log_decode(out)
    alpha = None if shown.all() else shown.astype(np.float32)
    return replace(
        picture, light=light, alpha=alpha, view=out if view is None else view, surround=False, part=None, warnings=()
    )


def _map(
    sphere: _Sphere, turn: Array, K: Array, rows: slice, columns: slice
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """px of the sphere with its margin that pixels of a view show (h, w), NaN beyond what it has."""
    v, u = np.mgrid[rows, columns].astype(np.float64)
    rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=-1) @ turn
    ahead = np.hypot(rays[..., 0], rays[..., 2])
    heading, fall = np.arctan2(rays[..., 0], rays[..., 2]), np.arctan2(rays[..., 1], ahead)
    (left, top, width, height), (full_width, full_height) = sphere.part.box, sphere.part.full
    x = (heading / (2 * np.pi) + 0.5) * full_width - 0.5 - left
    y = (fall / np.pi + 0.5) * full_height - 0.5 - top
    # half a pixel further where the sphere goes on over its border
    aside, above, below = 0.5 * np.array([width == full_width, top == 0, top + height == full_height])
    outside = (x < -aside) | (x > width - 1 + aside) | (y < -above) | (y > height - 1 + below)
    x, y = np.where(outside, np.nan, x) + sphere.margin, np.where(outside, np.nan, y) + sphere.margin
    return x.astype(np.float32), y.astype(np.float32)
