"""Smoothing that stops at edges."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.dense.edge_aware_smoothing import Smoother, edge_weights


def halves(shape: tuple[int, int] = (40, 60)) -> np.ndarray:
    """A guide with one edge in the middle."""
    guide = np.zeros((*shape, 3), np.float32)
    guide[:, shape[1] // 2 :] = 100
    return guide


def test_noise_goes_and_the_edge_stays() -> None:
    guide = halves()
    truth = np.where(guide[..., 0] > 0, 5.0, -5.0).astype(np.float32)
    noisy = truth + np.random.default_rng(1).normal(0, 1, truth.shape).astype(np.float32)
    out = Smoother.of(edge_weights(guide, 4.0), 50.0).smoothed(noisy, np.ones_like(noisy))
    assert np.abs(out - truth).max() < 0.6 < np.abs(noisy - truth).std()
    assert out[:, 30].min() - out[:, 29].max() > 9


def test_what_nobody_knows_is_filled_from_its_own_side() -> None:
    guide = halves()
    known = np.zeros(guide.shape[:2], np.float32)
    known[:, :10] = known[:, 50:] = 1
    values = np.where(np.arange(60) < 30, 2.0, 8.0).astype(np.float32)[None].repeat(40, 0) * known
    out = Smoother.of(edge_weights(guide, 4.0), 1000.0).smoothed(values, known)
    np.testing.assert_allclose(out[:, 10:28], 2.0, atol=0.05)
    np.testing.assert_allclose(out[:, 32:50], 8.0, atol=0.05)


def test_confidence_weighs() -> None:
    values = np.zeros((20, 20), np.float32)
    values[10, 10] = 100.0
    doubt = np.ones_like(values)
    doubt[10, 10] = 1e-4
    smoother = Smoother.of(edge_weights(np.zeros((20, 20, 1), np.float32), 4.0), 5.0)
    doubted, believed = (smoother.smoothed(values, c).max() for c in (doubt, np.ones_like(values)))
    assert doubted < 0.1 < believed


def test_a_constant_stays_and_rows_and_columns_are_alike() -> None:
    guide = np.random.default_rng(2).uniform(0, 50, (30, 30, 3)).astype(np.float32)
    weights = edge_weights(guide, 6.0)
    one = np.ones((30, 30), np.float32)
    np.testing.assert_allclose(Smoother.of(weights, 9.0).smoothed(3 * one, one), 3.0, rtol=1e-4)
    flat = edge_weights(np.zeros((41, 41, 1), np.float32), 6.0)
    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 1
    out = Smoother.of(flat, 20.0).smoothed(point, np.ones_like(point))
    np.testing.assert_allclose(out, out.T, atol=2e-3)
    assert abs(out.sum() - 1) < 0.05


def test_one_pass_solves_the_systems_of_rows_and_of_columns() -> None:
    """Against dense matrices."""
    rng = np.random.default_rng(4)
    values = rng.normal(size=(7, 9)).astype(np.float32)
    across, down = (rng.uniform(0, 30, shape).astype(np.float32) for shape in ((7, 8), (6, 9)))

    def solved(lines: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Each column of lines (n, m) by its own system."""
        out = np.empty_like(lines)
        for k, w in enumerate(1.5 * 2.0 / 3 * weight.T.astype(float)):
            step = np.diff(np.eye(len(lines)), axis=0)
            out[:, k] = np.linalg.solve(np.eye(len(lines)) + step.T @ (w[:, None] * step), lines[:, k])
        return out

    expected = solved(solved(values.T.astype(float), across.T).T, down)
    found = Smoother.of((across, down), 2.0, passes=1).smoothed(values, np.ones_like(values), floor=0.0)
    np.testing.assert_allclose(found, expected, atol=1e-5)
