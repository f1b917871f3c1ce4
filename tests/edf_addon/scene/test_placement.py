"""Where the viewpoint is put, how large all is, the ground under it, the backplate."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.scene import take_along  # noqa: E402
from mathutils import Euler, Matrix, Vector  # noqa: E402


@pytest.fixture
def scenes_own(stitched):
    """The scene's own camera: east of the origin, looking north-west and a little down."""
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("own", bpy.data.cameras.new("own"))
    scene.collection.objects.link(scene.camera)
    turned = Euler((math.radians(80), 0, math.radians(45))).to_matrix().to_4x4()
    scene.camera.matrix_world = Matrix.Translation((5, 1, 2)) @ turned
    scene.cursor.location = 3, 2, 1
    return scene.camera


def placed(role: str):
    bpy.context.view_layer.update()
    return take_along.find(bpy.context.scene.edf_stitch.result, role).matrix_world


@pytest.mark.parametrize(("place", "where", "ahead"), [
    ("CURSOR", (3, 2, 1), (0, 1, 0)), ("ORIGIN", (0, 0, 0), (0, 1, 0)),
    ("CAMERA", (5, 1, 2), (-math.sqrt(0.5), math.sqrt(0.5), 0)), ("AUTO", (3, 2, 1), (0, 1, 0)),
])  # fmt: skip
def test_the_viewpoint_is_put_where_the_artist_says(scenes_own, place, where, ahead):
    bpy.ops.edf.create_cameras(place=place)
    camera = placed("PANORAMA")
    np.testing.assert_allclose(camera.translation, where, atol=1e-5)
    np.testing.assert_allclose(camera.to_3x3() @ Vector((0, 0, -1)), ahead, atol=1e-5)


def test_without_a_place_it_stays_where_it_was_moved_to(scenes_own):
    bpy.ops.edf.create_cameras(place="ORIGIN")
    take_along.find(bpy.context.scene.edf_stitch.result, "RIG").location = 7, 7, 7
    bpy.ops.edf.depth_mesh()
    np.testing.assert_allclose(placed("MESH").translation, (7, 7, 7), atol=1e-5)


def test_above_ground_counts_from_the_ground_up(scenes_own):
    bpy.ops.edf.create_cameras(place="CAMERA", height=1.6)
    np.testing.assert_allclose(placed("PANORAMA").translation, (5, 1, 1.6), atol=1e-5)


def test_a_viewpoint_that_slides_is_put_there_by_its_middle(scenes_own, stitched):
    R, t = (np.array(stitched["geometry"][name]) for name in ("R", "t"))
    told = {"kind": "perspective", "focal_px": 300.0, "centre": [280.0, 180.0], "rotation": np.eye(3)}
    stitched["report"]["canvas"]["projection"] = told
    stitched["geometry"].update(K_canvas=[[None] * 3] * 3, viewpoint={
        "s1": 0.8, "c": -R.T @ t, "rotation": np.eye(3), "along": [1.0, 0.0], "ends": [-0.2, 0.5],
    })  # fmt: skip
    bpy.ops.edf.create_cameras(place="CURSOR", baseline=3)
    np.testing.assert_allclose(placed("PANORAMA").translation, (3, 2, 1), atol=1e-5)
    assert (placed("REFERENCE").translation - Vector((3, 2, 1))).length > 0.1


def test_a_scene_without_a_camera_is_no_place_and_nothing_is_left(stitched):
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.edf.create_cameras(place="CAMERA")
    assert not len(bpy.data.objects)


def test_the_panoramas_own_camera_is_no_place_for_it(stitched):
    bpy.ops.edf.create_cameras(look=True)
    with pytest.raises(RuntimeError, match="one of this panorama's own"):
        bpy.ops.edf.create_cameras(place="CAMERA")


def test_what_is_new_is_selected_and_nothing_else(scenes_own):
    scenes_own.select_set(True)
    bpy.ops.edf.depth_mesh()
    mesh = take_along.find(bpy.context.scene.edf_stitch.result, "MESH")
    assert bpy.context.selected_objects == [mesh] and bpy.context.view_layer.objects.active == mesh


def test_a_known_distance_of_two_cameras_scales_all_that_hangs_together(stitched):
    bpy.ops.edf.create_cameras(baseline=2)
    bpy.ops.edf.depth_mesh()
    panorama = bpy.context.scene.edf_stitch.result
    mesh, target = (take_along.find(panorama, role) for role in ("MESH", "TARGET"))
    before = np.array([vertex.co for vertex in mesh.data.vertices])
    take_along.select(bpy.context, [take_along.find(panorama, "REFERENCE"), target])
    bpy.context.view_layer.update()
    bpy.ops.edf.set_distance(distance=0.5)
    assert target.matrix_basis.translation.length == pytest.approx(0.5)
    np.testing.assert_allclose([vertex.co for vertex in mesh.data.vertices], before / 4, rtol=1e-5)
    assert take_along.usual_baseline(panorama) == pytest.approx(0.5)


def test_a_known_distance_of_two_vertices_does_too(stitched):
    bpy.ops.edf.depth_mesh()
    mesh = take_along.find(bpy.context.scene.edf_stitch.result, "MESH")
    for vertex in mesh.data.vertices:
        vertex.select = vertex.index in (0, 20)
    for edge in mesh.data.edges:
        edge.select = False
    for polygon in mesh.data.polygons:
        polygon.select = False
    bpy.context.tool_settings.mesh_select_mode = True, False, False
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.edf.set_distance(distance=3)
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert (mesh.data.vertices[0].co - mesh.data.vertices[20].co).length == pytest.approx(3, rel=1e-4)


def test_one_thing_has_no_distance(stitched):
    bpy.ops.edf.create_cameras()
    take_along.select(bpy.context, [take_along.find(bpy.context.scene.edf_stitch.result, "TARGET")])
    with pytest.raises(RuntimeError, match="two vertices"):
        bpy.ops.edf.set_distance(distance=1)


def test_a_backplate_is_the_picture_behind_a_surface_that_catches_shadows(stitched):
    scene, settings = bpy.context.scene, bpy.context.scene.edf_stitch
    bpy.ops.edf.set_up_backplate(picture=2)
    camera = scene.camera.data
    assert scene.camera == take_along.find(settings.result, "TARGET") and scene.render.film_transparent
    assert [one.image for one in camera.background_images] == [settings.target] and camera.show_background_images
    assert (scene.render.resolution_x, scene.render.resolution_y) == (320, 480)
    catcher = take_along.find(settings.result, "CATCHER")
    assert catcher.is_shadow_catcher and not catcher.visible_shadow, "lamps outside of a room light what is in it"
    kinds = {node.bl_idname for node in catcher.data.materials[0].node_tree.nodes}
    assert "ShaderNodeBsdfDiffuse" in kinds and "ShaderNodeEmission" not in kinds, "what shines has no shadows"
    with pytest.raises(RuntimeError, match="no picture 3"):
        bpy.ops.edf.set_up_backplate(picture=3)


def test_one_undo_takes_a_backplate_back(scenes_own):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    before = bpy.context.scene.render.resolution_x
    bpy.ops.edf.set_up_backplate()
    bpy.ops.ed.undo_push(message="Set Up Backplate")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert (scene.camera.name, scene.render.film_transparent, scene.render.resolution_x) == ("own", False, before)
    assert [one.name for one in bpy.data.objects] == ["own"] and not len(bpy.data.meshes)


def test_a_sky_catches_nothing_and_hides_no_world(stitched):
    d = np.array(stitched["depth"]["inverse_depth"]).reshape(10, 15)
    d[:5] = 0
    stitched["depth"]["inverse_depth"] = d.ravel()
    bpy.ops.edf.set_up_backplate()
    bpy.ops.edf.depth_mesh()
    panorama = bpy.context.scene.edf_stitch.result
    catcher, mesh = (take_along.find(panorama, role).data for role in ("CATCHER", "MESH"))
    assert (len(catcher.polygons), len(mesh.polygons)) == (14 * 5, 14 * 9)


def test_the_ground_lies_below_the_viewpoint_and_catches_shadows(stitched):
    rotation = np.eye(3)
    stitched["report"]["canvas"]["projection"] = {
        "kind": "equirectangular", "focal_px": 360 / np.pi, "centre": [359.5, 179.5], "rotation": rotation,
    }  # fmt: skip
    stitched["geometry"]["canvas"] = (720, 360)
    bpy.context.scene.cursor.location = 3, 2, 1
    bpy.ops.edf.use_as_world()
    assert take_along.find(bpy.context.scene.edf_stitch.result, "RIG") is None, "nothing unasked"
    bpy.ops.edf.use_as_world(height=1.6)
    plane = take_along.find(bpy.context.scene.edf_stitch.result, "GROUND")
    np.testing.assert_allclose(placed("RIG").translation, (3, 2, 1.6), atol=1e-6)
    np.testing.assert_allclose(placed("GROUND").translation, (3, 2, 0), atol=1e-6)
    assert plane.is_shadow_catcher and bpy.context.selected_objects == [plane]
