"""APAP: near matches decide, γ says how much the others count."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.field.strict import fit_strict
from edf_stitch.core.rivals.apap import fit_apap
from edf_stitch.core.rivals.homography import direct_linear
from edf_stitch.core.rivals.options import APAP

from ..field.test_strict import SIDE, SIZE, curved, some_matches


@pytest.fixture(scope="module")
def matches() -> Matches:
    x, y, _ = some_matches(SIDE, curved, 200, 0.3)
    return Matches(x, y)


def test_with_all_weights_alike_it_is_the_homography(matches: Matches) -> None:
    strict = fit_strict(SIDE, matches, SIZE, SIZE)
    whole = project(homogeneous(matches.x) @ direct_linear(*_kept(matches, strict)).T)
    gammas = (APAP.gamma, 0.1, 0.5, 1.0)
    off = [np.abs(fit_apap(strict, matches, gamma=g).predict(matches.x) - whole).max() for g in gammas]
    assert off[-1] < 1e-6 and off == sorted(off, reverse=True) and off[0] > 3
    assert np.abs(fit_apap(strict, matches, sigma=1e7).predict(matches.x) - whole).max() < 1e-3


def test_a_point_has_the_homography_that_its_weights_give(matches: Matches) -> None:
    """The moving direct linear transformation, point by point, by singular values as the paper has it."""
    strict = fit_strict(SIDE, matches, SIZE, SIZE)
    x, y, _ = _kept(matches, strict)
    sigma = APAP.sigma * np.sqrt(SIZE[0] * SIZE[1])
    for point in ((500.0, 300.0), (800.0, 600.0)):
        weight = np.maximum(np.exp(-((x - point) ** 2).sum(axis=1) / sigma**2), APAP.gamma)
        T, T_prime = (_similarity(p) for p in (x, y))
        a, b = homogeneous(x) @ T.T, homogeneous(y) @ T_prime.T
        rows = np.vstack([
            np.hstack([np.zeros_like(a), -a, b[:, 1:2] * a]), np.hstack([a, np.zeros_like(a), -b[:, :1] * a])
        ])  # fmt: skip
        h = np.linalg.svd(np.r_[weight, weight][:, None] * rows)[2][-1].reshape(3, 3)
        expected = project(homogeneous(np.array(point)) @ (np.linalg.inv(T_prime) @ h @ T).T)
        assert np.abs(fit_apap(strict, matches).predict(np.array([point])) - expected).max() < 1e-6


def test_far_from_all_matches_it_is_the_homography(matches: Matches) -> None:
    strict = fit_strict(SIDE, matches, SIZE, SIZE)
    far = np.array([[2600.0, 450.0], [600.0, -900.0]])
    expected = project(homogeneous(far) @ direct_linear(*_kept(matches, strict)).T)
    assert np.abs(fit_apap(strict, matches).predict(far) - expected).max() < 1e-6


def test_weights_of_matches_count() -> None:
    x = np.stack(np.meshgrid(np.linspace(0, 1100, 12), np.linspace(0, 800, 9)), axis=-1).reshape(-1, 2)
    x = np.vstack([x, x + 3])
    y = x + np.where(np.arange(len(x))[:, None] < len(x) // 2, 4.0, -4.0)
    heavy = np.where(np.arange(len(x)) < len(x) // 2, 1e6, 1.0)
    sent = fit_apap(fit_strict(SIDE, Matches(x, y, given=True), SIZE, SIZE), Matches(x, y, weight=heavy, given=True))
    assert np.abs(sent.predict(x[:50]) - x[:50] - 4.0).max() < 0.1


def _kept(matches: Matches, strict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    few = matches.subset(strict.fit.inliers_used)
    return few.x, few.y, few.weights


def _similarity(points: np.ndarray) -> np.ndarray:
    centre = points.mean(axis=0)
    s = np.sqrt(2) / np.linalg.norm(points - centre, axis=1).mean()
    return np.array([[s, 0, -s * centre[0]], [0, s, -s * centre[1]], [0, 0, 1]])
