"""What refined depth says between its nodes, and that it ends in nothing."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.moved_depth import build_refinement
from edf_stitch.core.dense.rim_options import BEYOND
from edf_stitch.core.field.refined_depth import RefinedDepth
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.raster.pull_push import carried_on

from ..line_scenes import Scene, scene


@pytest.fixture(params=[1.0, 2.75])
def refined(request: pytest.FixtureRequest) -> RefinedDepth:
    """7×9 nodes of numbers, 0 at the rim."""
    values = np.random.default_rng(3).normal(size=(7, 9, 4)).astype(np.float32)
    values[[0, -1]] = values[:, [0, -1]] = 0
    start = (-4.0, 10.0) if request.param == 1 else (-4.3, 10.2)
    return RefinedDepth(start, (request.param, request.param), values[..., 0], values[..., 1:3], values[..., 3])


def test_a_plane_is_what_its_nodes_say_linear_between_them_and_nothing_outside(refined: RefinedDepth) -> None:
    xs, ys = np.arange(-12.0, 40.0), np.arange(0.0, 40.0)
    planes = (refined.inverse_depth, "d"), (refined.shift, "s"), (refined.confidence, "c")
    for part, (values, name) in zip(refined.over(xs, ys), planes, strict=True):
        assert part.dtype == np.float32 and part.shape == (len(ys), len(xs), *values.shape[2:])
        for y, line in zip(ys, part, strict=True):
            v = (y - refined.start[1]) / refined.step[1]
            for x, got in zip(xs, line, strict=True):
                u = (x - refined.start[0]) / refined.step[0]
                if not (0 <= u <= 8 and 0 <= v <= 6):
                    assert not np.any(got), name
                    continue
                i, j = min(int(v), 5), min(int(u), 7)
                p, q = v - i, u - j
                expected = (
                    (1 - p) * ((1 - q) * values[i, j] + q * values[i, j + 1])
                    + p * ((1 - q) * values[i + 1, j] + q * values[i + 1, j + 1])
                )  # fmt: skip
                assert got == pytest.approx(expected, abs=1e-5), name


def test_strips_of_a_plane_are_the_plane(refined: RefinedDepth) -> None:
    xs, ys = np.arange(-12.0, 40.0), np.arange(0.0, 40.0)
    whole = refined.over(xs, ys)
    for cut in (3, 11, 17):
        for part, first, second in zip(whole, refined.over(xs, ys[:cut]), refined.over(xs, ys[cut:]), strict=True):
            assert np.array_equal(part, np.concatenate([first, second]))


def test_scattered_points_get_the_same(refined: RefinedDepth) -> None:
    """To the 1/32 of a node that OpenCV's interpolation is good for."""
    xs, ys = np.arange(-2.0, 15.0), np.arange(12.0, 24.0)
    for plane, points in zip(refined.over(xs, ys), refined.at(*np.meshgrid(xs, ys)), strict=True):
        assert np.abs(plane - points).max() < (1e-6 if refined.step[0] == 1 else 0.15)


# --- made of moves --------------------------------------------------------------------------------------------------


@pytest.fixture(params=["sideways", "aslant"])
def made(
    request: pytest.FixtureRequest,
) -> tuple[Scene, SparseMap, EpipolarLines, np.ndarray, np.ndarray, RefinedDepth]:
    """Moves of some px on a part of the picture: pair, field, lines, along, across, refined."""
    pair = scene(request.param)
    sparse = pair.field(shift=(0.3, 0.2))
    lines = EpipolarLines.over(sparse, (40, 30, 120, 90), 1.5)
    rows, columns = lines.shape
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    along, across = 2 + np.sin(x / 9) + y / 60, 0.4 * np.cos(y / 7)
    return pair, sparse, lines, along, across, build_refinement(lines, sparse, along, across, *everywhere(lines))


def everywhere(lines: EpipolarLines) -> tuple[np.ndarray, np.ndarray]:
    return np.full(lines.shape, 0.7, np.float32), np.ones(lines.shape, bool)


def test_on_its_nodes_it_does_what_the_moves_do(made: tuple) -> None:
    """As inverse depth along the line, and as a shift beside it: x' = π(H_inf p + (d + more) e') + shifts."""
    pair, sparse, lines, along, across, refined = made
    x, y = lines.nodes
    more, shift, sure = refined.at(x, y)
    sent = target_points(pair.view, lines.ideal, lines.inverse_depth + more.astype(float)) + lines.shift + shift
    meant = np.stack(lines.target(along, across), axis=-1)
    rim = BEYOND.confidence_erosion // 2
    inner = np.s_[rim:-rim, rim:-rim]
    np.testing.assert_allclose(sent[inner], meant[inner], atol=0.05)
    assert np.abs(sent - meant).max() < 1, "the last nodes before the border are what the others say"
    np.testing.assert_allclose(sure, 0.7, atol=1e-6)


def test_beyond_its_nodes_it_goes_on_smoothly_and_ends_in_nothing(made: tuple) -> None:
    pair, sparse, lines, along, across, refined = made
    for part in (refined.inverse_depth[..., None], refined.shift, refined.confidence[..., None]):
        for rim in (part[0], part[-1], part[:, 0], part[:, -1]):
            assert not rim.any()
    margin = (refined.confidence.shape[0] - lines.shape[0]) // 2
    inner = np.s_[margin:-margin, margin:-margin]
    assert margin >= 6 and (refined.confidence > 0).sum() == lines.depth_per_px.size, "sure of nothing beyond"
    known = refined.inverse_depth[inner]
    steps = max(np.abs(np.diff(known, axis=k)).max() for k in (0, 1))
    for k in (0, 1):
        assert np.abs(np.diff(refined.inverse_depth, axis=k)).max() < 4 * steps + known.max() / margin * 2
    beside = refined.inverse_depth[margin - 1, margin:-margin] / refined.inverse_depth[margin, margin:-margin]
    assert np.abs(beside - 1).max() < 0.25, "no step at the border"


def test_what_lies_outside_the_overlap_has_no_say(made: tuple) -> None:
    pair, sparse, lines, along, across, _ = made
    there = np.ones(lines.shape, bool)
    there[:, :20] = False
    spoiled = along.copy()
    spoiled[:, :20] = 500
    confidence = np.full(lines.shape, 0.7, np.float32)
    one, other = (build_refinement(lines, sparse, v, across, confidence, there) for v in (along, spoiled))
    for part, part_too in zip(one.parts, other.parts, strict=True):
        assert np.array_equal(part, part_too)
    assert not one.at(*(v[:, :19] for v in lines.nodes))[2].any()


def test_what_nobody_is_sure_of_does_not_go_on_beyond_the_border() -> None:
    """A mast that is found before a bare sky that moves by nonsense: beyond the border it keeps its own move, and the
    map has no step there."""
    pair = scene("sideways")
    sparse = pair.field(shift=(0.0, 0.0))
    lines = EpipolarLines.over(sparse, (40, 30, 120, 90), 1.0)
    confidence = np.zeros(lines.shape, np.float32)
    confidence[:, 40:75] = 0.9
    along, across = np.where(confidence > 0, np.float32(1), np.float32(12)), np.zeros(lines.shape, np.float32)
    refined = build_refinement(lines, sparse, along, across, confidence, np.ones(lines.shape, bool))
    rows, columns = (np.array(refined.confidence.shape) - lines.shape) // 2
    per_px = refined.inverse_depth[rows + 45, columns + 57] / 1.0  # of a px along the lines, on the mast
    moved = refined.inverse_depth / per_px
    mast = moved[rows - 8 : rows + 8, columns + 50 : columns + 66]
    assert mast.min() > 0.5 and mast.max() < 1.2
    sky = moved[:, columns + 15]
    assert abs(sky[rows + 45] - 12) < 2 and np.abs(sky[:rows]).max() < 1.2, "kept far inside alone"
    assert np.abs(np.diff(sky[: rows + 45])).max() < 1, "no fold on the way"


def test_gaps_are_filled_from_around_and_what_is_known_stays() -> None:
    y, x = np.mgrid[:50, :70].astype(np.float32)
    known = np.ones((50, 70), np.float32)
    known[20:32, 25:45] = 0
    known[:, 60:] = 0
    values = 3 + 0.02 * x
    filled, flat = (carried_on(np.where(known > 0, v, np.float32(99)), known) for v in (values, 0 * x - 1))
    assert np.array_equal(filled[known > 0], values[known > 0])
    assert np.abs(filled - values)[20:32, 25:45].max() < 0.15 and np.abs(flat + 1).max() < 1e-4
    assert np.abs(filled[:, 60:] - values[:, 59:60]).max() < 0.3
