"""Views of a painted world of any range of brightness, and pictures of them by exposure; shared by the tests of
brackets."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.synthetic_scenes.rendered import expose

WIDTH, HEIGHT = 480, 360


def painted_world(stops: float = 7.0, seed: int = 2, size: tuple[int, int] = (1200, 500)) -> np.ndarray:
    """Radiance (H, W, 3) float32: spots of all sizes over a range of stops, white at the middle of it."""
    random = np.random.default_rng(seed)
    width, height = size
    out = np.zeros((height, width), np.float32)
    for sigma in (1.5, 3, 6, 12, 25, 50):
        spots = cv2.GaussianBlur(random.standard_normal((height, width)).astype(np.float32), (0, 0), sigma)
        out += spots / spots.std() * sigma**0.3
    out = np.clip(out / (2.5 * out.std()), -1, 1) * stops / 2
    tint = np.array([1.0, 0.8, 0.6], np.float32)
    return (2.0 ** out[..., None] * 0.2 * tint).astype(np.float32)


def shot(
    light: np.ndarray, stops: float = 0.0, name: str = "a", noise: float = 1.0, seed: int = 0, **exif: object
) -> Picture:
    """The 8-bit picture (sRGB) of a view's light, exposed by so many stops more."""
    random = np.random.default_rng([seed, int(1000 * (stops + 20))])
    taken = expose(light, (2.0**stops,) * 3, noise, False, random)
    picture = picture_from_array(taken, name)
    return picture if not exif else Picture(
        picture.light, None, picture.view, 8, Exif(**exif), None, name
    )  # type: ignore[arg-type]


def view_of(world: np.ndarray, x: float = 100.0, y: float = 60.0, turn: float = 0.0) -> np.ndarray:
    """What a camera shows whose frame begins at px x, y of the world and is turned by degrees about its middle."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    to_world = np.column_stack([[[c, -s], [s, c]], middle - np.array([[c, -s], [s, c]]) @ middle + [x, y]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(world, to_world, (WIDTH, HEIGHT), flags=flags)


def bracket_of(light: np.ndarray, name: str = "a", stops: Sequence[float] = (0.0, -2.0, 2.0)) -> list[Picture]:
    """Exposures of one view from a tripod."""
    return [shot(light, one, f"{name}{one:+g}.png") for one in stops]


def exposure_tags(seconds: tuple[int, int], aperture: tuple[int, int] = (8, 1), iso: int = 100) -> Exif:
    """EXIF of an exposure."""
    return Exif(make="Ann", model="X", kept=((33434, seconds), (33437, aperture), (34855, iso)))
