"""The pictures that are stitched, opened and swapped, and the panorama, saved."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from .. import editor, idnames, pair, properties
from ..bridge import images, stand_ins
from ..jobs import modal, stitching


class EDF_OT_open_pair(bpy.types.Operator):  # noqa: N801
    """Open two photographs at once, as reference and target"""

    bl_idname = idnames.Operator.OPEN_PAIR
    bl_label = "Open Pair"
    bl_options = {"REGISTER", "UNDO"}

    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    is_browsed = False

    def invoke(self, context: Any, _event: Any) -> set[str]:
        self.filter_glob, self.is_browsed = stand_ins.endings(), True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        names = [file.name for file in self.files if file.name]
        if len(names) != 2:
            chosen = "1 was" if len(names) == 1 else f"{len(names)} were"
            self.report({"ERROR"}, f"Choose two pictures ({chosen} chosen): hold Ctrl, or Shift, for the second.")
            return {"CANCELLED"}
        paths = [Path(self.directory, name) for name in sorted(names)]
        if any(map(stand_ins.is_needed, paths)):
            how = "EXEC_DEFAULT" if bpy.app.background or not self.is_browsed else "INVOKE_DEFAULT"
            done: set[str] = bpy.ops.edf.develop_pair(how, reference=str(paths[0]), target=str(paths[1]))
            return {"FINISHED"} if done == {"RUNNING_MODAL"} else done
        try:
            _choose(context, [_loaded(path) for path in paths])
        except images.Unusable as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class EDF_OT_develop_pair(modal.LongWork, bpy.types.Operator):  # noqa: N801
    """Open two photographs that Blender cannot open itself (camera RAW, HEIC), as reference and target"""

    bl_idname = idnames.Operator.DEVELOP_PAIR
    bl_label = "Develop Pair"
    bl_options = {"INTERNAL", "UNDO"}
    makes = "the pictures"

    reference: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    target: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    def prepare(self, _context: Any, _folder: Path) -> dict[str, Any]:
        return {"show": [path for path in (self.reference, self.target) if stand_ins.is_needed(Path(path))]}

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        chosen = []
        for path in (self.reference, self.target):
            shown = found["files"].get(path)
            chosen.append(_loaded(Path(path)) if shown is None else stand_ins.bring(folder / shown, Path(path)))
        _choose(context, chosen)
        return "Opened " + " and ".join(image.name for image in chosen)


def _loaded(path: Path) -> bpy.types.Image:
    """Raises Unusable."""
    try:
        return bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        raise images.Unusable(f"{path.name} cannot be opened: {error}") from error


def _choose(context: Any, opened: list[bpy.types.Image]) -> None:
    """Make two images reference and target, and show the first."""
    settings = properties.settings_of(context.scene)
    with pair.choosing(settings):
        settings.reference, settings.target = opened
    stitching.show(context, opened[0])


class EDF_OT_swap(bpy.types.Operator):  # noqa: N801
    """Make the target the reference and the reference the target, with their cameras, lenses and masks"""

    bl_idname = idnames.Operator.SWAP
    bl_label = "Swap Pictures"
    bl_options = {"REGISTER", "UNDO"}

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


class EDF_OT_save(bpy.types.Operator):  # noqa: N801
    """Save the panorama as a file with its values kept: EXR or Radiance HDR (float), PNG or TIFF"""

    bl_idname = idnames.Operator.SAVE
    bl_label = "Save Panorama"
    bl_options = {"REGISTER"}

    image: StringProperty(name="Image", description="Which; the one that is shown, or was made last, where empty")
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        return editor.shown(context) is not None or properties.settings_of(context.scene).result is not None

    def invoke(self, context: Any, _event: Any) -> set[str]:
        image = self._image(context)
        self.filepath = bpy.path.clean_name(image.name) + (".exr" if image.is_float else ".png")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, _context: Any) -> bool:
        """The file dialog asks after every change: a name without a kind gets one."""
        if Path(self.filepath).suffix.lower() in images.KINDS or not Path(self.filepath).name:
            return False
        self.filepath = str(Path(self.filepath).with_suffix(".exr"))
        return True

    def execute(self, context: Any) -> set[str]:
        try:
            path = Path(bpy.path.abspath(self.filepath))
            images.save(self._image(context), path)
        except (images.Unusable, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Saved {path}")
        return {"FINISHED"}

    def _image(self, context: Any) -> bpy.types.Image:
        if self.image:
            return images.named(self.image)
        return editor.panorama(context) or editor.shown(context)


CLASSES = (EDF_OT_open_pair, EDF_OT_develop_pair, EDF_OT_swap, EDF_OT_save)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
