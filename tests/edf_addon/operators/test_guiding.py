"""Guides: lines in pictures or in the panorama that level holds to."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.bridge import result  # noqa: E402

from ..jobs.test_following import stitched  # noqa: E402, F401 (a fixture)


def test_a_guide_in_a_picture_levels_the_panorama_and_comes_back_with_it(stitched):  # noqa: F811
    settings = stitched.settings
    assert bpy.ops.edf.guide_add(kind="VERTICAL", picture=1, ends=(110.0, 20.0, 130.0, 160.0)) == {"FINISHED"}
    (guide,) = settings.guides
    assert guide.picture == settings.reference and settings.level == "AUTO"
    assert bpy.ops.edf.follow() == {"FINISHED"}
    known = result.read(settings.result)
    assert known["guides"] == [[0, "vertical", [110.0, 20.0, 130.0, 160.0]]]
    down = np.array(known["report"]["canvas"]["projection"]["rotation"])[:, 1]
    K = np.array(known["geometry"]["K"])
    first, other = (np.linalg.solve(K, [x, y, 1]) for x, y in ((110, 20), (130, 160)))
    normal = np.cross(first, other)
    assert abs(down @ normal / np.linalg.norm(normal)) < 1e-3, "the line is upright"
    settings.guides.clear()
    bpy.ops.edf.restore()
    assert [one.kind for one in settings.guides] == ["VERTICAL"]
    assert bpy.ops.edf.guide_remove() == {"FINISHED"} and not len(settings.guides)


def test_a_guide_in_the_panorama_lies_in_a_picture_that_shows_it(stitched):  # noqa: F811
    settings = stitched.settings
    width, height = settings.result.size
    ends = (width * 0.5, height * 0.4, width * 0.5, height * 0.6)
    assert bpy.ops.edf.guide_add(kind="HORIZONTAL", ends=ends) == {"FINISHED"}
    (guide,) = settings.guides
    assert guide.picture in (settings.reference, settings.target)
    assert 0 < guide.ends[0] < 240 and 0 < guide.ends[3] < 180 and guide.ends[3] > guide.ends[1] + 10
    with pytest.raises(RuntimeError, match="No picture shows both ends"):
        bpy.ops.edf.guide_add(kind="HORIZONTAL", ends=(-900.0, 0.0, width * 3.0, 5.0))
    settings.projection = "REFERENCE"
    with pytest.raises(RuntimeError, match="never levelled"):
        bpy.ops.edf.guide_add(kind="HORIZONTAL", ends=ends)
