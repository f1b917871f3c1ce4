"""Profiles that are made of primaries."""

from __future__ import annotations

import io

import numpy as np
import pytest
from edf_stitch.core.raster.colour import parse_icc, srgb_curve
from edf_stitch.core.raster.matrix_profile import matrix_profile

SRGB = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
P3 = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))


def test_srgb_comes_out_as_srgb() -> None:
    profile = parse_icc(matrix_profile("sRGB", SRGB))
    assert profile is not None and np.abs(profile.to_srgb - np.eye(3)).max() < 1e-3
    assert np.abs(profile.curves[0].table - srgb_curve().table).max() < 1e-5


def test_the_red_of_display_p3_lies_beyond_srgb() -> None:
    """To sRGB as CSS Color 4 has it."""
    profile = parse_icc(matrix_profile("Display P3", P3))
    assert profile is not None
    assert profile.to_srgb[:, 0] == pytest.approx([1.2249, -0.0420, -0.0197], abs=1e-3)
    assert profile.to_srgb.sum(axis=1) == pytest.approx([1, 1, 1], abs=1e-3), "white stays white"


def test_colour_management_takes_it() -> None:
    profiles = pytest.importorskip("PIL.ImageCms")
    made = profiles.ImageCmsProfile(io.BytesIO(matrix_profile("Display P3", P3)))
    assert profiles.getProfileDescription(made).strip() == "Display P3"
