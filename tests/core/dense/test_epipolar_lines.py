"""A field on the reference's pixels, and moves along its epipolar lines: held against x' ~ H_inf p + d e' by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.projective import distance_to_line, homogeneous, project
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from hypothesis import given
from hypothesis import strategies as st

from ..line_scenes import Field

SIZE, MARGIN = (240, 180), 20
BARREL, PINCUSHION = (-0.12, 0.02), (0.08,)
SHIFT = (0.7, -0.4)
PLANE = np.array([2e-4, -4e-4, 0.15])
MOTIONS = {
    "sideways": ((2.0, -8, 3), (1, 0.1, 0.15)),
    "epipole at infinity": ((0.0, 0, 0), (1, 0, 0)),
    "forward": ((0.5, -1, 0.5), (0.05, 0.02, -1)),
    "backward": ((0.0, 2, 0), (-0.1, 0.2, 1)),
}
Made = tuple[TwoView, SparseMap]


def depth(points: np.ndarray) -> np.ndarray:
    return points @ PLANE[:2] + PLANE[2]


def make(
    by_hand: SimpleNamespace, motion: str, distortion: tuple = (), distortion_prime: tuple = (), step: int = 1
) -> Made:
    cameras = by_hand.camera(SIZE, 220.0, distortion), by_hand.camera((260, 200), 250.0, distortion_prime)
    view = by_hand.view(*cameras, *MOTIONS[motion])
    return view, SparseMap.over_reference(Field(depth, SHIFT), view, *cameras, MARGIN, step)


@pytest.fixture(params=MOTIONS)
def made(request: pytest.FixtureRequest, by_hand: SimpleNamespace) -> Made:
    return make(by_hand, request.param)


@pytest.fixture(params=[(motion, step) for motion in MOTIONS for step in (1, 3)], ids=str)
def bent(request: pytest.FixtureRequest, by_hand: SimpleNamespace) -> Made:
    """Both lenses distort; of large pictures not every pixel is kept."""
    motion, step = request.param
    return make(by_hand, motion, BARREL, PINCUSHION, step)


def sent(view: TwoView, ideal: np.ndarray, d: np.ndarray) -> np.ndarray:
    return project(homogeneous(ideal) @ view.H_inf.T + d[..., None] * view.e_prime)


# --- the field on pixels --------------------------------------------------------------------------------------------


def test_the_field_is_asked_where_the_lens_would_have_no_distortion(bent: Made) -> None:
    _, sparse = bent
    x, y = np.meshgrid(np.arange(-15.0, 250, 12.5), np.arange(-12.0, 190, 11.25))
    raw = np.stack([x, y], axis=-1)
    d, shift = sparse.at(raw)
    off = np.abs(d - depth(undistort(raw, sparse.camera)))
    assert off.max() < 2e-4 * PLANE[2], "the grid's interpolation of a smooth bend is all that may differ"
    np.testing.assert_allclose(shift, np.broadcast_to(SHIFT, shift.shape), atol=1e-6)


def test_points_are_sent_along_their_lines_and_shifted(bent: Made) -> None:
    view, sparse = bent
    ideal = undistort(np.stack(np.meshgrid(np.arange(5.0, 235, 23), np.arange(4.0, 176, 19)), axis=-1), sparse.camera)
    np.testing.assert_allclose(sparse.target(ideal), sent(view, ideal, depth(ideal)) + SHIFT, atol=2e-2)


def test_smoothing_takes_fine_bends_and_leaves_coarse_ones_and_the_plane(by_hand: SimpleNamespace) -> None:
    cameras = by_hand.camera(SIZE, 220.0), by_hand.camera(SIZE, 220.0)
    view = by_hand.view(*cameras, *MOTIONS["sideways"])

    def waves(length: float, high: float = 0.01) -> SparseMap:
        def bend(points: np.ndarray) -> np.ndarray:
            return depth(points) + high * np.sin(points[..., 0] * (2 * np.pi / length))

        return SparseMap.over_reference(Field(bend), view, *cameras, MARGIN)

    def swing(field: SparseMap) -> float:
        ys, xs = (np.arange(n, dtype=float) - MARGIN for n in field.inverse_depth.shape)
        bend = field.inverse_depth - depth(np.stack(np.meshgrid(xs, ys), axis=-1))
        return float(np.abs(bend[60:-60, 60:-60]).max())

    fine, coarse, plain = waves(40.0), waves(400.0), waves(40.0, 0.0)
    assert swing(fine) > 0.0095 and swing(coarse) > 0.0095
    assert swing(fine.smoothed(48.0, PLANE)) < 0.001 and swing(coarse.smoothed(16.0, PLANE)) > 0.008
    assert swing(plain.smoothed(48.0, PLANE)) < 1e-6, "the plane itself stays, up to the picture's border"
    assert fine.smoothed(0.5, PLANE) is fine
    assert np.array_equal(fine.smoothed(48.0, PLANE).shift, fine.shift)


# --- lines ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1.0, 2.0, 2.5])
def test_nodes_lie_in_the_middle_of_their_cells(made: Made, step: float) -> None:
    _, sparse = made
    lines = EpipolarLines.over(sparse, (10, 20, 200, 150), step)
    x, y = lines.nodes
    assert lines.shape == x.shape == y.shape == (round(150 / step), round(200 / step))
    assert x[0, 0] == pytest.approx(10 + (step - 1) / 2) and y[0, 0] == pytest.approx(20 + (step - 1) / 2)
    assert x[0, -1] == pytest.approx(10 + 199 - (step - 1) / 2) and y[-1, 0] == pytest.approx(20 + 149 - (step - 1) / 2)
    np.testing.assert_allclose(np.stack([x, y], axis=-1), distort(lines.ideal, sparse.camera), atol=1e-4)


def test_where_nothing_moves_a_node_is_seen_where_the_field_sends_it(bent: Made) -> None:
    view, sparse = bent
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 3.0)
    ideal = sent(view, lines.ideal, lines.at(sparse).astype(float)) + SHIFT
    found = np.stack(lines.target(np.zeros(lines.shape, np.float32)), axis=-1)
    np.testing.assert_allclose(found, distort(ideal, sparse.camera_prime), atol=1e-3)


@pytest.mark.parametrize("move", [-12.0, 0.4, 9.0])
def test_a_move_is_a_change_of_inverse_depth(made: Made, move: float) -> None:
    """Exactly, not to first order: x' ~ H_inf p + (d + t · moved) e'."""
    view, sparse = made
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 3.0)
    expected = sent(view, lines.ideal, lines.inverse_depth + move * lines.depth_per_px.astype(float)) + SHIFT
    with np.errstate(invalid="ignore"):
        ahead = (1 + move * lines.w_rate) > 0.05
    found = np.stack(lines.target(np.full(lines.shape, move, np.float32)), axis=-1)
    assert ahead.mean() > 0.9
    np.testing.assert_allclose(found[ahead], expected[ahead], atol=2e-2)


def test_a_small_move_is_in_px_of_the_target(made: Made) -> None:
    _, sparse = made
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 3.0)
    before, after = (np.stack(lines.target(np.full(lines.shape, t, np.float32)), axis=-1) for t in (0.0, 0.25))
    far = np.linalg.norm(lines.base - project(lines_epipole(sparse)), axis=-1) > 20  # at the epipole nothing moves
    length = np.linalg.norm(after - before, axis=-1)
    assert far.mean() > 0.9 and np.abs(length[far] - 0.25).max() < 0.02


def lines_epipole(sparse: SparseMap) -> np.ndarray:
    e = sparse.two_view.e_prime
    return e if abs(e[2]) > 1e-9 else e + [0, 0, 1e-9]


@given(st.floats(-25, 25), st.sampled_from(sorted(MOTIONS)))
def test_the_move_that_leads_so_many_px_along_a_line_is_the_inverse(
    by_hand: SimpleNamespace, move: float, motion: str
) -> None:
    _, sparse = make(by_hand, motion)
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 12.0)
    moves = np.full(lines.shape, move, np.float32)
    with np.errstate(invalid="ignore"):
        ahead = (1 + move * lines.w_rate) > 0.2
    led = np.stack(lines.target(moves), axis=-1) - np.stack(lines.target(0 * moves), axis=-1)
    px = (led * lines.direction).sum(axis=-1)
    np.testing.assert_allclose(lines.along(px)[ahead], moves[ahead], atol=5e-3)


def test_some_rows_go_where_they_go_with_all_the_others(made: Made) -> None:
    lines = EpipolarLines.over(made[1], (0, 0, *SIZE), 3.0)
    rng = np.random.default_rng(3)
    along, across = (rng.normal(0, 3, lines.shape).astype(np.float32) for _ in range(2))
    whole, part = lines.target(along, across), lines.target(along, across, slice(5, 9))
    assert all(np.array_equal(a[5:9], b, equal_nan=True) for a, b in zip(whole, part, strict=True))


def test_a_field_without_shift_has_none(by_hand: SimpleNamespace) -> None:
    _, sparse = make(by_hand, sorted(MOTIONS)[0])
    still = replace(sparse, shift=None)
    points = np.random.default_rng(4).uniform(0, 60, (5, 6, 2))
    none = replace(sparse, shift=np.zeros((*sparse.inverse_depth.shape, 2), np.float32))
    for a, b in zip(still.at(points), none.at(points), strict=True):
        assert a.shape == b.shape and np.array_equal(a, b)


def test_across_leaves_the_line_by_so_many_px_to_its_side(made: Made) -> None:
    view, sparse = made
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 3.0)
    along, across = (np.full(lines.shape, v, np.float32) for v in (1.5, 2.0))
    on, off = (np.stack(lines.target(along, a), axis=-1) for a in (None, across))
    away = off - on
    np.testing.assert_allclose(away[..., 0], -2 * lines.direction[..., 1], atol=1e-4)
    np.testing.assert_allclose(away[..., 1], 2 * lines.direction[..., 0], atol=1e-4)
    flat = (off - lines.shift).reshape(-1, 2)
    assert np.abs(distance_to_line(view.F, lines.ideal.reshape(-1, 2), flat) - 2).max() < 2e-2


def test_behind_the_target_there_is_no_line(by_hand: SimpleNamespace) -> None:
    """A camera that went far ahead and is turned round has left much of the reference behind it."""
    cameras = by_hand.camera(SIZE, 220.0), by_hand.camera(SIZE, 220.0)
    view = by_hand.view(*cameras, (0.0, 80, 0), (1, 0, 0.2))
    sparse = SparseMap.over_reference(Field(depth), view, *cameras, MARGIN)
    lines = EpipolarLines.over(sparse, (0, 0, *SIZE), 3.0)
    third = (homogeneous(lines.ideal) @ view.H_inf.T + lines.inverse_depth[..., None] * view.e_prime)[..., 2]
    x, y = lines.target(np.zeros(lines.shape, np.float32))
    assert (third < 0).any() and (third > 0.1).any()
    assert np.isnan(x[third < 0]).all() and np.isnan(y[third < 0]).all()
    assert np.isfinite(x[third > 0.1]).all() and np.isfinite(y[third > 0.1]).all()


@pytest.mark.parametrize(
    "box", [(3, 5, 40, 30), (-4, 2, 21, 17), (2.25, 5, 40, 30), (3, 5, 4000, 30), (3, 5, 1, 30), (3, 5, 40, 1)]
)
def test_over_whole_pixels_it_is_what_it_is_at_them(made: Made, box: tuple[float, float, float, float]) -> None:
    _, sparse = made
    xs, ys = (start + np.arange(float(count)) for start, count in zip(box[:2], box[2:], strict=True))
    expected = sparse.at(np.stack(np.meshgrid(xs, ys), axis=-1))
    for a, b in zip(sparse.over(xs, ys), expected, strict=True):
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, atol=1e-6)
