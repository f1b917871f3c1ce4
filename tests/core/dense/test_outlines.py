"""A post before a wall: what was found of it is too wide, and ends up as wide as the reference shows it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import fundamental_from_pose
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.dense.edge_aware_smoothing import edge_weights
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.matching import ComparedPicture
from edf_stitch.core.dense.outlines import at_outlines

from ..line_scenes import MARGIN, SIZE, Field

FOCAL, WALL_PX, POST_PX = 190.0, 4, 10
"""Moves of the wall by the field, and of the post beyond that, px."""
POST = slice(90, 102)


def texture(seed: int, colour: tuple[int, int, int]) -> np.ndarray:
    random = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(random.normal(size=(SIZE[1], SIZE[0] + 40)), (0, 0), 1.2)
    shades = 30 * noise / noise.std()
    return np.clip(np.array(colour) + shades[..., None], 0, 255).astype(np.uint8)


def pictures(gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A step to the side: in the target the wall lies WALL_PX further right, the post POST_PX more; times `gain`."""
    wall, post = texture(1, (150, 120, 90)), texture(2, (60, 80, 140))
    reference, target = wall[:, 20 : 20 + SIZE[0]].copy(), wall[:, 20 - WALL_PX : 20 - WALL_PX + SIZE[0]].copy()
    reference[:, POST] = post[:, POST]
    moved = WALL_PX + POST_PX
    target[:, POST.start + moved : POST.stop + moved] = post[:, POST]
    return reference, np.rint(gain * target).astype(np.uint8)


def lines() -> EpipolarLines:
    K = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
    t = np.array([1.0, 0, 0])
    F = fundamental_from_pose(K, K, np.eye(3), t)
    view = TwoView(K, K, np.eye(3), t, F, np.eye(3), K @ t, np.ones(0, bool), 0.1, "general", "", "", 0.0, 0.0)
    camera = Camera(K, SIZE, "test", 0.0, np.zeros(5))
    field = SparseMap.over_reference(
        Field(lambda points: np.full(points.shape[:-1], WALL_PX / FOCAL)), view, camera, camera, MARGIN
    )
    return EpipolarLines.over(field, (0, 0, *SIZE), 1.0)


def settled(
    along: np.ndarray, found: np.ndarray, reference: np.ndarray, target: np.ndarray, alpha: np.ndarray | None = None
) -> np.ndarray:
    guide = cv2.GaussianBlur(reference, (0, 0), 1.0).astype(np.float32)
    views = ComparedPicture.of(reference, None, 1.0), ComparedPicture.of(target, alpha, 1.0)
    return at_outlines(lines(), along, np.zeros_like(along), found, edge_weights(guide, 4.0), views)


def widened(by: int) -> np.ndarray:
    along = np.zeros(SIZE[::-1], np.float32)
    along[:, POST.start - by : POST.stop + by] = POST_PX
    return along


@pytest.mark.parametrize("gain", [1.0, 0.7])
def test_a_post_is_as_wide_as_it_is_shown(gain: float) -> None:
    """On one side what lies beside it is hidden from the target; in other light, too."""
    along = widened(2)
    found = np.ones_like(along)
    out = settled(along, found, *pictures(gain))
    assert np.isin(out[5:-5], (0, POST_PX)).all(), "nothing in between"
    assert (out[5:-5, POST] == POST_PX).mean() > 0.98
    beside = np.r_[POST.start - 2 : POST.start, POST.stop : POST.stop + 2]
    assert (out[5:-5, beside] == 0).mean() > 0.9 and (along[5:-5, beside] == POST_PX).all()
    assert not out[:, : POST.start - 12].any() and not out[:, POST.stop + 12 :].any()


def test_values_in_between_belong_to_one_side() -> None:
    """Guesses between what was found."""
    along = cv2.blur(widened(0), (5, 5))
    found = np.where(np.isin(np.round(along, 2), (0, POST_PX)), np.float32(1), np.float32(0.01))
    out = settled(along, found, *pictures())
    sides = (np.abs(out[8:-8]) < 1.5) | (np.abs(out[8:-8] - POST_PX) < 1.5)
    before = (np.abs(along[8:-8]) < 1.5) | (np.abs(along[8:-8] - POST_PX) < 1.5)
    assert sides[:, 86:106].mean() > 0.9 and before[:, 86:106].mean() < 0.75


def test_what_the_pictures_do_not_tell_stays() -> None:
    """Nothing jumps; or the target shows nothing there."""
    ramp = np.tile(np.linspace(0, 9, SIZE[0], dtype=np.float32), (SIZE[1], 1))
    assert settled(ramp, np.ones_like(ramp), *pictures()) is ramp
    along = widened(4)
    nothing = np.zeros(SIZE[::-1], np.float32)
    assert np.array_equal(settled(along, np.ones_like(along), *pictures(), nothing), along)


def test_what_was_not_found_is_no_example() -> None:
    """Guesses far off, a column wide, beside the post."""
    along = widened(3)
    found = np.ones_like(along)
    along[:, POST.start - 8 : POST.start - 3] = -7
    found[:, POST.start - 8 : POST.start - 3] = 0
    out = settled(along, found, *pictures())
    there = out[5:-5, POST.start - 3 : POST.stop + 3]
    assert np.isin(np.round(there), (0, POST_PX, -7)).all() and (np.round(there) == -7).mean() < 0.02
