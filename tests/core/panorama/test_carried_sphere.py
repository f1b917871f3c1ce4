"""Dense inverse range, seen from a viewpoint that slides among N places."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.field.refined_sphere import RefinedSphere
from edf_stitch.core.field.sphere_chart import SphereChart
from edf_stitch.core.panorama.carried_sphere import carried_sphere
from edf_stitch.core.panorama.rig_viewpoint import RigViewpoint

from ..dense.sphere.card_scenes import CARD, HALF, WALL, inverse_range

PLACE = np.array([0.6, 0.0, 0.2])


@pytest.fixture(scope="module")
def refined() -> RefinedSphere:
    chart = SphereChart.whole(np.eye(3), 600)
    rays = chart.all_rays
    d = inverse_range(rays).astype(np.float32)
    return RefinedSphere(chart, d, (rays[..., 2] > 0.5).astype(np.float32), 0 * d + 0.01, rays[..., 2] > 0.05)


def sliding(s1: float) -> RigViewpoint:
    """To one place, whatever the heading."""
    return RigViewpoint(s1, np.eye(3), np.repeat(PLACE[None], 1440, axis=0))


def true_from(place: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Inverse range (…) along rays (…, 3) from another place."""
    ahead = rays[..., 2]
    card = place[:2] + rays[..., :2] * ((CARD - place[2]) / ahead)[..., None]
    hit = (np.abs(card) < HALF).all(axis=-1)
    return ahead / np.where(hit, CARD - place[2], WALL - place[2])


@pytest.mark.parametrize("s1", [0.5, 1.0])
def test_the_card_hides_another_part_of_the_wall_from_there(refined: RefinedSphere, s1: float) -> None:
    carried = carried_sphere(refined, sliding(s1))
    chart = refined.chart
    rows, columns = np.arange(200, 400.0), np.arange(500, 700.0)
    rays = chart.rays(rows, columns)
    found = carried.inverse_range[200:400, 500:700]
    off = np.abs(found - true_from(s1 * PLACE, rays)) * chart.per_radian
    assert np.percentile(off, 95) < 0.05
    # what the card uncovers is the wall's
    assert (off < 1).mean() > 0.985


def test_a_viewpoint_that_stays_changes_nothing_but_the_jumps(refined: RefinedSphere) -> None:
    same = carried_sphere(refined, sliding(0.0))
    inner = np.s_[200:400, 500:700]
    off = np.abs(same.inverse_range - refined.inverse_range)[inner] * refined.chart.per_radian
    # a point covers the cells around it, so that slopes move by up to a node
    assert (off < 0.1).mean() > 0.98


def test_confidence_goes_along(refined: RefinedSphere) -> None:
    carried = carried_sphere(refined, sliding(1.0))
    assert carried.confidence[300, 600] > 0.99 and carried.confidence[300, 0] < 0.01


def test_the_sphere_goes_on_behind(refined: RefinedSphere) -> None:
    behind = np.diag([-1.0, 1.0, -1.0])
    turned = RefinedSphere(
        SphereChart.whole(behind, 600), refined.inverse_range, refined.confidence, refined.deviation, refined.shown
    )  # fmt: skip
    back = RigViewpoint(1.0, behind, np.repeat((PLACE @ behind)[None], 1440, axis=0))
    first, second = carried_sphere(refined, sliding(1.0)), carried_sphere(turned, back)
    assert np.abs(first.inverse_range - second.inverse_range)[200:400, 500:700].max() < 1e-4
