"""Blender's cameras as K, R, t: against Blender's own projection, by hand, and back again."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest
from edf_stitch.core.cameras.blender_camera import BlenderLens, lens_for, matrix_world_of, pose_of
from edf_stitch.core.cameras.projective import rotation_from_vector
from hypothesis import given, settings
from hypothesis import strategies as st

numbers = st.floats(-1, 1)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)

# Prints, for random cameras, the settings, the world matrix and Blender's own projection matrix.
IN_BLENDER = """
import bpy, json, random
from mathutils import Euler, Matrix
random.seed(7)
scene, out = bpy.context.scene, []
data = bpy.data.cameras.new("c"); camera = bpy.data.objects.new("c", data); scene.collection.objects.link(camera)
render = scene.render
for number in range(200):
    data.lens, data.sensor_width, data.sensor_height = (random.uniform(*r) for r in ((12, 85), (20, 40), (15, 30)))
    data.sensor_fit = ("AUTO", "HORIZONTAL", "VERTICAL")[number % 3]
    data.shift_x, data.shift_y = random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4)
    render.resolution_x, render.resolution_y = random.randint(50, 2000), random.randint(50, 2000)
    render.resolution_percentage = random.choice((100, 37, 50, 83, 29))
    if number % 2:
        render.pixel_aspect_x, render.pixel_aspect_y = random.choice(((1, 1), (2, 1), (1, 1.5), (1.2, 1)))
    place, turn = ([random.uniform(-3, 3) for _ in range(3)] for _ in range(2))
    turned = Matrix.Translation(place) @ Euler(turn).to_matrix().to_4x4()
    camera.matrix_world = turned @ Matrix.Scale(random.uniform(.2, 5), 4)
    bpy.context.view_layer.update()
    p = render.resolution_percentage
    W, H = int(render.resolution_x * p / 100), int(render.resolution_y * p / 100)
    P = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=W, y=H,
        scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y)
    out.append({"lens": {"lens": data.lens, "sensor_width": data.sensor_width, "sensor_height": data.sensor_height,
        "sensor_fit": data.sensor_fit, "shift_x": data.shift_x, "shift_y": data.shift_y, "percentage": p,
        "resolution": [render.resolution_x, render.resolution_y],
        "aspect": [render.pixel_aspect_x, render.pixel_aspect_y]},
        "size": [W, H], "world": [list(row) for row in camera.matrix_world],
        "projection": [list(row) for row in P]})
print("CAMERAS", json.dumps(out))
"""


def test_k_r_t_project_as_blender_does() -> None:
    """Within 1e-3 px over 200 cameras; Blender's own matrices are in single precision."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("bpy is not installed")
    done = subprocess.run([sys.executable, "-c", IN_BLENDER],
                          capture_output=True, text=True, timeout=120)  # fmt: skip
    cameras = json.loads(done.stdout.split("CAMERAS ")[1].splitlines()[0])
    assert len(cameras) == 200
    random, worst = np.random.default_rng(0), 0.0
    for camera in cameras:
        settings_ = {key: tuple(v) if isinstance(v, list) else v for key, v in camera["lens"].items()}
        lens = BlenderLens(**settings_)
        assert list(lens.size) == camera["size"]
        world = np.array(camera["world"])
        R, t = pose_of(world)
        world[:3, :3] /= np.linalg.norm(world[:3, :3], axis=0)
        near = np.column_stack([random.uniform(-0.4, 0.4, (8, 2)), np.full(8, -1.0)]) * random.uniform(1, 20, (8, 1))
        points = near @ world[:3, :3].T + world[:3, 3]
        # both matrices are in single precision, hence only nearly rigid: their inverse is taken as Blender's view
        x, y, _, w = np.array(camera["projection"]) @ np.linalg.inv(world) @ homogeneous_rows(points)
        width, height = camera["size"]
        expected = np.column_stack([(x / w + 1) / 2 * width - 0.5, (1 - y / w) / 2 * height - 0.5])
        seen = (points @ R.T + t) @ lens.intrinsics.T
        worst = max(worst, float(np.linalg.norm(seen[:, :2] / seen[:, 2:] - expected, axis=1).max()))
    assert worst < 1e-3


def homogeneous_rows(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.ones(len(points))]).T


def test_by_hand() -> None:
    plain = BlenderLens(lens=50, resolution=(1920, 1080))
    assert np.allclose(plain.intrinsics, [[50 / 36 * 1920, 0, 959.5], [0, 50 / 36 * 1920, 539.5], [0, 0, 1]])
    upright = BlenderLens(lens=50, resolution=(1080, 1920))
    assert upright.intrinsics[0, 0] == pytest.approx(50 / 36 * 1920), "AUTO: the sensor's width along the longer side"
    vertical = BlenderLens(lens=50, resolution=(1920, 1080), sensor_fit="VERTICAL")
    assert vertical.intrinsics[0, 0] == pytest.approx(50 / 24 * 1080)
    shifted = BlenderLens(lens=50, resolution=(1000, 500), shift_x=0.1, shift_y=0.2).intrinsics
    assert shifted[:2, 2] == pytest.approx([399.5, 449.5]), "right and up moves the picture left and down"
    wide = BlenderLens(lens=36, resolution=(1000, 500), aspect=(2, 1)).intrinsics
    assert (wide[0, 0], wide[1, 1]) == pytest.approx((1000, 2000)), "a pixel twice as wide as high"
    assert BlenderLens(lens=50, resolution=(1001, 799), percentage=37).size == (370, 295)


def test_a_camera_without_a_turn_looks_down_with_y_up() -> None:
    R, t = pose_of(np.eye(4))
    assert np.allclose(R @ [0, 0, -1], [0, 0, 1]) and np.allclose(R @ [0, 1, 0], [0, -1, 0]) and not t.any()
    away = np.eye(4)
    away[:3, 3] = 1, 2, 3
    assert np.allclose(pose_of(away)[1], [-1, 2, 3])


@settings(max_examples=50)
@given(
    st.floats(50, 9000), st.integers(10, 5000), st.integers(10, 5000), st.floats(-500, 5000), st.floats(-500, 5000),
    st.floats(4, 50),
)  # fmt: skip
def test_a_lens_for_k_has_k(f: float, width: int, height: int, cx: float, cy: float, sensor: float) -> None:
    K = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]])
    lens = lens_for(K, (width, height), sensor)
    assert lens.size == (width, height) and np.allclose(lens.intrinsics, K, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("K", [[[500, 0, 9], [0, 510, 9], [0, 0, 1]], [[500, 2, 9], [0, 500, 9], [0, 0, 1]]])
def test_what_blender_has_no_lens_for(K: list) -> None:
    with pytest.raises(ValueError, match="square pixels"):
        lens_for(np.array(K, float), (100, 100))


@settings(max_examples=50)
@given(vectors, vectors, st.floats(0.1, 10))
def test_poses_go_there_and_back_whatever_the_scale(omega: np.ndarray, t: np.ndarray, scale: float) -> None:
    R = rotation_from_vector(3 * omega)
    world = matrix_world_of(R, t)
    world[:3, :3] *= scale
    again, there = pose_of(world)
    assert np.allclose(again, R, atol=1e-12) and np.allclose(there, t, atol=1e-12)
