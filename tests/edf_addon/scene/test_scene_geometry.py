"""Cameras and mesh out of a stitch: what they see is what the pictures and the panorama show."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.blender_camera import pose_of
from edf_stitch.core.cameras.projective import homogeneous, project, rotation_from_vector
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("bpy")

from edf_stitch.edf_addon.scene import scene_geometry as sg  # noqa: E402

SIZE, SIZE_PRIME, CANVAS = (400, 300), (320, 480), (560, 360)


@pytest.fixture(scope="module")
def known(by_hand):
    """What a result of a flat panorama holds."""
    view = by_hand.view(by_hand.camera(SIZE, 350.0), by_hand.camera(SIZE_PRIME, 410.0), (3, -8, 2), (1, 0.1, 0.2))
    K_canvas = view.K.copy()
    K_canvas[:2, 2] += 40, 25
    geometry = {
        "full_sizes": [list(SIZE), list(SIZE_PRIME)], "K": view.K.tolist(), "K_prime": view.K_prime.tolist(),
        "R": view.R.tolist(), "t": view.t.tolist(), "K_canvas": K_canvas.tolist(), "canvas": list(CANVAS),
    }  # fmt: skip
    return {"geometry": geometry, "report": {"canvas": {"projection": {"kind": "perspective"}}}}


def with_(known: dict, **geometry) -> dict:
    return {**known, "geometry": {**known["geometry"], **geometry}}


def round_one(known: dict, kind: str) -> dict:
    """The same of a round panorama, turned and cut off somewhere."""
    rotation = rotation_from_vector(np.radians((-7.0, 11.0, 4.0)))
    told = {"kind": kind, "focal_px": 250.0, "centre": [300.5, 140.25], "rotation": rotation.tolist()}
    nothing = [[None] * 3] * 3
    return {**with_(known, K_canvas=nothing), "report": {"canvas": {"projection": told}}}


def grid_of(columns: int, rows: int, d: np.ndarray, shows: np.ndarray | None = None) -> dict:
    shows = np.ones(columns * rows, int) if shows is None else shows
    return {"columns": columns, "rows": rows, "inverse_depth": d.ravel().tolist(), "shows": shows.ravel().tolist()}


def seen_by(camera: sg.PlacedCamera, points: np.ndarray) -> np.ndarray:
    """Where world points (N, 3) are seen, by Blender's own conventions; px."""
    R, t = pose_of(camera.matrix_world)
    return project((points @ R.T + t) @ camera.lens.intrinsics.T)


def test_the_reference_camera_stands_at_the_origin_upright_and_looks_along_y(known):
    reference = sg.placed_cameras(known)[0]
    np.testing.assert_allclose(reference.matrix_world[:3, 3], 0)
    np.testing.assert_allclose(reference.matrix_world[:3, :3] @ [0, 0, -1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(reference.matrix_world[:3, :3] @ [0, 1, 0], [0, 0, 1], atol=1e-12)


@given(baseline=st.floats(0.01, 100), seed=st.integers(0, 1000))
def test_a_point_is_seen_where_the_pictures_show_it(known, baseline, seed):
    """x and x' of one world point, and the panorama's pixel, agree with the three cameras, whatever the scale."""
    random = np.random.default_rng(seed)
    X = np.array([*random.uniform(-1, 1, 2), random.uniform(4, 20)])  # the reference camera's frame, baseline 1
    R, t, K, K_prime = (np.array(known["geometry"][key]) for key in ("R", "t", "K", "K_prime"))
    world = baseline * sg.UPRIGHT @ X
    cameras = sg.placed_cameras(known, baseline)
    assert [camera.name for camera in cameras] == ["Reference", "Target", "Panorama"]
    expected = project(K @ X), project(K_prime @ (R @ X + t)), project(np.array(known["geometry"]["K_canvas"]) @ X)
    for camera, pixel in zip(cameras, expected, strict=True):
        np.testing.assert_allclose(seen_by(camera, world[None])[0], pixel, atol=1e-8)
    apart = cameras[1].matrix_world[:3, 3] - cameras[0].matrix_world[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(apart), baseline)


def test_without_a_pose_there_is_no_target_camera(known):
    plane = with_(known, R=[[None] * 3] * 3, t=[None] * 3)
    assert [camera.name for camera in sg.placed_cameras(plane)] == ["Reference", "Panorama"]


def test_a_rotation_puts_both_cameras_in_one_place(known):
    turned = sg.placed_cameras(with_(known, t=[0, 0, 0]))
    np.testing.assert_allclose(turned[1].matrix_world[:3, 3], 0, atol=1e-12)
    assert not np.allclose(turned[1].matrix_world, turned[0].matrix_world)


@pytest.fixture(params=[None, 0.8])
def framed(request, known):
    """A result on a level plane of its own, and the same with a viewpoint that slides."""
    one = round_one(known, "perspective")
    if request.param is None:
        return one
    R, t = (np.array(one["geometry"][name]) for name in ("R", "t"))
    viewpoint = {"s1": request.param, "c": (-R.T @ t).tolist(), "rotation": np.eye(3).tolist(), "along": [1.0, 0.0],
                 "ends": [-0.2, 0.5]}  # fmt: skip
    return with_(one, viewpoint=viewpoint)


def test_a_plane_of_its_own_has_a_shifted_camera_that_sees_its_px(framed):
    """From where its middle is seen: there exactly, whatever the distance."""
    panorama = sg.placed_cameras(framed, 2.0)[-1]
    assert panorama.name == "Panorama" and panorama.lens.size == CANVAS
    projection, viewpoint = sg.projection_of(framed), sg.viewpoint_of(framed)
    middle = (np.array(CANVAS) - 1) / 2
    ray = projection.rays(middle)
    place = np.zeros(3) if viewpoint is None else viewpoint.place(ray)
    world = (place + ray * np.array([[3.0], [40.0]])) * 2.0 @ sg.axes(framed).T
    np.testing.assert_allclose(seen_by(panorama, world), [middle, middle], atol=1e-7)
    if viewpoint is None:
        assert panorama.place == "the reference's place"
        away = projection.rays(np.array([[0.0, 0], [559, 359]])) * 7.0
        np.testing.assert_allclose(seen_by(panorama, away * 2.0 @ sg.axes(framed).T), [[0, 0], [559, 359]], atol=1e-7)
    else:
        assert "of the way" in panorama.place and "0% to 80%" in panorama.place


def test_the_mesh_holds_the_points_that_were_seen_from_wherever_the_viewpoint_is(framed):
    """A plane is a plane, and the same one."""
    projection, viewpoint, normal = sg.projection_of(framed), sg.viewpoint_of(framed), np.array([0.1, -0.05, 0.3])
    nodes = np.stack(np.meshgrid(np.linspace(0, 559, 29), np.linspace(0, 359, 19)), axis=-1).reshape(-1, 2)
    rays = projection.rays(nodes)
    places = np.zeros_like(rays) if viewpoint is None else viewpoint.place(rays)
    d = (rays @ normal) / (1 - places @ normal)
    mesh = sg.depth_mesh({**framed, "depth": grid_of(29, 19, d)}, 3.0, farthest=1e6)
    X = mesh.vertices @ sg.axes(framed) / 3.0
    np.testing.assert_allclose(X @ normal, 1, atol=1e-9)


def test_panini_has_no_camera_but_as_a_plane(framed):
    told = {**framed["report"]["canvas"]["projection"], "kind": "pannini"}
    for distance, names in ((0.5, ["Reference", "Target"]), (0.0, ["Reference", "Target", "Panorama"])):
        one = {**framed, "report": {"canvas": {"projection": {**told, "distance": distance}}}}
        assert [camera.name for camera in sg.placed_cameras(one)] == names


def test_the_sizes_of_the_lenses_are_those_of_the_pictures(known):
    assert [camera.lens.size for camera in sg.placed_cameras(known)] == [SIZE, SIZE_PRIME, CANVAS]


def test_a_resized_pictures_two_focals_become_one(known):
    K = np.array(known["geometry"]["K"])
    K[0, 0] *= 1.0004
    camera = sg.placed_cameras(with_(known, K=K.tolist()))[0]
    assert camera.lens.intrinsics[0, 0] == pytest.approx(np.sqrt(K[0, 0] * K[1, 1]))


def test_the_meshs_vertices_lie_on_the_rays_of_their_uvs_at_the_depth_that_was_found(known):
    random = np.random.default_rng(2)
    d = random.uniform(0.05, 0.5, (9, 14))
    mesh = sg.depth_mesh({**known, "depth": grid_of(14, 9, d)}, baseline=2.5)
    panorama = sg.placed_cameras(known, 2.5)[-1]
    pixels = mesh.uvs * [1, -1] * CANVAS + [-0.5, CANVAS[1] - 0.5]
    np.testing.assert_allclose(seen_by(panorama, mesh.vertices), pixels, atol=1e-7)
    np.testing.assert_allclose(mesh.vertices[:, 1], 2.5 / d.ravel())
    assert len(mesh.faces) == 13 * 8


def test_faces_look_at_the_camera(known):
    mesh = sg.depth_mesh({**known, "depth": grid_of(5, 4, np.full(20, 0.2))})
    a, b, c, _ = (mesh.vertices[mesh.faces[:, corner]] for corner in range(4))
    assert (np.cross(b - a, c - a)[:, 1] < 0).all()


def test_a_plane_becomes_a_plane(known):
    K = np.array(known["geometry"]["K_canvas"])
    m = np.array([0.0004, -0.0002, 0.2])
    x, y = np.meshgrid(np.linspace(0, CANVAS[0] - 1, 12), np.linspace(0, CANVAS[1] - 1, 8))
    mesh = sg.depth_mesh({**known, "depth": grid_of(12, 8, homogeneous(np.stack([x, y], axis=-1)) @ m)})
    in_camera = mesh.vertices @ sg.UPRIGHT
    np.testing.assert_allclose(in_camera @ (K.T @ m), 1.0)


def test_what_lies_at_infinity_or_beyond_ends_at_the_farthest_depth(known):
    d = np.full((4, 6), 0.5)
    d[0] = 0.0
    d[1, :3] = -0.3
    mesh = sg.depth_mesh({**known, "depth": grid_of(6, 4, d)}, farthest=10)
    assert len(mesh.faces) == 15
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 1].round(9)), [2, 20])


def test_where_nothing_shows_or_the_depth_is_unknown_there_is_no_mesh(known):
    d, shows = np.full((4, 6), 0.5), np.ones((4, 6), int)
    shows[:, :2] = 0
    d[0, 5] = np.nan
    mesh = sg.depth_mesh({**known, "depth": grid_of(6, 4, d, shows)})
    assert len(mesh.faces) == 15 - 3 - 1, "the column between hidden nodes, and the face at the unknown one"
    assert len(mesh.vertices) == 24 - 4 - 1, "no loose vertices"
    assert mesh.faces.max() == len(mesh.vertices) - 1


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_panorama_without_depth_has_no_mesh(known, value):
    with pytest.raises(ValueError, match="no depth"):
        sg.depth_mesh({**known, "depth": grid_of(3, 3, np.full(9, value))})


@pytest.mark.parametrize("kind", ["cylindrical", "equirectangular"])
def test_a_round_panorama_stands_level_and_its_mesh_where_its_px_look(known, kind):
    """In the world's own directions: heading to the right of +y, elevation above the horizon."""
    round_ = round_one(known, kind)
    d = np.random.default_rng(3).uniform(0.05, 0.5, (8, 12))
    mesh = sg.depth_mesh({**round_, "depth": grid_of(12, 8, d)}, baseline=2.0)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 2.0 / d.ravel())
    x, y, z = mesh.vertices.T
    rise = z / np.hypot(x, y) if kind == "cylindrical" else np.arctan2(z, np.hypot(x, y))
    seen = np.stack([np.arctan2(x, y), -rise], axis=-1) * 250.0 + (300.5, 140.25)
    pixels = mesh.uvs * [1, -1] * CANVAS + [-0.5, CANVAS[1] - 0.5]
    np.testing.assert_allclose(seen, pixels, atol=1e-7)
    panorama = sg.placed_cameras(round_, 2.0)[-1]
    assert panorama.lens.resolution == CANVAS and panorama.lens.kind == kind
    np.testing.assert_allclose(panorama.matrix_world[:3, :3] @ [0, 0, -1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.array(panorama.lens.headings) * 250, [-301, 259.0])
    np.testing.assert_allclose(np.array(panorama.lens.elevations) * 250, [-219.25, 140.75])


@given(seed=st.integers(0, 1000))
def test_under_a_round_panorama_the_flat_cameras_stand_as_they_did(known, seed):
    """Turned with the world, and a point is still seen where the pictures show it."""
    random = np.random.default_rng(seed)
    X = np.array([*random.uniform(-1, 1, 2), random.uniform(4, 20)])
    round_ = round_one(known, "equirectangular")
    R, t, K, K_prime = (np.array(known["geometry"][key]) for key in ("R", "t", "K", "K_prime"))
    reference, target, _ = sg.placed_cameras(round_)
    world = sg.axes(round_) @ X
    np.testing.assert_allclose(seen_by(reference, world[None])[0], project(K @ X), atol=1e-8)
    np.testing.assert_allclose(seen_by(target, world[None])[0], project(K_prime @ (R @ X + t)), atol=1e-8)
