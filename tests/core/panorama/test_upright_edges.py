"""Poles and walls tell where down is, however the camera is held; what is not upright tells nothing."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.panorama.levelling import gravity, gravity_by_edges, turned
from edf_stitch.core.panorama.upright_edges import straight_edges
from edf_stitch.core.pictures.picture import Picture, picture_from_array

K = np.array([[500.0, 0, 319.5], [0, 500.0, 239.5], [0, 0, 1]])
CAMERA = Camera(K, (640, 480), "given", 0.0)


def street(pitch: float, roll: float, seed: int = 0, upright: bool = True) -> Picture:
    """A picture of poles on a floor of noise, by a camera held like that."""
    rng = np.random.default_rng(seed)
    view = np.full((480, 640, 3), 120, np.uint8)
    camera = turned(0, pitch, roll)
    for x in np.linspace(-9, 9, 13) + rng.uniform(-0.3, 0.3, 13):
        lean = (0, 0) if upright else rng.uniform(-2, 2, 2)
        corners = np.array([(x + dx, y, 9) for dx, y in ((0, -3), (0.3, -3), (0.3, 3), (0, 3))])
        corners[:2, 0] += lean[0]
        corners[:2, 2] += lean[1]
        seen = corners @ camera.T @ K.T
        cv2.fillConvexPoly(view, np.rint(16 * seen[:, :2] / seen[:, 2:]).astype(int), (230, 210, 60), shift=4)
    return picture_from_array(cv2.GaussianBlur(view, (0, 0), 0.8))


def edges(picture: Picture, camera: Camera, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals and lengths, as levelling takes them."""
    found = straight_edges(picture, camera, K)
    return found.normals, found.lengths


def off(down: np.ndarray, pitch: float, roll: float) -> float:
    return float(np.degrees(np.arccos(np.clip(down @ turned(0, pitch, roll)[:, 1], -1, 1))))


@pytest.mark.parametrize("pitch", [0.0, 5.0, -10.0, 20.0])
@pytest.mark.parametrize("roll", [0.0, 5.0, -10.0])
def test_poles_tell_pitch_and_roll(pitch: float, roll: float) -> None:
    found = edges(street(pitch, roll), CAMERA, K)
    assert len(found[0]) > 10 and np.allclose(np.linalg.norm(found[0], axis=1), 1)
    alone = [np.eye(3)]
    assert off(gravity_by_edges(alone, *found), pitch, roll) < 0.3
    assert off(gravity(alone), pitch, roll) > abs(pitch) - 1e-6, "which the camera alone cannot tell"


def test_edges_of_the_target_count_in_the_references_frame() -> None:
    first, second = turned(0, 12, 3), turned(40, 6, -2)
    R = second @ first.T
    normals, lengths = edges(street(6, -2), CAMERA, K)
    assert off(gravity_by_edges([np.eye(3), R], normals @ (turned(0, 6, -2) @ first.T), lengths), 12, 3) < 0.4


def test_edges_of_nothing_upright_and_none_at_all_leave_it_to_the_cameras() -> None:
    none = np.zeros((0, 3)), np.zeros(0)
    same = [np.eye(3)] * 2
    assert np.array_equal(gravity_by_edges(same, *none), gravity(same))
    blank = picture_from_array(np.full((48, 64, 1), 9, np.uint8))
    assert len(edges(blank, CAMERA, K)[0]) == 0
    leaning = edges(street(0, 0, upright=False), CAMERA, K)
    assert off(gravity_by_edges(same, *leaning), 0, 0) < 20, "no more than people look up or down"


def test_edges_of_every_direction_alike_leave_it_to_the_cameras_too() -> None:
    """A patterned tabletop; all of them on a spiral over the sphere."""
    z = np.linspace(-1, 1, 1001)[:-1] + 0.001
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(1000)
    normals = np.column_stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
    lengths = np.full(1000, 0.05)
    alone = [np.eye(3)]
    assert np.array_equal(gravity_by_edges(alone, normals, lengths), [0, 1, 0])
    upright = normals.copy()
    upright[::4] -= np.outer(upright[::4] @ turned(0, 15, 4)[:, 1], turned(0, 15, 4)[:, 1])
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    assert off(gravity_by_edges(alone, upright, lengths), 15, 4) < 0.3, "but a quarter that meet in a point are not"


def test_the_border_of_what_is_transparent_is_no_edge() -> None:
    picture = street(0, 0)
    picture.view[:, :200], alpha = 0, np.ones((480, 640), np.float32)
    alpha[:, :200] = 0
    opaque = picture_from_array(np.where(alpha[..., None] > 0, 120, 0).astype(np.uint8))
    shown = replace(opaque, alpha=alpha)
    assert len(edges(shown, CAMERA, K)[0]) == 0
    assert len(edges(opaque, CAMERA, K)[0]) > 0


def test_a_smaller_picture_says_the_same() -> None:
    large = picture_from_array(cv2.resize(street(8, 2).view, (2560, 1920), interpolation=cv2.INTER_CUBIC))
    scaled = np.diag([4.0, 4.0, 1.0]) @ K
    scaled[:2, 2] = 4 * K[:2, 2] + 1.5
    found = edges(large, replace(CAMERA, K=scaled, size=(2560, 1920)), scaled)
    assert off(gravity_by_edges([np.eye(3)], *found), 8, 2) < 0.3


def test_a_picture_seen_before_is_measured_by_the_camera_of_now() -> None:
    picture, wide = street(8, 2), K * [[0.5, 1, 1], [1, 0.5, 1], [1, 1, 1]]
    first, again, other = (straight_edges(one, CAMERA, at) for one, at in (
        (picture, K), (picture, wide), (street(-6, 1, seed=3), K)
    ))  # fmt: skip
    np.testing.assert_allclose(again.rays, first.rays * [2, 2, 1], atol=1e-9)
    assert np.array_equal(again.lengths, first.lengths) and other.rays.shape != first.rays.shape


def test_ends_lie_where_the_pole_ends_and_turn_with_the_camera() -> None:
    view = np.full((480, 640, 3), 120, np.uint8)
    cv2.rectangle(view, (300, 100), (330, 400), (230, 210, 60), -1)
    found = straight_edges(picture_from_array(view), CAMERA, K)
    ends = np.sort((found.rays @ K.T)[:2, :, 1], axis=1)
    assert np.abs(ends - [99.5, 400.5]).max() < 4 and np.abs(found.lengths[:2] - 301 / 640).max() < 0.01
    R = turned(10, 5, -3)
    turned_back = found.in_reference(R)
    assert np.allclose(turned_back.normals @ R.T, found.normals) and np.allclose(turned_back.lengths, found.lengths)
