"""Photographs are opened, from files or a folder, and stand in the list of pictures."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from .. import editor, idnames, pictures, properties
from ..bridge import images, stand_ins
from ..jobs import modal, stitching

# Seconds in which Blender draws a new window, and how often its tab is asked for before that is given up: 5 s.
UNTIL_DRAWN, MOST_TRIES = 0.2, 25


class Browsing:
    """A file dialog for pictures; several can be chosen."""

    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    is_browsed = False

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Opens the dialog, unless the files are known: they were dropped."""
        self.is_browsed = True
        if self.files:
            return self.execute(context)  # type: ignore[attr-defined, no-any-return]
        self.filter_glob = stand_ins.endings()
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def paths(self) -> list[Path]:
        """The chosen files, sorted as people count."""
        from ...core.pictures.listing import natural

        names = [file.name for file in self.files if file.name]
        return sorted((Path(bpy.path.abspath(self.directory), name) for name in names), key=natural)

    @property
    def how(self) -> str:
        """How an operator with long work is called: modal from a window, blocking from a script."""
        return "INVOKE_DEFAULT" if self.is_browsed and not bpy.app.background else "EXEC_DEFAULT"

    def put_into_list(self, context: Any, paths: Sequence[Path], instead: bool = False) -> set[str]:
        """Puts files into the list, or instead of it."""
        return into_list(self, context, paths, self.how, instead)


def into_list(operator: Any, context: Any, paths: Sequence[Path], how: str, instead: bool = False) -> set[str]:
    """Puts files into the list, or instead of it, for an operator, which reports it. how: see `Browsing.how`."""
    paths = [path.absolute() for path in paths]  # a worker stands in a folder of its own
    if any(map(stand_ins.is_needed, paths)):
        given = {"paths": "\n".join(map(str, paths)), "instead": instead}
        return modal.hand_on(operator, bpy.ops.edf.develop_pictures, how, **given)
    try:
        opened = [_loaded(path) for path in paths]
    except images.Unusable as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    operator.report({"INFO"}, _listed(context, opened, instead))
    return {"FINISHED"}


class EDF_OT_add_pictures(Browsing, bpy.types.Operator):  # noqa: N801
    """Add photographs to the list; hold Shift or Ctrl to choose several. Files can also be dropped on the sidebar"""

    bl_idname = idnames.Operator.ADD_PICTURES
    bl_label = "Add Pictures"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        paths = self.paths()
        if not paths:
            self.report({"ERROR"}, "No pictures were chosen: hold Shift or Ctrl to choose several.")
            return {"CANCELLED"}
        return self.put_into_list(context, paths)


class EDF_OT_add_folder(Browsing, bpy.types.Operator):  # noqa: N801
    """Add all photographs of a folder to the list"""

    bl_idname = idnames.Operator.ADD_FOLDER
    bl_label = "Add Folder"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        from ...core.pictures.listing import listed
        from ...core.system.errors import StitchError

        try:
            paths = listed([Path(bpy.path.abspath(self.directory))])
        except StitchError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.put_into_list(context, paths)


class EDF_OT_open_pair(Browsing, bpy.types.Operator):  # noqa: N801
    """Open two photographs at once, as reference and target, instead of what is in the list"""

    bl_idname = idnames.Operator.OPEN_PAIR
    bl_label = "Open Pair"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        paths = self.paths()
        if len(paths) != 2:
            chosen = "1 was" if len(paths) == 1 else f"{len(paths)} were"
            self.report({"ERROR"}, f"Choose two pictures ({chosen} chosen): hold Ctrl, or Shift, for the second.")
            return {"CANCELLED"}
        return self.put_into_list(context, paths, instead=True)


class EDF_OT_stitch_files(Browsing, bpy.types.Operator):  # noqa: N801
    """Make one panorama of photographs: they are put into the list, instead of what is in it, and stitched"""

    bl_idname = idnames.Operator.STITCH_FILES
    bl_label = "Stitch Panorama from Files"
    bl_options = {"REGISTER"}

    as_empty: BoolProperty(
        name="Add to the Scene", description="As an image empty at the 3D cursor", options={"SKIP_SAVE"}
    )
    as_world: BoolProperty(
        name="Light the Scene", description="Make a whole sphere of them, and a World that shows it",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, _context: Any) -> bool:
        return not modal.is_working()

    def execute(self, context: Any) -> set[str]:
        paths = self.paths()
        if len(paths) < 2:
            self.report({"ERROR"}, "Choose two pictures or more: hold Shift or Ctrl to choose several.")
            return {"CANCELLED"}
        goes_on_in_panel = any(map(stand_ins.is_needed, paths))
        if self.is_browsed and (goes_on_in_panel or not (self.as_empty or self.as_world)):
            _have_an_editor(context)
        opened = self.put_into_list(context, paths, instead=True)
        if opened != {"FINISHED"}:
            return opened
        if modal.is_working():
            button = "Stitch Environment" if self.as_world else "Stitch"
            self.report({"WARNING"}, f"The pictures are being developed: press {button} when they are in the list.")
            return {"FINISHED"}
        if self.as_world:
            return modal.hand_on(self, bpy.ops.edf.stitch_environment, self.how)
        return modal.hand_on(self, bpy.ops.edf.stitch, self.how, as_empty=self.as_empty)


class EDF_OT_develop_pictures(modal.LongWork, bpy.types.Operator):  # noqa: N801
    """Open photographs some of which Blender cannot open itself (camera RAW, HEIC)"""

    bl_idname = idnames.Operator.DEVELOP
    bl_label = "Develop Pictures"
    bl_options = {"INTERNAL", "UNDO"}
    makes = "the pictures"

    paths: StringProperty(name="Files", description="One path a line", options={"SKIP_SAVE"})
    instead: BoolProperty(name="Instead", description="Of the list, and not added to it", options={"SKIP_SAVE"})

    def prepare(self, _context: Any, _folder: Path) -> dict[str, Any]:
        return {"show": [path for path in self.paths.split("\n") if stand_ins.is_needed(Path(path))]}

    def finish(self, context: Any, folder: Path, found: dict[str, Any]) -> str:
        opened = []
        for path in self.paths.split("\n"):
            shown = found["files"].get(path)
            opened.append(_loaded(Path(path)) if shown is None else stand_ins.bring(folder / shown, Path(path)))
        return _listed(context, opened, self.instead)


def _loaded(path: Path) -> bpy.types.Image:
    """Raises Unusable."""
    try:
        return bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        raise images.Unusable(f"{path.name} cannot be opened: {error}") from error


def _listed(context: Any, opened: list[bpy.types.Image], instead: bool) -> str:
    """Images stand in the list, or are the list, and the first of them is shown; returns words about it."""
    settings = properties.settings_of(context.scene)
    if instead:
        pictures.choose(settings, opened)
    count = len(opened) if instead else pictures.add(settings, opened)
    if opened:
        stitching.show(context, opened[0])
    return f"{count} picture{'s' * (count != 1)} added to the list."


def _have_an_editor(context: Any) -> None:
    """Where no window has an Image Editor, opens one in a window of its own with the sidebar's tab, as renders do: what
    comes of an import would be seen nowhere."""
    if bpy.app.background or editor.all_spaces(context):
        return
    bpy.ops.wm.window_new()
    area = context.window_manager.windows[-1].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.show_region_ui = True
    bpy.app.timers.register(partial(_show_tab, iter(range(MOST_TRIES))), first_interval=UNTIL_DRAWN)


def _show_tab(tries: Iterator[int]) -> float | None:
    """The sidebar of the newest window shows the tab, which it knows once it was drawn. Returns seconds until it is
    to be tried again, None where it is done or no tries are left."""
    area = bpy.context.window_manager.windows[-1].screen.areas[0]
    sidebar = next((region for region in area.regions if region.type == "UI"), None)
    if area.type == "IMAGE_EDITOR" and sidebar is not None and sidebar.active_panel_category != idnames.TAB:
        try:
            sidebar.active_panel_category = idnames.TAB
        except (AttributeError, TypeError):  # no tabs are there yet, or not this one
            return None if next(tries, None) is None else UNTIL_DRAWN
        area.tag_redraw()
    return None


CLASSES = (EDF_OT_add_pictures, EDF_OT_add_folder, EDF_OT_open_pair, EDF_OT_stitch_files,
           EDF_OT_develop_pictures)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(CLASSES)
