"""How large a preview becomes, before it is made and after."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.frames.options import PREVIEW
from edf_stitch.core.frames.preview import first_share, next_share
from edf_stitch.core.options import LEAST_SCALE

SIZE = (4000, 3000)
CAMERA = Camera(np.array([[3500.0, 0, 1999.5], [0, 3500, 1499.5], [0, 0, 1]]), SIZE, "test", 0.0)


def turned(*degrees: float) -> list[np.ndarray]:
    return [rotation_from_vector(np.radians([0, -one, 0])) for one in degrees]


def test_pictures_side_by_side_are_worked_on_so_small_that_their_panorama_is_a_previews() -> None:
    width, height = np.radians(60) + 2 * np.arctan(2000 / 3500), 2 * np.arctan(1500 / 3500)
    share = first_share([CAMERA] * 3, turned(0, 30, 60))
    assert share**2 * width * height * 3500**2 == pytest.approx(PREVIEW.pixels, rel=0.02)
    assert first_share([CAMERA] * 3, turned(170, 200, 230)) == pytest.approx(share, rel=1e-6), "across the back too"
    assert first_share([CAMERA] * 12, turned(*range(0, 360, 30))) < 0.5 * first_share([CAMERA], turned(0))


def test_a_rotation_that_is_not_known_counts_as_none() -> None:
    nothing = [np.eye(3), np.full((3, 3), np.nan)]
    assert first_share([CAMERA] * 2, nothing) == first_share([CAMERA], turned(0))


def test_small_pictures_stay_as_they_are() -> None:
    assert first_share([CAMERA.resized((400, 300))] * 2, turned(0, 20)) == 1.0


def test_what_became_too_large_or_too_small_is_made_again() -> None:
    assert next_share(0.5, 1_500_000) == 0.5
    assert next_share(0.5, 5_600_000) == pytest.approx(0.25, rel=1e-6)
    assert next_share(0.2, 350_000) == pytest.approx(0.4, rel=1e-6)
    assert next_share(1.0, 350_000) == 1.0, "there are no more px"
    assert next_share(0.9, 10_000) == 1.0
    assert next_share(LEAST_SCALE, 9_000_000) == LEAST_SCALE
