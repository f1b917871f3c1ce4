"""Lines that a user says are upright or level, and which way is down by them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import project, rotation_from_angles
from edf_stitch.core.cameras.view import View
from edf_stitch.core.frames.reading import prepare
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.guides import constraints, guide_warnings, guided
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.system.errors import BadRequest

WIDTH, HEIGHT = 400, 300
CAMERA = Camera(np.array([[350.0, 0, 199.5], [0, 350.0, 149.5], [0, 0, 1]]), (WIDTH, HEIGHT), "test", 0.0)
PLAIN = picture_from_array(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
DOWN = np.array([np.sin(0.1), np.cos(0.1) * np.cos(0.2), np.cos(0.1) * np.sin(0.2)])
AHEAD = np.array([0.0, 0.0, 1.0]) - DOWN[2] * DOWN
AHEAD /= np.linalg.norm(AHEAD)
RIGHT = np.cross(DOWN, AHEAD)


def view(R: np.ndarray) -> View:
    nothing = np.full((3, 3), np.nan)
    return View(CAMERA, CAMERA.K, R, np.zeros(3), nothing, nothing[0])


def line(one: np.ndarray, other: np.ndarray, R: np.ndarray) -> tuple[float, ...]:
    """Two points (3,) of the reference's frame as shares of a picture's sides."""
    points = project(np.stack([one, other]) @ R.T @ CAMERA.K.T)
    return tuple(((points + 0.5) / (WIDTH, HEIGHT)).ravel())


TURNS = (np.eye(3), rotation_from_angles(8.0, 3.0, -2.0))


@pytest.mark.parametrize("R", TURNS)
def test_two_lines_of_either_kind_tell_which_way_is_down(R: np.ndarray) -> None:
    at = 3 * AHEAD + 0.3 * RIGHT
    upright = [("vertical", line(at + x * RIGHT, at + x * RIGHT + 0.7 * DOWN, R)) for x in (-1.0, 0.6)]
    # ends that are equally high, seen from the camera: as far away as each other
    level = [("horizontal", line(3 * AHEAD + 1.2 * RIGHT, 3 * AHEAD - 1.2 * RIGHT, R))]
    for guides in (upright, [upright[0], *level]):
        rows = constraints([replace(PLAIN, guides=tuple(guides))], [view(R)])
        assert rows.shape == (2, 3) and np.allclose(np.linalg.norm(rows, axis=1), 1)
        found = guided(np.array([0.0, 1.0, 0.0]), rows)
        assert np.degrees(np.arccos(found @ DOWN)) < 0.2


def test_one_line_is_held_to_and_the_rest_stays_as_it_was() -> None:
    rows = constraints([replace(PLAIN, guides=(("vertical", line(2 * AHEAD, 2 * AHEAD + DOWN, np.eye(3))),))],
                       [view(np.eye(3))])
    before = np.array([0.0, 1.0, 0.0])
    found = guided(before, rows)
    assert abs(found @ rows[0]) < 1e-3 < abs(before @ rows[0])
    across = before - (before @ rows[0]) * rows[0]
    assert found @ across / np.linalg.norm(across) > 0.99999


def test_without_lines_or_without_an_orientation_nothing_is_said() -> None:
    guides = replace(PLAIN, guides=(("vertical", (0.1, 0.1, 0.1, 0.9)),))
    assert constraints([PLAIN, guides], [view(np.eye(3)), view(np.full((3, 3), np.nan))]).shape == (0, 3)


def test_options_know_whose_they_are_and_refuse_what_is_no_line() -> None:
    options = StitchOptions(guides=((2, "vertical", (1.0, 2, 3, 4)), ("a", "horizontal", (5.0, 6, 7, 8))))
    assert options.guides_in(["a.png", "b.png"]) == [[("horizontal", (5, 6, 7, 8))], [("vertical", (1, 2, 3, 4))]]
    with pytest.raises(BadRequest, match="two different points"):
        StitchOptions(guides=((1, "vertical", (1.0, 2, 1, 2)),))
    for ends in ((1.0, 2.0, 1.0, 2.5), (1e300, 1.0, 2.0, 3.0), (float("nan"), 1.0, 2.0, 3.0), (1.0, 2.0, 3.0)):
        with pytest.raises(BadRequest, match="at least 1 px apart and in or near"):
            StitchOptions(guides=((1, "vertical", ends),))


@pytest.mark.parametrize(("frame", "left_out"), [
    ({}, False), ({"level": "none"}, True), ({"level": (1.0, 2.0, 3.0)}, True), ({"projection": "reference"}, True),
])  # fmt: skip
def test_lines_that_nothing_can_be_turned_by_are_told(frame: dict[str, Any], left_out: bool) -> None:
    views = [np.full_like(PLAIN.view, level) for level in (9, 90)]
    pictures = [replace(PLAIN, name=str(number), view=one) for number, one in enumerate(views)]
    given = StitchOptions(guides=((1, "vertical", (10.0, 20.0, 12.0, 200.0)),), **frame)
    told = [one for one in prepare(pictures, given).warnings if "left out" in one]
    assert len(told) == left_out


@pytest.mark.parametrize(("kinds", "words"), [
    (("vertical", "horizontal", "vertical"), ""), (("vertical", "horizontal"), ""),
    (("horizontal", "horizontal", "vertical"), "contradict each other"), (("horizontal",), "turn the panorama"),
])  # fmt: skip
def test_lines_that_contradict_each_other_are_told(kinds: tuple[str, ...], words: str) -> None:
    """Of an upright, a level and another upright line; two alone always agree with some way down."""
    begins = [3 * AHEAD + x * RIGHT for x in (0.3, 0, -1)]
    ends = [(at, at + along) for at, along in zip(begins, (DOWN, RIGHT, DOWN), strict=True)]
    lines = tuple((kind, line(*both, np.eye(3))) for kind, both in zip(kinds, ends, strict=False))
    rows = constraints([replace(PLAIN, guides=lines)], [view(np.eye(3))])
    told = guide_warnings(guided(DOWN, rows), rows, DOWN)
    assert len(told) == bool(words) and all(words in one for one in told)
