"""APAP, as-projective-as-possible stitching with moving direct linear transformation (Zaragoza et al., CVPR 2013).

Every point p has its own homography, fitted to all matches with weights max(exp(−|p − x_i|²/σ²), γ): near matches
dominate, and far from all of them γ leaves the global homography (eq. 9 to 13).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import LEAST_AHEAD, homogeneous
from ..cameras.two_view import TwoView
from ..field.field import FieldValues, Fit
from ..field.options import FADE
from ..field.strict import StrictField
from ..raster.arrays import Array
from ..raster.grid import Grid
from .homography import LinearEquations, direct_linear, knowing_only
from .options import APAP


@dataclass(frozen=True)
class ApapField:
    """x' = π(H(p) p).

    two_view: with the global homography in place of H_inf; equations: of the matches; sigma, gamma: σ px and γ.
    """

    two_view: TwoView
    equations: LinearEquations
    sigma: float
    gamma: float
    fit: Fit

    name = "apap"

    @property
    def plane(self) -> Array:
        """0 (3,): it ends in the global homography."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H p), finite everywhere, at a grid's nodes; d is NaN."""
        points = (grid.points if ideal is None else ideal).reshape(-1, 2)
        start = _in_front(homogeneous(points) @ self.two_view.H_inf.T)
        shape = grid.points.shape
        return FieldValues(np.full(shape[:2], np.nan), (self.predict(points) - start).reshape(shape))

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px."""
        out = np.empty((len(points), 2))
        rows = max(1, APAP.weights_at_once // len(self.equations.x))
        for start in range(0, len(points), rows):
            p = points[start : start + rows]
            H = self.equations.solutions(self._weights(p) ** 2)
            out[start : start + rows] = _in_front(np.einsum("mij,mj->mi", H, homogeneous(p)))
        return out

    def refitted(self, matches: Matches) -> ApapField:
        """The field fitted to other matches, none dropped. Raises DegenerateGeometry."""
        return _field(self.two_view, matches, self.sigma, self.gamma, np.full(len(matches), True))

    def _weights(self, points: Array) -> Array:
        """Weights (N, M) of the M matches at points (N, 2) px."""
        x = self.equations.x
        distance2 = np.subtract.outer(points[:, 0], x[:, 0]) ** 2 + np.subtract.outer(points[:, 1], x[:, 1]) ** 2
        return np.asarray(np.maximum(np.exp(-distance2 / self.sigma**2), self.gamma))


def fit_apap(strict: StrictField, matches: Matches, sigma: float | None = None, gamma: float = APAP.gamma) -> ApapField:
    """Fits APAP to the matches of the strict field: it has no defence of its own against outliers.

    Parameters
    ----------
    strict : StrictField
    matches : Matches
        The matches that `strict` was given, ideal px.
    sigma : float, optional
        σ in px; from the picture's size if not given.
    gamma : float

    Returns
    -------
    ApapField

    Raises
    ------
    DegenerateGeometry
        The matches do not determine a homography.
    """
    sigma = APAP.sigma * float(np.sqrt(strict.size[0] * strict.size[1])) if sigma is None else sigma
    return _field(strict.two_view, matches, sigma, gamma, strict.fit.inliers_used)


def _field(
    two_view: TwoView, matches: Matches, sigma: float, gamma: float, inliers_used: NDArray[np.bool_]
) -> ApapField:
    """The field of the matches that the mask inliers_used (N,) selects."""
    used = matches.subset(inliers_used)
    equations = LinearEquations.of(used.x, used.y, used.weights)
    view = knowing_only(two_view, direct_linear(used.x, used.y, used.weights))
    fit = Fit(inliers_used, np.nan, FADE.min_px * matches.scale, np.nan, np.nan, np.nan)
    field = ApapField(view, equations, sigma, gamma, fit)
    rms = float(np.sqrt(np.mean(np.sum((field.predict(used.x) - used.y) ** 2, axis=1))))
    return replace(field, fit=replace(field.fit, residual_px=rms))


def _in_front(rays: Array) -> Array:
    """π of rays (N, 3); rays behind the camera are projected as if just in front of it, far outside the picture."""
    least = LEAST_AHEAD * np.abs(rays[:, :2]).max(axis=1)
    result: Array = rays[:, :2] / np.maximum(rays[:, 2], np.maximum(least, 1e-300))[:, None]
    return result
