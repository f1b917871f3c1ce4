"""The frame of a panorama that is dragged in the window."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import editor  # noqa: E402
from edf_stitch.edf_addon.bridge import result  # noqa: E402
from edf_stitch.edf_addon.operators import framing  # noqa: E402
from edf_stitch.edf_addon.overlays import frame_handles  # noqa: E402

from ..jobs.test_following import stitched  # noqa: E402, F401 (a fixture)


def test_what_is_dragged_is_what_the_small_panorama_shows(stitched):  # noqa: F811
    settings = stitched.settings
    width, height = settings.result.size
    drag = bpy.ops.edf.frame_drag
    assert drag(part="RIGHT", start=(width, 9.0), end=(width - 40.0, 9.0)) == {"FINISHED"}
    assert settings.crop == "BOX" and tuple(settings.crop_box) == (0, 0, width - 40, height)
    assert drag(part="MIDDLE", start=(50.0, 50.0), end=(70.0, 50.0)) == {"FINISHED"}
    assert tuple(settings.crop_box)[2:] == (width, height), "of the panorama that is shown: there is nowhere to go"
    settings.crop_box = (0, 0, width - 40, height)
    assert bpy.ops.edf.follow() == {"FINISHED"}
    known = result.read(settings.result)
    assert known["share"] == 1 and known["report"]["canvas"]["box"] == [0, 0, width - 40, height]
    assert known["report"]["canvas"]["whole"] == [width, height]
    assert drag(part="HORIZON", start=(width / 2, 90.0), end=(width / 2, 100.0)) == {"FINISHED"}
    assert settings.crop == "AUTO" and settings.level == "ANGLES", "the box was one of another frame"
    before = np.array(known["report"]["canvas"]["projection"]["level"])
    assert np.degrees(settings.level_angles[1]) > before[1] + 1
    settings.projection = "REFERENCE"
    with pytest.raises(RuntimeError, match="never moved"):
        drag(part="HORIZON")


def test_it_is_caught_dragged_and_let_go_with_the_pointer(blender, monkeypatch):
    settings = blender.settings
    panorama = bpy.data.images.new("panorama", 600, 340)
    told = {"kind": "cylindrical", "focal_px": 300.0, "centre": [310.0, 170.0], "rotation": np.eye(3).tolist()}
    canvas = {"projection": told, "width": 600, "height": 340, "box": [0, 0, 600, 340], "whole": [600, 340]}
    known = {"share": 1.0, "report": {"canvas": canvas},
             "geometry": {"K": np.eye(3).tolist(), "K_canvas": [[None] * 3] * 3}}  # fmt: skip
    monkeypatch.setattr(framing, "why_not", lambda _: "")
    monkeypatch.setattr(editor, "panorama", lambda _: panorama)
    monkeypatch.setattr(editor, "known", lambda _: known)
    monkeypatch.setattr(editor, "let_go", lambda _: None)
    monkeypatch.setattr(framing, "to_picture", lambda _, space, region, position: (position, 1.0))
    one = framing.EDF_OT_frame_drag
    tool = SimpleNamespace(_drags=False, part="MIDDLE", start=(0.0, 0.0), end=(0.0, 0.0), report=lambda *_: None)
    for name in ("_catch", "_done", "execute"):
        setattr(tool, name, getattr(one, name).__get__(tool))
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # 0 where there is no window
    context = SimpleNamespace(scene=blender.scene, preferences=preferences)

    def event(kind: str, value: str, at: tuple[float, float]) -> set[str]:
        there = (SimpleNamespace(image=panorama), None, at)
        monkeypatch.setattr(framing, "under", lambda *_: there)
        return one.modal(tool, context, SimpleNamespace(type=kind, value=value))

    assert event("MOUSEMOVE", "NOTHING", (5.0, 5.0)) == {"PASS_THROUGH"}
    assert event("LEFTMOUSE", "PRESS", (900.0, 100.0)) == {"PASS_THROUGH"}, "there is nothing"
    assert event("LEFTMOUSE", "PRESS", (2.0, 100.0)) == {"RUNNING_MODAL"} and tool.part == "LEFT"
    assert event("MOUSEMOVE", "NOTHING", (52.0, 100.0)) == {"RUNNING_MODAL"}
    assert frame_handles.dragged["box"][0].tolist() == [50, 0] and settings.crop != "BOX"
    assert frame_handles.dragged["line"][:, 1].tolist() == [170, 170], "the horizon stays"
    assert event("LEFTMOUSE", "RELEASE", (52.0, 100.0)) == {"FINISHED"}
    assert settings.crop == "BOX" and tuple(settings.crop_box) == (50, 0, 550, 340) and not frame_handles.dragged
    assert event("ESC", "PRESS", (0.0, 0.0)) == {"CANCELLED"}


def test_without_a_panorama_of_this_release_there_is_a_reason(blender):
    with pytest.raises(RuntimeError, match="Stitch first"):
        bpy.ops.edf.frame_drag()
