"""Horizons: found from how two cameras were held, set by hand, and never turned over by a camera on its side."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.panorama.levelling import angles_of, gravity, parse_level, turned, upright
from edf_stitch.core.system.errors import BadRequest
from hypothesis import given
from hypothesis import strategies as st

angles = st.tuples(st.floats(-179, 179), st.floats(-89, 89), st.floats(-179, 179))


def between(first: tuple[float, float, float], second: tuple[float, float, float]) -> np.ndarray:
    """R from a camera at yaw, pitch, roll to another."""
    return turned(*second) @ turned(*first).T


def off_level(level: np.ndarray, first: tuple[float, float, float]) -> float:
    """Degrees between the gravity of a rotation and the true one."""
    return float(np.degrees(np.arccos(np.clip(level[:, 1] @ turned(*first)[:, 1], -1, 1))))


def test_angles_are_those_of_hugin() -> None:
    """The reference looks right of the middle, above the horizon, and is rolled clockwise."""
    right, down, ahead = np.eye(3)
    look = turned(30, 0, 0).T @ ahead
    assert look @ right > 0.49 and abs(look @ down) < 1e-12
    assert turned(0, 20, 0).T @ ahead @ down < -0.3, "y is down"
    assert turned(0, 0, 10).T @ right @ down > 0.17, "its right hand side hangs lower"
    assert np.array_equal(turned(0, 0, 0), np.eye(3))


@given(angles)
def test_angles_and_rotations_are_inverse_to_each_other(given: tuple[float, float, float]) -> None:
    rotation = turned(*given)
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-12 and np.linalg.det(rotation) > 0
    assert np.allclose(angles_of(rotation), given, atol=1e-6)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_straight_up_and_down_roll_is_nothing(pitch: float) -> None:
    rotation = turned(25, pitch, 0)
    assert np.abs(turned(*angles_of(rotation)) - rotation).max() < 1e-7


@pytest.mark.parametrize("pitch", [0.0, 8.0, -20.0, 25.0])
@pytest.mark.parametrize("yaw", [15.0, -30.0, 60.0])
def test_cameras_that_nobody_rolled_tell_gravity(pitch: float, yaw: float) -> None:
    """Both look up or down alike; the less they turn between, the less they tell."""
    first, second = (0.0, pitch, 0.0), (yaw, pitch, 0.0)
    level = upright(gravity([np.eye(3), between(first, second)]))
    assert off_level(level, first) < abs(pitch) * {15: 0.8, 30: 0.5, 60: 0.15}[round(abs(yaw))] + 1e-6
    assert abs(angles_of(level)[0]) < 1e-9, "the reference stays in the middle"


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(-6, 6))
def test_a_shaking_hand_does_not_tilt_the_panorama_wildly(roll: float, roll_2: float, yaw: float) -> None:
    """Almost the same direction twice: the cross product of the x axes would be anything."""
    level = upright(gravity([np.eye(3), between((0, 3, roll), (yaw, 2, roll_2))]))
    assert off_level(level, (0, 3, roll)) < 12


@pytest.mark.parametrize("roll", [90.0, -90.0, 180.0, 35.0])
def test_a_camera_on_its_side_does_not_turn_the_panorama_over(roll: float) -> None:
    down = gravity([np.eye(3), between((0, 0, 0), (20, 0, roll))])
    assert down[1] > np.cos(np.radians(30)), "the reference stays upright"
    assert np.isfinite(upright(down)).all()


def test_without_a_pose_the_reference_looks_straight_ahead() -> None:
    assert np.allclose(upright(gravity([np.eye(3)])), np.eye(3), atol=1e-12)


@pytest.mark.parametrize(("text", "level"), [
    ("auto", "auto"), ("none", "none"), ("0,0,0", (0.0, 0.0, 0.0)), ("-12.5,3,1e1", (-12.5, 3.0, 10.0)),
])  # fmt: skip
def test_levels_are_read(text: str, level: object) -> None:
    assert parse_level(text) == level


@pytest.mark.parametrize("text", ["", "Auto", "5", "1,2", "1,2,3,4", "a,b,c"])
def test_other_levels_are_refused_with_those_there_are(text: str) -> None:
    with pytest.raises(BadRequest, match="auto, none, or give YAW,PITCH,ROLL in degrees") as caught:
        parse_level(text)
    assert caught.value.exit_code == 2
