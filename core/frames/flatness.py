"""Pictures that are no flat photographs, found before anything is made of them: spheres are worked with as flat views
(`spheres`); what cannot be is refused here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.gpano import whole_sphere
from ..pictures.picture import Picture
from ..raster.arrays import Array
from ..system.errors import UnreadableImage
from .options import FLATNESS

Kind = Literal["flat", "sphere", "surround", "circle", "circles", "transparent"]
_ADVICE = {
    "surround": "it says that it shows directions all around, but not as an equirectangular sphere (2:1, or with "
    "GPano's numbers of the whole one): export it as such a sphere, or give the photographs that it was made from",
    "circles": "it shows two circles of fisheye lenses on black: cut them apart into two pictures, or make a sphere of "
    "them with the camera maker's program",
    "transparent": "it is entirely transparent: export it without transparency, or with the right one",
}
_FOUND = (
    "taken for a whole sphere because its ends meet, which its file does not say; if it is a flat photograph, crop it "
    "to another shape than 2:1"
)


def usable(picture: Picture) -> Picture:
    """The picture; of a sphere with the part of it that it shows, which files need not say, and with a warning where
    they do not; of a fisheye with its circle. Refuses (UnreadableImage) what shows nothing, what goes around in another
    way than a sphere, and two circles of fisheyes, with what to do."""
    kind, circle = _kind_and_circle(picture)
    if picture.part is None and kind == "sphere":
        height, width = picture.view.shape[:2]
        return replace(picture, part=whole_sphere((width, height)), warnings=(*picture.warnings, _FOUND))
    if kind in _ADVICE:
        raise UnreadableImage(f"{picture.name}: {_ADVICE[kind]}")
    return picture if circle is None else replace(picture, circle=circle)


def kind_of(picture: Picture) -> Kind:
    """What a picture is: a flat photograph, or one of those that need another projection, or none."""
    return _kind_and_circle(picture)[0]


def _kind_and_circle(picture: Picture) -> tuple[Kind, tuple[float, float, float] | None]:
    """The same, and the circle where it is one (see `Picture.circle`)."""
    if picture.alpha is not None and not picture.alpha.any():
        return "transparent", None
    if not picture.surround:  # first: black ends meet as well
        circles = _circles_in(picture.view)
        if circles:
            return ("circle", circles[0]) if len(circles) == 1 else ("circles", None)
    if picture.part is not None or (not picture.surround and _ends_meet(picture.view)):
        return "sphere", None
    return "surround" if picture.surround else "flat", None


def _ends_meet(view: NDArray[np.uint8]) -> bool:
    """Whether a picture twice as wide as high goes on from its right end at its left one, and has poles for rows.
    Frames, backdrops and skies meet as well: they are plain along the ends, or as much alike further in."""
    height, width = view.shape[:2]
    if abs(width - 2 * height) > FLATNESS.sphere_aspect * width or height < FLATNESS.least_side:
        return False
    size = min(FLATNESS.sphere_columns, width)
    small = _resized(view, (size, size // 2)).astype(np.float64)
    rows = small.shape[0]
    beside = np.abs(small - np.roll(small, 1, axis=1)).mean(axis=(0, 2))  # the first one: across the ends
    apart = float(np.abs(small - np.roll(small, size // 2, axis=1)).mean())
    spread = small.std(axis=1).mean(axis=1)
    middle = float(np.median(spread[rows // 4 : -rows // 4]))
    along = small.std(axis=0).mean(axis=1)
    in_by = FLATNESS.ends_in
    further = float(np.abs(small[:, in_by] - small[:, -1 - in_by]).mean())
    shows = (
        middle >= FLATNESS.least_spread
        and min(along[0], along[-1]) >= max(FLATNESS.least_spread, FLATNESS.ends_along * np.median(along))
        and further >= FLATNESS.ends_further * apart
    )
    return bool(
        shows
        and beside[0] <= FLATNESS.ends_beside * np.median(beside[1:]) + 1
        and beside[0] <= FLATNESS.ends_apart * apart
        and max(spread[0], spread[-1]) <= FLATNESS.pole_spread * middle
    )


def _circles_in(view: NDArray[np.uint8]) -> list[tuple[float, float, float]]:
    """The circle on black that is all that a picture shows, or two beside each other: middles x, y and radii, px."""
    if min(view.shape[:2]) < FLATNESS.least_side:
        return []
    height, width = view.shape[:2]
    double = abs(width - 2 * height) <= FLATNESS.double_aspect * width
    share = min(1.0, FLATNESS.circle_side / max(height, width // 2 if double else width))
    small = _resized(view, (max(1, round(width * share)), max(1, round(height * share)))).max(axis=2)
    middle = small.shape[1] // 2
    found = []
    for part in [small[:, :middle], small[:, middle:]] if double else [small]:
        circle = _circle_of(part)
        if circle is None:
            return []
        x, y = ((circle[0] + 0.5) / share - 0.5).tolist()
        found.append((x, y, circle[1] / share))
    return found


def _circle_of(small: NDArray[np.uint8]) -> tuple[Array, float] | None:
    small = np.ascontiguousarray(small)
    lit = cv2.medianBlur(small, 5) > FLATNESS.black
    corners = [lit[:4, :4], lit[:4, -4:], lit[-4:, :4], lit[-4:, -4:]]
    if any(corner.any() for corner in corners) or lit.mean() < FLATNESS.circle_share:
        return None
    points = _outline(lit)
    circle = _fitted(points, max(small.shape))
    if circle is None:
        return None
    centre, radius = circle
    row, column = np.mgrid[: small.shape[0], : small.shape[1]]
    off = np.hypot(column - centre[0], row - centre[1])
    outside = off > FLATNESS.outside * radius
    at_rim = np.abs(off / radius - FLATNESS.inside) < 0.01
    shown = (
        outside.mean() > FLATNESS.least_outside
        and (small[outside] <= FLATNESS.black).mean() > FLATNESS.black_outside
        and np.median(small[at_rim]) > FLATNESS.bright_rim
    )
    return circle if shown else None


def _outline(lit: NDArray[np.bool_]) -> Array:
    """Where rows and columns begin and end to show something (N, 2), but at the border of the picture."""
    found = []
    for axis in (0, 1):
        mask = lit if axis == 0 else lit.T
        which = np.flatnonzero(mask.any(axis=1))
        first, last = mask[which].argmax(axis=1), mask.shape[1] - 1 - mask[which, ::-1].argmax(axis=1)
        for places in (first, last):
            inner = (places > 1) & (places < mask.shape[1] - 2)
            points = np.column_stack([places[inner], which[inner]])
            found.append(points if axis == 0 else points[:, ::-1])
    outline: Array = np.concatenate(found).astype(np.float64)
    return outline


def _fitted(points: Array, side: int) -> tuple[Array, float] | None:
    """Centre (2,) and radius of the circle that most of the points lie on, None where they lie on none."""
    kept = np.ones(len(points), bool)
    for _ in range(FLATNESS.fits):
        if kept.sum() < FLATNESS.least_points:
            return None
        x, y = points[kept].T
        a, b, c = np.linalg.lstsq(np.column_stack([2 * x, 2 * y, np.ones_like(x)]), x * x + y * y, rcond=None)[0]
        centre, radius = np.array([a, b]), float(np.sqrt(max(c + a * a + b * b, 0.0)))
        off = np.abs(np.hypot(*(points - centre).T) - radius)
        kept = off < max(1.5, FLATNESS.on_circle * side)
    turns = np.degrees(np.arctan2(*(points[kept] - centre).T[::-1]))
    covered = len(np.unique(turns // FLATNESS.sector_deg)) * FLATNESS.sector_deg
    round_enough = kept.mean() > FLATNESS.share_on_circle and covered > FLATNESS.covered_deg
    return (centre, radius) if round_enough and radius > FLATNESS.least_radius * side else None


def _resized(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    shrunk: NDArray[np.uint8] = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return shrunk.reshape(size[1], size[0], *image.shape[2:])
