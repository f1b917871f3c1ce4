"""The camera that sees all directions from one place: Blender's equirectangular panorama, upright, +y in its middle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # Blender renders with these, and has no OpenCV
    from ...core.raster.arrays import Array


@dataclass(frozen=True)
class SphereCamera:
    """place (3,) in the world; size (W, H) px, W = 2 H; pixel centres are integers.

    A pixel shows azimuth 2π ((x + ½) / W − ½) to the right of +y at elevation π (½ − (y + ½) / H).
    """

    place: Array
    size: tuple[int, int]

    def directions(self, x: Array, y: Array) -> Array:
        """Unit directions (…, 3) in the world that pixels x, y (…) show."""
        width, height = self.size
        azimuth, up = 2 * np.pi * ((x + 0.5) / width - 0.5), np.pi * (0.5 - (y + 0.5) / height)
        level = np.cos(up)
        directions: Array = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(up)], axis=-1)
        return directions

    def all_directions(self) -> Array:
        """The same (H, W, 3) for all its pixels."""
        width, height = self.size
        return self.directions(*np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)))

    def pixels(self, directions: Array) -> tuple[Array, Array]:
        """x, y (…) of the pixels that show directions (…, 3) of any length; −½ ≤ x < W − ½."""
        width, height = self.size
        azimuth = np.arctan2(directions[..., 0], directions[..., 1])
        up = np.arctan2(directions[..., 2], np.hypot(directions[..., 0], directions[..., 1]))
        return (azimuth / (2 * np.pi) + 0.5) * width - 0.5, (0.5 - up / np.pi) * height - 0.5
