"""Masks to paint out what is to be ignored."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")


def test_a_new_mask_is_black_has_the_pictures_size_and_stays_in_the_file(blender, tmp_path):
    settings = blender.settings
    settings.reference, settings.target = (bpy.data.images.new(name, 40, 30) for name in ("a", "b"))
    bpy.ops.edf.mask_paint(side="target")
    mask = settings.ignore_target
    assert tuple(mask.size) == (40, 30) and settings.ignore_reference is None
    pixels = np.empty(40 * 30 * 4, np.float32)
    mask.pixels.foreach_get(pixels)
    assert not pixels.reshape(-1, 4)[:, :3].any()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "x.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "x.blend"))
    assert tuple(bpy.context.scene.edf_stitch.ignore_target.size) == (40, 30)


def test_a_mask_that_is_there_is_kept(blender):
    settings = blender.settings
    settings.reference = bpy.data.images.new("a", 8, 8)
    settings.ignore_reference = mask = bpy.data.images.new("own", 8, 8)
    bpy.ops.edf.mask_paint(side="reference")
    assert settings.ignore_reference == mask and len(bpy.data.images) == 2


def test_without_a_picture_there_is_a_reason(blender):
    with pytest.raises(RuntimeError, match="Choose a reference"):
        bpy.ops.edf.mask_paint(side="reference")
    blender.settings.reference = bpy.data.images.new("a", 8, 8)
    with pytest.raises(RuntimeError, match="no target"):
        bpy.ops.edf.mask_paint(side="target")
