"""Matches by hand, through the operators that the buttons call."""

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.operators import match_editing, match_pointing  # noqa: E402
from edf_stitch.edf_addon.overlays import drawing  # noqa: E402
from edf_stitch.edf_addon.panels import editing  # noqa: E402


@pytest.fixture
def settings(blender):
    """Two pictures and four matches: good, missed, left out, switched off."""
    settings = blender.settings
    settings.reference, settings.target = (bpy.data.images.new(name, 40, 30) for name in ("a", "b"))
    for number, (error, state, enabled) in enumerate(
        ((0.2, "USED", True), (7.0, "USED", True), (40.0, "LEFT_OUT", True), (-1.0, "USED", False))
    ):
        match = settings.matches.add()
        match.x, match.y, match.x2, match.y2 = number, 2 * number, number + 5, 2 * number + 5
        match.error, match.state, match.enabled = error, state, enabled
    return settings


def columns(settings) -> list[float]:
    return [match.x for match in settings.matches]


def test_adding_by_coordinates_puts_a_new_match_at_the_end_and_means_the_list_from_then_on(settings):
    assert bpy.ops.edf.match_add(point=(10.5, 20), target_point=(39, 0.25), weight=2) == {"FINISHED"}
    match = settings.matches[4]
    assert (match.x, match.y, match.x2, match.y2) == (10.5, 20, 39, 0.25)
    assert (match.state, match.enabled, match.weight, match.error) == ("ADDED", True, 2, -1)
    assert settings.match_index == 4 and settings.edited_matches


@pytest.mark.parametrize(("point", "target_point", "words"), [
    ((41, 3), (1, 1), "outside the reference"), ((1, 1), (3, -1), "outside the target"),
])  # fmt: skip
def test_a_point_outside_its_picture_is_refused(settings, point, target_point, words):
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.edf.match_add(point=point, target_point=target_point)
    assert len(settings.matches) == 4 and not settings.edited_matches


@pytest.mark.parametrize(("which", "left"), [
    ("ACTIVE", [0, 2, 3]), ("WORSE", [0, 3]), ("LEFT_OUT", [0, 1, 3]), ("DISABLED", [0, 1, 2]), ("ALL", []),
])  # fmt: skip
def test_deleting(settings, which, left):
    settings.match_index = 1
    bpy.ops.edf.match_delete(which=which)
    assert columns(settings) == left
    assert settings.edited_matches and settings.match_index <= len(left) - 1


def test_switching_off_and_on(settings):
    bpy.ops.edf.match_enable(action="DISABLE", which="WORSE", worse_than=3)
    assert [match.enabled for match in settings.matches] == [True, False, False, False]
    bpy.ops.edf.match_enable(action="INVERT", which="ALL")
    assert [match.enabled for match in settings.matches] == [False, True, True, True]
    bpy.ops.edf.match_enable(action="ENABLE", which="ALL")
    assert all(match.enabled for match in settings.matches)


def test_choosing_nothing_is_no_edit(settings):
    bpy.ops.edf.match_delete(which="ACTIVE")
    assert len(settings.matches) == 4 and not settings.edited_matches


def test_without_pictures_there_is_a_reason(blender):
    assert match_editing.why_not(bpy.context) == "Choose a reference and a target first"
    with pytest.raises(RuntimeError, match="Choose a reference"):
        bpy.ops.edf.match_add(point=(1, 1), target_point=(1, 1))


def test_moving_an_end_makes_a_match_new(settings):
    match_editing.move(settings.matches[0], "target", (9.0, 8.0))
    match = settings.matches[0]
    assert (match.x, match.y, match.x2, match.y2) == (0, 0, 9, 8)
    assert editing.standing(match) == "new"


def test_the_match_under_the_pointer_in_either_picture(settings):
    assert match_pointing.at(settings, "reference", (2.2, 4.1), 1) == 2
    assert match_pointing.at(settings, "target", (6.0, 7.3), 1) == 1
    assert match_pointing.at(settings, "reference", (20.0, 20), 5) is None


def test_a_match_that_was_begun_is_forgotten_when_another_picture_is_chosen(settings):
    editing = SimpleNamespace(_pair=match_pointing._pair(settings), _dragged=(3, "reference"))
    for expected in (1, 0):
        drawing.pending["reference"] = (5.0, 5.0)
        tick = SimpleNamespace(type="TIMER", value="NOTHING")
        assert match_pointing.EDF_OT_match_edit.modal(editing, bpy.context, tick) == {"PASS_THROUGH"}
        assert len(drawing.pending) == expected and (editing._dragged is None) == (expected == 0)
        settings.target = bpy.data.images.new("other", 40, 30)
    drawing.pending.clear()


def test_what_the_overlay_draws(settings):
    import numpy as np

    arrays = drawing.match_arrays(settings)
    np.testing.assert_array_equal(arrays["reference"], [[0, 0], [1, 2], [2, 4], [3, 6]])
    np.testing.assert_array_equal(arrays["target"], [[5, 5], [6, 7], [7, 9], [8, 11]])
    np.testing.assert_allclose(arrays["error"], [0.2, 7, 40, np.nan], rtol=1e-6)
    assert arrays["enabled"].tolist() == [True, True, True, False]


def test_every_way_of_the_menu_is_one_that_the_operators_offer(settings):
    for which, *_ in match_editing.WHICH:
        assert all(0 <= index < 4 for index in match_editing.indices(settings, which, 3.0))


@pytest.mark.parametrize("side", ["reference", "target"])
def test_a_click_is_moved_to_what_the_other_picture_shows(blender, side):
    import numpy as np

    random = np.random.default_rng(0)
    noise = random.uniform(size=(80, 100))
    for name, rolled in (("reference", (0, 0)), ("target", (4, -6))):  # the target shows all 4 lower, 6 to the left
        image = bpy.data.images.new(name, 100, 80, float_buffer=True)
        picture = np.ones((80, 100, 4), np.float32)
        picture[..., :3] = np.roll(noise, rolled, axis=(0, 1))[..., None]
        image.pixels.foreach_set(picture[::-1].ravel())
        setattr(blender.settings, name, image)
    there, here = ((50, 40), (44, 44)) if side == "reference" else ((44, 44), (50, 40))
    found = match_pointing.fine_tuned(blender.settings, side, there, (here[0] + 3, here[1] - 2))
    assert found == pytest.approx(here, abs=0.2)
