"""What is given about cameras beside what the pictures' files say of themselves."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.metadata import Exif


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
