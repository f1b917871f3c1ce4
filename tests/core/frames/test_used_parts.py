"""What given cameras leave out of their pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.frames.frame import Frame
from edf_stitch.core.frames.used_parts import within_lenses
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.system.errors import BadRequest

K = [[100.0, 0, 99.5], [0, 100, 74.5], [0, 0, 1]]
PICTURE = np.full((150, 200, 3), 128, np.uint8)


def frame(full: tuple[int, int] = (200, 150)) -> Frame:
    pictures = tuple(picture_from_array(PICTURE, name) for name in ("a.png", "b.png"))
    return Frame(pictures, (full, full))


def left_out(entry: dict[str, Any], full: tuple[int, int] = (200, 150)) -> tuple[np.ndarray, tuple[str, ...]]:
    """Where the first picture (H, W) is hidden, and what is said."""
    table = {"a.png": {"K": K, **entry}, "b.png": {"K": K}}
    found = within_lenses(frame(full), CameraRequest(cameras={"cameras": table}))
    alpha = found.pictures[0].alpha
    assert found.pictures[1].alpha is None
    return np.zeros((150, 200), bool) if alpha is None else alpha == 0, found.warnings


def test_polygons_are_hidden() -> None:
    hidden, said = left_out({"ignore": [[[10, 20], [30, 20], [30, 40], [10, 40]], [[100, 0], [110, 0], [100, 10]]]})
    y, x = np.mgrid[:150, :200]
    square = (x >= 10) & (x <= 30) & (y >= 20) & (y <= 40)
    assert np.array_equal(hidden, square | ((x >= 100) & (x - 100 + y <= 10))) and not said


def test_polygons_are_in_px_of_the_size_that_the_camera_is_about() -> None:
    hidden, _ = left_out({"size": [400, 300], "ignore": [[[20, 40], [61, 40], [61, 81], [20, 81]]]}, (400, 300))
    assert hidden[20:41, 10:31].all() and hidden.sum() == 21 * 21


def test_what_lies_beyond_the_lens_is_hidden_and_said() -> None:
    hidden, said = left_out({"K": [[70.0, 0, 99.5], [0, 70, 74.5], [0, 0, 1]], "lens": {"projection": "equidistant"}})
    y, x = np.mgrid[:150, :200]
    assert np.array_equal(hidden, np.hypot(x - 99.5, y - 74.5) > 70 * np.radians(80))
    assert len(said) == 1 and "80°" in said[0] and "a.png" in said[0] and "b.png" not in said[0]


def test_without_a_camera_file_nothing_changes() -> None:
    one = frame()
    assert within_lenses(one, CameraRequest(focal_px=(100.0,))) is one


@pytest.mark.parametrize("ignore", [[["x"]], [[[1, 2, 3]]], [[[float("nan"), 1]] * 3], [[]], 7,
                                    [[[10**400, 1]] * 3]])
def test_what_is_no_polygon_is_refused(ignore: Any) -> None:
    with pytest.raises(BadRequest, match="a.png: ignore must be polygons"):
        left_out({"ignore": ignore})
