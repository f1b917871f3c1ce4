"""Lenses in camera files."""

from __future__ import annotations

from typing import Any

import pytest
from edf_stitch.core.cameras.lens_entries import lens_entry
from edf_stitch.core.cameras.lens_models import Lens
from edf_stitch.core.cameras.sources import read_camera_file
from edf_stitch.core.system.errors import BadRequest

NAMES, SIZES = ("a.png", "b.png"), ((800, 600), (800, 600))
K = [[400.0, 0, 400], [0, 400, 300], [0, 0, 1]]


def read(lens: Any, **more: Any) -> Lens | None:
    table = {name: {"K": K, "lens": lens, **more} for name in NAMES}
    camera = read_camera_file({"cameras": table}, NAMES, SIZES)[0]
    assert camera is not None
    return camera.lens


def test_the_polynomial_is_one_at_half_the_shorter_side() -> None:
    assert read({"ptlens": [0.01, -0.02, 0.03]}) == Lens(ptlens=(0.01, -0.02, 0.03), radius=0.75)
    assert read({"ptlens": [0.01], "radius_px": 200}) == Lens(ptlens=(0.01, 0, 0), radius=0.5)


def test_what_is_written_is_read_back() -> None:
    for lens in (
        {"projection": "equisolid", "ptlens": [0.0, 0.01, 0.0], "radius_px": 280.0},
        {"projection": "equidistant", "angular": [0.01, -0.002, 0.0, 0.0]},
    ):
        table = {name: {"K": K, "lens": lens} for name in NAMES}
        camera = read_camera_file({"cameras": table}, NAMES, SIZES)[0]
        assert camera is not None and lens_entry(camera) == lens
    plain = read_camera_file({"cameras": {name: {"K": K} for name in NAMES}}, NAMES, SIZES)[0]
    assert plain is not None and lens_entry(plain) is None


@pytest.mark.parametrize(("lens", "said"), [
    ("equidistant", "an object"), ({"projection": "fish"}, "there are rectilinear, equidistant"),
    ({"k1": 1}, "k1 is not known"), ({"ptlens": [1, 2, 3, 4]}, "ptlens must be 3 numbers"),
    ({"ptlens": ["x"]}, "ptlens must be 3 numbers"), ({"radius_px": 0}, "radius_px is 0"),
    ({"ptlens": [float("nan")]}, "ptlens must be 3 numbers"), ({"angular": [0.1]}, "go with the projection"),
    ({"ptlens": [0, 0, 2.0]}, "folds on its axis"),
])  # fmt: skip
def test_a_lens_that_makes_no_sense_is_refused(lens: Any, said: str) -> None:
    with pytest.raises(BadRequest, match=said) as error:
        read(lens)
    assert "a.png" in str(error.value)


def test_a_lens_replaces_a_distortion() -> None:
    with pytest.raises(BadRequest, match="give one of them"):
        read({"projection": "equidistant"}, distortion=[0.1])
    assert read({"projection": "equidistant"}, distortion=[0.0]) is not None
