"""What an artist takes along from a panorama: its cameras, its surface, its World."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from .. import editor, idnames
from ..bridge import ownership
from ..scene import placement, take_along

ROLES = (
    ("REFERENCE", "Reference", "The camera that took the reference"),
    ("TARGET", "Target", "The camera that took the target"),
    ("PANORAMA", "Panorama", "A camera that sees the panorama, from where its middle is seen"),
)
_FARTHEST = {
    "name": "Farthest", "default": 20.0, "min": 1.1, "soft_max": 100.0,
    "description": "Where the surface ends, sky included, in multiples of its median depth",
}  # fmt: skip
# What is asked about the ground under an environment.
GROUND = {
    "name": "Camera Height", "default": 0.0, "min": 0.0, "soft_max": 10.0, "unit": "LENGTH", "options": {"SKIP_SAVE"},
    "description": "How high above the ground the pictures were taken: so far below the viewpoint, at z = 0, a plane "
    "catches shadows (Cycles); 0: no plane",
}  # fmt: skip


class _OfAPanorama:
    """Operators that need a finished stitch."""

    needs_depth = False

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = take_along.lacking(editor.panorama(context), cls.needs_depth)
        if reason:
            cls.poll_message_set(reason)  # type: ignore[attr-defined]
        return not reason


class _Placed(_OfAPanorama):
    """Operators whose objects hang on the panorama's rig: where it stands, and how large all is."""

    baseline: FloatProperty(
        name="Baseline", default=1.0, min=1e-4, soft_max=100.0, unit="LENGTH", precision=3, options={"SKIP_SAVE"},
        description="Distance between the two cameras in the scene, or from the first to the farthest; pictures alone "
        "do not tell it",
    )
    place: EnumProperty(
        name="Place", items=placement.PLACES, default="AUTO", options={"SKIP_SAVE"},
        description="Where in the scene the viewpoint is put",
    )
    height: FloatProperty(
        name="Above Ground", default=0.0, min=0.0, soft_max=10.0, unit="LENGTH", options={"SKIP_SAVE"},
        description="How high the viewpoint stands above z = 0; 0: as high as the place is",
    )

    def standing(self, context: Any, image: bpy.types.Image) -> placement.Standing:
        """As it was chosen."""
        if not self.properties.is_property_set("baseline"):  # type: ignore[attr-defined]
            self.baseline = take_along.usual_baseline(image)
        context.view_layer.update()  # of a camera that was just moved by a script
        return placement.Standing(self.baseline, self.place, self.height)


class EDF_OT_create_cameras(_Placed, bpy.types.Operator):  # noqa: N801
    """Put the cameras of this panorama into the scene, with the pictures as their backgrounds. They come selected, in
    a collection of their own"""

    bl_idname = idnames.Operator.CREATE_CAMERAS
    bl_label = "Create Cameras"
    bl_options = {"REGISTER", "UNDO"}

    look: BoolProperty(
        name="Look Through the Panorama's", default=False, options={"SKIP_SAVE"},
        description="Make the panorama's camera the scene's, and the render size that of the panorama",
    )

    def execute(self, context: Any) -> set[str]:
        image = editor.panorama(context)
        try:
            made = take_along.create_cameras(context.scene, image, self.standing(context, image))
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        take_along.select(context, list(made.values()))
        for words in ownership.changes(image):
            self.report({"WARNING"}, words)
        if "PANORAMA" not in made:
            self.report({"WARNING"}, take_along.no_lens(image))
        elif self.look:
            take_along.look_through(context.scene, made["PANORAMA"])
        if "PANORAMA" in made and editor.known(image)["geometry"].get("viewpoint"):
            self.report({"INFO"}, f"The panorama's camera stands {made['PANORAMA']['place']}")
        if "TARGET" not in made and len(ownership.pictures(image)) == len(ownership.SIDES):
            self.report({"WARNING"}, "The target's camera is not known: one plane does not tell where it stood")
        return {"FINISHED"}


class EDF_OT_depth_mesh(_Placed, bpy.types.Operator):  # noqa: N801
    """Lay the panorama on a surface that stands as far away as it was found to be, cut where near and far meet. It
    comes selected, in the panorama's collection"""

    bl_idname = idnames.Operator.DEPTH_MESH
    bl_label = "Depth Mesh"
    bl_options = {"REGISTER", "UNDO"}
    needs_depth = True

    farthest: FloatProperty(**_FARTHEST)

    def execute(self, context: Any) -> set[str]:
        image = editor.panorama(context)
        try:
            made = take_along.depth_mesh(context.scene, image, self.standing(context, image), self.farthest)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        take_along.select(context, [made])
        return {"FINISHED"}


class EDF_OT_set_up_backplate(_Placed, bpy.types.Operator):  # noqa: N801
    """Render things into a picture: its camera becomes the scene's, with the picture behind it and its render size;
    the film becomes transparent; the surface with depth catches shadows, and gives its light (Cycles)"""

    bl_idname = idnames.Operator.BACKPLATE
    bl_label = "Set Up Backplate"
    bl_options = {"REGISTER", "UNDO"}
    needs_depth = True

    picture: IntProperty(
        name="Picture", default=1, min=0, options={"SKIP_SAVE"},
        description="Whose camera is looked through, counted among those that were used; 0: the panorama's own",
    )
    farthest: FloatProperty(**_FARTHEST)

    def execute(self, context: Any) -> set[str]:
        image = editor.panorama(context)
        try:
            standing = self.standing(context, image)
            made = take_along.create_cameras(context.scene, image, standing)
            camera = take_along.camera_of(made, self.picture)
            catcher = take_along.depth_mesh(context.scene, image, standing, self.farthest, catches=True)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        take_along.look_through(context.scene, camera)
        context.scene.render.film_transparent = True
        take_along.select(context, [catcher, camera])
        self.report({"INFO"}, "The film is transparent: lay the render over the picture")
        return {"FINISHED"}


class EDF_OT_set_distance(_OfAPanorama, bpy.types.Operator):  # noqa: N801
    """Make the panorama's cameras and surface so large that two things are as far apart as they are in truth: two
    cameras that are selected, or in Edit Mode two vertices of the surface"""

    bl_idname = idnames.Operator.SET_DISTANCE
    bl_label = "Set Known Distance"
    bl_options = {"REGISTER", "UNDO"}

    distance: FloatProperty(
        name="Distance", default=1.0, min=1e-4, soft_max=100.0, unit="LENGTH", precision=3, options={"SKIP_SAVE"},
        description="How far apart they are in truth",
    )

    def invoke(self, context: Any, _event: Any) -> set[str]:
        try:
            self.distance = placement.marked_distance(context)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        asked: set[str] = context.window_manager.invoke_props_dialog(self)
        return asked

    def execute(self, context: Any) -> set[str]:
        rig = take_along.find(editor.panorama(context), take_along.RIG)
        try:
            if rig is None:
                raise ValueError("Nothing of this panorama is in the scene: create its cameras or its surface first")
            factor = self.distance / placement.marked_distance(context)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        with take_along.outside_edit_mode(context):
            placement.rescale(rig, factor)
        return {"FINISHED"}


class EDF_OT_look_through(_OfAPanorama, bpy.types.Operator):  # noqa: N801
    """Make this camera the scene's, with the render size of its picture, and look through it in the 3D views"""

    bl_idname = idnames.Operator.LOOK_THROUGH
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    role: EnumProperty(name="Camera", items=ROLES, default="PANORAMA")

    def execute(self, context: Any) -> set[str]:
        camera = take_along.find(editor.panorama(context), self.role)
        if camera is None:
            self.report({"ERROR"}, f"There is no camera of the {self.role.lower()}; create the cameras first")
            return {"CANCELLED"}
        take_along.look_through(context.scene, camera)
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.spaces.active.region_3d.view_perspective = "CAMERA"
        return {"FINISHED"}


class EDF_OT_use_as_world(bpy.types.Operator):  # noqa: N801
    """Surround the scene with this panorama, as the reference camera saw it: an equirectangular one in a World of its
    own. The World of before stays in the file"""

    bl_idname = idnames.Operator.USE_AS_WORLD
    bl_label = "Panorama to World"
    bl_options = {"REGISTER", "UNDO"}

    replace: BoolProperty(
        name="Replace the Scene's World", default=True, options={"SKIP_SAVE"},
        description="Let the scene use it at once, instead of the World that it has",
    )
    height: FloatProperty(**GROUND)

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = take_along.no_world(editor.panorama(context))
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Asks before the scene's own World is replaced."""
        if not take_along.replaces_world(context.scene):
            return self.execute(context)
        message = f"The scene's World “{context.scene.world.name}” is replaced, and stays in the file."
        asked: set[str] = context.window_manager.invoke_confirm(
            self, event, title=self.bl_label, message=message, confirm_text="Replace"
        )
        return asked

    def execute(self, context: Any) -> set[str]:
        image = editor.panorama(context)
        take_along.use_as_world(context.scene, image, self.replace)
        if self.height > 0:
            take_along.select(context, [take_along.ground(context.scene, image, self.height)])
        return {"FINISHED"}


CLASSES = (
    EDF_OT_create_cameras, EDF_OT_depth_mesh, EDF_OT_set_up_backplate, EDF_OT_set_distance, EDF_OT_look_through,
    EDF_OT_use_as_world,
)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(CLASSES)
