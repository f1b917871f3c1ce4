"""What a user may decide: the defaults, and everything that is refused before any work is done."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.choices import (
    BLENDS,
    CENTRE,
    CROPS,
    EXPOSURES,
    FADES,
    FIELDS,
    HOLES,
    PROJECTIONS,
    ROUND_FIELDS,
    SEAMS,
)
from edf_stitch.core.options import LEAST_SCALE, StitchOptions
from edf_stitch.core.system.errors import BadRequest

from ..pairs import ON_REFERENCE


def test_the_defaults_are_the_designs() -> None:
    options = StitchOptions()
    assert {one.name: getattr(options, one.name) for one in fields(options)} == {
        "field": "slack", "fade": "continue", "camera": CameraRequest(), "matches": None, "ignore": (),
        "ignore_in": (), "show": (), "guides": (), "viewpoint": None, "require_all": False, "scale_metres": None,
        "brackets": "auto", "slide": "auto", "projection": "auto", "level": "auto", "centre": None, "fov": None,
        "scale": 1.0, "crop": "auto", "dense": True, "blend": "multiband", "seam": "graphcut", "mask": None,
        "exposure": "auto",
        "holes": "auto", "preview": False, "seed": 0, "measure": True, "memory_gb": None, "cache": None,
    }  # fmt: skip


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize("blend", BLENDS)
def test_an_average_without_dense_refinement_has_few_features(blend: str, dense: bool) -> None:
    assert StitchOptions(blend=blend, dense=dense).few_features == (blend == "linear" and not dense)


def test_nothing_changes_them_afterwards() -> None:
    with pytest.raises(FrozenInstanceError):
        StitchOptions().seed = 3  # type: ignore[misc]


@pytest.mark.parametrize("asked", [
    *({"field": name} for name in FIELDS), *({"fade": name} for name in FADES), *({"blend": name} for name in BLENDS),
    *({"seam": name} for name in SEAMS), *({"holes": name} for name in HOLES), {"mask": Path("m.png")},
    *({"exposure": one} for one in (*EXPOSURES, 0.0, -1.5, 10)),
    *({"projection": name} for name in (*PROJECTIONS, "pannini:0.3")),
    {"projection": "auto", "slide": "auto"}, {"projection": "auto", "slide": 1.0}, {"slide": "auto"},
    {"projection": "auto", "field": "apap"}, {"projection": "auto", "centre": (-10.0, 3.0), "fov": 75.0},
    *({"crop": name} for name in CROPS), {"crop": (0, 0, 1, 1)}, {"crop": (3, 4, 500, 600)}, {"scale": 1},
    {"scale": LEAST_SCALE}, {"scale": 0.5}, {"seed": 0}, {"seed": 2**31 - 1}, {"matches": Path("m.csv")},
    {"matches": np.zeros((20, 4))}, {"ignore": (Path("a.png"),)}, {"ignore": (None, np.zeros((4, 4), bool))},
])  # fmt: skip
def test_what_is_offered_is_taken_as_it_is(asked: dict) -> None:
    options = replace(ON_REFERENCE, **asked)
    for name, value in asked.items():
        assert getattr(options, name) is value


@pytest.mark.parametrize(("asked", "words"), [
    *(({"field": name}, ("field", repr(name), "choose from: slack, strict, paper"))
      for name in ("", "Slack", "slack ")),
    *(({"fade": name}, ("fade", repr(name), "choose from: continue, plane, infinity"))
      for name in ("none", "", "Plane")),
    *(({"blend": name}, ("blend", repr(name), "choose from: multiband, feather, linear")) for name in ("", "Linear")),
    *(({"seam": name}, ("seam", repr(name), "choose from: graphcut, none")) for name in ("", "voronoi")),
    *(({"exposure": name}, (repr(name), "choose from: auto, reference, none, or a number of stops"))
      for name in ("", "Auto", "1")),
    *(({"exposure": value}, ("stops", "between -10 and 10")) for value in (10.1, -11, math.nan, math.inf)),
    *(({"brackets": value}, ("brackets", repr(value), "choose from: auto, off, or a number from 2"))
      for value in ("", "on", 1, 0, -3)),
    *(({"holes": name}, ("holes", repr(name), "choose from: auto, transparent, inpaint")) for name in ("", "fill")),
    *(({"crop": name}, ("crop", repr(name), "choose from: auto, full, inscribed, reference, or X, Y, W, H"))
      for name in ("tight", "", "1,2,3,4", "Full")),
    *(({"scale": scale}, ("scale", "between 0.02 and 1"))
      for scale in (0, 0.0199, 1.001, -1, 2, math.nan, math.inf, -math.inf)),
    *(({"projection": name}, (repr(name), "choose from: auto, reference, perspective, pannini", "pannini:D"))
      for name in ("", "flat", "Auto", "auto:1", "cylindrical:0.2")),
    *(({"projection": name}, (repr(name), "from 0 (a plane) to 1"))
      for name in ("pannini:x", "pannini:", "pannini:-1")),
    *(({"slide": value, "projection": "auto"}, ("slide", "from 0", "to 1, or auto"))
      for value in ("0", "", -0.1, 1.01, math.nan, (2.0, 0.0, 1.0))),
    *(({"slide": value, "projection": "auto"}, ("slide", "FROM,TO with 0 <= FROM < TO <= 1"))
      for value in ((), (0.5,), (0.5, 0.2), (0.5, 0.5, 0.5), (0.5, -0.1, 1.0), (0.5, 0.0, 1.1), (0.5, math.nan, 1.0))),
    *(({"centre": value, "projection": "auto"}, ("centre", "yaw, pitch"))
      for value in ((1.0,), (1.0, 2.0, 3.0), (math.nan, 0.0), (181.0, 0.0))),
    *(({"fov": value, "projection": "auto"}, ("field of view", "between 1 and 360")) for value in (0.5, 361, math.nan)),
    *(({"seed": seed}, ("seed", "from 0 to 2147483647")) for seed in (-1, 2**31, 2**63)),
])  # fmt: skip
def test_what_is_not_offered_is_refused_with_what_is(asked: dict, words: tuple[str, ...]) -> None:
    with pytest.raises(BadRequest) as refused:
        replace(ON_REFERENCE, **asked)
    assert refused.value.exit_code == 2
    for word in words:
        assert word in str(refused.value)


@pytest.mark.parametrize("crop", [(1, 2, 3), (0, 0, 0, 5), (0, 0, 5, -1), (-1, 0, 5, 5), (0, -1, 5, 5)])
def test_a_crop_that_no_panorama_has_is_refused_before_the_work(crop: tuple) -> None:
    """Whatever the panorama's size: nobody should wait for the end to hear of it."""
    with pytest.raises(BadRequest):
        StitchOptions(crop=crop)


@pytest.mark.parametrize("asked", [
    {"level": (1.0, 2.0, 3.0)}, {"centre": (1.0, 2.0)}, {"fov": 60.0}, {"slide": 0.5},
], ids=str)  # fmt: skip
def test_the_references_plane_has_one_frame_and_one_place(asked: dict) -> None:
    """Whether it is asked for or what a field is bound to: the words say which, and what would help."""
    (name,) = asked
    with pytest.raises(BadRequest, match=f"projection reference .* leave the {name} out, or choose another projection"):
        StitchOptions(projection="reference", **asked)
    with pytest.raises(BadRequest, match=f"field 'apap' .* leave the {name} out, or choose another field"):
        StitchOptions(projection="auto", field="apap", **asked)


def test_a_viewpoint_slides_only_where_depth_is_known_beyond_the_references_plane() -> None:
    assert StitchOptions().may_slide and StitchOptions(slide=0.5).may_slide
    in_part = StitchOptions(slide=(0.5, 0.0, 0.5))
    assert in_part.may_slide and in_part.slide_by_hand == (0.5, (0.0, 0.5))
    for stays in ({"slide": 0.0}, {"slide": (0.0, 0.0, 0.5)}, {"projection": "reference"}, {"field": "apap"}):
        assert not StitchOptions(**stays).may_slide


@pytest.mark.parametrize("asked", [{"centre": (1.0, 2.0)}, {"fov": 60.0}], ids=str)
def test_a_sphere_is_a_whole_one(asked: dict) -> None:
    with pytest.raises(BadRequest, match="whole sphere: leave centre and fov out, turn it by level, or cut"):
        StitchOptions(projection="equirectangular", **asked)
    assert StitchOptions(projection="equirectangular", level=(1.0, 2.0, 3.0)).surface == ("equirectangular", None)


@pytest.mark.parametrize("field", FIELDS)
def test_a_field_that_knows_one_plane_is_drawn_on_it(field: str) -> None:
    by_itself = "auto" if field in ROUND_FIELDS else "reference"
    assert StitchOptions(projection="auto", field=field).surface[0] == by_itself
    assert StitchOptions(projection="auto", field=field).may_slide == (field in ROUND_FIELDS)
    for name in PROJECTIONS[2:]:
        if field in ROUND_FIELDS:
            assert StitchOptions(projection=name, field=field).surface == (name, None)
        else:
            with pytest.raises(BadRequest, match="knows the reference's plane only"):
                StitchOptions(projection=name, field=field)
    assert StitchOptions(projection="pannini:0.25").surface == ("pannini", 0.25)


def test_a_crop_is_chosen_only_where_something_may_be_lost() -> None:
    for projection, kept in (("auto", "auto"), ("pannini", "auto"), ("reference", "full"), ("equirectangular", "full")):
        assert StitchOptions(projection=projection, crop="auto").kept == kept
        assert StitchOptions(projection=projection, crop="inscribed").kept == "inscribed"
    assert StitchOptions(projection="auto", field="rew", crop="auto").kept == "full"


# --- more than two pictures -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("asked", "words"), [
    ({"field": "homography"}, "'homography' is for two pictures only, and 3 are given: choose from: slack, strict"),
    ({"mask": Path("m.png")}, "painted mask .* --ignore NAME=MASK"),
    ({"fade": "infinity"}, "fade to infinity .* --fade continue"),
    ({"camera": CameraRequest(focal_px=(900, 950))}, "one for all pictures, or each its own by --cameras"),
    ({"camera": CameraRequest(principal=(90, 95, 96, 97))}, "one for all pictures"),
])  # fmt: skip
def test_what_only_a_pair_knows_is_refused_of_more(asked: dict, words: str) -> None:
    options = StitchOptions(**asked)
    options.check_goes_with(2)
    with pytest.raises(BadRequest, match=words):
        options.check_goes_with(3)


@pytest.mark.parametrize("viewpoint", [None, 1, 2, "b", "b.png", CENTRE])
def test_of_two_pictures_the_first_is_the_viewpoint(viewpoint: int | str | None) -> None:
    options = StitchOptions(viewpoint=viewpoint)
    options.check_goes_with(3)
    if viewpoint in (None, 1, CENTRE):
        options.check_goes_with(2)
    else:
        with pytest.raises(BadRequest, match="name the other one first"):
            options.check_goes_with(2)


def test_pictures_are_counted_from_one() -> None:
    with pytest.raises(BadRequest, match="counted from 1"):
        StitchOptions(viewpoint=0)


def test_masks_are_found_by_number_and_by_name() -> None:
    one, other = Path("m1.png"), Path("m2.png")
    options = StitchOptions(ignore=(None, one), ignore_in=(("c", other),))
    assert options.ignored_in(["a.png", "b.png", "c.jpg"]) == [None, one, other]
    assert options.files_read == [one, other]
    with pytest.raises(BadRequest, match=r"no picture is called 'c'; there are: a\.png, b\.png"):
        options.ignored_in(["a.png", "b.png"])
