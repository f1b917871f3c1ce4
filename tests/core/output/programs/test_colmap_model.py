"""The points of a COLMAP model: where they are, who sees them, and how far off."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from edf_stitch.core.measure.rig_figures import residuals as rig_residuals
from edf_stitch.core.output.camera_file import found_cameras
from edf_stitch.core.output.programs.points import points_of
from edf_stitch.core.output.programs.written import write_cameras
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.system.output_files import OutputFiles


def model_of(result: StitchResult, folder: Path) -> tuple[list[list[str]], list[list[str]], list[list[str]]]:
    """The words of the lines of cameras, images and points."""
    with OutputFiles() as files:
        write_cameras(result, folder, files)
    files_of = ("cameras.txt", "images.txt", "points3D.txt")
    first, second, third = ([line.split() for line in (folder / name).read_text().splitlines()] for name in files_of)
    return first, second, third


def residuals(result: StitchResult, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """px (O,) from where a picture sees a point to where its camera, by OpenCV, projects it; and the same of the file.
    """
    cameras, images, points = model_of(result, folder)
    X = {int(words[0]): np.array(words[1:4], float) for words in points}
    errors: dict[int, list[float]] = {key: [] for key in X}
    for index, (camera, pose) in enumerate(zip(cameras, images[::2], strict=True)):
        assert camera[1] == "OPENCV" and camera[0] == pose[0] == pose[8]
        fx, fy, cx, cy, *lens = map(float, camera[4:])
        w, x, y, z = map(float, pose[1:5])
        turn = 2 * np.arccos(w) * np.array([x, y, z]) / max(np.linalg.norm([x, y, z]), 1e-300)
        seen = np.array(images[2 * index + 1], float).reshape(-1, 3)
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        at = np.array([X[int(key)] for key in seen[:, 2]])
        px = cv2.projectPoints(at, turn, np.array(pose[5:8], float), K, np.array(lens))[0].reshape(-1, 2)
        for key, off in zip(seen[:, 2], np.linalg.norm(px - seen[:, :2], axis=1), strict=True):
            errors[int(key)].append(float(off))
    told = np.array([float(words[7]) for words in points])
    return np.array([np.mean(one) for one in errors.values()]), told


def test_points_project_to_where_they_are_seen_with_our_residuals(of_four: StitchResult, tmp_path: Path) -> None:
    found, told = residuals(of_four, tmp_path / "model")
    assert len(found) > 200 and np.abs(found - told).max() < 1e-6
    assert of_four.rig is not None
    own = rig_residuals(of_four.rig)[of_four.rig.observations.used]
    # what is hardly nearer than infinity is put there
    assert abs(points_of(of_four, found_cameras(of_four)).error.mean() - own.mean()) < 1e-3


def test_tracks_name_the_lines_of_the_pictures(of_four: StitchResult, tmp_path: Path) -> None:
    _, images, points = model_of(of_four, tmp_path / "model")
    seen = [np.array(line, float).reshape(-1, 3) for line in images[1::2]]
    for words in points:
        track = np.array(words[8:], int).reshape(-1, 2)
        assert len(track) >= 2
        for picture, place in track:
            assert seen[picture - 1][place, 2] == int(words[0])


def test_of_a_pair_the_inliers_are_points(small_result: StitchResult) -> None:
    found = found_cameras(small_result)
    points = points_of(small_result, found)
    assert len(points.X) == small_result.edges[0].two_view.inliers.sum()
    assert np.array_equal(points.picture, np.repeat((0, 1), len(points.X)))
    assert np.median(points.error[points.picture == 1]) < 1.0 and points.error[points.picture == 0].max() < 1e-6
