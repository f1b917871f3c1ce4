"""What an artist can do. Operators are thin: settings → job → worker → image."""

from pathlib import Path
from typing import Any

import bpy
from bpy.props import CollectionProperty, StringProperty

from . import idnames, images, modal, properties, result, stitching


class _Stitching(modal.LongWork):
    """What the three share that stitch. kind: of image that comes out of it."""

    kind = "panorama"

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        job, self.memory = stitching.make_job(context, folder)
        return job

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        return stitching.take_over(context, folder, found, self.memory, self.kind)


class EDF_OT_stitch(_Stitching, bpy.types.Operator):  # noqa: N801
    """Stitch the target into the reference's plane, as a new image. ESC cancels"""

    bl_idname = idnames.Operator.STITCH
    bl_label = "Stitch"
    bl_options = {"UNDO"}

    reference: StringProperty(name="Reference", description="Name of the image to choose first", options={"SKIP_SAVE"})
    target: StringProperty(name="Target", description="Name of the image to choose first", options={"SKIP_SAVE"})

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        for side in stitching.SIDES:
            if name := getattr(self, side):
                setattr(properties.settings_of(context.scene), side, image_named(name))
        return super().prepare(context, folder)


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


class EDF_OT_restitch(_Stitching, bpy.types.Operator):  # noqa: N801
    """Stitch the pictures of a panorama again, with its settings and its matches"""

    bl_idname = idnames.Operator.RESTITCH
    bl_label = "Stitch Again"
    bl_options = {"UNDO"}

    image: StringProperty(name="Panorama", description="Whose; the one that is shown, or was made last, where empty")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not modal.is_working() and panorama(context) is not None

    def prepare(self, context: Any, folder: Path) -> dict[str, Any]:
        settings = properties.settings_of(context.scene)
        bring_back(settings, panorama(context, self.image))
        settings.edited_matches = True
        return super().prepare(context, folder)


class EDF_OT_restore(bpy.types.Operator):  # noqa: N801
    """Bring the settings, pictures and matches of a panorama back, to change one thing and stitch again"""

    bl_idname = idnames.Operator.RESTORE
    bl_label = "Restore Settings"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Panorama", description="Whose; the one that is shown, or was made last, where empty")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return panorama(context) is not None

    def execute(self, context: Any) -> set[str]:
        try:
            bring_back(properties.settings_of(context.scene), panorama(context, self.image))
        except images.Unusable as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
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


class EDF_OT_open_pair(bpy.types.Operator):  # noqa: N801
    """Open two photographs at once, as reference and target"""

    bl_idname = idnames.Operator.OPEN_PAIR
    bl_label = "Open Pair"
    bl_options = {"REGISTER", "UNDO"}

    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    filter_image: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context: Any, _event: Any) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        names = [file.name for file in self.files if file.name]
        if len(names) != 2:
            chosen = "1 was" if len(names) == 1 else f"{len(names)} were"
            self.report({"ERROR"}, f"Choose two pictures ({chosen} chosen): hold Ctrl, or Shift, for the second.")
            return {"CANCELLED"}
        loaded = []
        for name in sorted(names):
            try:
                loaded.append(bpy.data.images.load(str(Path(self.directory, name)), check_existing=True))
            except RuntimeError as error:
                self.report({"ERROR"}, f"{name} cannot be opened: {error}")
                return {"CANCELLED"}
        settings = properties.settings_of(context.scene)
        if loaded != [settings.reference, settings.target]:
            settings.edited_matches = False  # they are those of other pictures
        settings.reference, settings.target = loaded
        stitching.show(context, loaded[0])
        return {"FINISHED"}


class EDF_OT_swap(bpy.types.Operator):  # noqa: N801
    """Make the target the reference and the reference the target, with their cameras, lenses and masks"""

    bl_idname = idnames.Operator.SWAP
    bl_label = "Swap Pictures"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        for one, other in (*properties.PICTURES, *(properties.LENSES if settings.own_lens else ())):
            mine, theirs = getattr(settings, one), getattr(settings, other)
            setattr(settings, one, theirs)
            setattr(settings, other, mine)
        for match in settings.matches:
            match.x, match.y, match.x2, match.y2 = match.x2, match.y2, match.x, match.y
            match.error = -1.0
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


class EDF_OT_save(bpy.types.Operator):  # noqa: N801
    """Save the panorama as a file with its values kept: EXR (float), PNG or TIFF"""

    bl_idname = idnames.Operator.SAVE
    bl_label = "Save Panorama"
    bl_options = {"REGISTER"}

    image: StringProperty(name="Image", description="Which; the one that is shown, or was made last, where empty")
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_image: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        return shown_image(context) is not None or properties.settings_of(context.scene).result is not None

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
            return image_named(self.image)
        return panorama(context) or shown_image(context)


def image_named(name: str) -> bpy.types.Image:
    """One of the file's images. Raises Unusable."""
    image = bpy.data.images.get(name)
    if image is None:
        raise images.Unusable(f"the file has no image named “{name}”")
    return image


def shown_image(context: Any) -> bpy.types.Image | None:
    """What the Image Editor shows that the operator was called from."""
    editor = context.space_data
    return editor.image if isinstance(editor, bpy.types.SpaceImageEditor) else None


def panorama(context: Any, name: str = "") -> bpy.types.Image | None:
    """The named image; else the shown one, if it is a panorama; else the one that was made last. Raises Unusable for a
    name that is none's."""
    if name:
        return image_named(name)
    shown = shown_image(context)
    return shown if result.read(shown) is not None else properties.settings_of(context.scene).result


def bring_back(settings: Any, image: bpy.types.Image | None) -> None:
    """Settings, pictures and matches of a panorama. Raises Unusable."""
    found = result.read(image)
    if found is None:
        raise images.Unusable("this image carries no settings: it is no panorama that was stitched here")
    for side, name in found["pictures"].items():
        setattr(settings, side, image_named(name))
    properties.restore(settings, found["settings"])
    stitching.fill_matches(settings, found["matches"], edited=False)


CLASSES = (
    EDF_OT_stitch, EDF_OT_preview, EDF_OT_restitch, EDF_OT_restore, EDF_OT_cancel, EDF_OT_open_pair, EDF_OT_swap,
    EDF_OT_reset, EDF_OT_save,
)  # fmt: skip


def register() -> None:
    """Make the operators known."""
    modal.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away again, and end whatever they do."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    modal.unregister()
