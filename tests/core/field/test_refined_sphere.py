"""What dense refinement found on the sphere, looked up along rays."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.field.refined_sphere import RefinedSphere
from edf_stitch.core.field.sphere_chart import SphereChart


def refined(height: int = 60) -> RefinedSphere:
    """Inverse range that grows with the height of a ray, confidence with its depth."""
    chart = SphereChart.whole(np.eye(3), height)
    rays = chart.rays(np.arange(height, dtype=float), np.arange(2 * height, dtype=float)).astype(np.float32)
    return RefinedSphere(chart, 2 + rays[..., 1], rays[..., 2], 3 - rays[..., 1], np.ones(chart.shape, bool))


def test_values_between_nodes_are_bilinear_all_around() -> None:
    one, random = refined(), np.random.default_rng(0)
    rays = random.normal(size=(40, 50, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays = rays[np.abs(rays[..., 1]) < 0.95][None]
    d, confidence, deviation = one.at(rays)
    assert np.abs(d - 2 - rays[..., 1]).max() < 2e-3
    assert np.abs(confidence - rays[..., 2]).max() < 2e-3
    assert np.abs(deviation - 3 + rays[..., 1]).max() < 2e-3


def test_where_both_ends_meet_there_is_no_gap() -> None:
    one = refined()
    angles = np.pi + np.linspace(-0.1, 0.1, 41)
    rays = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1)[None]
    assert np.abs(one.at(rays)[1] - np.cos(angles)).max() < 2e-3


def test_poles_have_the_nearest_nodes_values() -> None:
    one = refined()
    assert np.abs(one.at(np.array([[[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]]))[0] - [[3, 1]]).max() < 2e-3
