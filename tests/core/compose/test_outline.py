"""The frame by the outlines of the pictures: it is the frame that a stitch of them would have."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, rotation_from_vector
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.outline import border_of, frame_outline
from edf_stitch.core.panorama.canvas import border
from edf_stitch.core.panorama.framing import FrameRequest

SIZE, FOCAL, YAW = (400, 300), 350.0, 25.0


@pytest.fixture(scope="module")
def views(by_hand) -> tuple[View, View]:
    """Two pictures from one place, the second turned to the right."""
    camera = by_hand.camera(SIZE, FOCAL)
    R, K = rotation_from_vector(np.array([0.0, -np.radians(YAW), 0.0])), camera.K
    reference = View(camera, K, np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    return reference, View(camera, K, R, np.zeros(3), K @ R @ np.linalg.inv(K), np.zeros(3))


@pytest.fixture(scope="module")
def outlines(views) -> list[np.ndarray]:
    return [homogeneous(border(view.size)) @ np.linalg.inv(view.K).T @ view.R for view in views]


def test_the_middle_lies_between_the_pictures_and_the_box_holds_them(views, outlines):
    frame, box = frame_outline(FrameRequest("cylindrical"), "full", views, outlines)
    points = np.concatenate([frame.points(outline) for outline in outlines])
    step = frame.focal / 140  # to within a node of the coarse sphere
    np.testing.assert_allclose(box, np.concatenate([points.min(axis=0), points.max(axis=0)]), atol=2 * step)
    ahead = frame.rotation[:, 2]
    assert np.degrees(np.arctan2(ahead[0], ahead[2])) == pytest.approx(YAW / 2, abs=0.7)


def test_the_reference_alone_and_what_is_full_lie_within(views, outlines):
    asked = FrameRequest("perspective", level="none")
    frame, full = frame_outline(asked, "full", views, outlines)
    _, own = frame_outline(asked, "reference", views, outlines)
    _, inner = frame_outline(asked, "inscribed", views, outlines)
    half = np.array(SIZE) / 2 / FOCAL * frame.focal
    np.testing.assert_allclose(own, np.concatenate([-half, half]), atol=0.03 * frame.focal)
    for box in (own, inner):
        assert (box[:2] >= full[:2] - 1e-6).all() and (box[2:] <= full[2:] + 1e-6).all()
    assert np.prod(inner[2:] - inner[:2]) < 0.9 * np.prod(full[2:] - full[:2])


def test_a_box_counts_in_px_of_the_full_frame(views, outlines):
    asked = FrameRequest("cylindrical", level="none")
    _, full = frame_outline(asked, "full", views, outlines)
    _, box = frame_outline(asked, (40, 30, 200, 100), views, outlines)
    expected = np.concatenate([full[:2] + [40, 30], full[:2] + [240, 130]])
    np.testing.assert_allclose(box, expected, atol=6)
    assert frame_outline(asked, (0, 0, 9000, 9000), views, outlines) is None


def test_a_sphere_is_shown_whole_and_what_reaches_around_the_back_cannot_be_told(views, outlines):
    frame, box = frame_outline(FrameRequest("equirectangular"), "full", views, outlines)
    assert box[2] - box[0] == pytest.approx(2 * (box[3] - box[1]))
    turned = rotation_from_vector(np.array([0.0, np.pi, 0.0]))
    assert frame_outline(FrameRequest("cylindrical"), "full", views, [outline @ turned for outline in outlines]) is None


def test_the_border_runs_along_the_box_and_comes_back(views, outlines):
    frame, box = frame_outline(FrameRequest("pannini", 0.5), "full", views, outlines)
    points = frame.points(border_of(frame, box))
    np.testing.assert_allclose(points[0], points[-1], atol=1e-9)
    np.testing.assert_allclose(np.concatenate([points.min(axis=0), points.max(axis=0)]), box, atol=1e-6)


def test_a_frame_beside_all_pictures_has_no_outline(views, outlines):
    assert frame_outline(FrameRequest("cylindrical", centre=(170.0, 0.0)), "auto", views, outlines) is None
