"""What a stitch leaves in the scene: cameras with the pictures behind them, the panorama as a surface with depth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from mathutils import Matrix

from .. import editor
from ..bridge import compat, ownership, photo, result
from . import placement, shading
from .placement import Standing

RIG, MESH, CATCHER, GROUND = "RIG", "MESH", "CATCHER", "GROUND"
# Roles of the cameras of a pair; those of more pictures have their names.
ROLES = {"Reference": "REFERENCE", "Target": "TARGET", "Panorama": "PANORAMA"}
# What an object, or a World, is to which panorama, as custom properties of it.
OF, ROLE = "edf_stitch_panorama", "edf_stitch_role"
# How far the ground under an environment reaches to each side, in heights of its viewpoint: the horizon is 3° higher.
GROUND_HEIGHTS = 20.0
# How a background has to be shown whose pixels are stored so, by EXIF's orientation: turned (degrees) after being
# mirrored. Tried in a window: a background turns clockwise.
TURNS = {
    1: (0, False), 2: (0, True), 3: (180, False), 4: (180, True), 5: (-90, True), 6: (90, False), 7: (90, True),
    8: (-90, False),
}  # fmt: skip


def no_world(image: bpy.types.Image | None) -> str:
    """Why an image cannot surround a scene; "" where it can."""
    if image is None:
        return "Stitch a panorama first"
    if editor.known(image)["report"]["canvas"]["projection"]["kind"] != "equirectangular":
        return "Only an equirectangular panorama can surround the scene: choose that projection, and stitch"
    return ""


def lacking(image: bpy.types.Image | None, depth: bool = False) -> str:
    """Why nothing can be taken along from an image; "" where it can."""
    if image is None:
        return "Stitch a panorama first"
    if depth and not editor.known(image)["has_depth"]:
        return "This panorama has no depth: its pictures were taken from one place, or show one plane only"
    return ""


def no_lens(image: bpy.types.Image) -> str:
    """Why no camera of Blender's sees a panorama as it is; "" where one does."""
    told = editor.known(image)["report"]["canvas"]["projection"]
    if told["kind"] == "pannini" and told["distance"] > 0:
        return (
            "Blender has no lens that sees as Panini's projection does: the panorama's own camera is left out; "
            "stitched with Projection Perspective, Reference or Cylindrical it has one"
        )
    if told["kind"] == "cylindrical" and not compat.sees_cylinders():
        return "Blender has cylindrical lenses from 4.3 on: the panorama's own camera is left out"
    return ""


def known_baseline(known: dict[str, Any]) -> float | None:
    """How far apart the scene's own cameras stood, where a panorama's pictures were taken with them."""
    if known["cameras"] is None:
        return None
    reference, target = (Matrix(camera["matrix_world"]).translation for camera in known["cameras"])
    return (target - reference).length


def usual_baseline(image: bpy.types.Image) -> float:
    """As far as this panorama's cameras stand apart already, else as those did that took its pictures, else 1."""
    rig = find(image, RIG)
    return rig["baseline"] if rig is not None else known_baseline(editor.known(image)) or 1.0


def create_cameras(
    scene: bpy.types.Scene, image: bpy.types.Image, standing: Standing
) -> dict[str, bpy.types.Object]:
    """The cameras of a panorama, by role; those that are there already are set anew. The panorama's own is missing
    where Blender has no lens like it (see `no_lens`). Raises ValueError."""
    from . import scene_geometry

    pictures = {**_pictures_by_role(image), "PANORAMA": image}
    rig = _rig(scene, image, standing)
    made, baseline = {}, standing.baseline
    for placed in scene_geometry.placed_cameras(editor.known(image), baseline):
        role, lens = ROLES.get(placed.name, placed.name), placed.lens
        if role == "PANORAMA" and no_lens(image):
            continue
        camera = find(image, role) or _link(scene, image, role, bpy.data.cameras.new(f"{placed.name} of {image.name}"))
        data = camera.data
        if isinstance(lens, scene_geometry.RoundLens):
            compat.make_panoramic(data, lens.kind, lens.headings, lens.elevations)
        else:
            data.type = "PERSP"
            data.sensor_fit, data.sensor_width, data.lens = lens.sensor_fit, lens.sensor_width, lens.lens
            data.shift_x, data.shift_y = lens.shift_x, lens.shift_y
        data.clip_start, data.clip_end = 0.01 * baseline, 1e4 * baseline
        _put_behind(data, pictures[role])
        camera["resolution"], camera["place"] = lens.resolution, placed.place
        camera.parent, camera.matrix_parent_inverse = rig, Matrix()
        camera.matrix_basis = Matrix(placed.matrix_world.tolist())
        made[role] = camera
    return made


def _pictures_by_role(image: bpy.types.Image) -> dict[str, bpy.types.Image | None]:
    from . import scene_geometry

    known, pictures = editor.known(image), ownership.pictures(image)
    if "cameras" not in known["geometry"]:
        return dict(zip(("REFERENCE", "TARGET"), pictures, strict=True))
    names = [scene_geometry.called(one["name"]) for one in known["pictures"]]
    return dict(zip(names, pictures, strict=True))


def camera_of(made: dict[str, bpy.types.Object], picture: int) -> bpy.types.Object:
    """The camera of a picture, counted from 1 among those that have one, of those that `create_cameras` made; the
    panorama's own of 0. Raises ValueError where there is none."""
    roles = [role for role in made if role != "PANORAMA"]
    if picture > len(roles):
        raise ValueError(f"There is no picture {picture}: {len(roles)} have a camera whose place is known")
    role = roles[picture - 1] if picture else "PANORAMA"
    if role not in made:
        raise ValueError("Blender has no lens that sees this panorama: choose the camera of a picture")
    return made[role]


@contextmanager
def outside_edit_mode(context: Any) -> Iterator[None]:
    """In Object Mode as long as it lasts: in Edit Mode a mesh has a copy that is written back over it."""
    was_editing = context.mode == "EDIT_MESH"
    if was_editing:
        bpy.ops.object.mode_set(mode="OBJECT")
    yield
    if was_editing:
        bpy.ops.object.mode_set(mode="EDIT")


def select(context: Any, made: list[bpy.types.Object]) -> None:
    """These objects alone are selected, the last of them active; only in Object Mode, where nothing else is begun."""
    if context.mode != "OBJECT":
        return
    for one in context.selected_objects:
        one.select_set(False)
    for one in made:
        one.select_set(True)
    context.view_layer.objects.active = made[-1]


def image_empty(scene: bpy.types.Scene, image: bpy.types.Image) -> bpy.types.Object:
    """A new empty that shows an image, upright at the 3D cursor."""
    empty = bpy.data.objects.new(image.name, None)
    empty.empty_display_type, empty.data = "IMAGE", image
    empty.location, empty.rotation_euler = scene.cursor.location, (math.pi / 2, 0.0, 0.0)
    scene.collection.objects.link(empty)
    return empty


def depth_mesh(
    scene: bpy.types.Scene, image: bpy.types.Image, standing: Standing, farthest: float, catches: bool = False
) -> bpy.types.Object:
    """The panorama as a surface that shines, or catches light and shadows and has no sky; one that is there gets
    new vertices. Raises ValueError."""
    from ...core.output.depth.nodes import DepthNodes
    from . import scene_geometry

    kept = image.get(result.DEPTH)
    nodes = None if kept is None else DepthNodes.from_bytes(bytes(kept))
    surface = scene_geometry.depth_mesh(editor.known(image), standing.baseline, farthest, nodes, ends_open=catches)
    role, what = (CATCHER, "Catcher") if catches else (MESH, "Depth")
    rig, there = _rig(scene, image, standing), find(image, role)
    mesh = bpy.data.meshes.new(f"{what} of {image.name}") if there is None else there.data
    _fill(mesh, surface)
    if not mesh.materials:
        mesh.materials.append(shading.receiving(image) if catches else shading.emission(image))
    object_ = there or _link(scene, image, role, mesh)
    object_.parent, object_.matrix_parent_inverse, object_.matrix_basis = rig, Matrix(), Matrix()
    if catches:
        shading.catch(object_)
        object_.display_type = "BOUNDS"  # the picture behind it shows the same
    return object_


def _fill(mesh: bpy.types.Mesh, surface: Any) -> None:
    """Gives a mesh the vertices, faces and uvs of a surface instead of its own."""
    import numpy as np

    mesh.clear_geometry()
    count = len(surface.faces)
    mesh.vertices.add(len(surface.vertices))
    mesh.vertices.foreach_set("co", surface.vertices.astype(np.float32).ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", surface.faces.ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    uvs = mesh.uv_layers.new(name="Panorama")
    uvs.data.foreach_set("uv", surface.uvs[surface.faces.ravel()].astype(np.float32).ravel())
    mesh.validate()
    mesh.update()


def look_through(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Make it the scene's camera, and the render size that of its picture: a camera has none of its own."""
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = camera["resolution"]
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0


def replaces_world(scene: bpy.types.Scene) -> bool:
    """Whether the scene has a World that is none of a panorama's."""
    return scene.world is not None and scene.world.get(OF) is None


def use_as_world(scene: bpy.types.Scene, image: bpy.types.Image, replace: bool = True) -> bpy.types.World:
    """A World that shows the panorama where its rig's cameras see it, or those of a new rig would: the scene's where it
    has none of its own, or that is to be replaced. That one is kept in the file."""
    import numpy as np

    from ...core.cameras.blender_world import world_rotation
    from . import scene_geometry

    known = editor.known(image)
    stands = placement.matrix(find(image, RIG), scene, known, Standing(usual_baseline(image)))
    camera = np.array(stands) @ scene_geometry.in_world(*scene_geometry.ORIGIN, scene_geometry.axes(known))
    turn = world_rotation(camera, scene_geometry.matrix(known["report"]["canvas"]["projection"]["rotation"]))
    world = next((one for one in bpy.data.worlds if one.get(OF) == image), None) or bpy.data.worlds.new(image.name)
    world[OF] = image
    shading.surround(world, image, Matrix(turn.tolist()))
    if replace or not replaces_world(scene):
        if scene.world not in (None, world):
            scene.world.use_fake_user = True
        scene.world = world
    else:
        world.use_fake_user = True
    return world


def ground(scene: bpy.types.Scene, image: bpy.types.Image, height: float) -> bpy.types.Object:
    """A level plane at z = 0 that catches shadows, so far below the viewpoint of a panorama's rig, which is put there;
    one that is there already is set anew."""
    rig = _rig(scene, image, Standing(usual_baseline(image), height=height))
    plane = find(image, GROUND) or _link(scene, image, GROUND, bpy.data.meshes.new(f"Ground of {image.name}"))
    half = GROUND_HEIGHTS * height
    mesh = plane.data
    mesh.clear_geometry()
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    plane.location = rig.matrix_world.translation.x, rig.matrix_world.translation.y, 0.0
    shading.catch(plane)
    return plane


def find(image: bpy.types.Image | None, role: str) -> bpy.types.Object | None:
    """The object that is `role` to a panorama, if it is still there."""
    return next((one for one in bpy.data.objects if one.get(OF) == image and one.get(ROLE) == role), None)


def _rig(scene: bpy.types.Scene, image: bpy.types.Image, standing: Standing) -> bpy.types.Object:
    """The empty that everything of a panorama hangs on: moved, turned or scaled, all goes along and stays right."""
    rig = find(image, RIG)
    matrix = placement.matrix(rig, scene, editor.known(image), standing)
    if rig is None:
        rig = _link(scene, image, RIG, None)
        rig.empty_display_size = 0.2 * standing.baseline
    rig.matrix_world, rig["baseline"] = matrix, standing.baseline
    return rig


def _link(scene: bpy.types.Scene, image: bpy.types.Image, role: str, data: Any) -> bpy.types.Object:
    """A new object in the panorama's own collection."""
    name = data.name if data is not None else f"Rig of {image.name}"
    made = bpy.data.objects.new(name, data)
    made[OF], made[ROLE] = image, role
    collection = next((one for one in bpy.data.collections if one.get(OF) == image), None)
    if collection is None:
        collection = bpy.data.collections.new(image.name)
        collection[OF] = image
    if collection.name not in scene.collection.children:
        scene.collection.children.link(collection)
    collection.objects.link(made)
    return made


def _put_behind(data: bpy.types.Camera, image: bpy.types.Image | None) -> None:
    """Show an image behind everything that the camera sees."""
    data.background_images.clear()
    if image is None:
        return
    behind = data.background_images.new()
    behind.image, behind.alpha, behind.display_depth = image, 1.0, "BACK"
    turn, behind.use_flip_x = TURNS[photo.orientation(image)]
    behind.rotation = math.radians(turn)
    # turned by a quarter, an image is fitted into the frame before it is turned
    behind.frame_method = "FIT" if turn % 180 else "STRETCH"
    behind.scale = max(image.size) / max(1, min(image.size)) if turn % 180 else 1.0
    data.show_background_images = True
