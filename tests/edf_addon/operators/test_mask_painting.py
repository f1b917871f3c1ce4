"""Masks to paint out what is to be ignored."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.bridge import images, result  # noqa: E402


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


@pytest.fixture
def panorama(blender, monkeypatch):
    """A panorama of 60 × 40 px."""
    known = {"report": {}}
    settings = blender.settings
    settings.reference, settings.target = (bpy.data.images.new(name, 40, 30) for name in ("a", "b"))
    settings.result = bpy.data.images.new("p", 60, 40)
    monkeypatch.setattr(result, "read", lambda image: known if image == settings.result else None)
    return known


def test_a_seams_mask_decides_nothing_until_it_is_painted(blender, panorama):
    bpy.ops.edf.mask_paint(side="seam")
    mask = blender.settings.seam_mask
    assert tuple(mask.size) == (60, 40)
    pixels = np.empty(60 * 40 * 4, np.float32)
    mask.pixels.foreach_get(pixels)
    assert not pixels.any(), "transparent: the seam is found as before"
    assert images.read(mask).shape == (40, 60, 4)


def test_a_seam_is_painted_over_a_panorama_only(blender, panorama):
    blender.settings.result = None
    with pytest.raises(RuntimeError, match="Stitch once"):
        bpy.ops.edf.mask_paint(side="seam")


def test_a_painted_seam_is_obeyed(chosen, pixels_of):
    """All black: the reference's own pixels wherever it shows any. All white: the target's, bent, where both do."""
    settings = chosen.settings
    settings.exposure, settings.projection = False, "REFERENCE"
    bpy.ops.edf.stitch()
    whole = settings.result
    left, top = result.read(whole)["report"]["canvas"]["offset"]
    bpy.ops.edf.mask_paint(side="seam")
    true = pixels_of(settings.reference)[..., :3]
    off = {}
    for value in (0.0, 1.0):
        painted = np.full((*whole.size, 4), value, np.float32)
        painted[..., 3] = 1
        settings.seam_mask.pixels.foreach_set(painted.ravel())
        bpy.ops.edf.stitch()
        height, width = true.shape[:2]
        own = pixels_of(settings.result)[top : top + height, left : left + width, :3]
        off[value] = np.abs(own - true).max(axis=2)
    assert (off[1.0] > 1.5 / 255).mean() > 0.2
    assert np.percentile(off[0.0], 95) < 1.5 / 255, "all but the border, where bands go over into the target"


def test_the_seam_that_was_found_can_be_taken_as_the_painted_one(chosen, pixels_of):
    """And gives the same panorama again."""
    settings = chosen.settings
    settings.take_masks = True
    bpy.ops.edf.stitch()
    first = settings.result
    settings.seam_mask = result.companions(first)["seam"]
    bpy.ops.edf.stitch()
    assert np.abs(pixels_of(settings.result) - pixels_of(first)).max() < 1.5 / 255
