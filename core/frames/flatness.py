"""Pictures that are no flat photographs, found before anything is made of them.

Here they are refused. What is to become of spheres and fisheye circles as inputs begins at `kind_of`.
"""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture
from ..raster.arrays import Array
from ..system.errors import UnreadableImage
from .options import FLATNESS

Kind = Literal["flat", "sphere", "circle", "transparent"]
_ADVICE = {
    "sphere": "it shows a whole turn (an equirectangular or cylindrical panorama), no flat photograph: cut flat views "
    "out of it with a panorama program, or give the photographs that it was made from",
    "circle": "it is the circle of a fisheye lens on black: give the lens (--cameras), or turn it into a flat one with "
    "a lens correction program first",
    "transparent": "it is entirely transparent: export it without transparency, or with the right one",
}


def check_flat(picture: Picture, lens_given: bool = False) -> None:
    """Refuses (UnreadableImage) what shows nothing, a whole sphere, or, if no lens is given, a fisheye's circle, with
    what to do."""
    kind = kind_of(picture)
    if kind != "flat" and not (kind == "circle" and lens_given):
        raise UnreadableImage(f"{picture.name}: {_ADVICE[kind]}")


def kind_of(picture: Picture) -> Kind:
    """What a picture is: a flat photograph, or one of those that need another projection, or none."""
    if picture.alpha is not None and not picture.alpha.any():
        return "transparent"
    if not picture.surround and _shows_circles(picture.view):  # first: black ends meet as well
        return "circle"
    return "sphere" if picture.surround or _ends_meet(picture.view) else "flat"


def _ends_meet(view: NDArray[np.uint8]) -> bool:
    """Whether a picture twice as wide as high goes on from its right end at its left one, and has poles for rows."""
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
    return bool(
        beside[0] <= FLATNESS.ends_beside * np.median(beside[1:]) + 1
        and beside[0] <= FLATNESS.ends_apart * apart
        and max(spread[0], spread[-1]) <= FLATNESS.pole_spread * middle
    )


def _shows_circles(view: NDArray[np.uint8]) -> bool:
    """Whether all that a picture shows is a circle on black, or two beside each other."""
    if min(view.shape[:2]) < FLATNESS.least_side:
        return False
    height, width = view.shape[:2]
    double = abs(width - 2 * height) <= FLATNESS.double_aspect * width
    share = min(1.0, FLATNESS.circle_side / max(height, width // 2 if double else width))
    small = _resized(view, (max(1, round(width * share)), max(1, round(height * share)))).max(axis=2)
    middle = small.shape[1] // 2
    return all(_is_circle(half) for half in ([small[:, :middle], small[:, middle:]] if double else [small]))


def _is_circle(small: NDArray[np.uint8]) -> bool:
    small = np.ascontiguousarray(small)
    lit = cv2.medianBlur(small, 5) > FLATNESS.black
    corners = [lit[:4, :4], lit[:4, -4:], lit[-4:, :4], lit[-4:, -4:]]
    if any(corner.any() for corner in corners) or lit.mean() < FLATNESS.circle_share:
        return False
    points = _outline(lit)
    circle = _fitted(points, max(small.shape))
    if circle is None:
        return False
    centre, radius = circle
    row, column = np.mgrid[: small.shape[0], : small.shape[1]]
    off = np.hypot(column - centre[0], row - centre[1])
    outside = off > FLATNESS.outside * radius
    at_rim = np.abs(off / radius - FLATNESS.inside) < 0.01
    return bool(
        outside.mean() > FLATNESS.least_outside
        and (small[outside] <= FLATNESS.black).mean() > FLATNESS.black_outside
        and np.median(small[at_rim]) > FLATNESS.bright_rim
    )


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
