"""Dates and logos that are burnt into all pictures at the same place are found, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.frames.overlays import overlays_in
from edf_stitch.core.frames.reading import prepare
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import Picture, picture_from_array

HEIGHT, WIDTH, SHIFT = 360, 480, 60


def scene(count: int, seed: int = 1, shift: int = SHIFT) -> list[np.ndarray]:
    """Views of a texture with edges, each moved on."""
    rng = np.random.default_rng(seed)
    wide = cv2.GaussianBlur(rng.random((HEIGHT, WIDTH + shift * count, 3)).astype(np.float32), (0, 0), 12)
    wide = (255 * (wide - wide.min()) / np.ptp(wide)).astype(np.uint8)
    for _ in range(150 + 50 * count):
        x, y = rng.integers(0, wide.shape[1]), rng.integers(0, HEIGHT)
        size = rng.integers(5, 40, 2)
        cv2.rectangle(wide, (x, y), (x + size[0], y + size[1]), rng.integers(0, 256, 3).tolist(), cv2.FILLED)
    return [wide[:, shift * number : shift * number + WIDTH].copy() for number in range(count)]


def dated(
    levels: np.ndarray, place: tuple[int, int], colour: tuple[int, int, int] = (255, 255, 255), size: float = 0.7
) -> np.ndarray:
    return cv2.putText(levels.copy(), "26.07.2019 14:31", place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 2, cv2.LINE_AA)


def compressed(levels: np.ndarray, quality: int = 85) -> np.ndarray:
    return cv2.imdecode(cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)


def found(views: list[np.ndarray]) -> list[np.ndarray | None]:
    return overlays_in([picture_from_array(view) for view in views])


def written(place: tuple[int, int], size: float = 0.7) -> np.ndarray:
    return dated(np.zeros((HEIGHT, WIDTH, 3), np.uint8), place, size=size)[..., 0] > 128


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("place", [(20, 340), (270, 30), (150, 180)])
@pytest.mark.parametrize("colour", [(255, 255, 255), (255, 140, 20), (0, 0, 0), (40, 220, 60)])
def test_a_date_of_any_colour_at_any_place_is_found(
    count: int, place: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    masks = found([compressed(dated(view, place, colour)) for view in scene(count)])
    for mask in masks:
        assert mask is not None and mask[written(place)].mean() > 0.95
        assert mask.mean() < 0.1


def test_a_logo_and_a_date_in_two_corners_are_both_found() -> None:
    views = [dated(view, (20, 340)) for view in scene(2)]
    for view in views:
        cv2.circle(view, (430, 50), 30, (220, 30, 40), cv2.FILLED)
        cv2.circle(view, (430, 50), 14, (250, 250, 250), cv2.FILLED)
    for mask in found([compressed(view) for view in views]):
        assert mask is not None and mask[written((20, 340))].mean() > 0.98 and mask[20:80, 405:455].mean() > 0.9


def test_deep_gray_and_float_pictures_show_it_too() -> None:
    views = [dated(view, (20, 340)) for view in scene(2)]
    for changed in (
        [view.astype(np.uint16) * 257 for view in views], [view[..., :1] for view in views],
        [(view / 255).astype(np.float32) for view in views],
    ):  # fmt: skip
        assert found(changed)[0] is not None


@pytest.mark.parametrize("seed", range(6))
def test_a_scene_that_moves_has_none(seed: int) -> None:
    assert found([compressed(view) for view in scene(2, seed)]) == [None, None]
    assert found(scene(4, seed)) == [None] * 4


def test_what_agrees_without_being_burnt_in() -> None:
    view = scene(2)[0]
    assert found([view, view]) == [None, None], "the same picture"
    noise = np.random.default_rng(1).integers(-3, 4, view.shape)
    assert found([view, np.clip(view + noise, 0, 255).astype(np.uint8)]) == [None, None], "a burst"
    sky = [one.copy() for one in scene(2)]
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    dark = np.clip(1.4 - 1.6 * np.hypot(row - HEIGHT / 2, column - WIDTH / 2) / 300, 0, 1)[..., None]
    for one in sky:
        one[:150] = np.linspace(255, 200, 150)[:, None, None]  # clipped above, then a sky
    assert found([(one * dark).astype(np.uint8) for one in sky]) == [None, None], "skies and dark corners"
    bright = [np.clip(one.astype(int) * 3, 0, 255).astype(np.uint8) for one in scene(2)]
    assert found(bright) == [None, None], "clipped light"
    framed = [cv2.copyMakeBorder(one[2:-2, 2:-2], 2, 2, 2, 2, cv2.BORDER_CONSTANT) for one in scene(2)]
    assert found(framed) == [None, None], "a line along the borders"


def posters(levels: np.ndarray, places: list[tuple[int, int]]) -> np.ndarray:
    """Pictures of 50 × 36 px pinned up at places (left, top)."""
    rng = np.random.default_rng(9)
    pinned = levels.copy()
    for left, top in places:
        pinned[top : top + 36, left : left + 50] = cv2.resize(
            rng.integers(0, 256, (9, 12, 3), np.uint8), (50, 36), interpolation=cv2.INTER_NEAREST
        )
    return pinned


def test_a_camera_that_stood_still_has_none() -> None:
    """Posters on a blank wall, and somebody who walks through: most outlines stay where they are."""
    wall = posters(np.full((HEIGHT, WIDTH, 3), 200, np.uint8), [(20, 20), (200, 150), (400, 300), (20, 300)])
    views = [wall.copy(), wall.copy()]
    for view, left in zip(views, (120, 300), strict=True):
        view[60:120, left : left + 40] = scene(1)[0][60:120, 60:100]
    assert found(views) == [None, None]


def test_a_part_of_the_scene_that_stays_is_none() -> None:
    """What is far away may stay in its place while trees beside it move: around each part of it others stay, too."""
    still = [(x, y) for x in (10, 100) for y in (10, 90)]
    views = scene(2)
    for view in views:
        view[:140, :170] = 180  # haze between what is far
    assert found([posters(view, still) for view in views]) == [None, None]
    assert found([posters(view, still[:1]) for view in views])[0] is not None, "a single one is a logo"


def test_pictures_of_other_sizes_are_not_compared() -> None:
    first, second, third = (dated(view, (20, 340)) for view in scene(3))
    masks = found([first, cv2.resize(second, (240, 180)), third])
    assert masks[1] is None and masks[0] is not None and masks[2] is not None


def test_it_is_left_out_and_told_of_by_name() -> None:
    pictures: list[Picture] = [
        replace(picture_from_array(dated(view, (20, 340))), name=name)
        for view, name in zip(scene(2), ("left.jpg", "right.jpg"), strict=True)
    ]
    frame = prepare(pictures, StitchOptions())
    assert any("left.jpg and right.jpg" in one and "--ignore-ref" in one for one in frame.warnings)
    for picture in frame.pictures:
        assert picture.alpha is not None and not picture.alpha[written((20, 340))].any()
    many = [replace(picture_from_array(dated(view, (20, 340))), name=f"{n}.jpg") for n, view in enumerate(scene(3))]
    assert any("3 pictures" in one and "--ignore NAME=MASK" in one for one in prepare(many, StitchOptions()).warnings)
    plain = [replace(picture_from_array(view), name=f"{n}.jpg") for n, view in enumerate(scene(2))]
    assert prepare(plain, StitchOptions()).warnings == ()
