"""A camera of a synthetic scene: its axes are OpenCV's (x right, y down, z forward), the world's are the scene's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # Blender renders with these, and has no OpenCV
    from ..core.raster.arrays import Array


@dataclass(frozen=True)
class SceneCamera:
    """K (3, 3) px, R, t: a world point X is seen at K (R X + t); size (W, H) px; pixel centres are integers.

    k1: radial distortion of its lens (`sets.bent_lens`); none of pairs.
    """

    K: Array
    R: Array
    t: Array
    size: tuple[int, int]
    k1: float = 0.0

    @property
    def place(self) -> Array:
        """Where the camera stands in the world (3,)."""
        return -self.R.T @ self.t

    def widened(self, left: int, top: int, width: int, height: int) -> SceneCamera:
        """The same with an ideal lens and a larger sensor, whose first pixel lies at (left, top) of this picture."""
        K = self.K.copy()
        K[:2, 2] -= (left, top)
        return SceneCamera(K, self.R, self.t, (width, height))
