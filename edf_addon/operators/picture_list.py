"""The list of pictures: what an artist does to its rows."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import EnumProperty, IntProperty

from .. import editor, idnames, pair, pictures, properties, switches
from ..bridge import result
from ..jobs import following

WHICH = (
    ("SHOWN", "Shown Image", "The image that the editor shows"),
    ("FILE", "Images of This File", "All photographs among the file's images"),
)
# Of images that are a picture each.
SOURCES = ("FILE", "SEQUENCE", "GENERATED")
WAYS = (("UP", "Up", "One row up"), ("DOWN", "Down", "One row down"))


class _OfAList:
    """Operators that need pictures in the list."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return len(properties.settings_of(context.scene).pictures) > 0


class EDF_OT_add_images(bpy.types.Operator):  # noqa: N801
    """Add images that are open in Blender to the list"""

    bl_idname = idnames.Operator.ADD_IMAGES
    bl_label = "Add Images"
    bl_options = {"REGISTER", "UNDO"}

    which: EnumProperty(name="Which", items=WHICH)

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        found = [editor.shown(context)] if self.which == "SHOWN" else bpy.data.images
        masks = {getattr(entry, kind) for entry in settings.pictures for kind in pictures.MASKS}
        not_wanted = {*properties.pointers(settings).values(), *_made_by_stitches(), *masks} - {settings.seen_from}
        photographs = [one for one in found if one and one not in not_wanted and one.source in SOURCES]
        count = pictures.add(settings, photographs)
        if not count:
            self.report({"WARNING"}, "There is no image to add that is not in the list yet, or a panorama.")
            return {"CANCELLED"}
        return {"FINISHED"}


class EDF_OT_remove_picture(_OfAList, bpy.types.Operator):  # noqa: N801
    """Take this picture out of the list; it stays in the file"""

    bl_idname = idnames.Operator.REMOVE_PICTURE
    bl_label = "Remove Picture"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        with pair.choosing(settings):
            settings.pictures.remove(settings.picture_index)
            settings.picture_index = max(0, min(settings.picture_index, len(settings.pictures) - 1))
        return {"FINISHED"}


class EDF_OT_move_picture(_OfAList, bpy.types.Operator):  # noqa: N801
    """Move this picture in the list. Of two, the first is the reference"""

    bl_idname = idnames.Operator.MOVE_PICTURE
    bl_label = "Move Picture"
    bl_options = {"REGISTER", "UNDO"}

    way: EnumProperty(name="Way", items=WAYS)

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        to = settings.picture_index + (-1 if self.way == "UP" else 1)
        if not 0 <= to < len(settings.pictures):
            return {"CANCELLED"}
        with pair.choosing(settings):
            settings.pictures.move(settings.picture_index, to)
            settings.picture_index = to
        return {"FINISHED"}


class EDF_OT_clear_pictures(_OfAList, bpy.types.Operator):  # noqa: N801
    """Take all pictures out of the list; they stay in the file"""

    bl_idname = idnames.Operator.CLEAR_PICTURES
    bl_label = "Clear List"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        pictures.choose(properties.settings_of(context.scene), [])
        return {"FINISHED"}


class EDF_OT_see_from(bpy.types.Operator):  # noqa: N801
    """See the panorama from where this picture was taken; pressed again, from the first that connects with others"""

    bl_idname = idnames.Operator.SEE_FROM
    bl_label = "See From Here"
    bl_options = {"REGISTER", "UNDO"}

    row: IntProperty(name="Row", description="Of the list, from 0", min=0)

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        if self.row >= len(settings.pictures):
            self.report({"ERROR"}, "The list has no such row.")
            return {"CANCELLED"}
        image = settings.pictures[self.row].image
        settings.seen_from = None if settings.seen_from == image else image
        following.ask(settings)
        return {"FINISHED"}


class EDF_OT_picture_state(bpy.types.Operator):  # noqa: N801
    """What the last stitch did with this picture"""

    bl_idname = idnames.Operator.PICTURE_STATE
    bl_label = "Show Picture"
    bl_options = {"INTERNAL"}

    row: IntProperty(name="Row", min=0, options={"SKIP_SAVE"})

    @classmethod
    def description(cls, context: Any, given: Any) -> str:
        settings = properties.settings_of(context.scene)
        return said_of(settings.pictures[given.row]) if given.row < len(settings.pictures) else ""

    def execute(self, context: Any) -> set[str]:
        properties.settings_of(context.scene).picture_index = self.row
        return {"FINISHED"}


class EDF_OT_swap(bpy.types.Operator):  # noqa: N801
    """Make the target the reference and the reference the target, with their cameras, lenses and masks"""

    bl_idname = idnames.Operator.SWAP
    bl_label = "Swap Pictures"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return len(pictures.used(properties.settings_of(context.scene))) == 2

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        with pair.choosing(settings):
            for one, other in (*properties.PICTURES, *(properties.LENSES if settings.own_lens else ())):
                mine, theirs = getattr(settings, one), getattr(settings, other)
                setattr(settings, one, theirs)
                setattr(settings, other, mine)
            for match in settings.matches:
                match.x, match.y, match.x2, match.y2 = match.x2, match.y2, match.x, match.y
                match.error = -1.0
            pair.owns_matches(settings)
        return {"FINISHED"}


def said_of(entry: Any) -> str:
    """What the last stitch did with a picture of the list, in words."""
    if entry.image is None:
        return "This picture is no longer in the file: remove the row"
    if entry.state == "LEFT_OUT":
        return switches.in_the_panel(f"{entry.image.name} is left out: {entry.why}")
    return "Used by the last stitch" if entry.state == "USED" else "Not stitched yet as it is now"


def _made_by_stitches() -> set[bpy.types.Image]:
    """Panoramas, and the images that belong to them."""
    panoramas = [image for image in bpy.data.images if result.read(image) is not None]
    return {*panoramas, *(other for one in panoramas for other in result.companions(one).values())}


CLASSES = (EDF_OT_add_images, EDF_OT_remove_picture, EDF_OT_move_picture, EDF_OT_clear_pictures, EDF_OT_see_from,
           EDF_OT_picture_state, EDF_OT_swap)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(CLASSES)
