"""Exposures of one view are found among pictures in any order, and nothing else is taken for one."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.frames.brackets import Bracket, brackets_in
from edf_stitch.core.frames.exposures import stops_told
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.system.errors import BadRequest

from .exposed_views import HEIGHT, WIDTH, bracket_of, exposure_tags, painted_world, shot, view_of

WORLD = painted_world()
VIEWS = [view_of(WORLD, x) for x in (20.0, 240.0, 460.0)]


def names(pictures: list[Picture], brackets: list[Bracket]) -> list[tuple[str, ...]]:
    return [tuple(pictures[number].name for number in bracket.numbers) for bracket in brackets]


def test_brackets_are_found_in_any_order_by_what_they_show() -> None:
    pictures = [one for number, light in enumerate(VIEWS) for one in bracket_of(light, str(number))]
    expected = [tuple(f"{number}{stops}.png" for stops in ("-2", "+0", "+2")) for number in range(3)]
    found = brackets_in(pictures, "auto")
    assert names(pictures, found) == expected
    for bracket in found:
        assert np.allclose(bracket.stops, (-2, 0, 2), atol=0.02) and bracket.shift < 1e-3
        assert all(np.array_equal(homography, np.eye(3)) for homography in bracket.homographies), "nothing is resampled"
    mixed = [pictures[number] for number in (8, 3, 0, 5, 1, 7, 2, 4, 6)]
    assert sorted(names(mixed, brackets_in(mixed, "auto"))) == expected
    assert brackets_in(pictures, "off") == []


@pytest.mark.parametrize("stops", [(0.0, 1.0), (0.0, -1.0, 1.0), (-4.0, -2.0, 0.0, 2.0, 4.0), (0.0, -3.0, 3.0)])
def test_any_number_of_exposures(stops: tuple[float, ...]) -> None:
    pictures = [*bracket_of(VIEWS[0], "a", stops), shot(VIEWS[2], 0, "b")]
    (bracket,) = brackets_in(pictures, "auto")
    assert sorted(bracket.numbers) == list(range(len(stops)))
    middle = sorted(stops)[len(stops) // 2]
    assert np.allclose(bracket.stops, np.sort(stops) - middle, atol=0.05)
    assert pictures[bracket.numbers[bracket.middle]].name == f"a{middle:+g}.png"


def test_exposures_from_the_hand_are_aligned() -> None:
    moves = ((0, 0, 0), (5.3, -2.1, 0.4), (-3, 4.4, -0.3))
    lights = [view_of(WORLD, 100 + dx, 60 + dy, turn) for dx, dy, turn in moves]
    pictures = [shot(light, stops, f"{stops:+g}") for light, stops in zip(lights, (0, -2, 2), strict=True)]
    pictures.append(shot(VIEWS[2], 0, "other"))
    (bracket,) = brackets_in(pictures, "auto")
    assert np.allclose(bracket.stops, (-2, 0, 2), atol=0.02) and 0.005 < bracket.shift < 0.03
    # a point in the world, where each exposure shows it
    point = np.array([[[200.0, 150.0]]])
    for homography, number in zip(bracket.homographies, (1, 0, 2), strict=True):
        dx, dy, turn = moves[number]
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        middle = np.array([WIDTH / 2, HEIGHT / 2])
        there = np.array([[c, s], [-s, c]]) @ (point[0, 0] - [dx, dy] - middle) + middle
        assert np.abs(cv2.perspectiveTransform(point, homography)[0, 0] - there).max() < 0.15


def moved_apart(light: np.ndarray, px: float) -> np.ndarray:
    """The same view from a little further to the right: what is near, its lower half, moves by so many px."""
    near = cv2.warpAffine(light, np.array([[1, 0, -px], [0, 1, 0.0]]), light.shape[1::-1])
    return np.concatenate([light[: HEIGHT // 2], near[HEIGHT // 2 :]])


@pytest.mark.parametrize("px", [3.0, 8.0])
def test_pictures_from_different_places_are_no_bracket(px: float) -> None:
    pictures = [shot(VIEWS[0], 0, "a"), shot(moved_apart(VIEWS[0], px), 1.5, "b"), shot(VIEWS[2], 0, "c")]
    assert brackets_in(pictures, "auto") == []
    with pytest.raises(BadRequest, match="a and b are no exposures of one view: they were not taken from one place"):
        brackets_in(pictures[:2], 2)


@pytest.mark.parametrize("step", [40, 120, 220])
def test_a_panorama_whose_exposures_differ_is_none(step: int) -> None:
    stops = (0, 1.5, -1.5, 2, 0)
    pictures = [shot(view_of(WORLD, 10 + step * k), stops[k], str(k)) for k in range(4)]
    assert brackets_in(pictures, "auto") == []


def test_near_duplicates_are_none() -> None:
    """The same view at the same exposure, and a third of a stop beside it, which cameras vary by themselves."""
    pictures = [shot(VIEWS[0], stops, str(stops), seed=k) for k, stops in enumerate((0, 0, 0.33, -0.25))]
    assert brackets_in(pictures, "auto") == []
    # beside a true bracket each exposure is taken once
    doubled = [*bracket_of(VIEWS[0]), shot(VIEWS[0], 0, "again", seed=9), shot(VIEWS[2], 0, "b")]
    (bracket,) = brackets_in(doubled, "auto")
    assert len(bracket.numbers) == 3 and bracket.numbers[0] == 1


def test_what_is_no_exposure_of_a_camera_is_left_alone() -> None:
    floats = [picture_from_array(VIEWS[0] * np.float32(2.0**stops), f"{stops}") for stops in (0, -2, 2)]
    assert brackets_in(floats, "auto") == []
    holed = [replace(one, alpha=np.ones(one.view.shape[:2], np.float32)) for one in bracket_of(VIEWS[0])]
    assert brackets_in(holed, "auto") == []
    cameras = [replace(one, exif=Exif(model=str(k))) for k, one in enumerate(bracket_of(VIEWS[0]))]
    assert brackets_in(cameras, "auto") == []
    with pytest.raises(BadRequest, match="--brackets 3: 0 is no exposure of a camera"):
        brackets_in(floats, 3)


def test_two_pictures_are_a_pair() -> None:
    assert brackets_in(bracket_of(VIEWS[0])[:2], "auto") == []


def test_exposures_by_exif() -> None:
    assert stops_told(shot(VIEWS[0])) is None
    told = replace(shot(VIEWS[0]), exif=exposure_tags((1, 60), (8, 1), 200))
    assert stops_told(told) == pytest.approx(np.log2(200 / 100 / 60 / 64))
    # 1/60 s stands for 1/64: what is seen is believed where both agree to within what numbers are rounded by
    pictures = [replace(one, exif=exposure_tags(time)) for one, time in
                zip(bracket_of(VIEWS[0]), ((1, 60), (1, 250), (1, 15)), strict=True)]  # fmt: skip
    (bracket,) = brackets_in([*pictures, shot(VIEWS[2], 0, "b")], "auto")
    assert np.allclose(bracket.stops, (-2, 0, 2), atol=0.02)
    # a camera whose curve is steeper than sRGB's
    steep = [replace(one, exif=exposure_tags(time)) for one, time in
             zip(bracket_of(VIEWS[0] ** 1.5 * 2), ((1, 60), (1, 125), (1, 30)), strict=True)]  # fmt: skip
    (bracket,) = brackets_in([*steep, shot(VIEWS[2], 0, "b")], "auto")
    assert np.allclose(bracket.stops, np.log2([60 / 125, 1, 2]), atol=0.01)
    # the same exposure by EXIF, only brightened afterwards: copies, not a bracket
    same = [replace(one, exif=exposure_tags((1, 60))) for one in bracket_of(VIEWS[0])]
    assert brackets_in(same, "auto") == []


def test_a_wall_without_features_is_told_by_its_levels() -> None:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    wall = (0.1 + 0.1 * x / WIDTH + 0.05 * y / HEIGHT)[..., None] * np.ones(3, np.float32)
    pictures = [*bracket_of(cv2.GaussianBlur(wall, (0, 0), 9), "wall", (0, -1.5, 1.5)), shot(VIEWS[2], 0, "b")]
    assert names(pictures, brackets_in(pictures, "auto")) == [("wall-1.5.png", "wall+0.png", "wall+1.5.png")]


def test_so_many_in_a_row_are_taken_as_they_are_named() -> None:
    pictures = [one for number, light in enumerate(VIEWS[:2]) for one in bracket_of(light, str(number))]
    found = brackets_in(pictures, 3)
    assert [bracket.numbers for bracket in found] == [(1, 0, 2), (4, 3, 5)]
    turned = [shot(view_of(WORLD, 100 + 25 * k), 2 * k, str(k)) for k in range(2)]
    assert brackets_in([*turned, shot(VIEWS[2], 0, "b")], "auto") == [], "4 % of the picture is no tremor of a hand"
    (bracket,) = brackets_in(turned, 2)
    assert bracket.shift == pytest.approx(25 / np.hypot(WIDTH, HEIGHT), rel=0.02)
    for second, said in ((view_of(WORLD, 420), "one view"), (view_of(WORLD, 200), "the camera turned between them by")):
        with pytest.raises(BadRequest, match=said):
            brackets_in([shot(view_of(WORLD, 100), 0, "a"), shot(second, 2, "b")], 2)
    with pytest.raises(BadRequest, match="their sizes differ"):
        brackets_in([shot(VIEWS[0], 0, "a"), shot(VIEWS[0][:300], 2, "b")], 2)
    with pytest.raises(BadRequest, match="no part of the view is well exposed in both"):
        brackets_in([shot(VIEWS[0], -12, "a"), shot(VIEWS[0], 9, "b")], 2)
