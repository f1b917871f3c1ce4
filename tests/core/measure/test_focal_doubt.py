"""How far a focal length may be off, and how much uprights would lean for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.edge import Edge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.measure.focal_doubt import FocalDoubt, focal_doubt
from edf_stitch.core.measure.options import FOCAL_DOUBT, WARNING
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.pose.estimation import estimate
from edf_stitch.core.pose.options import EDGE_FOCAL

from ..point_scenes import FOCAL, SIZE, turned_by, unit

K = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
CANVAS = Canvas(*SIZE, (0, 0))


def assumed(focal: float = 0.9 * max(SIZE)) -> Camera:
    own = K.copy()
    own[0, 0] = own[1, 1] = focal
    return Camera(own, SIZE, "assumed", INTRINSICS.assumed_sigma, knowledge=Knowledge.ASSUMED)


def edge(camera: Camera, R: np.ndarray) -> Edge:
    """A pair of cameras whose axes lie R apart, in front of points anywhere."""
    random = np.random.default_rng(0)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (6000, 2))
    y = project((homogeneous(x) @ np.linalg.inv(K).T * random.uniform(2, 9, (len(x), 1))) @ R.T @ K.T
                + K @ unit(1, 0.2, 0.1) * 0.8)  # fmt: skip
    ok = (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    found = Matches(x[ok][:300], y[ok][:300] + random.normal(0, 0.3, y[ok][:300].shape))
    return Edge(0, 1, found, found, estimate(found, camera, camera))


TURNED = turned_by(10, -25, 0)


def test_what_is_given_is_not_doubted_and_what_edges_say_is_doubted_as_far_as_they_are_off() -> None:
    given = replace(assumed(FOCAL), log_sigma=0.0, knowledge=Knowledge.GIVEN)
    assert focal_doubt((given, given), edge(given, TURNED), CANVAS) == FocalDoubt(0.0, 0.0)
    by_edges = replace(
        assumed(FOCAL), source=EDGE_FOCAL.source, log_sigma=EDGE_FOCAL.log_sigma, knowledge=Knowledge.EDGES
    )
    doubt = focal_doubt((assumed(), assumed()), edge(by_edges, TURNED), CANVAS)
    assert doubt.off == EDGE_FOCAL.log_sigma and doubt.lean_deg > 0


def test_matches_alone_are_doubted_more_than_they_doubt_themselves() -> None:
    pair = edge(assumed(), TURNED)
    assert pair.two_view.focal_deviation < 0.1
    doubt = focal_doubt((assumed(), assumed()), pair, CANVAS)
    assert doubt.off == FOCAL_DOUBT.by_matches and doubt.lean_deg > WARNING.lean_deg
    (warning,) = doubt.warnings((assumed(), assumed()), pair)
    focal = pair.two_view.K[0, 0]
    assert f"{focal:.0f} px" in warning and f"{doubt.lean_deg:.1f}°" in warning and "--focal35" in warning
    assert f"{focal * np.hypot(36, 24) / np.hypot(*SIZE):.0f} mm on 35 mm film, from the matches) may" in warning
    unknown = replace(pair, two_view=replace(pair.two_view, focal_source="not determined by the matches, assumed"))
    assert "35 mm film, not determined by the matches) may" in doubt.warnings((assumed(), assumed()), unknown)[0]


def test_the_lean_is_what_another_focal_length_makes() -> None:
    """Uprights of a target that is turned by 10° in pitch and 25° in yaw, as two focal lengths have them."""
    pair = edge(assumed(), TURNED)
    doubt = focal_doubt((assumed(), assumed()), pair, CANVAS)
    leaning = []
    for factor in np.exp([-doubt.off, 0.0, doubt.off]):
        camera = replace(assumed(pair.two_view.K[0, 0] * factor), log_sigma=0.0, knowledge=Knowledge.GIVEN)
        view = edge(camera, TURNED).two_view
        # the picture of a plumb line at the target's right end, in the reference's frame
        ends = [view.R.T @ np.linalg.inv(view.K_prime) @ (SIZE[0] - 1, y, 1) for y in (445.0, 455.0)]
        leaning.append(np.degrees(np.arctan2(ends[1][0] / ends[1][2] - ends[0][0] / ends[0][2],
                                             ends[1][1] / ends[1][2] - ends[0][1] / ends[0][2])))  # fmt: skip
    off = max(abs(leaning[0] - leaning[1]), abs(leaning[2] - leaning[1]))
    assert 0.2 * off < doubt.lean_deg < 5 * off + 0.5


def test_nothing_is_said_where_it_would_not_be_seen_or_something_is_known() -> None:
    pair = edge(assumed(), TURNED)
    assert FocalDoubt(0.17, WARNING.lean_deg / 2).warnings((assumed(), assumed()), pair) == []
    exif = replace(assumed(FOCAL), log_sigma=INTRINSICS.exif_sigma, knowledge=Knowledge.EXIF)
    assert FocalDoubt(0.17, 5.0).warnings((exif, exif), pair) == []
    assert FocalDoubt(0.17, np.nan).warnings((assumed(), assumed()), pair) == []


@pytest.mark.parametrize("model", ["rotation", "plane"])
def test_without_a_pose_nothing_is_known(model: str) -> None:
    pair = edge(assumed(), TURNED)
    pair = replace(pair, two_view=replace(pair.two_view, model=model))
    doubt = focal_doubt((assumed(), assumed()), pair, CANVAS)
    assert np.isnan(doubt.off) and np.isnan(doubt.lean_deg)
