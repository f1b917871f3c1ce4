"""Straight edges stay straight where nearly all that was found along them says so, and nowhere else."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.straight_edges import straightened

from ..line_scenes import Field

SIZE = (160, 120)
EDGE = np.array([[[20.0, 30.0], [130.0, 70.0]]])


@pytest.fixture(params=[1.0, 1.25], ids=["at full size", "smaller"])
def lines(request: pytest.FixtureRequest, by_hand: SimpleNamespace) -> EpipolarLines:
    """A slanting wall, whose field is right."""
    camera = by_hand.camera(SIZE, 200.0)
    view = by_hand.view(camera, camera, (0.0, 0, 0), (-1, 0.05, 0.0))
    wall = Field(lambda points: 0.02 + 1e-4 * points[..., 0] + 5e-5 * points[..., 1])
    sparse = SparseMap.over_reference(wall, view, camera, camera, 10)
    return EpipolarLines.over(sparse, (0, 0, *SIZE), request.param)


def from_edge(lines: EpipolarLines) -> tuple[np.ndarray, np.ndarray]:
    """Distances (h, w) px of all nodes from the edge, and places along it from 0 to 1."""
    x, y = np.moveaxis(lines.ideal, -1, 0)
    start, span = EDGE[0, 0], EDGE[0, 1] - EDGE[0, 0]
    length = np.linalg.norm(span)
    across = ((x - start[0]) * span[1] - (y - start[1]) * span[0]) / length
    return np.abs(across), ((x - start[0]) * span[0] + (y - start[1]) * span[1]) / length**2


def bend(lines: EpipolarLines, along: np.ndarray) -> float:
    away, place = from_edge(lines)
    on = (away < 1) & (place > 0.05) & (place < 0.95)
    return float(along[on].std())


def test_what_was_found_along_an_edge_is_put_onto_its_line(lines: EpipolarLines) -> None:
    away, place = from_edge(lines)
    along = (0.3 * np.sin(25 * place) * np.exp(-((away / 6) ** 2))).astype(np.float32)
    found = straightened(lines, along, EDGE)
    assert found.dtype == np.float32 and bend(lines, found) < 0.25 * bend(lines, along)
    assert np.array_equal(found[away > 10], along[away > 10]), "what lies elsewhere is not touched"


def test_where_it_lies_does_not_matter_as_long_as_it_is_straight(lines: EpipolarLines) -> None:
    """A line in space that is nearer than the field has it, and comes nearer along itself."""
    away, place = from_edge(lines)
    depth = np.where(away < 3, 0.01 + 0.005 * place, 0)
    along = (depth / lines.depth_per_px).astype(np.float32)
    assert np.abs(straightened(lines, along, EDGE) - along)[(away < 0.5) & (place > 0.1) & (place < 0.9)].max() < 0.02


def test_a_part_that_lies_elsewhere_stays_where_it_was_found(lines: EpipolarLines) -> None:
    """A sixth of the edge belongs to something nearer."""
    away, place = from_edge(lines)
    other = (place > 0.58) & (place < 0.74)
    along = np.where(other, 4.0, 0.2 * np.sin(25 * place)).astype(np.float32)
    found = straightened(lines, along, EDGE)
    core = (place > 0.65) & (place < 0.67)
    assert np.array_equal(found[core], along[core])
    rest = (away < 1) & ((place < 0.55) | (place > 0.8)) & (place > 0.05) & (place < 0.95)
    assert found[rest].std() < 0.5 * along[rest].std()


@pytest.mark.parametrize("much", [2.0, 6.0])
def test_an_edge_that_is_not_straight_in_space_is_left_alone(lines: EpipolarLines, much: float) -> None:
    _, place = from_edge(lines)
    along = (much * np.sin(12 * place)).astype(np.float32)
    assert np.array_equal(straightened(lines, along, EDGE), along)


def test_nothing_is_done_without_edges_or_where_nothing_is_known(lines: EpipolarLines) -> None:
    along = np.random.default_rng(1).normal(0, 0.2, lines.shape).astype(np.float32)
    assert np.array_equal(straightened(lines, along, np.zeros((0, 2, 2))), along)
    assert np.array_equal(straightened(lines, along, np.array([[[50.0, 50], [56, 50]]])), along), "too short"
    assert np.array_equal(straightened(lines, along, EDGE + 500), along), "outside"


def test_what_lies_behind_the_camera_says_nothing_of_the_rest(lines: EpipolarLines) -> None:
    away, place = from_edge(lines)
    along = (0.3 * np.sin(25 * place)).astype(np.float32)
    along[(place > 0.5) & (place < 0.55)] = np.nan
    rest = (away < 1) & (place > 0.6) & (place < 0.95)
    assert straightened(lines, along, EDGE)[rest].std() < 0.3 * along[rest].std()
