"""The panels, drawn onto a layout that only takes notes: what an artist reads and can press in which state."""

import json
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import properties, status  # noqa: E402
from edf_stitch.edf_addon.bridge import ownership, result  # noqa: E402
from edf_stitch.edf_addon.jobs import health  # noqa: E402
from edf_stitch.edf_addon.panels import choices, clips, finished, main, picture_list, rows, sidebar  # noqa: E402

ICONS = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())
FREE = {"enabled", "active", "scale_y", "alignment", "use_property_split", "use_property_decorate"}


class Button:
    """An operator's properties: only those that it has can be set."""

    def __init__(self, idname: str) -> None:
        room, _, verb = idname.partition(".")
        object.__setattr__(self, "known", getattr(getattr(bpy.ops, room), verb).get_rna_type().properties.keys())

    def __setattr__(self, name: str, value: object) -> None:
        assert name in self.known


class Layout:
    """Takes notes: `said` (texts), `props`, `buttons` (operator, can be pressed)."""

    def __init__(self, notes: SimpleNamespace | None = None, enabled: bool = True) -> None:
        self.notes = notes or SimpleNamespace(said=[], props=[], buttons=[])
        self.enabled, self._above = True, enabled

    def __setattr__(self, name: str, value: object) -> None:
        assert name in FREE | {"notes", "_above"}, name
        object.__setattr__(self, name, value)

    def _part(self, **_: object) -> "Layout":
        return Layout(self.notes, self._above and self.enabled)

    row = column = box = split = _part

    def separator(self, **_: object) -> None: ...

    def label(self, text: str = "", icon: str = "NONE", icon_value: int = 0) -> None:
        assert icon in ICONS, icon
        self.notes.said.append(f"<{icon_value}> {text}" if icon_value else text)

    def icon(self, data: bpy.types.ID) -> int:
        return data.session_uid  # in a window, the number of its thumbnail

    def prop(self, data: object, name: str, text: str | None = None, **_: object) -> None:
        assert name in data.bl_rna.properties, name
        self.notes.props.append(name)

    def operator(self, idname: str, text: str = "", icon: str = "NONE", emboss: bool = True) -> Button:
        assert icon in ICONS, icon
        self.notes.buttons.append((str(idname), self._above and self.enabled))
        return Button(idname)

    def template_ID(self, data: object, name: str, open: str) -> None:  # noqa: A002
        self.prop(data, name)

    def template_list(self, kind: str, _id: str, data: object, name: str, active: object, index: str, **_: int) -> None:
        assert hasattr(bpy.types, kind)
        self.prop(data, name)
        self.prop(active, index)

    def menu(self, kind: str, **_: object) -> None:
        assert hasattr(bpy.types, kind)

    def progress(self, factor: float, text: str) -> None:
        assert 0 <= factor <= 1
        self.notes.said.append(text)


@pytest.fixture
def draw(blender):
    """Draws a panel, or all of them; returns the notes."""

    def drawn(*wanted) -> SimpleNamespace:
        layout = Layout()
        space = SimpleNamespace(image=None, overlay=SimpleNamespace(show_overlays=True))
        context = SimpleNamespace(
            scene=blender.scene, window_manager=blender.window_manager, space_data=space, area=None,
            region=SimpleNamespace(width=280), preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        )  # fmt: skip
        for panel in wanted or sidebar.PANELS:
            if not hasattr(panel, "poll") or panel.poll(context):
                panel.draw_rows(SimpleNamespace(layout=layout), context, blender.settings, rows.width_of(context))
        return layout.notes

    return drawn


def text(notes: SimpleNamespace) -> str:
    return " ".join(notes.said)


def test_with_nothing_chosen_stitch_is_gray_and_says_why(draw):
    notes = draw()
    assert ("edf.stitch", False) in notes.buttons and ("edf.preview", False) in notes.buttons
    assert ("edf.add_pictures", True) in notes.buttons and ("edf.add_folder", True) in notes.buttons
    assert "takes two pictures or more" in text(notes) and "There is something to see after a stitch" in text(notes)
    assert "Stitch a panorama first" in text(notes)


def test_with_a_pair_it_can_be_pressed(draw, chosen):
    assert {("edf.stitch", True), ("edf.swap", True)} <= set(draw(main.EDF_PT_main).buttons)
    chosen.settings.edited_matches = True
    assert "none that is switched on" in text(draw(main.EDF_PT_main))


def test_each_picture_of_the_list_has_its_thumbnail(chosen):
    layout, settings = Layout(), chosen.settings
    for number, entry in enumerate(settings.pictures):
        picture_list.EDF_UL_pictures.draw_item(None, None, layout, settings, entry, 0, None, "", number)
    shown = [f"<{entry.image.session_uid}> {entry.image.name}" for entry in settings.pictures]
    assert len(shown) == 2 and set(shown) <= set(layout.notes.said)


def test_the_clips_of_the_list_are_rows_and_what_they_lack_is_said(draw, blender, tmp_path):
    assert "Choose two clips or more" in text(draw(clips.EDF_PT_clips))
    for number in (1, 2):
        image = bpy.data.images.new("frame", 8, 8)
        image.filepath_raw, image.file_format = str(tmp_path / f"frame_{number}.png"), "PNG"
        image.save()
    blender.settings.clips.add().clip = bpy.data.movieclips.load(str(tmp_path / "frame_1.png"))
    blender.settings.clips.add()
    notes = draw(clips.EDF_PT_clips)
    assert {"frame_1.png: 2 frames", "No longer in the file"} <= set(notes.said)
    assert ("edf.remove_clip", True) in notes.buttons
    assert "Choose two clips or more" in text(notes)


def test_at_work_there_is_the_stage_and_cancel_and_nothing_else_to_press(draw, chosen):
    status.begin()
    status.now.stage, status.now.share = "seam", 0.42
    try:
        notes = draw(main.EDF_PT_main)
    finally:
        status.end("")
    assert [button for button in notes.buttons if button[1]] == [("edf.cancel", True)]
    assert "Finding the seam 42%" in text(notes).replace("  ", " ")


def test_a_failure_and_a_broken_library_are_said_in_words(draw, monkeypatch):
    monkeypatch.setattr(health, "problem", lambda: "OpenCV cannot be found: reinstall EDF Stitch")
    status.end("The pictures have nothing in common.", failed=True)
    try:
        said = text(draw(main.EDF_PT_main))
    finally:
        status.end("")
    assert "OpenCV cannot be found: reinstall EDF Stitch." in said and "nothing in common." in said


@pytest.fixture
def stitched(chosen, small_result, fingerprint):
    """A panorama whose report warns."""
    report = json.loads(json.dumps({**small_result.report, "warnings": ["the focal length is doubtful"]}))
    image = chosen.settings.result = bpy.data.images.new("panorama", 60, 40)
    both = [chosen.settings.reference, chosen.settings.target]
    result.store(image, {"report": report, "has_depth": False, "heat_range": [3.0, 40.0], "geometry": {},
                         "pictures": [{"name": one.name, "fingerprint": fingerprint(one)} for one in both]})
    ownership.hold(image, both, {})
    return chosen


def test_a_panorama_says_how_it_went(draw, stitched):
    stitched.settings.overlay, stitched.settings.show_matches = "DISPLACEMENT", True
    said = text(draw())
    asked = ("The focal length is doubtful.", "General scene", "Alignment", "Blue 3 px, red 40 px", "no depth")
    for words in ("reference.png, target.png", *asked):
        assert words in said, words
    assert ("edf.use_as_world", True) not in draw().buttons, "only a sphere can surround a scene"


def test_what_has_no_effect_says_why(draw, stitched):
    settings = stitched.settings
    settings.blend, settings.fake_user, settings.projection, settings.field = "LINEAR", False, "CYLINDRICAL", "PAPER"
    said = text(draw(choices.EDF_PT_output, choices.EDF_PT_frame))
    for words in ("An average has no seam", "may be dropped on save", "Slack or Strict"):
        assert words in said, words


def test_every_setting_is_in_some_panel(draw, stitched):
    """In one state or another."""
    settings, seen = stitched.settings, set()
    settings.own_lens, settings.crop, settings.projection, settings.level = True, "BOX", "CYLINDRICAL", "ANGLES"
    settings.overlay = "DISPLACEMENT"
    seen |= set(draw().props)
    settings.projection, settings.slide_auto = "PANNINI", False
    settings.guides.add()
    for source in settings.bl_rna.properties["camera"].enum_items.keys():
        settings.camera = source
        seen |= set(draw().props)
    missing = {one for one in properties.EDF_PG_settings.bl_rna.properties.keys()} - seen
    of_a_row = {"seen_from", "clips"}
    hidden = {"rna_type", "name", "result", "matches_reference", "matches_target", "version", "exposure"}
    assert missing == hidden | of_a_row


def test_every_property_that_a_table_names_is_there(blender):
    tables = (choices.CAMERA, choices.FIELD, choices.FRAME, choices.OUTPUT, choices.KEEP, choices.TAKE)
    for table in (*tables, finished.OVERLAYS):
        for row in table:
            assert row.name in blender.settings.bl_rna.properties
