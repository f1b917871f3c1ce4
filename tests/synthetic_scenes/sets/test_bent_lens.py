"""Lenses with distortion: bent and straightened agree, and a bent picture shows what its camera sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.sets.bent_lens import bent, bent_camera, ideal_camera, straightened, through_lens
from hypothesis import given, settings
from hypothesis import strategies as st

from .analytic_room import camera_passes

BENDS = st.floats(-0.12, 0.12)


def camera_with(k1: float) -> SceneCamera:
    return replace(View((0.1, 0.2, 1.4), 20.0, 3.0, 4.0, 22.0).camera((160, 120)), k1=k1)


def all_pixels(camera: SceneCamera) -> np.ndarray:
    return np.stack(np.meshgrid(*(np.arange(side, dtype=float) for side in camera.size)), axis=-1)


@settings(max_examples=30, deadline=None)
@given(BENDS)
def test_straightening_undoes_bending_and_the_ideal_camera_sees_all(k1: float) -> None:
    camera = camera_with(k1)
    pixels = all_pixels(camera)
    straight = straightened(pixels, camera)
    assert np.allclose(bent(straight, camera), pixels, atol=1e-6)
    ideal, corner = ideal_camera(camera)
    assert (straight >= corner).all() and (straight <= np.array(corner) + ideal.size - 1).all()
    again = bent_camera(ideal, corner, camera.size, k1)
    assert np.allclose(again.K, camera.K) and again.size == camera.size and again.k1 == k1


@pytest.mark.parametrize("k1", [-0.08, 0.05])
def test_a_barrel_draws_corners_in_as_the_engine_means_it(k1: float) -> None:
    camera = camera_with(k1)
    pixels = all_pixels(camera)
    corner = bent(pixels, camera)[0, 0]
    assert (corner > 0).all() if k1 < 0 else (corner < 0).all()
    known = replace(Camera(camera.K, camera.size, "", 0.0), distortion=np.array([k1, 0, 0, 0, 0.0]))
    assert np.allclose(distort(pixels, known), bent(pixels, camera), atol=1e-9)


def test_what_lies_beyond_the_fold_is_not_seen() -> None:
    camera = camera_with(-0.08)
    beyond = camera.K[:2, 2] + camera.K[0, 0] * np.array([1.01 / np.sqrt(0.24), 0])
    within = beyond - [0.03 * camera.K[0, 0], 0]
    assert np.isnan(bent(beyond, camera)).all() and np.isfinite(bent(within, camera)).all()


def test_a_bent_picture_shows_along_its_rays_what_lies_there() -> None:
    camera = camera_with(-0.08)
    ideal, corner = ideal_camera(camera)
    light, depth = through_lens(camera_passes(ideal), camera, corner)
    assert light.shape == (120, 160, 3) and depth.shape == (120, 160)
    # the same rays through a camera of which they are whole pixels
    straight = np.rint(straightened(all_pixels(camera), camera)[::40, ::40] - corner).astype(int)
    at = np.rint(bent((straight + corner).astype(float), camera)).astype(int).clip(0, [159, 119])
    there = camera_passes(ideal)
    rows, columns = at[..., 1], at[..., 0]
    assert np.abs(depth[rows, columns] / there.depth[straight[..., 1], straight[..., 0]] - 1).max() < 0.03
    assert np.abs(light[rows, columns] - there.light[straight[..., 1], straight[..., 0]]).max() < 0.15
    assert all(np.array_equal(a, b) for a, b in zip(
        through_lens(there, ideal, (0, 0)), (there.light, there.depth), strict=True
    ))  # fmt: skip
