"""The mesh of a panorama: closed all round, bounded, cut at edges; and what Blender imports and sees of it."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.scale import Scale
from edf_stitch.core.output.depth import mesh as meshes
from edf_stitch.core.output.depth.mesh import depth_grid, mesh_bytes
from edf_stitch.core.output.depth.options import MESH
from edf_stitch.core.output.depth.range_image import range_image
from edf_stitch.core.output.depth.surface import cut_surface
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.viewpoint import Viewpoint

from .finished import HEIGHT, WIDTH, finished, plane, rays_of, sphere

# A room around the viewpoint, in the first picture's frame (y down), and a ball in it.
LOW, HIGH = np.array([-3.0, -1.2, -2.0]), np.array([4.0, 1.6, 5.0])
BALL, RADIUS = np.array([0.8, 0.1, 1.6]), 0.4


def room(rays: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore"):
        walls = (np.where(rays > 0, HIGH, LOW) / rays).min(axis=-1)
    along = rays @ BALL
    left = along**2 - BALL @ BALL + RADIUS**2
    ball = np.where((left > 0) & (along > 0), along - np.sqrt(np.maximum(left, 0)), np.inf)
    return np.minimum(walls, ball)


def in_room(scale: Scale = Scale(), shows: np.ndarray | None = None) -> SimpleNamespace:  # noqa: B008
    return finished(sphere(), room(rays_of(sphere())), shows, scale=scale)


def parts_of(data: bytes) -> tuple[dict, bytes]:
    """JSON and buffer of a .glb file."""
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON" and size % 4 == 0
    rest, kind = struct.unpack("<I4s", data[20 + size : 28 + size])
    assert kind == b"BIN\0" and 28 + size + rest == len(data)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def part(told: dict, buffer: bytes, number: int, kind: str, columns: int) -> np.ndarray:
    view = told["bufferViews"][number]
    values = np.frombuffer(buffer, kind, view["byteLength"] // 4, view["byteOffset"])
    return values.reshape(-1, columns)


def test_a_whole_sphere_is_closed() -> None:
    """Every edge of a face, found by where its ends lie, belongs to another one too."""
    ranges = 2.0 + rays_of(sphere()) @ [0.5, 0.2, 0.7]
    surface = cut_surface(depth_grid(result := finished(sphere(), ranges), range_image(result)))
    _, same = np.unique(surface.vertices.round(9), axis=0, return_inverse=True)
    faces = same.reshape(-1)[surface.faces]
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends = ends[ends[:, 0] != ends[:, 1]]  # faces at a pole have three corners
    there = {tuple(one) for one in ends.tolist()}
    assert {(b, a) for a, b in there} == there and len(there) == len(ends)


def test_it_holds_the_room_and_no_skins() -> None:
    result = in_room()
    surface = cut_surface(depth_grid(result, range_image(result)))
    points = surface.vertices * [1, -1, -1] @ sphere().projection.rotation.T
    away = np.linalg.norm(points, axis=1)
    assert np.percentile(np.abs(room(points / away[:, None]) / away - 1), 99) < 0.05
    near = away < 2.1
    on_ball = np.linalg.norm(points - BALL, axis=1) < RADIUS + 0.05
    mixed = on_ball[surface.faces].any(axis=1) & ~on_ball[surface.faces].all(axis=1)
    assert on_ball.sum() > 300 and near.sum() > on_ball.sum() and mixed.mean() < 1e-4


def test_the_number_of_its_faces_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "MESH", replace(MESH, most_nodes=5000))
    result = in_room()
    assert 4000 < len(cut_surface(depth_grid(result, range_image(result))).faces) < 6000
    shows = np.zeros((HEIGHT, WIDTH), bool)
    shows[60:120, 100:200] = True
    result = in_room(shows=shows)
    assert 4000 < len(cut_surface(depth_grid(result, range_image(result))).faces) < 6500, "of what is shown"


def test_the_file_holds_all_in_its_own_axes_and_metres() -> None:
    result = in_room(Scale(2.0, "told"))
    data, warnings = mesh_bytes(result, range_image(result))
    assert not warnings and data == mesh_bytes(result, range_image(result))[0]
    told, buffer = parts_of(data)
    points, uvs = part(told, buffer, 0, "<f4", 3), part(told, buffer, 1, "<f4", 2)
    corners = part(told, buffer, 2, "<u4", 3)
    assert corners.max() == len(points) - 1 and len(uvs) == len(points)
    assert told["asset"]["extras"] == {"unit": "metres", "source": "told"}
    # ahead is −z, right is x, up is y: where the middle of each quarter of the texture lies
    u, v = uvs.T
    heading = np.arctan2(points[:, 0], -points[:, 2])
    inner = (v > 0.1) & (v < 0.9) & (u > 0.01) & (u < 0.99)
    np.testing.assert_allclose(heading[inner], (u[inner] - 0.5) * 2 * np.pi, atol=1e-5)
    rise = np.arctan2(points[:, 1], np.hypot(points[:, 0], points[:, 2]))
    np.testing.assert_allclose(rise, (0.5 - v) * np.pi, atol=1e-5)
    true = 2.0 * room(points * [1, -1, -1] @ sphere().projection.rotation.T / np.linalg.norm(points, axis=1)[:, None])
    assert np.median(np.abs(np.linalg.norm(points, axis=1) / true - 1)) < 0.01
    a, b, c = (points[corners[:, k]] for k in range(3))
    facing = np.sum(np.cross(b - a, c - a) * a, axis=1)
    assert (facing < 1e-6).all(), "counter-clockwise as seen from the origin"
    view = told["bufferViews"][3]
    png = np.frombuffer(buffer, np.uint8, view["byteLength"], view["byteOffset"])
    assert cv2.imdecode(png, cv2.IMREAD_UNCHANGED).shape == (HEIGHT, WIDTH, 3)
    assert "alphaMode" not in told["materials"][0]


def test_what_the_panorama_does_not_show_is_cut_out_of_its_texture() -> None:
    shows = np.ones((HEIGHT, WIDTH), bool)
    shows[:, 100:150] = False
    result = in_room(shows=shows)
    told, buffer = parts_of(mesh_bytes(result, range_image(result))[0])
    assert told["materials"][0]["alphaMode"] == "MASK"
    uvs = part(told, buffer, 1, "<f4", 2)
    assert not ((uvs[:, 0] > 103 / WIDTH) & (uvs[:, 0] < 147 / WIDTH)).any()
    assert (uvs[:, 0] * WIDTH)[uvs[:, 0] < 0.35].max() == pytest.approx(100, abs=1e-3), "up to where it ends"


def test_a_large_texture_is_reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "MESH", replace(MESH, texture_px=120))
    result = in_room()
    told, buffer = parts_of(mesh_bytes(result, range_image(result))[0])
    view = told["bufferViews"][3]
    png = np.frombuffer(buffer, np.uint8, view["byteLength"], view["byteOffset"])
    assert cv2.imdecode(png, cv2.IMREAD_UNCHANGED).shape == (60, 120, 3)


def test_where_the_viewpoint_slides_points_stand_where_they_are_and_that_is_said() -> None:
    c = np.array([1.0, 0, 0])
    viewpoint = Viewpoint(0.5, c, np.eye(3), np.array([1.0, 0]), (-0.2, 0.2))
    canvas = plane()
    places = viewpoint.place(rays_of(canvas))
    wall = (4.0 - places[..., 2]) / rays_of(canvas)[..., 2]
    slides = finished(canvas, wall, viewpoint=viewpoint, scale=Scale(2.0, "told"))
    surface = cut_surface(depth_grid(slides, range_image(slides)))
    vertices = surface.vertices / 2.0
    np.testing.assert_allclose(vertices[:, 2], -4.0, rtol=0.01)
    x = 4.0 * (surface.uvs[:, 0] * 200 - 100) / (WIDTH / (2 * np.pi))
    assert np.allclose(vertices[:, 0][x < -2], x[x < -2], atol=0.05)
    assert np.allclose(vertices[:, 0][x > 2], x[x > 2] + 0.5, atol=0.05)
    assert "slides" in mesh_bytes(slides, range_image(slides))[1][0]


@pytest.fixture
def seen(tmp_path: Path) -> Callable[[bytes], np.ndarray]:
    """What a spherical camera of Blender's at the origin sees of a file, levels (H, W, 4)."""
    bpy = pytest.importorskip("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    try:
        scene.render.engine = "CYCLES"
    except TypeError:
        pytest.skip("this Blender has no Cycles")

    def render(data: bytes) -> np.ndarray:
        (tmp_path / "mesh.glb").write_bytes(data)
        bpy.ops.import_scene.gltf(filepath=str(tmp_path / "mesh.glb"))
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(camera)
        scene.camera, camera.rotation_euler = camera, (np.pi / 2, 0, 0)  # along +y, z up
        camera.data.type, camera.data.clip_start = "PANO", 1e-3
        lens = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
        lens.panorama_type = "EQUIRECTANGULAR"
        scene.cycles.samples, scene.cycles.use_denoising = 4, False
        scene.view_settings.view_transform, scene.render.film_transparent = "Standard", True
        scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
        scene.render.resolution_percentage = 100
        scene.render.image_settings.file_format = "PNG"
        scene.render.image_settings.color_mode = "RGBA"
        scene.render.filepath = str(tmp_path / "seen.png")
        bpy.ops.render.render(write_still=True)
        return cv2.imread(str(tmp_path / "seen.png"), cv2.IMREAD_UNCHANGED).astype(float)

    return render


@pytest.mark.blender
def test_blender_imports_it_and_sees_the_panorama_from_the_origin(seen: Callable[[bytes], np.ndarray]) -> None:
    import bpy

    result = in_room(Scale(2.0, "told"))
    smooth = cv2.resize(np.random.default_rng(1).random((19, 37, 3)), (WIDTH, HEIGHT)).astype(np.float32)
    result.panorama = Layer(smooth, result.panorama.alpha)
    data, _ = mesh_bytes(result, range_image(result))
    picture = seen(data)
    told, buffer = parts_of(data)
    view = told["bufferViews"][3]
    png = np.frombuffer(buffer, np.uint8, view["byteLength"], view["byteOffset"])
    true = cv2.imdecode(png, cv2.IMREAD_UNCHANGED).astype(float)
    there = picture[..., 3] == 255
    assert there.mean() > 0.999, "no gaps"
    off = np.abs(picture[..., :3] - true)[there].mean()
    assert off < 2
    assert np.abs(np.roll(picture[..., :3], 3, axis=1) - true)[there].mean() > 3 * off
    (made,) = (one for one in bpy.data.objects if one.type == "MESH")
    points = np.array([made.matrix_world @ vertex.co for vertex in made.data.vertices])
    extent = points.max(axis=0) - points.min(axis=0)
    turned = np.abs(sphere().projection.rotation.T) @ (HIGH - LOW) * 2.0
    assert extent[2] == pytest.approx(turned[1], rel=0.06), "z is up, in metres"
