"""The settings of a scene, and the engine's options that they become."""

import dataclasses
import math
from dataclasses import replace
from pathlib import Path

import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.choices import EXR_COMPRESSIONS, EXR_DEPTHS
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.exr import ExrForm

bpy = pytest.importorskip("bpy")
properties = pytest.importorskip("edf_stitch.edf_addon.properties")
from edf_stitch.edf_addon import earlier, engine_options, status  # noqa: E402

# What the panel asks for until an artist changes something.
DEFAULTS = StitchOptions(fade="continue", slide="auto", projection="auto", crop="auto", holes="auto")


def options_in_words(settings) -> StitchOptions:
    """As the worker makes them of what it reads."""
    options = engine_options.options_of(settings)
    camera = CameraRequest(**options.pop("camera"))
    tuples = {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}
    return StitchOptions(**tuples, camera=camera)


def test_by_default_everything_is_chosen_for_the_artist(blender):
    assert options_in_words(blender.settings) == DEFAULTS


@pytest.mark.parametrize("name", [*engine_options.CHOICES, "projection", "crop"])
def test_every_choice_is_one_that_the_engine_offers(blender, name):
    for item in blender.settings.bl_rna.properties[name].enum_items:
        blender.settings.projection = "REFERENCE"  # which every field knows
        setattr(blender.settings, name, item.identifier)
        chosen = getattr(options_in_words(blender.settings), name)
        special = {"BOX": (0, 0, 1000, 1000), "PANNINI": "pannini:0.5", "AUTO": "full" if name == "crop" else "auto"}
        assert chosen == special.get(item.identifier, item.identifier.lower())


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
    assert engine_options.options_of(blender.settings)["camera"] == request_


def test_a_target_with_its_own_lens_gives_two_values(blender):
    blender.settings.camera, blender.settings.own_lens = "FOCAL", True
    blender.settings.focal, blender.settings.target_focal = 24, 50
    camera = engine_options.options_of(blender.settings)["camera"]
    assert camera == {"focal_mm": [24, 50], "sensor_mm": [36, 36]}
    assert dataclasses.asdict(CameraRequest(**camera))


def test_every_property_has_a_tooltip(blender):
    """An artist points at a thing before reading about it."""
    for group in (properties.EDF_PG_settings, properties.EDF_PG_match, properties.EDF_PG_picture):
        for prop in group.bl_rna.properties:
            if prop.identifier not in ("rna_type", "name", "matches", "match_index"):
                assert len(prop.description) > 8, prop.identifier


def test_swapping_twice_changes_nothing_and_once_everything(blender):
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
    settings = blender.settings
    settings.reference = bpy.data.images.new("a", 8, 8)
    settings.field, settings.crop, settings.scale, settings.focal = "PAPER", "BOX", 0.5, 50
    settings.show_matches = True
    bpy.ops.edf.reset()
    assert settings.reference.name == "a" and settings.show_matches
    assert options_in_words(settings) == DEFAULTS
    assert settings.focal == 24


def test_what_goes_on_is_neither_saved_nor_undone(blender, tmp_path):

    status.begin()
    assert blender.window_manager.edf_stitch_job.running
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "x.blend"))
    status.end("Stitched.")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "x.blend"))
    job = bpy.context.window_manager.edf_stitch_job
    assert (job.running, job.message) == (False, "Stitched.")


def test_every_option_of_the_engine_is_offered(blender):
    """Those that come as files or images are added to a job by hand; three are nobody's wish, some of more than two
    pictures are right as they are, and two are the command's: a panel shows its picture, a scene has its unit."""
    by_hand = {"matches", "ignore", "show", "guides", "mask", "viewpoint"}
    of_many = {"require_all", "ignore_in", "brackets"}
    options = {field.name for field in dataclasses.fields(StitchOptions)}
    nobodys, of_command = {"measure", "cache", "memory_gb"}, {"preview", "scale_metres"}
    assert options - nobodys - of_many - of_command == set(engine_options.options_of(blender.settings)) | by_hand


def test_a_round_panorama_is_turned_by_angles_in_degrees(blender):
    settings = blender.settings
    settings.level, settings.projection = "ANGLES", "REFERENCE"
    assert engine_options.options_of(settings)["level"] == "auto", "the reference's own plane is not turned"
    settings.projection, settings.level_angles = "CYLINDRICAL", [math.radians(angle) for angle in (10, -5, 2)]
    assert options_in_words(settings).level == pytest.approx((10, -5, 2), abs=1e-5)


def test_the_frame_is_moved_and_sized_in_degrees_and_the_reference_keeps_its_own(blender):
    settings = blender.settings
    settings.centre, settings.fov = (math.radians(10), math.radians(-4)), math.radians(90)
    settings.slide_auto, settings.slide = False, 0.25
    options = engine_options.options_of(settings)
    assert options["centre"] == pytest.approx([10, -4], abs=1e-5) and options["fov"] == pytest.approx(90, abs=1e-5)
    assert options["slide"] == 0.25
    settings.slide_part = (0.75, 0.25)
    assert engine_options.options_of(settings)["slide"] == [0.25, 0.25, 0.75]
    assert options_in_words(settings).slide_by_hand == (0.25, (0.25, 0.75))
    assert engine_options.options_of(settings, is_set=True)["slide"] == 0.25, "a set has no such part"
    settings.centre, settings.fov = (math.pi, -math.pi), 2 * math.pi
    assert options_in_words(settings).centre == (180, -180) and options_in_words(settings).fov == 360
    settings.projection = "EQUIRECTANGULAR"
    assert engine_options.options_of(settings)["fov"] is None, "a sphere is whole"
    bpy.ops.edf.reference_frame()
    options = engine_options.options_of(settings)
    assert (options["projection"], options["slide"], options["crop"]) == ("reference", 0.0, "full")
    assert options["exposure"] == "reference"
    assert options["centre"] is None and options["fov"] is None


def test_the_exposure_is_a_name_or_stops(blender):
    settings = blender.settings
    for item in settings.bl_rna.properties["light"].enum_items:
        settings.light = item.identifier
        assert options_in_words(settings).exposure == item.identifier.lower()
    settings.light_stops = -1.5
    assert options_in_words(settings).exposure == "none", "what is left as taken gets no brighter"
    settings.light = "AUTO"
    assert options_in_words(settings).exposure == -1.5


@pytest.mark.parametrize(("exposure", "light"), [(True, "REFERENCE"), (False, "NONE")])
def test_the_exposure_that_an_earlier_release_asked_for_is_the_same(blender, exposure, light):
    settings = blender.settings
    settings.exposure = exposure
    assert settings.light == light, "a script of then"
    settings.light = "AUTO"
    properties.restore(settings, {"exposure": exposure, "fade": "PLANE"}, {})
    assert settings.light == light, "a panorama of then"
    settings.property_unset("light")
    settings.version, settings.reference = 0, bpy.data.images.new("a", 8, 8)
    settings.version = 0
    earlier.bring_up_to_date(settings)
    assert settings.light == light, "a file of then"


@pytest.mark.parametrize("projection", ["PERSPECTIVE", "CYLINDRICAL"])
def test_a_panorama_of_an_earlier_release_brings_back_what_was_meant(blender, projection):
    kept = {"projection": projection, "fade": "INFINITY", "crop": "INSCRIBED", "holes": "TRANSPARENT"}
    properties.restore(blender.settings, kept, {})
    options = options_in_words(blender.settings)
    assert options.exposure == "reference"
    assert options.projection == ("reference" if projection == "PERSPECTIVE" else "cylindrical")
    assert (options.fade, options.crop, options.holes, options.slide) == ("infinity", "inscribed", "transparent", 0.0)


def test_a_panorama_of_this_release_brings_back_its_own_perspective(blender):
    blender.settings.projection = "PERSPECTIVE"
    kept = properties.keep(blender.settings)
    blender.settings.projection = "AUTO"
    properties.restore(blender.settings, kept, {})
    assert options_in_words(blender.settings).projection == "perspective"


def test_files_keep_the_numbers_that_earlier_releases_gave_the_choices(blender):
    """A file holds a choice by its number alone."""
    numbers = {
        "projection": {"REFERENCE": 0, "CYLINDRICAL": 1, "EQUIRECTANGULAR": 2}, "fade": {"PLANE": 0, "INFINITY": 1},
        "holes": {"TRANSPARENT": 0, "INPAINT": 1}, "crop": {"FULL": 0, "INSCRIBED": 1, "REFERENCE": 2, "BOX": 3},
    }  # fmt: skip
    for name, known in numbers.items():
        items = blender.settings.bl_rna.properties[name].enum_items
        assert {identifier: items[identifier].value for identifier in known} == known


def test_scenes_that_an_earlier_release_left_untouched_mean_its_defaults(blender):
    """Choosing pictures marks a scene as of now; a scene without pictures has nothing to keep."""
    settings = blender.settings
    properties.bring_up_to_date()
    assert options_in_words(settings) == DEFAULTS
    settings.reference = bpy.data.images.new("a", 8, 8)
    properties.bring_up_to_date()
    assert options_in_words(settings) == DEFAULTS and settings.version == earlier.VERSION
    settings.version, settings.crop = 0, "INSCRIBED"  # as such a release leaves it
    properties.bring_up_to_date()
    options = options_in_words(settings)
    assert (options.projection, options.fade, options.holes, options.slide) == ("reference", "plane", "transparent", 0)
    assert options.crop == "inscribed", "what was set stays"


# Saved in Blender 4.3 by the release before the settings had a version: a scene for each case, named after it.
EARLIER = Path(__file__).parent / "earlier_release.blend"


@pytest.mark.parametrize(("scene", "expected"), [
    ("untouched", dict(projection="reference", fade="plane", crop="full", holes="transparent", slide=0.0)),
    ("perspective", dict(projection="reference", fade="infinity", crop="inscribed", holes="transparent", slide=0.0)),
    ("cylindrical", dict(projection="cylindrical", fade="plane", crop=[0, 0, 1000, 1000], holes="inpaint", slide=0.0)),
    ("equirectangular", dict(projection="equirectangular", crop="reference", holes="transparent", slide=0.0)),
    ("without pictures", dict(projection="auto", fade="continue", crop="auto", holes="auto", slide="auto")),
])  # fmt: skip
def test_a_file_of_an_earlier_release_opens_as_it_was_meant(blender, scene, expected):
    bpy.ops.wm.open_mainfile(filepath=str(EARLIER))
    options = engine_options.options_of(bpy.data.scenes[scene].edf_stitch)
    assert {name: options[name] for name in expected} == expected


def test_a_file_of_this_release_opens_with_what_nobody_set_as_it_is_now(blender, tmp_path):
    blender.settings.reference = bpy.data.images.new("a", 8, 8)
    blender.settings.crop = "FULL"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "now.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "now.blend"))
    assert options_in_words(bpy.context.scene.edf_stitch) == replace(DEFAULTS, crop="full")


@pytest.mark.skipif(bpy.app.version < (4, 3, 0), reason="this Blender tells nobody of what is appended")
def test_an_appended_scene_of_an_earlier_release_means_the_same(blender):
    bpy.ops.wm.append(directory=f"{EARLIER}/Scene/", filename="untouched")
    assert engine_options.options_of(bpy.data.scenes["untouched"].edf_stitch)["projection"] == "reference"


def test_every_form_of_exr_is_offered(blender):
    settings = blender.settings
    assert engine_options.exr_form_of(settings) == dataclasses.asdict(ExrForm())
    for name, known in (("exr_depth", EXR_DEPTHS), ("exr_compression", EXR_COMPRESSIONS)):
        assert tuple(item.identifier.lower() for item in settings.bl_rna.properties[name].enum_items) == known
    settings.exr_depth, settings.exr_compression = "HALF", "DWAB"
    assert engine_options.exr_form_of(settings) == {"depth": "half", "compression": "dwab"}
