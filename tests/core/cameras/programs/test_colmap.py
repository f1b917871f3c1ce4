"""Models of COLMAP, as text and binary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.system.errors import BadRequest, UnreadableImage

from .program_files import COLMAP_MODELS, MOVE, cameras, colmap_binary, colmap_text

Write = Callable[[Path, str], Path]
both = pytest.mark.parametrize("write", [colmap_text, colmap_binary])


@both
@pytest.mark.parametrize("model", COLMAP_MODELS)
def test_each_model_is_what_opencv_projects_by(write: Write, model: str, tmp_path: Path) -> None:
    (camera, _), values = cameras(write(tmp_path, model)), COLMAP_MODELS[model][1]
    fy = 700 if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL") else 710
    # there the middle of the first pixel is at 0.5
    assert np.allclose(camera.K, [[700, 0, 400.5], [0, fy, 298.5], [0, 0, 1]])
    rays = np.array([[0.3, -0.2, 1.0], [-0.5, 0.4, 1.0]])
    more = np.array(values[3 if fy == 700 else 4 :], float)
    if model == "OPENCV_FISHEYE":
        seen = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), camera.K, more)[0]
    else:
        five = np.resize(np.append(more, np.zeros(5)), 5)
        seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, five)[0]
    assert np.abs(distort((rays @ camera.K.T)[:, :2], camera) - seen.reshape(-1, 2)).max() < 1e-9


@both
def test_poses_are_world_to_camera(write: Write, tmp_path: Path) -> None:
    first, second = cameras(write(tmp_path, "PINHOLE"))
    assert first.pose is not None and second.pose is not None and first.fixed
    assert np.allclose(first.pose[0], np.eye(3)) and not first.pose[1].any()
    assert np.allclose(second.pose[0], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]) and np.allclose(second.pose[1], MOVE)


@both
def test_a_model_is_found_by_its_folder_or_a_file_of_it(write: Write, tmp_path: Path) -> None:
    folder = tmp_path / "project" / "sparse" / "0"
    folder.mkdir(parents=True)
    write(folder, "PINHOLE")
    some_file = next(folder.glob("images.*"))
    for path in (tmp_path / "project", folder.parent, folder, some_file):
        assert len(cameras(path)) == 2


def test_a_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("")
    with pytest.raises(UnreadableImage, match="no COLMAP model in it"):
        cameras(tmp_path)


@pytest.mark.parametrize(("file", "old", "new", "said"), [
    ("cameras.txt", "PINHOLE", "FOV", r"cameras.txt, line 2: .* 'FOV' is not read; SIMPLE_"),
    ("cameras.txt", " 299", "", "line 2: 3 parameters; PINHOLE has 4"),
    ("cameras.txt", "701", "x", "line 2: a parameter is 'x'; a number"),
    ("cameras.txt", "701", "nan", "line 2: a parameter is 'nan'; a number"),
    ("cameras.txt", "701", "-701", "line 2: the focal length is -701"),
    ("cameras.txt", "800", "800.5", "line 2: the width is '800.5'; a whole number"),
    ("cameras.txt", "800", "0", "line 2: a picture of 0 × 600 px"),
    ("cameras.txt", "3 P", "4 P", "images.txt, line 2: it was taken by camera 3, which cameras.txt lacks"),
    ("cameras.txt", "PINHOLE 800 600 701", "FULL_OPENCV 800 600 5 5 5 5 0 0 0 1 701", "k4 to k6 of FULL_OPENCV"),
    ("images.txt", "3 images/a.png", "3", "line 2: 9 values; an image has a number, QW"),
    ("images.txt", "1 0 0 0 0", "0 0 0 0 0", "line 2: QW QX QY QZ are no rotation"),
    ("images.txt", "images/a.png", "images/b.png", "line 4: images/b.png has a camera already"),
])  # fmt: skip
def test_damage_is_refused_with_its_line(file: str, old: str, new: str, said: str, tmp_path: Path) -> None:
    colmap_text(tmp_path, "PINHOLE")
    text = (tmp_path / file).read_text().replace("700", "701")
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new, 1))
    with pytest.raises(BadRequest, match=said):
        cameras(tmp_path)


def test_a_binary_file_that_ends_early_is_refused_with_the_byte(tmp_path: Path) -> None:
    colmap_binary(tmp_path, "OPENCV")
    whole = {name: (tmp_path / name).read_bytes() for name in ("cameras.bin", "images.bin")}
    for name, data in whole.items():
        for end in range(len(data)):
            (tmp_path / name).write_bytes(data[:end])
            with pytest.raises(BadRequest, match=rf"{name}, byte \d+: (the file ends here|a name begins here)"):
                cameras(tmp_path)
        (tmp_path / name).write_bytes(data)


def test_a_number_of_points_that_no_file_holds_is_refused(tmp_path: Path) -> None:
    colmap_binary(tmp_path, "PINHOLE")
    data = (tmp_path / "images.bin").read_bytes()
    at = data.index(b"a.png\0") + 6
    (tmp_path / "images.bin").write_bytes(data[:at] + b"\xff" * 8 + data[at + 8 :])
    with pytest.raises(BadRequest, match="bytes too early"):
        cameras(tmp_path)
    (tmp_path / "cameras.bin").write_bytes(b"\xff" * 7)
    with pytest.raises(BadRequest, match="cameras.bin, byte 0"):
        cameras(tmp_path)
