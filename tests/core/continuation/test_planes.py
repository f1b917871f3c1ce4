"""Planes next to the border, and which of them goes on where."""

from __future__ import annotations

import itertools

import numpy as np
from edf_stitch.core.continuation.banded import Equations
from edf_stitch.core.continuation.plane_labels import _best, _islands
from edf_stitch.core.continuation.planes import find_planes
from edf_stitch.core.continuation.samples import Samples, samples_of, seen_at
from edf_stitch.core.continuation.system import _straight, cell_areas, without_folds
from edf_stitch.core.continuation.target_grid import TargetGrid

from .plane_worlds import AHEAD, DOWN, GROUND, RIGHT, Field, world


def sampled(planes: list[tuple[float, float, float]]) -> tuple[TargetGrid, Samples, np.ndarray]:
    """The grid of a world, its samples, and the planes' normals (K, 3) as the target sees them."""
    room = world(planes)
    view = room.views[1]
    normals = room.planes @ view.R.T
    normals /= (1 + normals @ view.t)[:, None]
    grid = TargetGrid.over(view, view.R @ DOWN)
    return grid, samples_of(Field(room.depth), *room.views, None), normals


def test_all_planes_of_a_room_are_found_with_their_kinds() -> None:
    grid, samples, normals = sampled([GROUND, AHEAD, RIGHT])
    noisy = Samples(
        samples.points, samples.inverse_depth + np.random.default_rng(0).normal(0, 5e-4, len(samples.points)),
        samples.trust, samples.at_border,
    )  # fmt: skip
    found = find_planes(grid, noisy, np.zeros(len(noisy.points)))[:3]
    for normal, kind in zip(normals, ("level", "upright", "upright"), strict=True):
        nearest = min(found, key=lambda plane: np.linalg.norm(plane.normal - normal))
        assert np.linalg.norm(nearest.normal - normal) < 0.02 * np.linalg.norm(normal) + 2e-3
        assert nearest.kind == kind


def test_samples_lie_where_the_target_sees_them() -> None:
    grid, samples, normals = sampled([AHEAD])
    assert len(samples.points) > 1000
    assert np.allclose(grid.rays_of(samples.points) @ normals[0], samples.inverse_depth, atol=1e-6)
    seen = seen_at(grid, samples)
    assert np.allclose(seen.inverse_depth[seen.inside], (grid.rays @ normals[0])[seen.inside], rtol=0.05)
    assert seen.to_border[seen.inside].min() >= 1 and (seen.to_border[grid.in_picture & ~seen.inside] == 0).all()


def test_messages_find_the_best_labels() -> None:
    random = np.random.default_rng(5)
    for shape in ((1, 6), (6, 1), (2, 3)):
        cost = random.uniform(0, 2, (*shape, 2)).astype(np.float32)
        down = random.uniform(0, 1, (shape[0] - 1, shape[1], 2, 2)).astype(np.float32)
        across = random.uniform(0, 1, (shape[0], shape[1] - 1, 2, 2)).astype(np.float32)

        def total(
            label: np.ndarray, cost: np.ndarray = cost, down: np.ndarray = down, across: np.ndarray = across
        ) -> float:
            rows, columns = np.indices(label.shape)
            return float(
                cost[rows, columns, label].sum()
                + down[rows[:-1], columns[:-1], label[:-1], label[1:]].sum()
                + across[rows[:, :-1], columns[:, :-1], label[:, :-1], label[:, 1:]].sum()
            )

        every = [np.array(one).reshape(shape) for one in itertools.product((0, 1), repeat=shape[0] * shape[1])]
        assert total(_best(cost, down, across)) <= min(map(total, every)) + (0.15 if min(shape) > 1 else 1e-5)


def test_a_plane_that_is_not_connected_to_where_it_was_seen_is_an_island() -> None:
    label = np.ones((6, 12), int)
    label[:, :3] = 0
    label[2:4, 8:10] = 0
    inside = np.zeros(label.shape, bool)
    inside[:, :6] = True
    islands = _islands(label, inside, 2)
    assert islands[2:4, 8:10, 0].all() and not islands[:, :7, 0].any() and not islands[..., 1].any()


def test_equations_of_edges_hold_on_planes_and_uprights_and_only_there() -> None:
    grid, _, normals = sampled([AHEAD])
    ends = np.array([[[300.0, 60.0], [390.0, 250.0]], [[350.0, 40.0], [350.0, 260.0]]])
    lines, uprights = _straight(grid, grid.rays_of(ends))
    plane = grid.by_number(grid.rays @ (normals[0] + [0.02, 0.05, 0.0]))
    assert len(lines.wanted) > 50 and len(uprights.wanted) > 20

    def left(equations: Equations, z: np.ndarray) -> float:
        return float(np.abs(np.einsum("nk,nk->n", equations.factors, z[equations.nodes])).max())

    assert left(lines, plane) < 1e-9
    # the left edge leans, so only the right one asks for δ / λ, which is interpolated between nodes
    assert left(uprights, grid.by_number(0.2 * grid.level_range)) < 0.05 < left(uprights, plane)
    assert left(lines, grid.by_number(0.1 + 1e-6 * grid.grid.points[..., 0] ** 2)) > 1e-4


def test_what_would_fold_is_smoothed_and_the_rest_stays() -> None:
    grid, samples, normals = sampled([AHEAD])
    seen = seen_at(grid, samples)
    wall = grid.rays @ normals[0]
    beyond = grid.in_picture & ~seen.inside
    steep = wall + 0.8 * (beyond & (np.abs(grid.grid.points[..., 0] - 370) < 12))
    assert cell_areas(grid, steep).min() < 0
    smooth = without_folds(grid, steep, seen)
    assert cell_areas(grid, smooth)[beyond[:-1, :-1]].min() > 0
    assert np.array_equal(smooth[seen.inside], steep[seen.inside])
    assert np.array_equal(without_folds(grid, wall, seen), wall)
