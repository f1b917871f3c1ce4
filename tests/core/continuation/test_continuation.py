"""What goes on beyond the overlap, against worlds of which everything is true."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, rotation_from_vector
from edf_stitch.core.continuation.continuation import Continuation, continue_beyond
from edf_stitch.core.continuation.options import LABELS, SYSTEM
from edf_stitch.core.continuation.target_grid import TargetGrid

from ...asked import counting
from .plane_worlds import AHEAD, DOWN, GROUND, RIGHT, SIZE, Field, World, world


@pytest.mark.parametrize(
    ("planes", "median", "p90"),
    [([AHEAD], 0.01, 0.01), ([GROUND, AHEAD], 0.1, 0.8), ([GROUND, AHEAD, RIGHT], 0.1, 0.5)],
    ids=["a wall", "a wall and the ground", "a corner of a room"],
)
def test_planes_go_on(planes: Sequence[tuple[float, float, float]], median: float, p90: float) -> None:
    room = world(planes)
    error = room.error(room.continued())
    assert np.median(error) < median and np.percentile(error, 90) < p90


def test_a_leaning_camera_asks_gravity_which_walls_are_upright() -> None:
    room = world([GROUND, AHEAD, RIGHT])
    lean = rotation_from_vector(np.radians([0.0, 0.0, 25.0]))
    tilted = world([tuple(lean @ np.array(plane)) for plane in (GROUND, AHEAD, RIGHT)])
    assert np.percentile(room.error(room.continued()), 90) < 0.5
    assert np.percentile(tilted.error(tilted.continued(down=lean @ DOWN)), 90) < 1.0


def test_leaves_at_the_border_do_not_pull_the_wall_behind_them() -> None:
    room = world([GROUND, AHEAD])
    cells = np.random.default_rng(1).random((SIZE[1] // 20 + 2, SIZE[0] // 20 + 2)) < 0.25

    def leafy(points: np.ndarray) -> np.ndarray:
        column, row = (np.clip(points[..., k] / 20, 0, side // 20).astype(int) for k, side in enumerate(SIZE))
        return room.depth(points) + 0.15 * cells[row, column]

    error = room.error(room.continued(leafy))
    assert np.median(error) < 0.7 and np.percentile(error, 90) < 2.5


def test_a_ray_meets_the_surface_at_its_range_and_nothing_lies_beyond_infinity() -> None:
    room = world([AHEAD])
    surface = room.continued()
    rays = room.target_rays[::9, ::9].reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.allclose(surface.at(rays), rays[:, 2] / 8, atol=2e-4)
    everywhere = np.random.default_rng(0).normal(size=(500, 3))
    everywhere /= np.linalg.norm(everywhere, axis=1, keepdims=True)
    found = surface.at(everywhere)
    assert np.isfinite(found).all() and (found >= 0).all()


def test_of_two_surfaces_a_ray_shows_the_nearer() -> None:
    room = world([AHEAD])
    grid = TargetGrid.over(room.views[1], DOWN)
    # a pillar that hides what lies behind it from the reference's place: rays beside it meet pillar and wall
    pillar = np.abs(grid.grid.points[..., 0] - 200) < 20
    surface = Continuation.of(room.views[0].K, grid, np.where(pillar, 0.6, 0.1), 20.0)
    ray = grid.panorama_rays(surface.inverse_depth)[pillar & (np.abs(grid.grid.points[..., 1] - 150) < 10)]
    unit = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    assert (surface.at(unit) > 0.4).all()


def test_whether_to_go_on_is_asked_at_every_round() -> None:
    room = world([GROUND, AHEAD])
    with counting() as count:
        room.continued()
    assert count["find_planes"] >= 2 and count["surface"] >= SYSTEM.first_rounds + SYSTEM.rounds
    assert count["_best"] >= LABELS.sweeps


def test_the_outline_lies_on_the_surface() -> None:
    room = world([AHEAD])
    surface = room.continued()
    points = np.array([[10.0, 20.0], [380.0, 290.0], [200.0, 150.0]])
    rays = surface.outline(points)
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    view = room.views[1]
    there = (unit @ view.R.T + surface.at(unit)[:, None] * view.t) @ view.K.T
    assert np.allclose(there[:, :2] / there[:, 2:], points, atol=0.2)


def test_the_same_bytes_each_time() -> None:
    room = world([GROUND, AHEAD, RIGHT])
    assert room.continued().inverse_depth.tobytes() == room.continued().inverse_depth.tobytes()


def test_it_takes_over_more_slowly_where_the_field_is_far_off_at_the_border() -> None:
    room = world([AHEAD])
    calm = room.continued()

    def step(points: np.ndarray) -> np.ndarray:
        return room.depth(points) + 0.12 * (points[..., 0] > SIZE[0] - 12)

    assert calm.takeover_px == pytest.approx(0.015 * SIZE[0])
    assert room.continued(step).takeover_px > 1.5 * calm.takeover_px


def test_without_a_baseline_or_an_overlap_nothing_is_continued() -> None:
    room = world([AHEAD])
    reference, target = room.views
    still = type(target)(target.camera, target.K, target.R, np.zeros(3), target.H_inf, np.zeros(3))
    arguments = None, room.picture, np.zeros((0, 2, 3)), DOWN, True
    assert continue_beyond(Field(room.depth), (reference, still), *arguments) is None
    away = world([AHEAD], yaw=100.0)
    assert continue_beyond(Field(away.depth), away.views, *arguments) is None


def edges_upright(room: World, columns: Sequence[float]) -> np.ndarray:
    """Rays to both ends of upright edges at some columns of the target, which looks level."""
    ends = np.array([[[column, 20.0], [column, 280.0]] for column in columns])
    return homogeneous(ends) @ np.linalg.inv(room.views[1].K).T


def bent(points: np.ndarray) -> np.ndarray:
    """Inverse depth of a surface that bulges both ways: no plane."""
    return 0.12 + 0.01 * np.sin(points[..., 0] / 40 + points[..., 1] / 60)


def test_straight_edges_stay_straight() -> None:
    room = world([AHEAD])
    ends = np.array([[[300.0, 60.0], [390.0, 250.0]]])
    edge = homogeneous(ends) @ np.linalg.inv(room.views[1].K).T

    def bend(surface: Continuation) -> float:
        """rad by which the edge's rays leave one plane."""
        at = ends[0, 0] + np.linspace(0, 1, 50)[:, None] * (ends[0, 1] - ends[0, 0])
        rays = surface.outline(at)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return float(np.linalg.svd(rays)[1][2])

    # the same edge found many times outweighs what else the surface wants
    free, held = (bend(room.continued(bent, edges)) for edges in (None, np.repeat(edge, 60, axis=0)))
    assert held < 0.5 * free


def test_upright_edges_stay_upright_as_far_as_gravity_is_confirmed() -> None:
    room = world([AHEAD])

    def lean(surface: Continuation) -> float:
        """Degrees off upright of the edges as the panorama shows them."""
        ends = np.array([[[column, 40.0], [column, 260.0]] for column in (330.0, 380.0)])
        rays = surface.outline(ends)
        normals = np.cross(rays[:, 0], rays[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return float(np.degrees(np.arcsin(np.abs(normals @ DOWN).max())))

    edges = edges_upright(room, (330.0, 380.0))
    free, doubtful, sure = (
        lean(room.continued(bent, lines, confirmed))
        for lines, confirmed in ((None, True), (edges, False), (edges, True))
    )
    assert sure < 0.6 * free and sure < 0.7 * doubtful
