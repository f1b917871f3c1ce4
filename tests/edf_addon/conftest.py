"""An empty scene with the extension on, for each test: in bpy as a module, or in a whole Blender that has it on."""

from collections.abc import Iterator
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")


@pytest.fixture
def blender() -> Iterator[SimpleNamespace]:
    """scene, settings, window_manager of a file that was just begun."""
    import edf_stitch

    if not hasattr(bpy.types.Scene, "edf_stitch"):
        edf_stitch.register()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    yield SimpleNamespace(
        scene=scene, settings=scene.edf_stitch, window_manager=bpy.context.window_manager, data=bpy.data
    )
    bpy.ops.wm.read_homefile(use_empty=True)
