"""What is given about cameras beside what the pictures' files say of themselves."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for, read_camera_file
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.system.errors import BadRequest


@pytest.mark.parametrize(("distortion", "undistorted"), [([-0.1], True), ([-0.1], False), ([], True)])
def test_a_distortion_that_was_removed_already_is_not_removed_again_in_silence(
    tmp_path: Path, distortion: list[float], undistorted: bool
) -> None:
    path = tmp_path / "cameras.json"
    entry = {"K": [[300, 0, 159.5], [0, 300, 119.5], [0, 0, 1]], "distortion": distortion}
    path.write_text(json.dumps({"cameras": {"a.jpg": entry, "b.jpg": entry}}), "utf-8")
    exifs = (Exif(undistorted=undistorted), Exif())
    _, warnings = cameras_for(CameraRequest(cameras=path), ["a.jpg", "b.jpg"], [(320, 240)] * 2, exifs)
    said = [one for one in warnings if "distortion was removed already" in one]
    assert len(said) == (undistorted and bool(distortion)) and not any("b.jpg" in one for one in said)


HUGE = 10**400


@pytest.mark.parametrize("wrong", [
    {"K": [[HUGE, 0, 159.5], [0, 300, 119.5], [0, 0, 1]]}, {"distortion": [HUGE]}, {"t": [HUGE, 0, 0]},
    {"lens": {"projection": "equidistant", "angular": [HUGE]}}, {"size": [4 * HUGE, 3 * HUGE]}, {"focal_sigma": HUGE},
], ids=lambda wrong: next(iter(wrong)))  # fmt: skip
def test_whole_numbers_that_no_float_holds_are_refused(tmp_path: Path, wrong: dict[str, object]) -> None:
    path = tmp_path / "cameras.json"
    entry = {"K": [[300, 0, 159.5], [0, 300, 119.5], [0, 0, 1]], "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 0]}
    path.write_text(json.dumps({"cameras": {"a.jpg": entry | wrong, "b.jpg": entry}}), "utf-8")
    with pytest.raises(BadRequest, match=r"of a\.jpg"):
        read_camera_file(path, ["a.jpg", "b.jpg"], [(320, 240)] * 2)
