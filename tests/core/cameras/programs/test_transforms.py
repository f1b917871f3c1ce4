"""transforms.json as NeRF programs write it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.system.errors import BadRequest

from .program_files import cameras, transforms


def changed(folder: Path, **values: Any) -> Path:
    path = transforms(folder)
    content = json.loads(path.read_text())
    first = values.pop("frame", {})
    content["frames"][0] |= first
    path.write_text(json.dumps({key: value for key, value in (content | values).items() if value is not None}))
    return path


def test_intrinsics_are_shared_or_of_a_frame(tmp_path: Path) -> None:
    first, second = cameras(transforms(tmp_path))
    assert np.allclose(first.K, [[700, 0, 400.5], [0, 710, 298.5], [0, 0, 1]])
    assert second.focal == 650 and np.allclose(first.distortion, (-0.1, 0, 0.001, 0, 0))


def test_axes_are_opengls(tmp_path: Path) -> None:
    """The second camera looks along x from (1, 2, 3), with y up: 5 ahead of it lies (6, 2, 3), above that y + 1."""
    pose = cameras(transforms(tmp_path))[1].pose
    assert pose is not None
    for point, seen in (((6, 2, 3), (0, 0, 5)), ((6, 3, 3), (0, -1, 5)), ((6, 2, 4), (1, 0, 5))):
        assert np.allclose(pose[0] @ point + pose[1], seen)


def test_an_angle_is_a_focal_length_and_the_middle_is_the_default(tmp_path: Path) -> None:
    path = changed(tmp_path, fl_x=None, fl_y=None, cx=None, cy=None, camera_angle_x=float(np.pi / 2), k1=0, p1=0)
    first, _ = cameras(path)
    assert np.allclose(first.K, [[400, 0, 399.5], [0, 400, 299.5], [0, 0, 1]])


def test_a_fisheye_is_kannala_brandts(tmp_path: Path) -> None:
    first, _ = cameras(changed(tmp_path, camera_model="OPENCV_FISHEYE", p1=0, k4=0.001))
    assert first.lens is not None
    assert (first.lens.projection, first.lens.angular) == (LensProjection.EQUIDISTANT, (-0.1, 0, 0, 0.001))
    assert isinstance(first.lens, Lens) and not first.distortion.any()


@pytest.mark.parametrize(("values", "said"), [
    ({"frames": []}, "frames must be a list"), ({"w": None}, "frame 0 .*: w and h"), ({"w": -1}, "a picture of -1"),
    ({"fl_x": None}, "fl_x .* is missing"), ({"fl_x": "far"}, "the focal length is 'far'; a number"),
    ({"fl_x": True}, "the focal length is True"),
    ({"camera_model": "FOV"}, "the camera model 'FOV' is not read; PINHOLE"),
    ({"camera_model": "PINHOLE"}, "k1 is not 0, which the camera model PINHOLE does not have"),
    ({"frame": {"transform_matrix": [[1, 0], [0, 1]]}}, "frame 0 .*: transform_matrix must be 4×4"),
    ({"frame": {"transform_matrix": np.ones((4, 4)).tolist()}}, "the last row"),
    ({"frame": {"transform_matrix": np.diag([2.0, 1, 1, 1]).tolist()}}, "R is not a rotation"),
    ({"frame": {"transform_matrix": np.full((3, 4), 1e308).tolist()}}, "R is not a rotation"),
    ({"frame": {"file_path": 3}}, "an object with file_path"),
    ({"frame": {"file_path": "./images/b"}}, "a camera already"),
    ({"fl_x": None, "camera_angle_x": 4}, "camera_angle_x is 4"),
])  # fmt: skip
def test_damage_is_refused_with_its_frame(values: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=said):
        cameras(changed(tmp_path, **values))
