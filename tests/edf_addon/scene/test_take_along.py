"""What a stitch leaves in the scene: Blender's own cameras see what the pictures show, and undo takes it all back."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.core.cameras.projective import homogeneous, project, rotation_from_vector  # noqa: E402
from edf_stitch.core.output.depth.nodes import DepthNodes  # noqa: E402
from edf_stitch.edf_addon.bridge import cameras, compat, result  # noqa: E402
from edf_stitch.edf_addon.scene import take_along  # noqa: E402

CANVAS = 560, 360
COLUMNS, ROWS = 15, 10


def seen(camera, points: np.ndarray) -> np.ndarray:
    """px at which Blender itself sees world points, at the render size of that camera's picture."""
    scene = bpy.context.scene
    take_along.look_through(scene, camera)
    bpy.context.view_layer.update()
    width, height = scene.render.resolution_x, scene.render.resolution_y
    P = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=width, y=height)
    x, y, _, w = np.array(P) @ np.linalg.inv(np.array(camera.matrix_world)) @ homogeneous(points).T
    return np.column_stack([(x / w + 1) / 2 * width - 0.5, (1 - y / w) / 2 * height - 0.5])


def test_blender_sees_a_point_where_the_pictures_show_it(stitched):
    bpy.ops.edf.create_cameras(baseline=0.3)
    geometry = stitched["geometry"]
    random = np.random.default_rng(1)
    X = np.column_stack([random.uniform(-1, 1, (20, 2)), random.uniform(4, 20, 20)])
    world = 0.3 * np.column_stack([X[:, 0], X[:, 2], -X[:, 1]])
    expected = {
        "REFERENCE": project(X @ geometry["K"].T), "PANORAMA": project(X @ geometry["K_canvas"].T),
        "TARGET": project((X @ geometry["R"].T + geometry["t"]) @ geometry["K_prime"].T),
    }  # fmt: skip
    for role, pixels in expected.items():
        camera = take_along.find(bpy.context.scene.edf_stitch.result, role)
        assert np.abs(seen(camera, world) - pixels).max() < 1e-2, role


def test_the_cameras_have_the_pictures_behind_them(stitched):
    settings, scene = bpy.context.scene.edf_stitch, bpy.context.scene
    bpy.ops.edf.create_cameras()
    assert scene.camera is None, "the scene's camera is changed only where that is asked for"
    bpy.ops.edf.create_cameras(look=True)
    for role, image in (("REFERENCE", settings.reference), ("TARGET", settings.target), ("PANORAMA", settings.result)):
        data = take_along.find(settings.result, role).data
        assert data.show_background_images and [one.image for one in data.background_images] == [image]
    assert scene.camera == take_along.find(settings.result, "PANORAMA")
    assert (scene.render.resolution_x, scene.render.resolution_y) == CANVAS


def test_the_meshs_vertices_are_seen_at_their_uvs(stitched):
    bpy.ops.edf.create_cameras(baseline=2)
    bpy.ops.edf.depth_mesh(baseline=2)
    panorama = bpy.context.scene.edf_stitch.result
    mesh = take_along.find(panorama, "MESH").data
    assert len(mesh.polygons) == (COLUMNS - 1) * (ROWS - 1)
    uvs = np.array([one.uv for one in mesh.uv_layers["Panorama"].data])
    corners = np.array([mesh.vertices[loop.vertex_index].co for loop in mesh.loops])
    pixels = uvs * [1, -1] * np.array(CANVAS) + [-0.5, CANVAS[1] - 0.5]
    assert np.abs(seen(take_along.find(panorama, "PANORAMA"), corners) - pixels).max() < 0.02
    d = stitched["depth"]["inverse_depth"]
    near = d.max()
    assert min(vertex.co.y for vertex in mesh.vertices) == pytest.approx(2 / near, rel=1e-5)


def test_the_mesh_is_cut_where_near_and_far_meet(stitched):
    """A near thing before a far one, with the nodes that the worker left: no face reaches from one to the other."""
    columns, rows = 57, 37
    d = np.full((rows, columns), 0.05)
    d[10:25, 20:40] = 0.5
    middles = np.minimum(np.minimum(d[1:, 1:], d[1:, :-1]), np.minimum(d[:-1, 1:], d[:-1, :-1]))
    x, y = np.linspace(-0.5, 559.5, columns), np.linspace(-0.5, 359.5, rows)
    panorama = bpy.context.scene.edf_stitch.result
    panorama[result.DEPTH] = DepthNodes(x, y, d, middles, np.ones(d.shape, bool)).to_bytes()
    bpy.ops.edf.depth_mesh()
    mesh = take_along.find(panorama, "MESH").data
    assert len(mesh.polygons) == (columns - 1) * (rows - 1)
    away = np.array([vertex.co.y for vertex in mesh.vertices])
    ends = away[[list(polygon.vertices) for polygon in mesh.polygons]]
    assert (np.ptp(ends, axis=1) < 0.5).all() and {2, 20} == set(away.round())
    mesh_normals = np.array([polygon.normal for polygon in mesh.polygons])
    centres = np.array([polygon.center for polygon in mesh.polygons])
    assert (np.sum(mesh_normals * centres, axis=1) < 0).all(), "they face the viewpoint"


def test_the_mesh_shows_the_panorama_whatever_the_light(stitched):
    bpy.ops.edf.depth_mesh()
    panorama = bpy.context.scene.edf_stitch.result
    (material,) = take_along.find(panorama, "MESH").data.materials
    if hasattr(material, "cycles"):
        assert material.cycles.emission_sampling == "NONE", "200 000 lamps cost each render ten seconds"
    kinds = {node.bl_idname: node for node in material.node_tree.nodes}
    assert kinds["ShaderNodeTexImage"].image == panorama and "ShaderNodeBsdfPrincipled" not in kinds
    source = kinds["ShaderNodeEmission"].inputs["Color"].links[0].from_node
    assert source == kinds["ShaderNodeTexImage"]
    assert kinds["ShaderNodeOutputMaterial"].inputs["Surface"].links[0].from_node == kinds["ShaderNodeMixShader"]


def test_again_sets_the_same_objects_anew(stitched):
    for baseline in (1, 5):
        bpy.ops.edf.create_cameras(baseline=baseline)
        bpy.ops.edf.depth_mesh()  # goes by the cameras
    panorama = bpy.context.scene.edf_stitch.result
    assert len(bpy.data.cameras) == 3 and len(bpy.data.meshes) == 1 and len(bpy.data.materials) == 1
    roles = {"RIG", "MESH", "REFERENCE", "TARGET", "PANORAMA"}
    assert {one[take_along.ROLE] for one in bpy.data.objects} == roles
    assert take_along.find(panorama, "TARGET").matrix_basis.translation.length == pytest.approx(5)
    nearest = min(vertex.co.y for vertex in take_along.find(panorama, "MESH").data.vertices)
    assert nearest == pytest.approx(5 / stitched["depth"]["inverse_depth"].max(), rel=1e-5)


def test_all_hangs_on_one_empty(stitched):
    bpy.ops.edf.create_cameras()
    bpy.ops.edf.depth_mesh()
    panorama = bpy.context.scene.edf_stitch.result
    rig = take_along.find(panorama, "RIG")
    assert {one.parent for one in bpy.data.objects if one != rig} == {rig}
    (collection,) = bpy.context.scene.collection.children
    assert set(collection.objects) == set(bpy.data.objects)


def test_with_the_scenes_own_cameras_the_rig_stands_where_they_stood(stitched):
    from mathutils import Euler, Matrix

    settings = bpy.context.scene.edf_stitch
    for name, place in (("reference", (1, 2, 3)), ("target", (1, 6, 6))):
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        bpy.context.scene.collection.objects.link(camera)
        camera.matrix_world = Matrix.Translation(place) @ Euler((1, 0.2, 0.4)).to_matrix().to_4x4()
        setattr(settings, f"{name}_camera", camera)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    stitched["cameras"] = cameras.describe_both(settings, bpy.context.scene, depsgraph)
    stood = np.array(settings.reference_camera.matrix_world)
    settings.reference_camera.location = 9, 9, 9  # moved since, and no longer chosen
    settings.reference_camera = None
    assert take_along.known_baseline(stitched) == pytest.approx(5)
    bpy.ops.edf.create_cameras()
    bpy.context.view_layer.update()
    made = take_along.find(settings.result, "REFERENCE")
    np.testing.assert_allclose(np.array(made.matrix_world), stood, atol=1e-5)
    assert take_along.find(settings.result, "TARGET").matrix_basis.translation.length == pytest.approx(5)


def test_a_plane_without_a_pose_gives_two_cameras_and_says_so(stitched):
    stitched["geometry"].update(R=[[None] * 3] * 3, t=[None] * 3)
    assert bpy.ops.edf.create_cameras() == {"FINISHED"}
    assert len(bpy.data.cameras) == 2


def test_without_a_panorama_or_without_depth_there_is_a_reason(stitched):
    stitched["has_depth"] = False
    with pytest.raises(RuntimeError, match="no depth"):
        bpy.ops.edf.depth_mesh()
    bpy.context.scene.edf_stitch.result = None
    for call in (bpy.ops.edf.create_cameras, bpy.ops.edf.depth_mesh, bpy.ops.edf.look_through):
        with pytest.raises(RuntimeError, match="Stitch a panorama first"):
            call()


def test_undo_takes_the_cameras_back_and_leaves_the_panorama(stitched):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.edf.create_cameras()
    bpy.ops.ed.undo_push(message="Create Cameras")
    assert len(bpy.data.cameras) == 3
    bpy.ops.ed.undo()
    assert not len(bpy.data.cameras) and bpy.context.scene.edf_stitch.result is not None


def test_looking_through_a_camera_that_is_not_there_says_so(stitched):
    with pytest.raises(RuntimeError, match="create the cameras first"):
        bpy.ops.edf.look_through(role="TARGET")


@pytest.fixture
def sphere(stitched):
    """The same as an equirectangular panorama, turned."""
    rotation = rotation_from_vector(np.radians((-7.0, 11.0, 4.0)))
    told = {"kind": "equirectangular", "focal_px": 360 / np.pi, "centre": [359.5, 179.5], "rotation": rotation}
    stitched["report"]["canvas"]["projection"] = told
    stitched["geometry"]["canvas"] = (720, 360)
    return stitched


def test_a_panini_panorama_has_no_camera_and_says_what_has(sphere, capfd):
    sphere["report"]["canvas"]["projection"] |= {"kind": "pannini", "distance": 0.5}
    assert bpy.ops.edf.create_cameras() == {"FINISHED"}
    panorama = bpy.context.scene.edf_stitch.result
    assert take_along.find(panorama, "PANORAMA") is None and take_along.find(panorama, "REFERENCE") is not None
    assert "with Projection Perspective" in "".join(capfd.readouterr())


def test_a_camera_says_where_it_stands(stitched):
    bpy.ops.edf.create_cameras()
    panorama = bpy.context.scene.edf_stitch.result
    places = {role: take_along.find(panorama, role)["place"] for role in ("REFERENCE", "TARGET", "PANORAMA")}
    assert places["PANORAMA"] == places["REFERENCE"] == "the reference's place" != places["TARGET"]


def test_a_blender_without_a_cylindrical_lens_leaves_out_that_camera(sphere, monkeypatch):
    sphere["report"]["canvas"]["projection"]["kind"] = "cylindrical"
    monkeypatch.setattr(compat, "sees_cylinders", lambda: False)
    assert bpy.ops.edf.create_cameras() == {"FINISHED"}
    panorama = bpy.context.scene.edf_stitch.result
    assert take_along.find(panorama, "PANORAMA") is None
    assert take_along.find(panorama, "REFERENCE") is not None and take_along.find(panorama, "TARGET") is not None


def test_a_sphere_surrounds_the_scene_as_its_cameras_see_it(sphere):
    """Wherever the rig stands and looks: a direction is found in the texture where the panorama's mesh has it."""
    from mathutils import Euler, Matrix

    bpy.ops.edf.create_cameras()
    scene = bpy.context.scene
    rig = take_along.find(scene.edf_stitch.result, "RIG")
    rig.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.4, -0.2, 1.1)).to_matrix().to_4x4()
    bpy.context.view_layer.update()
    bpy.ops.edf.use_as_world()
    nodes = {node.bl_idname: node for node in scene.world.node_tree.nodes}
    assert nodes["ShaderNodeTexEnvironment"].image == scene.edf_stitch.result
    turn = np.array(Euler(nodes["ShaderNodeMapping"].inputs["Rotation"].default_value).to_matrix())
    bpy.ops.edf.depth_mesh()
    mesh = take_along.find(scene.edf_stitch.result, "MESH")
    bpy.context.view_layer.update()
    corners = np.array([mesh.data.vertices[loop.vertex_index].co for loop in mesh.data.loops])
    away = corners @ np.array(rig.matrix_world.to_3x3()).T  # from the cameras, in the world
    x, y, z = (away @ turn.T).T
    found = np.column_stack([0.5 - np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arctan2(z, np.hypot(x, y)) / np.pi])
    uvs = np.array([one.uv for one in mesh.data.uv_layers["Panorama"].data])
    apart = found - uvs
    apart[:, 0] -= np.round(apart[:, 0])
    assert np.abs(apart).max() < 1e-4


def test_a_spheres_camera_is_panoramic(sphere):
    bpy.ops.edf.create_cameras()
    camera = take_along.find(bpy.context.scene.edf_stitch.result, "PANORAMA").data
    assert camera.type == "PANO"
    if hasattr(camera, "panorama_type"):
        assert camera.panorama_type == "EQUIRECTANGULAR"
        assert (camera.longitude_min, camera.longitude_max) == pytest.approx((-np.pi, np.pi), abs=1e-5)
        assert (camera.latitude_min, camera.latitude_max) == pytest.approx((-np.pi / 2, np.pi / 2), abs=1e-5)


def test_a_flat_panorama_surrounds_nothing(stitched):
    with pytest.raises(RuntimeError, match="Only an equirectangular"):
        bpy.ops.edf.use_as_world()
