"""The camera of a fisheye's circle, of which nothing is known but what it shows."""

from __future__ import annotations

import numpy as np

from .camera import Camera
from .lens_models import Lens, LensProjection
from .options import INTRINSICS


def camera_of_circle(circle: tuple[float, float, float], size: tuple[int, int]) -> Camera:
    """A camera that shows as many degrees as most fisheyes in a circle.

    Parameters
    ----------
    circle : (float, float, float)
        Its middle x, y and its radius, px.
    size : (int, int)
        (W, H) px of the picture.

    Returns
    -------
    Camera
        Of an equidistant lens.
    """
    x, y, radius = circle
    focal = radius / np.radians(INTRINSICS.circle_deg / 2)
    K = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
    return Camera(K, size, "its circle", 0.0, lens=Lens(LensProjection.EQUIDISTANT))


def assumed_of_circle(name: str) -> str:
    """What is said of a picture of this name whose lens was taken for such a one."""
    return (
        f"{name} is the circle of a fisheye: it is taken for that of an equidistant lens which shows "
        f"{INTRINSICS.circle_deg:.0f}°; if it is another one, give it by --cameras"
    )
