"""What warp and dense refinement need of one picture: how its camera stands to the reference's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..raster.arrays import Array
from .camera import Camera
from .two_view import TwoView


@dataclass(frozen=True, eq=False)
class View:
    """A canvas point p at inverse depth d is seen at H_inf p + d e_prime (docs/method.md), before the lens.

    camera: its lens and size; K (3, 3) px as the geometry took it; R (3, 3), t (3,): it sees X of the reference's frame
    at R X + t; H_inf = K R K_reference⁻¹; e_prime = K t. Of the reference itself R = H_inf = I and t = e_prime = 0. NaN
    where a model does not know one.
    """

    camera: Camera
    K: Array
    R: Array
    t: Array
    H_inf: Array
    e_prime: Array

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the picture."""
        return self.camera.size


def views_of(two_view: TwoView, cameras: tuple[Camera, ...]) -> tuple[View, ...]:
    """The views of a pair: the reference's first."""
    reference = View(cameras[0], two_view.K, np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    return reference, View(
        cameras[1], two_view.K_prime, two_view.R, two_view.t, two_view.H_inf, two_view.e_prime
    )
