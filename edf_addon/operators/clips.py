"""Clips of cameras that stand still: put into the list, and stitched frame by frame."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import idnames, properties
from ..jobs import clip_stitching, job, modal
from .opening import Browsing


class EDF_OT_add_clips(Browsing, bpy.types.Operator):  # noqa: N801
    """Add clips of cameras that stand still to the list: movies, or image sequences, of which one frame will do"""

    bl_idname = idnames.Operator.ADD_CLIPS
    bl_label = "Add Clips"
    bl_options = {"REGISTER", "UNDO"}

    filter_movie: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    def execute(self, context: Any) -> set[str]:
        clips = properties.settings_of(context.scene).clips
        for path in first_frames(self.paths()):
            try:
                loaded = bpy.data.movieclips.load(str(path), check_existing=True)
            except RuntimeError as error:
                self.report({"ERROR"}, f"{path.name} cannot be opened: {error}")
                return {"CANCELLED"}
            if loaded not in {entry.clip for entry in clips}:
                clips.add().clip = loaded
        return {"FINISHED"}


class EDF_OT_remove_clip(bpy.types.Operator):  # noqa: N801
    """Take this clip out of the list; it stays in the file"""

    bl_idname = idnames.Operator.REMOVE_CLIP
    bl_label = "Remove Clip"
    bl_options = {"REGISTER", "UNDO"}

    row: IntProperty(name="Row", min=0)

    def execute(self, context: Any) -> set[str]:
        properties.settings_of(context.scene).clips.remove(self.row)
        return {"FINISHED"}


def first_frames(paths: Iterable[Path]) -> list[Path]:
    """Movies, and of each image sequence the first frame that is among these files, sorted as people count: Blender
    finds the others by the last number in its name."""
    kept: dict[object, Path] = {}
    for path in paths:
        numbered = re.fullmatch(r"(.*?)\d+(\D*)", path.stem)
        is_movie = path.suffix.lower() in bpy.path.extensions_movie
        kept.setdefault(path if is_movie or numbered is None else (path.parent, *numbered.groups(), path.suffix), path)
    return list(kept.values())


_FIRST = {"name": "First Frame", "default": 1, "min": 0, "options": {"SKIP_SAVE"},
          "description": "Of the scene's frames, as the clips lie in it"}  # fmt: skip
_LAST = {"name": "Last Frame", "default": 250, "min": 0, "options": {"SKIP_SAVE"},
         "description": "Of the scene's frames, as the clips lie in it"}  # fmt: skip
_FOLDER = {"name": "Folder", "subtype": "DIR_PATH", "options": {"SKIP_SAVE"},
           "description": "Where the frames are written. What is there and up to date is not made again"}  # fmt: skip
_KIND = {"name": "Format", "items": clip_stitching.SUFFIXES, "description": "Of the files of the frames"}


class EDF_OT_stitch_clips(bpy.types.Operator):  # noqa: N801
    """Make one panorama of each frame of the clips, all with the same cameras, seam and light, as an image sequence"""

    bl_idname = idnames.Operator.STITCH_CLIPS
    bl_label = "Stitch Clips"
    bl_options = {"REGISTER"}

    first: IntProperty(**_FIRST)
    last: IntProperty(**_LAST)
    folder: StringProperty(**_FOLDER)
    kind: EnumProperty(**_KIND)
    is_asked = False

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = clip_stitching.why_not(properties.settings_of(context.scene))
        if reason:
            cls.poll_message_set(job.sentence(reason).rstrip("."))
        return not reason and not modal.is_working()

    def invoke(self, context: Any, _event: Any) -> set[str]:
        self.is_asked = True
        self._suggest(context)
        asked: set[str] = context.window_manager.invoke_props_dialog(self, width=400, confirm_text="Stitch")
        return asked

    def execute(self, context: Any) -> set[str]:
        self._suggest(context)
        how = "INVOKE_DEFAULT" if self.is_asked and not bpy.app.background else "EXEC_DEFAULT"
        given = {"first": self.first, "last": self.last, "folder": self.folder, "kind": self.kind}
        return modal.hand_on(self, bpy.ops.edf.stitch_clip_frames, how, **given)

    def _suggest(self, context: Any) -> None:
        """The frames that all clips show, and a folder beside the first one, where nothing was said."""
        settings = properties.settings_of(context.scene)
        first, last = clip_stitching.common_range(settings)
        wanted = {"first": first, "last": last, "folder": clip_stitching.suggested_folder(settings)}
        for name, value in wanted.items():
            if not self.properties.is_property_set(name):
                setattr(self, name, value)


class EDF_OT_stitch_clip_frames(modal.LongWork, bpy.types.Operator):  # noqa: N801
    """Make one panorama of each frame of the clips"""

    bl_idname = idnames.Operator.CLIP_FRAMES
    bl_label = "Stitch Frames"
    bl_options = {"UNDO", "INTERNAL"}
    makes = "the frames"
    when_cancelled = "Cancelled. The frames that are finished stay: stitched again, it goes on from there."

    first: IntProperty(**_FIRST)
    last: IntProperty(**_LAST)
    folder: StringProperty(**_FOLDER)
    kind: EnumProperty(**_KIND)

    def prepare(self, context: Any, _folder: Path) -> dict[str, Any]:
        return clip_stitching.make_job(context.scene, self.first, self.last, self.folder, self.kind)

    def finish(self, context: Any, _folder: Path, found: dict[str, Any]) -> str:
        return clip_stitching.take_over(context, found)


CLASSES = (EDF_OT_add_clips, EDF_OT_remove_clip, EDF_OT_stitch_clips, EDF_OT_stitch_clip_frames)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
