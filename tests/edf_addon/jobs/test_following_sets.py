"""The small panorama of more than two pictures that follows the settings, of what their stitch has kept."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import editor  # noqa: E402
from edf_stitch.edf_addon.bridge import result  # noqa: E402
from edf_stitch.edf_addon.jobs import following, job, modal  # noqa: E402

start = job.start


@pytest.fixture
def stitched(listed):
    """A set that was stitched, with a cache."""
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    return listed


def test_a_set_is_composed_again_of_what_its_stitch_kept(stitched, monkeypatch):
    settings = stitched.settings
    panorama = settings.result
    jobs = []

    def begin(request, folder):
        for entry in request["pictures"]:
            entry["path"] = "is not read again"
        jobs.append(request)
        return start(request, folder)

    monkeypatch.setattr(job, "start", begin)
    assert not editor.is_behind(settings, panorama)
    for name, value in (("slide", 0.5), ("light", "NONE"), ("blend", "FEATHER"), ("projection", "CYLINDRICAL")):
        settings.slide_auto = False
        setattr(settings, name, value)
        assert editor.is_behind(settings, settings.result), name
        assert bpy.ops.edf.follow() == {"FINISHED"}, name
        assert not editor.is_behind(settings, settings.result), name
    assert bpy.ops.edf.see_from(row=1) == {"FINISHED"}
    assert editor.is_behind(settings, settings.result) and bpy.ops.edf.follow() == {"FINISHED"}
    assert not editor.is_behind(settings, settings.result)
    assert result.read(settings.result)["report"]["pictures"][0]["name"] == "2.png", "seen from there"
    bpy.ops.edf.see_from(row=1)
    assert bpy.ops.edf.follow() == {"FINISHED"}
    assert result.read(settings.result)["report"]["pictures"][0]["name"] == "1.png", "as before"
    small = result.read(settings.result)
    assert small["kind"] == "preview" and not {"features", "geometry"} & set(small["seconds"])
    assert small["kept"] == result.read(panorama)["kept"] and len(jobs) == 6
    assert small["report"]["canvas"]["projection"]["kind"] == "cylindrical"
    assert [entry.state for entry in settings.pictures][:3] == ["USED"] * 3
    assert panorama.name in bpy.data.images, "the large one stays"
    cameras = [np.array(one["K"]) for one in small["geometry"]["cameras"]]
    full = [np.array(one["K"]) for one in result.read(panorama)["geometry"]["cameras"]]
    assert np.allclose(cameras, full, rtol=1e-6), "in px of the full pictures"


def test_what_is_no_longer_kept_is_found_again(stitched, monkeypatch, tmp_path):
    settings = stitched.settings
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "empty"))
    settings.crop = "FULL"
    assert bpy.ops.edf.follow() == {"FINISHED"}
    assert settings.result.name.endswith("preview") and not editor.is_behind(settings, settings.result)


def test_the_worker_that_waits_for_the_first_change_has_found_the_depth_meanwhile(listed, monkeypatch):
    """So that the panorama is not held back by it, nor the first change."""
    listed.settings.dense, requests, be_ready = True, [], following.be_ready
    monkeypatch.setattr(following, "be_ready", requests.append)
    assert bpy.ops.edf.stitch() == {"FINISHED"} and len(requests) == 1
    assert "dense" in result.read(listed.settings.result)["seconds"]
    with monkeypatch.context() as in_a_window:
        told = {name: getattr(bpy.app, name) for name in ("tempdir", "binary_path")}
        in_a_window.setattr(following.bpy, "app", SimpleNamespace(background=False, **told))
        be_ready(requests[0])
    waiting = modal._ahead
    listed.settings.blend = "FEATHER"
    assert bpy.ops.edf.follow() == {"FINISHED"} and modal._ahead is None and not waiting.folder.exists()
    assert "dense" not in result.read(listed.settings.result)["seconds"]
    be_ready(requests[0])
    assert modal._ahead is None, "nothing follows under -b"
