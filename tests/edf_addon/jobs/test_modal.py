"""Where ESC cancels, and what the status bar says."""

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")
modal = pytest.importorskip("edf_stitch.edf_addon.jobs.modal")


def area(kind: str, x: int, width: int) -> SimpleNamespace:
    return SimpleNamespace(type=kind, x=x, y=0, width=width, height=100)


@pytest.mark.parametrize(("at", "over"), [((50, 50), True), ((150, 50), False), ((50, 100), False), ((-1, 50), False)])
def test_escape_cancels_over_an_image_editor_only(at, over):
    areas = [area("IMAGE_EDITOR", 0, 100), area("VIEW_3D", 100, 100)]
    context = SimpleNamespace(window=SimpleNamespace(screen=SimpleNamespace(areas=areas)))
    assert modal._is_over_editor(context, SimpleNamespace(mouse_x=at[0], mouse_y=at[1])) == over


def test_without_a_window_there_is_nowhere_else_to_press_it():
    assert modal._is_over_editor(SimpleNamespace(window=None), SimpleNamespace())


def test_what_is_said_already_is_not_drawn_again_and_again(blender, monkeypatch):
    drawn: list[str | None] = []
    monkeypatch.setattr(modal, "redraw", lambda _context: drawn.append("panels"))
    monkeypatch.setattr(modal, "_say_in_status_bar", drawn.append)
    monkeypatch.setattr(modal.explain, "how_far", lambda stage, share, _left: f"{stage} {share:.0%}")
    modal.status.begin()
    work = modal.LongWork()
    for share in (0.1, 0.1, 0.104, 0.2):
        modal.status.now.share = share
        work._say_how_far(bpy.context)
    modal.status.now.cancelling = True
    work._say_how_far(bpy.context)
    modal.status.end("")
    bar = [words for words in drawn if words != "panels"]
    assert bar == ["EDF Stitch: read 10%", "EDF Stitch: read 20%", "EDF Stitch: Cancelling…"]
    assert drawn.count("panels") == len(bar)
