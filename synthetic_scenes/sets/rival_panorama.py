"""A rival's panorama, which assumes one place for all pictures, as the true sphere lies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import Array
from .set_measures import SetTruth, colour_figures, common_rotation, sampled


@dataclass(frozen=True, eq=False)
class RivalPanorama:
    """light (H, W, 3), scene-linear, and alpha (H, W) of a panorama; pixels: x, y (…) of it that show directions
    (…, 3) in its own axes; rotations: from these axes to each picture's it uses, by the picture's number."""

    light: NDArray[np.float32]
    alpha: NDArray[np.float32]
    pixels: Callable[[Array], tuple[Array, Array]]
    rotations: Mapping[int, Array]

    def on_sphere(self, truth: SetTruth) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """The panorama (H, W, 3) on the true sphere, and where (H, W) it shows something.

        What it takes for rotation is partly parallax, so that no one turn brings all onto the truth: of that which fits
        all rotations best, and those that fit one of them, the one that shows it in the best light is taken.
        """
        numbers = list(self.rotations)
        seen = truth.views_at(numbers) > 0

        def turned(chosen: list[int]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
            found = np.array([self.rotations[number] for number in chosen])
            gauge = common_rotation(found, [truth.rendered.cameras[number].R for number in chosen])
            return sampled(self.light, self.alpha, np.stack(self.pixels(truth.directions @ gauge.T), axis=-1))

        shown = [turned(chosen) for chosen in (numbers, *([number] for number in numbers))]
        return max(shown, key=lambda one: colour_figures(one[0], one[1] & seen, truth)[0]["psnr_db"])
