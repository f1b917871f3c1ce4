"""What dragging a panorama's frame asks for, by its geometry."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.panorama.levelling import angles_of

pytest.importorskip("bpy")

from edf_stitch.edf_addon.overlays import frame_drag as fd  # noqa: E402
from edf_stitch.edf_addon.scene.scene_geometry import projection_of  # noqa: E402


@pytest.fixture
def known() -> dict:
    """A small cylinder, half as large as the full one, of which the crop has left a box."""
    rotation = rotation_from_vector(np.radians((-4.0, 14.0, 2.0)))
    told = {"kind": "cylindrical", "focal_px": 300.0, "centre": [310.0, 170.0], "rotation": rotation.tolist(),
            "level": list(angles_of(rotation))}  # fmt: skip
    canvas = {"projection": told, "width": 600, "height": 340, "box": [20, 10, 600, 340], "whole": [640, 360]}
    geometry = {"K": np.diag([300.0, 300.0, 1.0]).tolist(), "K_canvas": [[None] * 3] * 3, "canvas": [600, 340]}
    return {"share": 0.5, "geometry": geometry, "report": {"canvas": canvas}}


@pytest.mark.parametrize(("point", "part"), [
    ((2.0, 100.0), "LEFT"), ((598.0, 338.0), "RIGHT BOTTOM"), ((300.0, -5.0), "TOP"), ((100.0, 172.0), fd.HORIZON),
    ((300.0, 100.0), fd.MIDDLE), ((650.0, 100.0), None),
])  # fmt: skip
def test_what_lies_under_the_pointer(known: dict, point: tuple[float, float], part: str | None) -> None:
    assert fd.part_at(known, np.array(point), 6.0) == part


def test_dragged_edges_are_a_crop_of_the_full_panorama(known: dict) -> None:
    assert fd.box_by(known, "LEFT", np.array([30.0, 99.0])) == [100, 20, 1140, 680]
    assert fd.box_by(known, "RIGHT BOTTOM", np.array([-30.0, -40.0])) == [40, 20, 1140, 600]
    assert fd.box_by(known, fd.MIDDLE, np.array([5.0, -4.0])) == [50, 12, 1200, 680], "its size stays"
    left, top, width, height = fd.box_by(known, "RIGHT", np.array([999.0, 0.0]))
    assert left + width == 2 * (640 - fd.ROUNDED), "no further than there is something, rounded safely"
    assert fd.box_by(known, "LEFT", np.array([9999.0, 0.0]))[2] == 2 * fd.LEAST, "something is left"
    assert fd.box_by({**known, "share": 1.0}, "RIGHT", np.array([999.0, 0.0]))[2] == 620
    box = fd.box_by(known, "LEFT TOP", np.array([30.0, 20.0]))
    np.testing.assert_allclose(fd.shown_box(known, box), [[30, 20], [600, 340]])


def test_the_middle_is_dragged_by_its_angle_and_a_sphere_turned(known: dict) -> None:
    assert fd.centre_by(known, (0.1, 0.0), np.array([30.0, -15.0])) == pytest.approx((0.2, 0.05))
    projection = projection_of(known)
    assert projection is not None
    there = projection.rays(np.array([[340.0, 170.0]]))[0]
    rotation = projection.rotation @ rotation_from_vector(np.array([0.0, 0.1, 0.0]))
    np.testing.assert_allclose(rotation[:, 2], there, atol=1e-12)
    assert fd.level_turned(known, np.array([30.0, 7.0])) == pytest.approx(angles_of(rotation))


def test_a_dragged_horizon_is_level_then(known: dict) -> None:
    same = fd.horizon_by(known, np.array([300.0, 170.0]), np.array([300.0, 170.0]))
    projection = projection_of(known)
    assert projection is not None
    assert fd.level_by_line(known, same) == pytest.approx(angles_of(projection.rotation), abs=0.2)
    for start, end in (
        ((300.0, 170.0), (300.0, 200.0)), ((550.0, 170.0), (560.0, 190.0)), ((30.0, 170.0), (30.0, 150.0)),
    ):
        line = fd.horizon_by(known, np.array(start), np.array(end))
        assert line[0, 0] < line[1, 0]
        yaw, pitch, roll = fd.level_by_line(known, line)
        before = angles_of(projection.rotation)
        moved = abs(pitch - before[1]) > 3 if start[0] == 300 else abs(roll - before[2]) > 2
        assert moved and abs(yaw - before[0]) < 3
    raised = fd.level_by_line(known, fd.horizon_by(known, np.array([300.0, 170.0]), np.array([300.0, 200.0])))
    assert raised[1] > angles_of(projection.rotation)[1], "what lay below is level: the reference looks further up"
