"""The file of cameras, read back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for, read_camera_file
from edf_stitch.core.output.camera_file import camera_table
from edf_stitch.core.output.json_file import json_bytes
from edf_stitch.core.output.outputs import OutputRequest, check
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.core.system.output_files import OutputFiles

NAMES = ["a.png", "b.png", "c.png"]
K = [[500.0, 0, 200], [0, 500, 150], [0, 0, 1]]
EYE = np.eye(3).tolist()


def named(result: StitchResult) -> StitchResult:
    pictures = [replace(one, name=name) for one, name in zip(result.pictures, NAMES, strict=False)]
    return replace(result, pictures=tuple(pictures))


def test_cameras_are_those_of_the_full_pictures(small_result: StitchResult) -> None:
    half = replace(named(small_result), full_sizes=tuple((2 * w, 2 * h) for w, h in small_result.full_sizes))
    table = json.loads(json_bytes(camera_table(half)))
    for camera, view in zip(read_camera_file(table, NAMES[:2], list(half.full_sizes)), half.views, strict=True):
        assert camera is not None
        np.testing.assert_allclose(camera.resized(view.size).K, view.K, rtol=1e-12)


def test_what_is_written_is_read_back(small_result: StitchResult, tmp_path: Path) -> None:
    one = named(small_result)
    (tmp_path / "c.json").write_bytes(json_bytes(camera_table(one)))
    for camera, view in zip(read_camera_file(tmp_path / "c.json", NAMES[:2], one.full_sizes), one.views, strict=True):
        assert camera is not None and camera.pose is not None
        np.testing.assert_array_equal(camera.K, view.K)
        np.testing.assert_allclose(camera.pose[0], view.R, atol=1e-15)
        np.testing.assert_array_equal(camera.pose[1], view.t)


def test_where_no_pose_is_known_none_is_written(small_result: StitchResult) -> None:
    views = tuple(replace(view, R=np.full((3, 3), np.nan)) for view in small_result.views)
    table = camera_table(replace(named(small_result), views=views))["cameras"]
    assert all(set(entry) == {"K", "distortion"} for entry in table.values())


def test_two_pictures_of_one_name_are_refused_before_the_work(tmp_path: Path) -> None:
    request = OutputRequest(tmp_path / "out.png", cameras=tmp_path / "c.json")
    with OutputFiles() as files:
        check(request, files, NAMES)
        with pytest.raises(BadRequest, match=r"two pictures are called a\.png"):
            check(request, files, ["a.png", "b.png", "a.png"])


# --- of more than two pictures ----------------------------------------------------------------------------------------


def known(table: dict) -> list[str]:
    request = CameraRequest(cameras={"cameras": table})
    found, _ = cameras_for(request, NAMES, [(400, 300)] * 3, [Exif()] * 3)
    return [f"{camera.source}{'' if camera.pose is None else ' and pose'}" for camera in found]


def test_those_that_are_given_are_held_and_the_others_found() -> None:
    assert known({name: {"K": K} for name in NAMES}) == ["camera file"] * 3
    some = known({"a.png": {"K": K}, "c.png": {"K": K}})
    assert some == ["camera file", "a.png (camera file)", "camera file"]
    posed = {"K": K, "R": EYE, "t": [0, 0, 0]}
    assert known({"a.png": posed, "b.png": posed, "c.png": {"K": K}}) == [
        "camera file and pose", "camera file and pose", "camera file",
    ]  # fmt: skip


def test_a_borrowed_focal_length_says_whose_it_is() -> None:
    exifs = [Exif(), Exif(focal35_mm=28.0), Exif()]
    found, _ = cameras_for(CameraRequest(), NAMES, [(400, 300)] * 3, exifs)
    assert [camera.lens_of for camera in found] == ["b.png", "", "b.png"]
    assert found[0].source == "b.png (EXIF 35 mm equivalent)"


def test_names_that_are_none_of_the_pictures_are_told() -> None:
    def told(*more: str) -> list[str]:
        request = CameraRequest(cameras={"cameras": {name: {"K": K} for name in (*NAMES, *more)}})
        return cameras_for(request, NAMES, [(400, 300)] * 3, [Exif()] * 3)[1]

    assert told() == []
    assert told("A.png", "x") == ["the camera file names what is none of the pictures: A.png, x"]
    assert told(*"123456")[0].endswith(": 1, 2, 3, 4, 5, …")


@pytest.mark.parametrize(("table", "words"), [
    ({"z.png": {"K": K}}, "names none of the pictures"),
    ({"reference": {"K": K}, "target": {"K": K}}, "names none of the pictures"),
    ({"a.png": 3}, r"the camera of a\.png: an object"),
    ({"a.png": {"K": K, "R": EYE, "t": [0, 0, 0]}}, "one picture only"),
    ({name: {"K": K, "R": EYE, "t": [0, 0, 0]} for name in ("a.png", "B.png")}, r"none of them: B\.png; check the sp"),
])  # fmt: skip
def test_a_file_that_does_not_fit_is_refused(table: dict, words: str) -> None:
    with pytest.raises(BadRequest, match=words):
        known(table)
