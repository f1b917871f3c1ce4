"""Calibrations of OpenCV, ROS and Agisoft, for all pictures."""

from __future__ import annotations

from pathlib import Path
from random import Random

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.sources import read_camera_file
from edf_stitch.core.system.errors import BadRequest, StitchError

from .program_files import NAMES, SIZES, cameras

K = np.array([[700, 0, 401], [0, 710, 299], [0, 0, 1.0]])
LENS = np.array([-0.1, 0.02, 0.001, -0.002, 0.003])
ROS = """image_width: 800
image_height: 600
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [700.0, 0.0, 401.0, 0.0, 710.0, 299.0, 0.0, 0.0, 1.0]
distortion_model: equidistant
distortion_coefficients:
  rows: 1
  cols: 4
  data: [0.01, -0.002,
    0.0003, -0.0001]
"""
AGISOFT = """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>800</width>
  <height>600</height>
  <f>700</f>
  <cx>3.5</cx>
  <cy>-2</cy>
  <b1>1.5</b1>
  <b2>0.25</b2>
  <k1>-0.1</k1>
  <k2>0.02</k2>
  <k3>0.003</k3>
  <p1>0.001</p1>
  <p2>-0.002</p2>
  <date>2024-01-01T00:00:00Z</date>
</calibration>
"""


def by_opencv(path: Path) -> Path:
    """What OpenCV itself writes."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 800)
    storage.write("image_height", 600)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", LENS[None])
    storage.release()
    return path


@pytest.mark.parametrize("name", ["c.yml", "c.xml"])
def test_opencvs_own_files_serve_all_pictures(name: str, tmp_path: Path) -> None:
    for camera in cameras(by_opencv(tmp_path / name)):
        assert np.array_equal(camera.K, K) and np.array_equal(camera.distortion, LENS) and camera.fixed


def test_a_fisheye_of_ros_is_kannala_brandts(tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text(ROS)
    camera = cameras(tmp_path / "c.yaml")[0]
    assert camera.lens is not None and camera.lens.angular == (0.01, -0.002, 0.0003, -0.0001)
    assert np.array_equal(camera.K, K) and not camera.distortion.any()


def agisofts(x: float, y: float) -> tuple[float, float]:
    """Where Agisoft's formulas (Metashape's manual, appendix D) see (x, y, 1), px from the first pixel's corner."""
    r2 = x * x + y * y
    bent = 1 - 0.1 * r2 + 0.02 * r2**2 + 0.003 * r2**3
    x1 = x * bent + (0.001 * (r2 + 2 * x * x) + 2 * -0.002 * x * y)
    y1 = y * bent + (-0.002 * (r2 + 2 * y * y) + 2 * 0.001 * x * y)
    return 400 + 3.5 + x1 * 700 + x1 * 1.5 + y1 * 0.25, 300 - 2 + y1 * 700


def seen_at(camera: Camera, x: float, y: float) -> np.ndarray:
    return distort(np.array([(camera.K @ (x, y, 1))[:2]]), camera)[0]


def test_agisofts_formulas_are_ours(tmp_path: Path) -> None:
    (tmp_path / "c.xml").write_text(AGISOFT)
    camera = cameras(tmp_path / "c.xml")[0]
    for x, y in ((0.3, -0.2), (-0.4, 0.35)):
        assert np.allclose(seen_at(camera, x, y) + 0.5, agisofts(x, y), atol=1e-9)


def test_an_agisoft_fisheye_is_kannala_brandts(tmp_path: Path) -> None:
    text = AGISOFT.replace("frame", "fisheye").replace("<p1>0.001", "<p1>0").replace("<p2>-0.002", "<p2>0")
    (tmp_path / "c.xml").write_text(text)
    lens = cameras(tmp_path / "c.xml")[0].lens
    assert lens is not None and lens.angular == (-0.1, 0.02, 0.003, 0)


@pytest.mark.parametrize(("text", "old", "new", "said"), [
    (ROS, "data: [700.0, ", "data: [", "the camera's matrix must be 9 numbers"),
    (ROS, "image_width: 800\n", "", "image_width and image_height"), (ROS, "800", "wide", "the width is 'wide'"),
    (ROS, "700.0", "fast", "a number of the camera's matrix is 'fast'"),
    (ROS, "-0.0001]", "-0.0001, 0.1]", "5 distortion coefficients; 4 are read"),
    (AGISOFT, "frame", "cylindrical", "the projection is 'cylindrical'; frame and fisheye"),
    (AGISOFT, "<f>700</f>", "", "the focal length is None"), (AGISOFT, "<k1>-0.1", "<k1>much", "k1 is 'much'"),
    (AGISOFT, "<k3>", "<k4>0.1</k4><k3>", "k4 of a frame calibration is not read"),
    (AGISOFT, "frame", "fisheye", "p1 of a fisheye calibration is not read"),
    (AGISOFT, "</calibration>", "", "not sound XML"),
    (AGISOFT, "calibration", "camera", "XML that is neither a calibration"),
    (AGISOFT, "<calibration>", '<!DOCTYPE a [<!ENTITY b "c">]><calibration>', "it defines entities"),
])  # fmt: skip
def test_damage_is_refused_with_what_is_wrong(text: str, old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in text
    (tmp_path / "c").write_text(text.replace(old, new))
    with pytest.raises(BadRequest, match=said):
        cameras(tmp_path / "c")


@pytest.mark.parametrize("text", [ROS, AGISOFT])
def test_damaged_files_are_read_or_refused_and_nothing_else(text: str, tmp_path: Path) -> None:
    data, random, path = text.encode(), Random(0), tmp_path / "c"
    for _ in range(150):
        damaged = bytearray(data)
        for _ in range(random.randint(1, 5)):
            at = random.randrange(len(damaged))
            what = random.choice((b"", b"\0", b"<", b"[", b"9e999", b":", b"\xff", b"-"))
            damaged[at : at + random.randint(0, 9)] = what
        path.write_bytes(damaged)
        try:
            read_camera_file(path, NAMES, SIZES)
        except StitchError as error:
            assert str(error)
