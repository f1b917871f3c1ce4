"""What the report says of the pictures' light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.compose.decided import Decided
from edf_stitch.core.compose.tone.clipped import ClippedLight
from edf_stitch.core.compose.tone.exposure import Exposure, unchanged
from edf_stitch.core.compose.tone.toned import ToneCurve, Vignetting
from edf_stitch.core.measure.exposure_entry import exposure_entry, exposure_warnings
from edf_stitch.core.measure.options import WARNING
from edf_stitch.core.pictures.picture import picture_from_array

NOTHING = np.zeros((4, 4), bool)


def test_all_that_was_done_is_told() -> None:
    levels = np.full((10, 20, 3), 100, np.uint8)
    levels[:, :5, 2], levels[:, 5:8] = 250, 249
    pictures = picture_from_array(levels, "a"), picture_from_array(2 * np.ones((4, 4, 3), np.float32), "b")
    lens = Vignetting(-0.1, -0.3)
    first = Exposure(np.float32([0.5, 0.5, 0.5]), np.zeros(3, np.float32), 9, lens, overexposed=0.25)
    table = ClippedLight((None, None, None))
    second = replace(first, gain=np.float32([2, 4, 8]), curve=ToneCurve(-0.2, -4, -1), overexposed=0, clipped=table)
    entry = exposure_entry(pictures, [Decided(NOTHING, NOTHING, one) for one in (first, second)])
    assert [gain.tolist() for gain in entry.pop("gain")] == [[0.5, 0.5, 0.5], [2, 4, 8]]
    assert entry == {
        "stops": [-1, 2], "vignetting": [-0.1, -0.3], "curve": [None, [-0.2, -4, -1]],
        "clipped": [pytest.approx(0.25), 0.0], "overexposed": [0.25, 0], "restored": [False, True],
    }  # fmt: skip


def test_camera_raw_is_the_only_float_picture_that_clips() -> None:
    light = np.full((10, 20, 3), 0.2, np.float32)
    light[:5, :, 1] = 0.5
    raw = replace(picture_from_array(light, "a.nef"), clips_at=0.5)
    exposures = [Decided(NOTHING, NOTHING, unchanged(3))] * 2
    assert exposure_entry([raw, replace(raw, clips_at=float("inf"))], exposures)["clipped"] == [0.5, 0.0]


def test_what_could_not_be_matched_and_what_is_over_exposed_is_warned_of() -> None:
    names = ["a.jpg", "b.jpg"]
    fine = replace(unchanged(3), overexposed=WARNING.overexposed_share)
    assert exposure_warnings(names, [fine, fine]) == []
    (one,) = exposure_warnings(names, [fine, replace(fine, why_not="it differs by 7.0 stops")])
    assert "b.jpg" in one and "7.0 stops" in one and "could not be matched" in one
    (one,) = exposure_warnings(names, [replace(fine, overexposed=0.31), fine])
    assert "a.jpg is over-exposed" in one and "31%" in one
