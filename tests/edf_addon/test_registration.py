"""Switching the extension on and off."""

import subprocess
import sys

import pytest

bpy = pytest.importorskip("bpy")


def test_on_and_off_twice_each(blender):
    import edf_stitch

    edf_stitch.register()  # is on already
    for _ in range(2):
        edf_stitch.unregister()
        edf_stitch.unregister()
        assert not hasattr(bpy.types.Scene, "edf_stitch") and not hasattr(bpy.types, "EDF_OT_swap")
        edf_stitch.register()
        edf_stitch.register()
        assert hasattr(bpy.types.Scene, "edf_stitch") and hasattr(bpy.types, "EDF_OT_swap")


def test_every_operator_that_is_named_is_there(blender):
    from edf_stitch.edf_addon import idnames

    for name in idnames.Operator:
        room, _, verb = name.partition(".")
        assert verb in dir(getattr(bpy.ops, room)), name


# Operators that change nothing of the file, or only call others that do.
NO_STEP = {"CANCEL", "ENVIRONMENT", "MASK_DONE", "MATCH_EDIT", "PICTURE_STATE", "POINTER", "PRESET_ADD", "SAVE",
           "STITCH_CLIPS", "STITCH_FILES"}  # fmt: skip


def test_one_undo_takes_back_what_any_operator_changes(blender):
    from edf_stitch.edf_addon import idnames

    without = set()
    for name in idnames.Operator:
        kind = getattr(bpy.types, "EDF_OT_" + name.partition(".")[2])
        if not {"UNDO", "UNDO_GROUPED"} & getattr(kind, "bl_options", set()):
            without.add(name.name)
    assert without == NO_STEP


@pytest.mark.skipif(bool(bpy.app.binary_path), reason="a whole Blender's Python has no bpy of its own")
def test_registering_loads_nothing_of_the_engine():
    """What it loads is Blender's own; what takes time is the worker's."""
    code = (
        "import os, sys, bpy; before = set(sys.modules); import edf_stitch; edf_stitch.register()\n"
        "print(*sorted({name.split('.')[0] for name in set(sys.modules) - before}))\n"
        "print(*sorted(name for name in sys.modules if name.startswith('edf_stitch.core')), flush=True)\n"
        "os._exit(0)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=120, check=True)
    loaded, engine = done.stdout.splitlines()[-2:]  # Blender 5.2 says before which colours it uses
    assert not {"cv2", "scipy", "poselib", "OpenEXR", "exifread", "tqdm", "numpy"} & set(loaded.split())
    assert engine == ""
