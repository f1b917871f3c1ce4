"""The small panorama that follows the frame: when it is made, of what, and what it replaces."""

import math
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import editor, properties, status  # noqa: E402
from edf_stitch.edf_addon.bridge import result  # noqa: E402
from edf_stitch.edf_addon.jobs import following, job, modal  # noqa: E402

from .test_stitching import Modal, working  # noqa: E402, F401 (a fixture)


@pytest.fixture
def stitched(chosen):
    """A stitch on a cylinder, whose frame can be changed."""
    settings = chosen.settings
    settings.projection, settings.level, settings.slide_auto = "CYLINDRICAL", "ANGLES", False
    settings.crop, settings.fade, settings.holes = "FULL", "PLANE", "TRANSPARENT"
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    return chosen


def test_what_follows_is_made_of_the_same_matches_without_a_search(stitched, monkeypatch):
    settings = stitched.settings
    first, matches = settings.result, len(settings.matches)
    assert first.session_uid in status.now.made, "what the panel's last line tells of"
    assert not editor.is_behind(settings, first)
    settings.level_angles[0] = math.radians(5)
    assert editor.is_behind(settings, settings.result)
    jobs = []
    monkeypatch.setattr(job, "start", lambda request, folder: jobs.append(request) or start(request, folder))
    assert bpy.ops.edf.follow() == {"FINISHED"}
    assert jobs[0]["matches"] == "matches.csv" and jobs[0]["options"]["measure"] is False
    assert not editor.is_behind(settings, settings.result), "it shows what is chosen"
    kept = result.read(settings.result)
    assert kept["kind"] == "preview" and kept["seconds"].get("features", 0) == 0
    assert settings.result.name == "reference preview" and len(settings.matches) == matches
    rotation = kept["report"]["canvas"]["projection"]["rotation"]
    assert rotation[0][0] == pytest.approx(math.cos(math.radians(5)), abs=1e-6)
    assert first.name in bpy.data.images, "the large one stays"


start = job.start


def test_large_pictures_are_made_small_for_it(chosen, monkeypatch):
    monkeypatch.setattr(following, "MOST_PIXELS", 240 * 180 // 4)
    chosen.settings.result = bpy.data.images.new("old", 8, 8)
    request, _ = following.make_job(bpy.context, job.new_folder(bpy.app.tempdir))
    assert request["options"]["scale"] == pytest.approx(0.5)
    for left in leftover_folders():
        job.remove(left)


def test_nothing_follows_without_a_panorama_of_these_pictures(stitched, folder):
    settings = stitched.settings
    settings.projection = "REFERENCE"
    assert editor.is_behind(settings, settings.result)
    settings.target = None
    assert not editor.is_behind(settings, settings.result)
    assert not editor.is_behind(settings, None)


def test_it_begins_once_when_the_frame_rests(stitched, monkeypatch):
    """Each change begins the waiting anew."""
    settings, begun = stitched.settings, []
    monkeypatch.setattr(following.bpy, "app", SimpleNamespace(background=False, timers=Timers(begun)))
    ahead = []
    monkeypatch.setattr(modal, "start_ahead", lambda: ahead.append("started"))
    settings.slide, settings.slide = 0.2, 0.4
    settings.fov = 1.2
    assert begun == ["register", "unregister", "register", "unregister", "register"] and ahead
    settings.result = None
    settings.slide = 0.6
    assert len(begun) == 5, "there is nothing to follow"


class Timers:
    """Blender's timers, which take notes."""

    def __init__(self, notes: list[str]) -> None:
        self.notes, self.waits = notes, False

    def is_registered(self, _function: object) -> bool:
        return self.waits

    def register(self, _function: object, first_interval: float) -> None:
        assert 0 < first_interval < 1
        self.notes.append("register")
        self.waits = True

    def unregister(self, _function: object) -> None:
        self.notes.append("unregister")
        self.waits = False


class Following(Modal):
    """A picture that follows the frame, where there is no window."""

    follows = True


def test_it_makes_way_for_other_work_and_other_work_never_for_it(chosen, working):  # noqa: F811
    one = Following()
    assert not one._start(bpy.context) and "still at work" in one.said[0][1]
    modal.stop("Stopped.")
    assert one._start(bpy.context) and not modal.is_working() and not status.now.running, "nobody has to wait for it"
    other = Following()
    assert other._start(bpy.context), "the one before is ended"
    assert one.modal(bpy.context, SimpleNamespace(type="TIMER", value="NOTHING")) == {"CANCELLED"}
    third = Modal()
    modal.start_ahead()
    assert third._start(bpy.context) and modal.is_working() and modal._ahead is None
    modal.stop("Stopped.")


def test_a_worker_that_waits_does_the_next_job_that_follows(stitched, monkeypatch):
    """It is started once, loads its libraries meanwhile, and its folder goes with it."""
    monkeypatch.setattr(job, "start", lambda *_: pytest.fail("there was one already"))
    modal.start_ahead()
    waiting = modal._ahead
    modal.start_ahead()
    assert modal._ahead is waiting and waiting.poll() is None
    stitched.settings.level_angles[0] = math.radians(5)
    assert bpy.ops.edf.follow() == {"FINISHED"} and modal._ahead is None
    assert not editor.is_behind(stitched.settings, stitched.settings.result)
    assert not waiting.folder.exists()


def test_a_worker_waits_for_the_next_change_and_another_takes_the_place_of_a_dead_one(blender):
    modal.start_ahead()
    waiting = modal._ahead
    assert following._begin() is None and modal._ahead is waiting, "there is nothing to follow by now"
    modal._ahead._process.kill()
    modal._ahead._process.wait()
    while modal._ahead.poll() is None:
        pass
    assert modal._take_ahead() is None, "it has died meanwhile"
    modal.start_ahead()
    modal._ahead._process.kill()
    modal._ahead._process.wait()
    while modal._ahead.poll() is None:
        pass
    dead = modal._ahead
    modal.start_ahead()
    assert modal._ahead is not dead and not dead.folder.exists(), "another one waits"
    modal.stop("Another file is opened.")
    assert modal._ahead is None


def test_a_frame_is_followed_only_while_it_is_switched_on(blender):
    assert following.changed in properties.on_reframe
    import edf_stitch

    edf_stitch.unregister()
    assert following.changed not in properties.on_reframe
    edf_stitch.register()


def leftover_folders():
    from ..conftest import leftovers

    return leftovers()


def test_an_undo_while_it_is_made_begins_anew(blender, monkeypatch):
    """Else it would show the guide, mask or place that was just undone."""
    asked, ended = [], []
    monkeypatch.setattr(following, "ask", asked.append)
    monkeypatch.setattr(modal, "_end", lambda: ended.append("ended"))
    following._show_again()
    assert not asked and not ended, "nothing was being made"
    monkeypatch.setattr(modal, "_is_following", True)
    following._show_again()
    assert len(ended) == len(asked) == 1 and asked[0] == blender.settings


def test_after_an_undo_the_editor_that_showed_it_shows_the_panorama_of_then(blender, monkeypatch):
    """Blender forgets what an editor showed when the image goes; other editors are left alone."""
    then = blender.settings.result = bpy.data.images.new("then", 8, 8)
    mine, other, busy = (SimpleNamespace(image=image, as_pointer=lambda number=number: number) for number, image in
                         enumerate((None, None, "something else")))  # fmt: skip
    monkeypatch.setattr(editor, "all_spaces", lambda _: [(None, mine), (None, other), (None, busy)])
    monkeypatch.setattr(following, "_shown_in", {0: 0.0, 2: 0.0})
    following._show_again()
    assert (mine.image, other.image, busy.image) == (then, None, "something else")


def test_after_an_undo_the_panel_tells_no_longer_of_what_was_undone(blender):
    """What is still there is told of, and errors are."""
    one = bpy.data.images.new("panorama", 8, 8)
    for made in (frozenset(), frozenset({one.session_uid, -1})):
        status.end("panorama: 8 × 8 px", made=made)
        following._show_again()
        assert status.now.message
    bpy.data.images.remove(one)
    following._show_again()
    assert not status.now.message


def test_guides_and_places_that_are_switched_are_followed(blender, monkeypatch):
    asked = []
    monkeypatch.setattr(following, "changed", asked.append)
    for one in (blender.settings.guides.add(), blender.settings.places.add()):
        one.use = False
    assert asked == [blender.settings] * 2
