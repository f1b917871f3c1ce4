"""Masks of the pictures of the list, and places that come from one of them."""

import json

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import editor, pictures  # noqa: E402
from edf_stitch.edf_addon.bridge import result  # noqa: E402
from edf_stitch.edf_addon.jobs import job, stitching  # noqa: E402
from edf_stitch.edf_addon.operators import taking  # noqa: E402


@pytest.fixture
def stitched(listed):
    """A set that was stitched, with a cache, and which picture each of its points comes from."""
    listed.settings.take_masks = True
    listed.settings.seam = "GRAPHCUT"
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    return listed


def test_a_mask_is_made_for_a_row_small_enough_and_used_by_its_number(blender, monkeypatch):
    settings = blender.settings
    pictures.choose(settings, [bpy.data.images.new(name, 4096, 2048) for name in "abc"])
    assert bpy.ops.edf.picture_mask(row=1, kind="show") == {"FINISHED"}
    assert bpy.ops.edf.picture_mask(row=2, kind="ignore") == {"FINISHED"}
    mask = settings.pictures[1].show
    assert settings.pictures[2].ignore.name == "c Never Use", "as the panel calls it"
    assert tuple(mask.size) == (2048, 1024) and mask.name == "b Use Here" and settings.pictures[1].ignore is None
    assert pictures.mask_of(settings, mask) == (settings.pictures[1], "show")
    assert editor.beneath(settings, mask) == settings.pictures[1].image
    assert bpy.ops.edf.picture_mask(row=1, kind="show") == {"FINISHED"}
    assert settings.pictures[1].show == mask, "one that is there is kept"
    settings.pictures[0].use = False
    folder = job.new_folder(bpy.app.tempdir)
    request: dict = {}
    stitching._add_masks(request, settings, folder)
    assert request["masks"] == [None, "ignore_1.npy"] and request["shown"] == ["show_0.npy", None]
    assert (folder / "show_0.npy").is_file()
    job.remove(folder)
    assert bpy.ops.edf.add_images(which="FILE") == {"CANCELLED"}, "masks are no pictures to add"
    assert bpy.ops.edf.picture_mask_remove(row=1, kind="show") == {"FINISHED"}
    assert settings.pictures[1].show is None and mask.name in bpy.data.images
    with pytest.raises(RuntimeError, match="no picture to paint"):
        bpy.ops.edf.picture_mask(row=7, kind="show")


def test_without_a_list_or_a_panorama_there_is_a_reason(blender):
    with pytest.raises(RuntimeError, match="Add pictures"):
        bpy.ops.edf.picture_mask()
    with pytest.raises(RuntimeError, match="Stitch first"):
        bpy.ops.edf.take_from()


def _labels(panorama, pixels_of):
    return np.rint(pixels_of(result.companions(panorama)["labels"])[..., 0] * 255).astype(int)


def test_a_place_comes_from_the_picture_that_was_asked_for_and_from_none_when_it_is_removed(stitched, pixels_of):
    settings, panorama = stitched.settings, stitched.settings.result
    labels = _labels(panorama, pixels_of)
    alpha = pixels_of(result.companions(panorama)["2.png mask"])[..., 0] > 0.5
    rows, columns = np.nonzero(alpha & (labels == 1))
    middle = len(columns) // 2
    x, y = float(columns[middle]), float(rows[middle])
    assert bpy.ops.edf.take_from(place=(x, y), radius=12.0, picture=2) == {"FINISHED"}
    assert [place.picture.name for place in settings.places] == ["2.png"]
    (circle,) = json.loads(settings.places[0].circles)
    assert 0 <= circle[0] < 320 and 0 <= circle[1] < 240 and 8 < circle[2] < 20
    assert bpy.ops.edf.follow() == {"FINISHED"}
    report = result.read(settings.result)
    assert report["places"][0]["picture"] == 1 and report["kind"] == "preview"
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    now = _labels(settings.result, pixels_of)
    here = (slice(int(y) - 4, int(y) + 5), slice(int(x) - 4, int(x) + 5))
    assert (now[here] == 2).all() and (labels[here] != 2).any()
    with pytest.raises(RuntimeError, match="does not show this place"):
        bpy.ops.edf.take_from(place=(3.0, 100.0), radius=3.0, picture=3)
    settings.places.clear()
    bpy.ops.edf.restore()
    assert [place.picture.name for place in settings.places] == ["2.png"], "it belongs to the panorama"
    assert bpy.ops.edf.place_remove() == {"FINISHED"} and not len(settings.places)


def test_what_is_drawn_lies_where_the_pictures_show_it(stitched, pixels_of):
    """The panorama's point under a circle's middle is that of the picture, by the masks of what each shows."""
    settings = stitched.settings
    panorama = settings.result
    for number, name in enumerate(("1.png", "2.png", "3.png")):
        shown = pixels_of(result.companions(panorama)[f"{name} mask"])[..., 0] > 0.5
        rows, columns = np.nonzero(shown)
        drawn = [(float(columns.mean()), float(rows.mean()), 5.0)]
        ((x, y, _),) = taking.circles_in(panorama, settings.pictures[number].image, drawn)
        assert abs(x - 160) < 40 and abs(y - 120) < 40, name
