"""An Image Editor of its own for what is imported."""

import pytest

bpy = pytest.importorskip("bpy")


def test_a_tab_that_never_comes_is_not_asked_for_for_ever(blender):
    """Without a window that is drawn no sidebar knows its tabs."""
    from edf_stitch.edf_addon.operators import opening

    area = bpy.context.window_manager.windows[-1].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.show_region_ui = True
    tries = iter(range(2))
    waits = [opening._show_tab(tries) for _ in range(3)]
    assert waits == [opening.UNTIL_DRAWN, opening.UNTIL_DRAWN, None]
