"""Folds that noise makes go; the jump from a near thing to a far one stays."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.dense import unfolding
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.unfolding import _areas, _hidden, _without_large_moves, unfolded
from edf_stitch.core.field.folding import jacobian
from edf_stitch.core.field.visibility import nearness_of, occluded
from edf_stitch.core.raster.picture_map import PictureMap

from ..line_scenes import Field

SIZE = (160, 120)
FAR, NEAR = 0.02, 0.12  # 20 px apart
CARD = np.s_[35:85, 60:110]


@pytest.fixture(params=["to the right", "to the left", "forward"])
def made(request: pytest.FixtureRequest, by_hand: SimpleNamespace) -> tuple[TwoView, EpipolarLines]:
    """A wall, whose field is right."""
    camera = by_hand.camera(SIZE, 200.0)
    t = {"to the right": (-1, 0.05, 0.0), "to the left": (1, 0.1, 0.05), "forward": (0.05, 0.0, -1)}[request.param]
    view = by_hand.view(camera, camera, (0.0, 0, 0), t)
    sparse = SparseMap.over_reference(Field(lambda points: np.full(points.shape[:-1], FAR)), view, camera, camera, 10)
    return view, EpipolarLines.over(sparse, (0, 0, *SIZE), 1.0)


def folded(lines: EpipolarLines, along: np.ndarray) -> np.ndarray:
    turn = jacobian(*lines.target(along, np.zeros_like(along)))
    return turn <= 0


def noisy(view: TwoView, lines: EpipolarLines, along: np.ndarray) -> int:
    """How many nodes turn over that do not lie at the rim of what is hidden."""
    rim = cv2.dilate(hidden(view, lines, along).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return int((folded(lines, along) & ~rim).sum())


def hidden(view: TwoView, lines: EpipolarLines, along: np.ndarray) -> np.ndarray:
    depth = (lines.inverse_depth + along * lines.depth_per_px).astype(np.float32)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    infinite = (homogeneous(np.stack([x, y], axis=-1).astype(float)) @ view.H_inf[2]).astype(np.float32)
    with np.errstate(invalid="ignore", divide="ignore"):
        nearness = nearness_of(depth, depth * np.float32(view.e_prime[2]) + infinite)
    return occluded(PictureMap(*lines.target(along), SIZE), nearness)


def noise(shape: tuple[int, int], much: float, sigma: float) -> np.ndarray:
    values = cv2.GaussianBlur(np.random.default_rng(4).normal(size=shape).astype(np.float32), (0, 0), sigma)
    return values * np.float32(much / values.std())


def test_noise_that_turns_the_map_over_is_smoothed_and_nothing_else(made: tuple[TwoView, EpipolarLines]) -> None:
    view, lines = made
    along = np.zeros(lines.shape, np.float32)
    along[50:80, 100:140] = noise((30, 40), 1.5, 1.0)
    along[20:40, 100:140] = noise((20, 40), 1.8, 1.6)  # coarser
    assert noisy(view, lines, along) > 80
    found = unfolded(lines, view, SIZE, along, np.zeros_like(along))
    assert found.dtype == np.float32 and noisy(view, lines, found) <= 1
    assert np.array_equal(found[:, :70], along[:, :70]), "what does not fold is not touched"
    assert np.abs(found).max() <= np.abs(along).max()


def test_what_is_right_beside_a_wrong_node_keeps_its_place(made: tuple[TwoView, EpipolarLines]) -> None:
    view, lines = made
    right = np.zeros(lines.shape, np.float32)
    right[:, 110:] = 0.6  # a step too small to fold
    along = right.copy()
    along[30:90:9, 105:116:9] += 4.0
    wrong = along != right
    assert noisy(view, lines, along) > 8
    found = unfolded(lines, view, SIZE, along, np.zeros_like(along))
    assert noisy(view, lines, found) == 0
    assert np.abs(found - right)[~wrong].max() < 0.05


def test_a_map_without_folds_stays_as_it_is(made: tuple[TwoView, EpipolarLines]) -> None:
    view, lines = made
    along = noise(lines.shape, 1.0, 15.0)
    if abs(view.t[2]) > 0.5:  # forward: at the epipole nothing may move
        y, x = np.indices(lines.shape)
        epipole = view.e_prime[:2] / view.e_prime[2]
        along *= np.minimum(1, np.hypot(x - epipole[0], y - epipole[1]) / 30)
    assert not folded(lines, along).any()
    assert np.array_equal(unfolded(lines, view, SIZE, along, np.zeros_like(along)), along)


def test_a_near_thing_keeps_its_rim(made: tuple[TwoView, EpipolarLines]) -> None:
    """Where it hides the wall the map has to turn over, and may."""
    view, lines = made
    depth = np.full(lines.shape, FAR)
    depth[CARD] = NEAR
    along = ((depth - lines.inverse_depth) / lines.depth_per_px).astype(np.float32)
    behind = hidden(view, lines, along)
    assert behind.sum() > 200 and folded(lines, along).any()
    found = unfolded(lines, view, SIZE, along, np.zeros_like(along))
    assert (np.abs(found - along) > 0.5).mean() < 0.02
    middle = np.zeros(lines.shape, bool)
    middle[CARD] = True
    middle = cv2.erode(middle.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0
    assert np.abs(found - along)[middle].max() < 0.5, "the thing itself"
    assert hidden(view, lines, found).sum() > 0.7 * behind.sum(), "and what it hides"


def test_a_node_behind_the_target_hurts_nobody(made: tuple[TwoView, EpipolarLines]) -> None:
    view, lines = made
    base = lines.base.copy()
    base[:10] = np.nan
    broken = EpipolarLines(lines.box, lines.step, lines.ideal, lines.inverse_depth, base, lines.shift,
                   lines.depth_per_px, lines.direction, lines.w_rate, lines.camera_prime)  # fmt: skip
    along = np.zeros(lines.shape, np.float32)
    along[50:80, 100:140] = noise((30, 40), 1.5, 1.0)
    found = unfolded(broken, view, SIZE, along, np.zeros_like(along))
    assert np.isfinite(found).all() and noisy(view, broken, found) <= 1


@pytest.mark.parametrize("step", [1.0, 2.0])
def test_the_depth_order_is_that_of_the_undistorted_nodes(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, step: float
) -> None:
    """What hides what is decided by depth in front of the target: that of a node's ideal pixel, not of its raw one."""
    cameras = by_hand.camera(SIZE, 200.0, (-0.3,)), by_hand.camera(SIZE, 200.0)
    view = by_hand.view(*cameras, (0.0, 20, 0), (-1, 0.05, 0.1))
    sparse = SparseMap.over_reference(Field(lambda points: np.full(points.shape[:-1], FAR)), view, *cameras, 10)
    lines = EpipolarLines.over(sparse, (10, 20, 120, 80), step)
    asked = []

    def ask(picture_map: PictureMap, nearness: np.ndarray) -> np.ndarray:
        asked.append(nearness)
        return occluded(picture_map, nearness)

    monkeypatch.setattr(unfolding, "occluded", ask)
    along = noise(lines.shape, 3.0, 1.0)
    unfolded(lines, view, SIZE, along, np.zeros_like(along))
    d = lines.inverse_depth + along * lines.depth_per_px
    ray = np.concatenate([lines.ideal, np.ones((*lines.shape, 1))], axis=-1) @ view.H_inf[2] + d * view.e_prime[2]
    assert np.allclose(asked[0], np.maximum(d, 0) / ray, rtol=1e-5)


def test_the_area_of_any_node_is_that_of_the_whole_map() -> None:
    """By central differences inside, by one step at the border, as for all nodes at once."""
    x, y = np.random.default_rng(0).normal(size=(2, 7, 9)).astype(np.float32)
    whole = jacobian(x, y).ravel()
    assert np.allclose(_areas(x, y, np.arange(x.size)), whole, atol=1e-5)
    some = np.array([0, 8, 13, 40, 62])
    assert np.allclose(_areas(x, y, some), whole[some], atol=1e-5)


@pytest.mark.parametrize("box, step", [((0, 0, *SIZE), 2.0), ((20, 10, 120, 100), 1.0), ((20, 10, 120, 100), 2.0)])
def test_what_is_hidden_is_so_on_nodes_of_a_part_and_on_coarser_ones(
    by_hand: SimpleNamespace, box: tuple[int, int, int, int], step: float
) -> None:
    camera = by_hand.camera(SIZE, 200.0)
    view = by_hand.view(camera, camera, (0.0, 0, 0), (1, 0.1, 0.3))
    sparse = SparseMap.over_reference(Field(lambda points: np.full(points.shape[:-1], FAR)), view, camera, camera, 10)

    def found_on(lines: EpipolarLines) -> np.ndarray:
        x, y = lines.ideal[..., 0], lines.ideal[..., 1]
        card = (x > 59.2) & (x < 110.2) & (y > 34.2) & (y < 85.2)
        along = ((np.where(card, NEAR, FAR) - lines.inverse_depth) / lines.depth_per_px).astype(np.float32)
        return _hidden(lines, view, SIZE, along, *lines.target(along))

    whole = found_on(EpipolarLines.over(sparse, (0, 0, *SIZE), 1.0))
    part = whole[box[1] : box[1] + box[3], box[0] : box[0] + box[2]]
    found = found_on(EpipolarLines.over(sparse, box, step))
    size = found.shape[::-1]
    share = cv2.resize(part.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    assert found.sum() > 0.7 * share.sum() > 100
    assert not found[cv2.dilate(share, np.ones((3, 3))) == 0].any()
    if step == 1:
        assert (found != part).mean() < 0.002


def test_patches_that_smoothing_moved_far_are_put_back() -> None:
    start = noise((40, 50), 3.0, 2.0)
    along = start.copy()
    along[5:15, 5:15] += 2.0
    along[25:35, 20:40] += np.where(np.arange(20) < 10, 1.0, 9.0)
    found = _without_large_moves(along, start)
    assert np.array_equal(found[:20], along[:20]) and np.array_equal(found[20:], start[20:])
    assert np.array_equal(_without_large_moves(along[:20], start[:20]), along[:20])
