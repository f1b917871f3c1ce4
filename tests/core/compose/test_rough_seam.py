"""A rough seam tells what a cut would show: misplaced things, not light, and nothing where the pictures agree."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.compose.seams import rough_seam
from edf_stitch.core.compose.seams.rough_seam import RoughSeam
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.picture_map import PictureMap

from ...pairs import own_map

SIZE, FOCAL = (480, 360), 450.0
COARSE = 150.0


@pytest.fixture
def views(by_hand: SimpleNamespace) -> tuple[View, ...]:
    camera = by_hand.camera(SIZE, FOCAL)
    return views_of(by_hand.view(camera, camera, (0, -25, 0), (-1.0, 0, 0)), (camera, camera))


def canvas_of(views: tuple[View, ...], focal: float) -> Canvas:
    projection = round_projection("cylindrical", views[0].K * [[focal / FOCAL], [focal / FOCAL], [1]], np.eye(3))
    reach = round(focal)
    return Canvas(2 * reach, reach, (2 * reach // 3, reach // 2), projection=projection)


def far_away(views: tuple[View, ...], focal: float, shift: float = 0.0) -> Warp:
    """Everything at infinite distance; shift: px by which the target's map is wrong upwards."""
    canvas = canvas_of(views, focal)
    a, b, c = canvas.project_rows(views[1].H_inf, canvas.xs, canvas.ys)
    x, y = (np.where(c > 1e-6, v / np.maximum(c, 1e-6), np.nan).astype(np.float32) for v in (a, b))
    return Warp(
        canvas, (own_map(canvas, views[0].camera), PictureMap(x, y + np.float32(shift), SIZE)),
        np.zeros(x.shape, np.float32),
    )  # fmt: skip


def seen(views: tuple[View, ...], number: int, bands: bool = True) -> np.ndarray:
    """What a picture shows of a sky with level stripes, or of plain sky."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(views[number].K).T @ views[number].R
    rise = rays[..., 1] / np.hypot(rays[..., 0], rays[..., 2])
    light = 120 + (80 * np.sin(40 * rise) if bands else 0 * rise)
    return np.repeat(np.rint(light)[..., None], 3, axis=2).astype(np.uint8)


def rough(views: tuple[View, ...], first: np.ndarray, second: np.ndarray, **how: Any) -> float:
    pictures = [picture_from_array(first), picture_from_array(second)]
    return RoughSeam.of(pictures, views, COARSE)(far_away(views, COARSE, **how))


def test_pictures_that_agree_are_joined_unseen(views: tuple[View, ...]) -> None:
    assert rough(views, seen(views, 0), seen(views, 1)) == 0


def test_light_is_no_step_but_what_is_misplaced_is(views: tuple[View, ...]) -> None:
    darker = (0.85 * seen(views, 1)).astype(np.uint8)
    assert rough(views, seen(views, 0), darker) < 5
    assert rough(views, seen(views, 0), seen(views, 1), shift=25.0) > 20


def test_the_seam_goes_around_a_person_but_not_around_one_that_the_border_cuts(views: tuple[View, ...]) -> None:
    plain = [seen(views, number, bands=False) for number in (0, 1)]
    inside, cut = plain[1].copy(), plain[1].copy()
    cv2.rectangle(inside, (60, 120), (120, 240), (20, 30, 200), -1)
    assert rough(views, plain[0], inside) == 0
    # from what both show into what the target alone shows
    cv2.rectangle(cut, (0, 120), (479, 240), (20, 30, 200), -1)
    assert rough(views, plain[0], cut) > 15


def test_it_reads_pictures_of_any_size_and_their_alpha(views: tuple[View, ...]) -> None:
    pictures = [seen(views, 0), seen(views, 1)]
    alpha = np.full((*SIZE[::-1], 1), 255, np.uint8)
    alpha[:, :200] = 0
    wrong = pictures[1].copy()
    wrong[:, :190] = 255  # below what is transparent
    found = RoughSeam.of(
        [picture_from_array(pictures[0]), picture_from_array(np.dstack([wrong, alpha]))], views, COARSE
    )
    assert found(far_away(views, COARSE)) < 5
    height, width = found.pictures[0].view.shape[:2]
    assert (width, height) == (160, 120), "so many px per radian"


def test_a_seam_is_lost_where_both_pictures_are_busy(views: tuple[View, ...]) -> None:
    def leaves(number: int) -> np.ndarray:
        """Spots in any place, and thus elsewhere in the other picture; FOCAL / COARSE px are one of the small picture.
        """
        spots = np.random.default_rng(number).integers(40, 216, (SIZE[1] // 6, SIZE[0] // 6), np.uint8)
        return np.repeat(cv2.resize(spots, SIZE, interpolation=cv2.INTER_NEAREST)[..., None], 3, axis=2)

    assert rough(views, leaves(0), leaves(1)) < 10
    assert rough(views, leaves(0), seen(views, 1, bands=False)) > 20


def test_a_warp_is_looked_at_once_and_another_one_anew(views: tuple[View, ...]) -> None:
    both = RoughSeam.of([picture_from_array(seen(views, number)) for number in (0, 1)], views, COARSE)
    right, wrong = far_away(views, COARSE), far_away(views, COARSE, shift=25.0)
    assert both.look(right) is both.look(right)
    assert both(wrong) > 20
    assert both(right) == 0


def test_what_neither_picture_can_see_counts_by_its_border(views: tuple[View, ...], monkeypatch: pytest.MonkeyPatch
                                                           ) -> None:  # fmt: skip
    """Hidden where the target alone shows something it is a hole; hidden where both do, the seam sees to it."""
    pictures = [picture_from_array(seen(views, number)) for number in (0, 1)]
    cut = RoughSeam.of(pictures, views, COARSE)
    shown = cut.look(far_away(views, COARSE)).shown
    alone, both = (
        np.argwhere(cv2.erode(np.pad(one, 1).astype(np.uint8), np.ones((13, 13), np.uint8))[1:-1, 1:-1])
        for one in (shown[1] & ~shown[0], shown[1] & shown[0])
    )
    for places, expected in ((alone, 10**2 - 8**2), (both, 0)):
        row, column = places[len(places) // 2]
        hidden = np.zeros(shown[0].shape, bool)
        hidden[row - 4 : row + 4, column - 4 : column + 4] = True
        monkeypatch.setattr(rough_seam, "occluded", lambda *_, hidden=hidden: hidden.copy())
        assert cut(far_away(views, COARSE)) == expected
