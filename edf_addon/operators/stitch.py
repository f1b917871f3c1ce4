"""Stitching, previews, stitching again. Operators are thin: settings → job → worker → image."""

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty

from .. import editor, idnames, offered, pair, pictures, properties
from ..bridge import images, ownership, result
from ..jobs import following, modal, stitching
from ..scene import take_along
from . import opening, scene_objects


class _Stitching(modal.LongWork):
    """What the three share that stitch. kind: of image that comes out of it."""

    kind = "panorama"

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        job, self.memory = stitching.make_job(context, folder)
        return job

    def _take(self, context: Any, outcome: Any) -> set[str]:
        done = super()._take(context, outcome)
        if done == {"FINISHED"}:
            following.be_ready(self._request)
        return done

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        return stitching.take_over(context, folder, found, self.memory, self.kind)


class EDF_OT_stitch(_Stitching, bpy.types.Operator):  # noqa: N801
    """Make one panorama of the pictures of the list, as a new image. ESC cancels"""

    bl_idname = idnames.Operator.STITCH
    bl_label = "Stitch Panorama"
    bl_options = {"UNDO"}

    reference: StringProperty(name="Reference", description="Name of the image to choose first", options={"SKIP_SAVE"})
    target: StringProperty(name="Target", description="Name of the image to choose first", options={"SKIP_SAVE"})
    filepaths: StringProperty(
        name="Files", description="Paths of photographs, one a line, that are to be the list first",
        options={"SKIP_SAVE"},
    )
    images: StringProperty(
        name="Images", description="Names of images, one a line, that are to be the list first", options={"SKIP_SAVE"}
    )
    as_empty: BoolProperty(
        name="Add to the Scene", description="As an image empty at the 3D cursor", options={"SKIP_SAVE"}
    )

    def execute(self, context: Any) -> set[str]:
        return super().execute(context) if self._has_opened(context) else {"CANCELLED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        return super().invoke(context, event) if self._has_opened(context) else {"CANCELLED"}

    def _has_opened(self, context: Any) -> bool:
        """Puts the files that were named into the list; False where that failed, which is reported."""
        paths = [Path(bpy.path.abspath(line)) for line in self.filepaths.splitlines() if line]
        self.filepaths = ""  # `invoke` may call `execute`
        return not paths or opening.into_list(self, context, paths, "EXEC_DEFAULT", instead=True) == {"FINISHED"}

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        settings = properties.settings_of(context.scene)
        if self.images:
            pictures.choose(settings, [images.named(name) for name in self.images.splitlines() if name])
        named = {side: images.named(name) for side in ownership.SIDES if (name := getattr(self, side))}
        with pair.choosing(settings):
            for side, image in named.items():
                setattr(settings, side, image)
        return super().prepare(context, folder)

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        words = super().finish(context, folder, found)
        if self.as_empty:
            empty = take_along.image_empty(context.scene, properties.settings_of(context.scene).result)
            take_along.select(context, [empty])
        return words


class EDF_OT_preview(_Stitching, bpy.types.Operator):  # noqa: N801
    """Stitch at reduced size, to see soon what the settings do. The image of the last preview is replaced"""

    bl_idname = idnames.Operator.PREVIEW
    bl_label = "Preview"
    bl_options = {"UNDO"}
    kind = "preview"

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        scale = properties.settings_of(context.scene).preview_scale
        job, self.memory = stitching.make_job(context, folder, scale)
        return job


# What the operators of an environment are asked.
_HOLES = {"name": "Holes", "items": [one for one in offered.HOLES if one[0] != "AUTO"], "default": "INPAINT",
          "description": "What no picture shows between those that do"}
_FILL = {"name": "Fill Above and Below", "default": True,
         "description": "What no picture shows of the sphere is filled smoothly from its rim, so that it lights the "
         "scene; off: it stays open, and dark"}
_REPLACE = {"name": "Replace the Scene's World", "default": True,
            "description": "Let the scene use it at once; the World that it has stays in the file"}


class EDF_OT_stitch_environment(bpy.types.Operator):  # noqa: N801
    """Make a whole sphere of the pictures of the list, exposures of one view merged, and a World that shows it"""

    bl_idname = idnames.Operator.ENVIRONMENT
    bl_label = "Stitch Environment"
    bl_options = {"REGISTER"}

    holes: EnumProperty(**_HOLES)
    fill: BoolProperty(**_FILL)
    replace: BoolProperty(**_REPLACE)
    height: FloatProperty(**scene_objects.GROUND)
    is_asked = False

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not modal.is_working() and not stitching.why_not(properties.settings_of(context.scene))

    def invoke(self, context: Any, _event: Any) -> set[str]:
        self.is_asked = True
        asked: set[str] = context.window_manager.invoke_props_dialog(self, confirm_text="Stitch")
        return asked

    def execute(self, _context: Any) -> set[str]:
        how = "INVOKE_DEFAULT" if self.is_asked and not bpy.app.background else "EXEC_DEFAULT"
        given = {"holes": self.holes, "fill": self.fill, "replace": self.replace, "height": self.height}
        return modal.hand_on(self, bpy.ops.edf.stitch_sphere, how, **given)


class EDF_OT_stitch_sphere(_Stitching, bpy.types.Operator):  # noqa: N801
    """Make a whole sphere of the pictures of the list, and a World that shows it"""

    bl_idname = idnames.Operator.SPHERE
    bl_label = "Stitch Sphere"
    bl_options = {"UNDO", "INTERNAL"}

    holes: EnumProperty(**_HOLES)
    fill: BoolProperty(**_FILL)
    replace: BoolProperty(**_REPLACE)
    height: FloatProperty(**scene_objects.GROUND)

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        self.instead = {"projection": "EQUIRECTANGULAR", "crop": "FULL", "holes": self.holes}
        job, self.memory = stitching.make_job(context, folder, instead=self.instead)
        return {**job, "fill": self.fill}

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        words = super().finish(context, folder, found)
        settings = properties.settings_of(context.scene)
        image = settings.result
        for name, value in self.instead.items():  # else a small flat panorama would follow, and take the sphere's place
            setattr(settings, name, value)
        world = take_along.use_as_world(context.scene, image, self.replace)
        if self.height > 0:
            take_along.select(context, [take_along.ground(context.scene, image, self.height)])
        seen = ": look at it in Rendered shading" if self.replace else ""
        return f"{words} The World “{world.name}” shows it{seen}."


class EDF_OT_restitch(_Stitching, bpy.types.Operator):  # noqa: N801
    """Stitch the pictures of a panorama again, with its settings and its matches"""

    bl_idname = idnames.Operator.RESTITCH
    bl_label = "Stitch Again"
    bl_options = {"UNDO"}

    image: StringProperty(name="Panorama", description="Whose; the one that is shown, or was made last, where empty")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not modal.is_working() and editor.panorama(context) is not None

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        settings = properties.settings_of(context.scene)
        for words in bring_back(context, editor.panorama(context, self.image)):
            self.report({"WARNING"}, words)
        settings.edited_matches = not pictures.is_set(settings)
        return super().prepare(context, folder)


class EDF_OT_follow(_Stitching, bpy.types.Operator):  # noqa: N801
    """Show the frame and the viewpoint that are chosen now, small and soon, from the matches of the last panorama"""

    bl_idname = idnames.Operator.FOLLOW
    bl_label = "Follow the Frame"
    bl_options = {"UNDO", "INTERNAL"}
    kind = "preview"
    follows = True

    joins: BoolProperty(
        name="Join", description="Be undone with the step before, instead of being one", options={"SKIP_SAVE"}
    )

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        job, self.memory = following.make_job(context, folder)
        return job

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        return following.take_over(context, folder, found, self.memory)

    def _take(self, context: Any, outcome: Any) -> set[str]:
        done = super()._take(context, outcome)
        return {"CANCELLED"} if self.joins else done  # of which Blender makes no step


class EDF_OT_restore(bpy.types.Operator):  # noqa: N801
    """Bring the settings, pictures and matches of a panorama back, to change one thing and stitch again"""

    bl_idname = idnames.Operator.RESTORE
    bl_label = "Restore Settings"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Panorama", description="Whose; the one that is shown, or was made last, where empty")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return editor.panorama(context) is not None

    def execute(self, context: Any) -> set[str]:
        try:
            changes = bring_back(context, editor.panorama(context, self.image))
        except images.Unusable as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for words in changes:
            self.report({"WARNING"}, words)
        return {"FINISHED"}


class EDF_OT_cancel(bpy.types.Operator):  # noqa: N801
    """Stop the work; nothing is changed"""

    bl_idname = idnames.Operator.CANCEL
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context: Any) -> bool:
        return modal.is_working()

    def execute(self, _context: Any) -> set[str]:
        modal.cancel()
        return {"FINISHED"}


class EDF_OT_reset(bpy.types.Operator):  # noqa: N801
    """Set everything back to its default; the pictures and the panorama stay"""

    bl_idname = idnames.Operator.RESET
    bl_label = "Reset Settings"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        for name in properties.names_of_settings(settings):
            settings.property_unset(name)
        return {"FINISHED"}


class EDF_OT_reference_frame(bpy.types.Operator):  # noqa: N801
    """Keep the reference's plane, place and every pixel as it is, on a canvas that holds both pictures: for plates"""

    bl_idname = idnames.Operator.REFERENCE_FRAME
    bl_label = "Reference Frame"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        settings.projection, settings.crop = "REFERENCE", "FULL"
        settings.slide_auto, settings.slide = False, 0.0
        settings.light, settings.light_stops = "REFERENCE", 0.0
        return {"FINISHED"}


def bring_back(context: Any, image: bpy.types.Image | None) -> list[str]:
    """Settings, pictures and matches of a panorama; returns what has changed since, in words. Raises Unusable."""
    settings = properties.settings_of(context.scene)
    found = result.read(image)
    if image is None or found is None:
        raise images.Unusable("this image carries no settings: it is no panorama that was stitched here")
    if lost := ownership.missing(image):
        raise images.Unusable("; ".join(lost))
    with pair.choosing(settings):
        pictures.choose(settings, ownership.pictures(image))
        properties.restore(settings, found["settings"], ownership.chosen(image))
        pictures.bring_back(settings, ownership.chosen(image), found)
        if "matches" in found:
            stitching.fill_matches(settings, found["matches"], edited=False)
    return ownership.changes(image) + ownership.camera_changes(image, context)


CLASSES = (
    EDF_OT_stitch, EDF_OT_stitch_environment, EDF_OT_stitch_sphere, EDF_OT_preview, EDF_OT_restitch, EDF_OT_follow,
    EDF_OT_restore, EDF_OT_cancel, EDF_OT_reset, EDF_OT_reference_frame,
)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(CLASSES)
