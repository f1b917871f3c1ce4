"""The settings of a scene, and the engine's options that they become."""

import dataclasses
import math

import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.options import StitchOptions

properties = pytest.importorskip("edf_stitch.edf_addon.properties")


def engine_options(settings) -> StitchOptions:
    """As the worker makes them of what it reads."""
    options = properties.options_of(settings)
    camera = CameraRequest(**options.pop("camera"))
    return StitchOptions(**options, camera=camera)


def test_the_defaults_are_the_engines_own(blender):
    assert engine_options(blender.settings) == StitchOptions()


@pytest.mark.parametrize("name", [*properties.CHOICES, "crop"])
def test_every_choice_is_one_that_the_engine_offers(blender, name):
    for item in blender.settings.bl_rna.properties[name].enum_items:
        setattr(blender.settings, name, item.identifier)
        chosen = getattr(engine_options(blender.settings), name)
        assert chosen == item.identifier.lower() or (item.identifier, chosen) == ("BOX", [0, 0, 1000, 1000])


@pytest.mark.parametrize(
    ("source", "values", "request_"),
    [
        ("FOCAL", {"focal": 24, "sensor": 36}, {"focal_mm": [24], "sensor_mm": [36]}),
        ("FOCAL35", {"focal35": 26}, {"focal35": [26]}),
        ("FOCAL_PX", {"focal_px": 1830}, {"focal_px": [1830]}),
        ("AUTOMATIC", {"focal": 50}, {}),
    ],
)
def test_the_focal_length_comes_from_where_the_artist_says(blender, source, values, request_):
    blender.settings.camera = source
    for name, value in values.items():
        setattr(blender.settings, name, value)
    assert properties.options_of(blender.settings)["camera"] == request_


def test_a_target_with_its_own_lens_gives_two_values(blender):
    blender.settings.camera, blender.settings.own_lens = "FOCAL", True
    blender.settings.focal, blender.settings.target_focal = 24, 50
    camera = properties.options_of(blender.settings)["camera"]
    assert camera == {"focal_mm": [24, 50], "sensor_mm": [36, 36]}
    assert dataclasses.asdict(CameraRequest(**camera))


def test_every_property_has_a_tooltip(blender):
    """An artist points at a thing before reading about it."""
    for group in (properties.EDF_PG_settings, properties.EDF_PG_match):
        for prop in group.bl_rna.properties:
            if prop.identifier not in ("rna_type", "name", "matches", "match_index"):
                assert len(prop.description) > 8, prop.identifier


def test_swapping_twice_changes_nothing_and_once_everything(blender):
    import bpy

    settings = blender.settings
    settings.reference, settings.target = (bpy.data.images.new(name, 8, 8) for name in "ab")
    settings.focal, settings.target_focal = 24, 50
    match = settings.matches.add()
    match.x, match.y, match.x2, match.y2 = 1, 2, 3, 4
    bpy.ops.edf.swap()
    assert (settings.reference.name, settings.target.name) == ("b", "a")
    assert (match.x, match.y, match.x2, match.y2) == (3, 4, 1, 2)
    assert settings.focal == 24, "one lens took both: it stays"
    bpy.ops.edf.swap()
    settings.own_lens = True
    bpy.ops.edf.swap()
    assert (settings.reference.name, settings.focal, settings.target_focal) == ("b", 50, 24)


def test_reset_keeps_the_pictures(blender):
    import bpy

    settings = blender.settings
    settings.reference = bpy.data.images.new("a", 8, 8)
    settings.field, settings.crop, settings.scale, settings.focal = "PAPER", "BOX", 0.5, 50
    settings.show_matches = True
    bpy.ops.edf.reset()
    assert settings.reference.name == "a" and settings.show_matches
    assert engine_options(settings) == StitchOptions()
    assert settings.focal == 24


def test_what_goes_on_is_neither_saved_nor_undone(blender, tmp_path):
    import bpy
    from edf_stitch.edf_addon import status

    status.begin()
    assert blender.window_manager.edf_stitch_job.running
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "x.blend"))
    status.end("Stitched.")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "x.blend"))
    job = bpy.context.window_manager.edf_stitch_job
    assert (job.running, job.message) == (False, "Stitched.")


def test_every_option_of_the_engine_is_offered(blender):
    """Those that come as files or images are added to a job by hand; two are nobody's wish."""
    by_hand = {"matches", "ignore", "mask"}
    options = {field.name for field in dataclasses.fields(StitchOptions)}
    assert options - {"measure", "cache"} == set(properties.options_of(blender.settings)) | by_hand


def test_a_round_panorama_is_turned_by_angles_in_degrees(blender):
    settings = blender.settings
    settings.level = "ANGLES"
    assert properties.options_of(settings)["level"] == "auto", "a flat one is not turned"
    settings.projection, settings.level_angles = "CYLINDRICAL", [math.radians(angle) for angle in (10, -5, 2)]
    assert engine_options(settings).level == pytest.approx((10, -5, 2), abs=1e-5)
