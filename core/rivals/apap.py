"""APAP, as-projective-as-possible stitching with moving direct linear transformation (Zaragoza et al., CVPR 2013).

Every point p has a homography of its own, that of all matches with weights max(exp(−|p − x_i|²/σ²), γ): near matches
decide, and where there are none γ leaves what all of them agree on (eq. 9 to 13).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous
from ..cameras.two_view import TwoView
from ..field.field import FieldValues, Fit
from ..field.options import FADE
from ..field.strict import StrictField
from ..raster.arrays import Array
from ..raster.grid import Grid
from .homography import LinearEquations, direct_linear, knowing_only
from .options import APAP

# Nothing is shown of what lies less than this in front of the target camera, relative to its lengths.
LEAST_AHEAD = 1e-6


@dataclass(frozen=True)
class ApapField:
    """x' = π(H(p) p); two_view: the homography of all matches alike in the place of H_inf; sigma: σ in px."""

    two_view: TwoView
    equations: LinearEquations
    sigma: float
    gamma: float
    fit: Fit

    name = "apap"

    @property
    def plane(self) -> Array:
        """It ends in the homography of all matches."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H p), finite everywhere, at a grid's nodes; no depth."""
        points = (grid.points if ideal is None else ideal).reshape(-1, 2)
        start = _in_front(homogeneous(points) @ self.two_view.H_inf.T)
        shape = grid.points.shape
        return FieldValues(np.full(shape[:2], np.nan), (self.predict(points) - start).reshape(shape))

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2)."""
        out = np.empty((len(points), 2))
        rows = max(1, APAP.weights_at_once // len(self.equations.x))
        for start in range(0, len(points), rows):
            p = points[start : start + rows]
            H = self.equations.solutions(self._weights(p) ** 2)
            out[start : start + rows] = _in_front(np.einsum("mij,mj->mi", H, homogeneous(p)))
        return out

    def refitted(self, matches: Matches) -> ApapField:
        """The field on other matches, all kept. Raises DegenerateGeometry."""
        return _field(self.two_view, matches, self.sigma, self.gamma, np.full(len(matches), True))

    def _weights(self, points: Array) -> Array:
        x = self.equations.x
        apart = np.subtract.outer(points[:, 0], x[:, 0]) ** 2 + np.subtract.outer(points[:, 1], x[:, 1]) ** 2
        return np.maximum(np.exp(-apart / self.sigma**2), self.gamma)


def fit_apap(strict: StrictField, matches: Matches, sigma: float | None = None, gamma: float = APAP.gamma) -> ApapField:
    """APAP on the matches that the strict field stands on: outliers would each have their own place in the picture.

    sigma in px, from the picture's size where it is not given. Raises DegenerateGeometry.
    """
    sigma = APAP.sigma * float(np.sqrt(strict.size[0] * strict.size[1])) if sigma is None else sigma
    return _field(strict.two_view, matches, sigma, gamma, strict.fit.inliers_used)


def _field(two_view: TwoView, matches: Matches, sigma: float, gamma: float, kept: NDArray[np.bool_]) -> ApapField:
    few = matches.subset(kept)
    equations = LinearEquations.of(few.x, few.y, few.weights)
    view = knowing_only(two_view, direct_linear(few.x, few.y, few.weights))
    fit = Fit(kept, np.nan, FADE.min_px * matches.scale, np.nan, np.nan, np.nan)
    field = ApapField(view, equations, sigma, gamma, fit)
    rms = float(np.sqrt(np.mean(np.sum((field.predict(few.x) - few.y) ** 2, axis=1))))
    return replace(field, fit=replace(field.fit, residual_px=rms))


def _in_front(rays: Array) -> Array:
    """π of rays (N, 3), those that run behind the camera or close by as if they were just in front: far outside."""
    least = LEAST_AHEAD * np.abs(rays[:, :2]).max(axis=1)
    return rays[:, :2] / np.maximum(rays[:, 2], np.maximum(least, 1e-300))[:, None]
