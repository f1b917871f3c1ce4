"""Lenses in camera files: from JSON to `Lens` and back (docs/formats.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..system.errors import BadRequest
from .camera import Camera
from .lens_models import Lens, LensProjection

_KEYS = ("projection", "angular", "ptlens", "radius_px")


def lens_of(entry: Any, K: np.ndarray[Any, Any], size: tuple[int, int], name: str) -> Lens:
    """The lens that a camera file tells.

    Parameters
    ----------
    entry : dict
        {"projection": of `LensProjection`, "angular": [k1, k2, k3, k4]?, "ptlens": [a, b, c]?, "radius_px": R?}, with R
        half of the picture's shorter side where it is not told.
    K : (3, 3)
        Of its picture, px.
    size : (int, int)
        (W, H) px of its picture.
    name : str
        What the picture is called.

    Raises
    ------
    BadRequest
        With what is wrong with it.
    """
    place = f"the lens of {name}"
    if not isinstance(entry, dict):
        raise BadRequest(f'{place}: an object like {{"projection": "equidistant"}} is needed')
    unknown = [str(key) for key in entry if key not in _KEYS]
    if unknown:
        raise BadRequest(f"{place}: {', '.join(unknown[:5])} is not known; there are {', '.join(_KEYS)}")
    projection = entry.get("projection", LensProjection.RECTILINEAR)
    if projection not in list(LensProjection):
        raise BadRequest(f"{place}: the projection is {projection!r}; there are {', '.join(LensProjection)}")
    angular = _numbers(entry, "angular", 4, place)
    if any(angular) and projection != LensProjection.EQUIDISTANT:
        raise BadRequest(f"{place}: angular coefficients go with the projection equidistant, not {projection}")
    half = _numbers({"radius_px": [entry.get("radius_px", min(size) / 2)]}, "radius_px", 1, place)[0]
    if not half > 0:
        raise BadRequest(f"{place}: radius_px is {half:g}; it is where the polynomial is 1, and above 0")
    ptlens = _numbers(entry, "ptlens", 3, place)
    lens = Lens(LensProjection(projection), angular, ptlens, half / float(K[0, 0]) if any(ptlens) else 1.0)
    if not lens.limit > 0:
        raise BadRequest(f"{place}: it folds on its axis, so that no ray can be told from another; check its numbers")
    return lens


def lens_entry(camera: Camera) -> dict[str, Any] | None:
    """What a camera file says of a camera's lens besides its distortion; None where that is all."""
    lens = camera.lens
    if lens is None:
        return None
    angular = {"angular": list(lens.angular)} if any(lens.angular) else {}
    ptlens = {"ptlens": list(lens.ptlens), "radius_px": lens.radius * camera.focal} if any(lens.ptlens) else {}
    return {"projection": str(lens.projection), **angular, **ptlens}


def _numbers(entry: dict[str, Any], key: str, count: int, place: str) -> tuple[float, ...]:
    """Up to so many finite numbers; 0 for those that are missing."""
    given = entry.get(key) or []
    try:
        values = np.asarray(given, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        values = np.full(1, np.nan)
    if len(values) > count or not np.isfinite(values).all():
        raise BadRequest(f"{place}: {key} must be {count} number{'s' if count > 1 else ''}")
    return tuple(float(value) for value in np.pad(values, (0, count - len(values))))
