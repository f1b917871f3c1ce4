"""Nuke's .chan: places, rotations and angles by its own axes."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.output.camera_file import found_cameras
from edf_stitch.core.output.programs.chan_file import chan_file
from edf_stitch.core.pipeline import StitchResult


def axis(number: int, degrees: float) -> np.ndarray:
    return rotation_from_vector(np.radians(degrees) * np.eye(3)[number])


def test_cameras_see_points_where_nukes_do(of_four: StitchResult) -> None:
    """A point of the first camera's frame, in Nuke's world, by its rotation Z, X, Y: ahead is −z, up is y."""
    found = found_cameras(of_four)
    lines = chan_file(found, (np.eye(3), 1.0)).decode().splitlines()
    assert [line.split("\t")[0] for line in lines] == ["1", "2", "3", "4", "5"]
    point = np.array([0.3, -0.2, 4.0])
    for one, line in zip(found, lines, strict=False):
        place, (x, y, z), angle = (np.array(part) for part in np.split(np.array(line.split("\t")[1:], float), (3, 6)))
        turn = axis(1, y) @ axis(0, x) @ axis(2, z)
        seen = turn.T @ (point * (1, -1, -1) - place)
        assert one.R is not None and one.t is not None
        assert np.abs(seen * (1, -1, -1) - (one.R @ point + one.t)).max() < 1e-6
        # half the angle is seen at the border
        assert abs(np.tan(np.radians(angle[0]) / 2) * one.camera.K[1, 1] - one.camera.size[1] / 2) < 1e-6


def test_the_last_line_is_the_panorama(of_four: StitchResult) -> None:
    line = chan_file(found_cameras(of_four), (axis(1, 30.0), np.radians(50))).decode().splitlines()[-1]
    values = np.array(line.split("\t"), float)
    # to the right is a negative turn about y, which is up there
    assert np.allclose(values, (5, 0, 0, 0, 0, -30, 0, 50), atol=1e-8)


def test_a_camera_that_looks_straight_up_is_written_without_a_word() -> None:
    """Its angles are not unique, which SciPy warns about (and pytest would make an error of): any are right."""
    line = chan_file([], (axis(0, 90.0), np.radians(50))).decode().splitlines()[-1]
    x, y, z = (float(value) for value in line.split("\t")[4:7])
    assert x == pytest.approx(90, abs=1e-3) and y + z == pytest.approx(0, abs=1e-3)
