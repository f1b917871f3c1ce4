"""The focal length by straight edges: found where matches are led astray, and only then."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.pose.edge_focal import Edges, focal_by_edges
from edf_stitch.core.pose.estimation import estimate
from edf_stitch.core.pose.options import EDGE_FOCAL
from edf_stitch.core.pose.refinement import Pose, refine_pose

from ..point_scenes import FOCAL, SIZE, turned_by, unit

SIDE = max(SIZE)
K = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
HELD = turned_by(12, 25, 3)  # from a building's axes to the reference's
R, T = turned_by(4, -20, 2), unit(1, 0.1, 0.2)


def assumed(factor: float = 1.0) -> Camera:
    focal = K.copy()
    focal[0, 0] = focal[1, 1] = 0.9 * SIDE * factor
    return Camera(focal, SIZE, "assumed", INTRINSICS.assumed_sigma, knowledge=Knowledge.ASSUMED)


def matches() -> Matches:
    random = np.random.default_rng(1)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (2000, 2))
    there = (homogeneous(x) @ np.linalg.inv(K).T * random.uniform(4, 14, (len(x), 1))) @ R.T + T
    y = project(there @ K.T)
    ok = (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    assert ok.sum() > 300
    return Matches(x[ok] + random.normal(0, 0.3, (ok.sum(), 2)), y[ok] + random.normal(0, 0.3, (ok.sum(), 2)))


def edges(turn: np.ndarray, of_building: bool, seed: int) -> Edges:
    """Edges along a building's three axes in a picture whose camera is turned so from them, or anywhere."""
    random = np.random.default_rng(seed)
    middle = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (400, 2))
    points = turn[:, random.integers(0, 3, 400)].T @ K.T
    way = points[:, :2] - points[:, 2:] * middle
    angle = np.arctan2(way[:, 1], way[:, 0]) + np.radians(random.normal(0, 0.4, 400))
    free = random.uniform(0, np.pi, 400)
    angle = np.where(random.uniform(size=400) < (0.6 if of_building else 0.0), angle, free)
    lengths = np.sort(random.uniform(0.03, 0.15, 400))[::-1]
    half = np.column_stack([np.cos(angle), np.sin(angle)]) * (lengths * SIDE / 2)[:, None]
    return Edges(np.stack([middle - half, middle + half], axis=1), lengths)


def led_astray(factor: float) -> SimpleNamespace:
    """What matches would say if they asked for another focal length: K and K' times factor, and the pose that follows.
    """
    camera = assumed(factor * FOCAL / (0.9 * SIDE)).with_focal_held()
    pose, _ = refine_pose(matches(), Pose(camera.K, camera.K, R, T), camera, camera, 0.3)
    return SimpleNamespace(K=camera.K, K_prime=camera.K, R=pose.R, t=pose.t, sigma=1.0)


@pytest.mark.parametrize("factor", [0.66, 1.4])
def test_edges_of_a_building_correct_matches_that_are_led_astray(factor: float) -> None:
    both = edges(HELD, True, 0), edges(R @ HELD, True, 1)
    found = focal_by_edges(matches(), led_astray(factor), (assumed(), assumed()), both)
    assert found is not None
    for camera in found:
        assert camera.focal == pytest.approx(FOCAL, rel=0.06)
        assert camera.knowledge == Knowledge.EDGES and camera.source == EDGE_FOCAL.source


def test_matches_that_are_right_keep_their_say() -> None:
    both = edges(HELD, True, 0), edges(R @ HELD, True, 1)
    assert focal_by_edges(matches(), led_astray(1.0), (assumed(), assumed()), both) is None


@pytest.mark.parametrize("count", [400, 0])
def test_edges_that_run_anywhere_have_no_say(count: int) -> None:
    both = [edges(HELD, False, seed) for seed in (2, 3)]
    both = tuple(Edges(one.ends[:count], one.lengths[:count]) for one in both)
    assert focal_by_edges(matches(), led_astray(0.66), (assumed(), assumed()), both) is None


def test_a_focal_length_by_edges_is_held_and_said_to_be_so() -> None:
    """Matches do not move it again; its uncertainty is that of edges."""
    known = assumed(1.1)
    known = Camera(known.K, SIZE, EDGE_FOCAL.source, EDGE_FOCAL.log_sigma, knowledge=Knowledge.EDGES)
    view = estimate(matches(), known, known)
    assert view.model == "general" and view.K[0, 0] == pytest.approx(known.focal) and view.warnings == ()
    assert view.focal_source == EDGE_FOCAL.source and view.focal_deviation == EDGE_FOCAL.log_sigma
    assert 1 < view.h_inf_spread < 500
