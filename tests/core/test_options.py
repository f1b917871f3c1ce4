"""What a user may decide: the defaults, and everything that is refused before any work is done."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.choices import BLENDS, CROPS, FADES, FIELDS, HOLES, SEAMS
from edf_stitch.core.options import LEAST_SCALE, StitchOptions
from edf_stitch.core.system.errors import BadRequest

from ..pairs import ON_REFERENCE


def test_the_defaults_are_the_designs() -> None:
    options = StitchOptions()
    assert {one.name: getattr(options, one.name) for one in fields(options)} == {
        "field": "slack", "fade": "plane", "camera": CameraRequest(), "matches": None, "ignore": (),
        "slide": 0.0, "projection": "reference", "level": "auto", "centre": None, "fov": None, "scale": 1.0,
        "crop": "full", "dense": True, "blend": "multiband", "seam": "graphcut", "mask": None, "exposure": True,
        "holes": "transparent", "seed": 0, "measure": True, "cache": None,
    }  # fmt: skip


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize("blend", BLENDS)
def test_a_preview_is_an_average_without_dense_refinement(blend: str, dense: bool) -> None:
    assert StitchOptions(blend=blend, dense=dense).preview == (blend == "linear" and not dense)


def test_nothing_changes_them_afterwards() -> None:
    with pytest.raises(FrozenInstanceError):
        StitchOptions().seed = 3  # type: ignore[misc]


@pytest.mark.parametrize("asked", [
    *({"field": name} for name in FIELDS), *({"fade": name} for name in FADES), *({"blend": name} for name in BLENDS),
    *({"seam": name} for name in SEAMS), *({"holes": name} for name in HOLES), {"mask": Path("m.png")},
    {"exposure": False},
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
    *(({"holes": name}, ("holes", repr(name), "choose from: auto, transparent, inpaint")) for name in ("", "fill")),
    *(({"crop": name}, ("crop", repr(name), "choose from: auto, full, inscribed, reference, or X, Y, W, H"))
      for name in ("tight", "", "1,2,3,4", "Full")),
    *(({"scale": scale}, ("scale", "between 0.02 and 1"))
      for scale in (0, 0.0199, 1.001, -1, 2, math.nan, math.inf, -math.inf)),
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
