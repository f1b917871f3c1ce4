"""The sphere's pixels and directions, and where cameras see what it shows."""

from __future__ import annotations

import numpy as np
from edf_stitch.synthetic_scenes.ground_truth import visible
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera
from edf_stitch.synthetic_scenes.sets.sphere_truth import in_frame, seen_by
from hypothesis import given
from hypothesis import strategies as st

from .analytic_room import BALL, camera_passes, hit

SPHERE = SphereCamera(np.array([0.1, -0.2, 1.5]), (640, 320))
ANGLES = st.floats(-180, 180)


@given(st.lists(st.tuples(st.floats(-0.5, 639.499), st.floats(0, 319)), min_size=1, max_size=9))
def test_pixels_and_directions_are_each_others_inverse(points: list[tuple[float, float]]) -> None:
    x, y = np.array(points).T
    directions = SPHERE.directions(x, y)
    assert np.allclose(np.linalg.norm(directions, axis=-1), 1)
    back = SPHERE.pixels(3.0 * directions)
    turns = np.remainder(back[0] - x + 1, 640) - 1  # both ends of a line are one direction
    assert np.abs(turns).max() < 1e-6 and np.abs(back[1] - y).max() < 1e-6


def test_ahead_is_the_middle_right_is_right_and_up_is_up() -> None:
    x, y = SPHERE.pixels(np.array([[0, 1.0, 0], [1, 0, 0], [0, 1, 1], [-1, 0, 0]]))
    assert np.allclose(x, [319.5, 479.5, 319.5, 159.5]) and np.allclose(y, [159.5, 159.5, 79.5, 159.5])


@given(ANGLES, st.floats(-60, 60), ANGLES, st.floats(0.5, 50))
def test_a_camera_sees_points_where_projection_says(yaw: float, pitch: float, roll: float, away: float) -> None:
    camera = View((0.4, 0.3, 1.2), yaw, pitch, roll, 24.0).camera((400, 300))
    directions = SPHERE.all_directions()[::20, ::20]
    pixels, depth = seen_by(camera, SPHERE, directions, np.full(directions.shape[:2], away))
    there = (SPHERE.place + away * directions) @ camera.R.T + camera.t
    assert np.allclose(depth, there[..., 2], atol=1e-9)
    ahead = there[..., 2] > 1e-6
    expected = (there @ camera.K.T)[ahead]
    assert np.allclose(pixels[ahead], expected[:, :2] / expected[:, 2:], atol=1e-6)
    assert np.isnan(pixels[there[..., 2] < -1e-6]).all()


def test_what_is_infinitely_far_is_seen_in_its_direction() -> None:
    camera = View((5.0, 3.0, 1.2), 20.0, 5.0, 0.0, 24.0).camera((400, 300))
    directions = SPHERE.all_directions()[::20, ::20]
    pixels, depth = seen_by(camera, SPHERE, directions, np.full(directions.shape[:2], np.inf))
    ahead = directions @ camera.R[2] > 0
    expected = (directions @ camera.R.T @ camera.K.T)[ahead]
    assert np.allclose(pixels[ahead], expected[:, :2] / expected[:, 2:]) and np.isinf(depth[ahead]).all()
    assert in_frame(pixels, camera).any() and not in_frame(pixels, camera)[~ahead].any()


def test_a_ball_hides_the_wall_behind_it_from_a_camera_aside() -> None:
    camera = View((1.2, 0.0, 1.5), 0.0, 0.0, 0.0, 24.0).camera((400, 300))
    way = BALL - camera.place
    behind = camera.place + way * (np.linalg.norm(way) + 1.0) / np.linalg.norm(way)
    direction = (behind - SPHERE.place) / np.linalg.norm(behind - SPHERE.place)
    assert hit(SPHERE.place, direction[None])[0] > np.linalg.norm(behind - SPHERE.place), "it sees past the ball"
    aside = np.array([0.4, 1.0, 0.2]) / np.linalg.norm([0.4, 1.0, 0.2])
    directions = np.stack([direction, aside])[:, None]
    distance = hit(SPHERE.place, directions)
    pixels, depth = seen_by(camera, SPHERE, directions, distance)
    assert in_frame(pixels, camera).all()
    assert visible(pixels, depth, camera_passes(camera).depth).ravel().tolist() == [False, True]
