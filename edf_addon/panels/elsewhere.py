"""Where else than in the sidebar hands look: menus, and files that are dropped on the editor."""

from __future__ import annotations

from typing import Any

import bpy

from .. import idnames
from ..bridge import stand_ins
from ..idnames import Operator

# What pictures usually end in. All that camera RAW may end in is known by the engine, which is not loaded for this.
_USUAL = (
    ".jpg", ".jpeg", ".png", ".tif", ".tiff", ".exr", ".hdr", ".webp", ".bmp", *stand_ins.HEIC_SUFFIXES, ".dng",
    ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2",
)  # fmt: skip


class EDF_FH_pictures(bpy.types.FileHandler):  # noqa: N801
    """Picture files that are dropped on an Image Editor go into the list"""

    bl_idname = idnames.DROPPED
    bl_label = "Add to the Stitch"
    bl_import_operator = Operator.ADD_PICTURES
    bl_file_extensions = ";".join(_USUAL)

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        return context.area is not None and context.area.type == "IMAGE_EDITOR"


def in_image_menu(self: Any, _context: Any) -> None:
    """The Image Editor's Image menu."""
    self.layout.separator()
    self.layout.operator(Operator.STITCH, icon="IMAGE_DATA")
    self.layout.operator(Operator.STITCH_FILES)
    self.layout.operator(Operator.ENVIRONMENT, icon="WORLD")
    self.layout.operator(Operator.USE_AS_WORLD)


def in_add_menu(self: Any, _context: Any) -> None:
    """The 3D View's Add ▸ Image."""
    self.layout.operator(Operator.STITCH_FILES, text="Stitched Panorama", icon="IMAGE_DATA").as_empty = True


def in_import_menu(self: Any, _context: Any) -> None:
    """File ▸ Import."""
    self.layout.operator(Operator.STITCH_FILES, text="Photographs as Panorama")
    self.layout.operator(Operator.STITCH_FILES, text="Photographs as HDRI Environment").as_world = True


MENUS = (("IMAGE_MT_image", in_image_menu), ("VIEW3D_MT_image_add", in_add_menu),
         ("TOPBAR_MT_file_import", in_import_menu))  # fmt: skip


def register() -> None:
    """Put the entries into Blender's menus."""
    bpy.utils.register_class(EDF_FH_pictures)
    for name, entries in MENUS:
        getattr(bpy.types, name).append(entries)


def unregister() -> None:
    """Take them out again."""
    for name, entries in MENUS:
        getattr(bpy.types, name).remove(entries)
    bpy.utils.unregister_class(EDF_FH_pictures)
