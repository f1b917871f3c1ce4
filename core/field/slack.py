"""The slack field: the strict field plus a stiff spline of the matches' residuals across their epipolar lines.

x' = π(H_inf p + d e') + s(p) (docs/method.md, 4). It compensates lens distortion that is not modelled and errors of F;
outside the overlap s fades to 0 and the field stays on its epipolar lines. Cross-validation decides how stiff s is:
where the residuals are nothing but noise, s = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.grid import Grid
from .fade import fading, on_nodes
from .field import FieldValues, Fit
from .options import SLACK
from .spline import SmoothingProblem, ThinPlateSpline
from .strict import StrictField, robust_mean


@dataclass(frozen=True)
class SlackField:
    """The strict field plus s(p).

    spline: s before it is bounded, two components in target px; smoothing: its λ, infinite where s = 0; slack_px: the
    length that s is bounded to; fade_px: width of its fade outside the overlap.
    """

    strict: StrictField
    spline: ThinPlateSpline
    smoothing: float
    slack_px: float
    fade_px: float

    name = "slack"

    @property
    def two_view(self) -> TwoView:
        """The strict field's geometry."""
        return self.strict.two_view

    @property
    def plane(self) -> Array:
        """m (3,) of the strict field."""
        return self.strict.plane

    @property
    def fit(self) -> Fit:
        """How the strict field was fitted."""
        return self.strict.fit

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Inverse depth and shift at a grid's nodes; ideal (rows, columns, 2): see `Field.on_grid`."""
        own, depth = self.spline, self.strict.spline
        if not len(depth.centres) or not len(own.centres):
            slack, depth_at_nodes = on_nodes(own, grid, ideal), None
        else:  # both have the same centres: the kernel, which takes the time, is evaluated once
            weights, affine = (
                np.column_stack(both) for both in ((own.weights, depth.weights), (own.affine, depth.affine))
            )
            values = on_nodes(replace(own, weights=weights, affine=affine), grid, ideal)
            slack, depth_at_nodes = values[..., :2], values[..., 2]
        inverse_depth, distance = self.strict.with_fade(grid, ideal, depth_at_nodes)
        alpha = fading(distance, self.fade_px)[..., None]
        return FieldValues(inverse_depth, alpha * self._bounded(slack), self.strict.far)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) in the overlap, where nothing fades."""
        return self.strict.predict(points) + self._bounded(self.spline.at(points))

    def refitted(self, matches: Matches) -> SlackField:
        """Both parts fitted to other matches, none dropped, with the same λ. Raises DegenerateGeometry."""
        return _on_matches(self.strict.refitted(matches), matches, self.smoothing)

    def _bounded(self, slack: Array) -> Array:
        """Slack (…, 2) px, shortened to at most slack_px."""
        length = np.linalg.norm(slack, axis=-1, keepdims=True)
        result: Array = slack * (self.slack_px / np.maximum(length, max(self.slack_px, 1e-300)))
        return result


def fit_slack(strict: StrictField, matches: Matches) -> SlackField:
    """Adds slack to a strict field.

    λ minimises the leave-one-out error of the residuals across the lines, among those at least as stiff as
    `SlackOptions` asks for; there is no slack where it gains too little.

    Parameters
    ----------
    strict : StrictField
    matches : Matches
        The matches that `strict` was given, ideal px of both pictures.

    Returns
    -------
    SlackField
    """
    used = matches.subset(strict.fit.inliers_used)
    deciding = used.thinned(SLACK.deciding_matches)
    residuals = _residuals_across(strict, deciding)
    ladder = np.maximum(SLACK.smoothing_ladder, SLACK.min_relative_smoothing * strict.fit.smoothing)
    errors = np.linalg.norm(_problem(strict, deciding).held_out(residuals, ladder), axis=-1)
    *scores, without = robust_mean(np.vstack([errors, np.linalg.norm(residuals, axis=1)]))
    best = int(np.argmin(scores))
    worthwhile = scores[best] < (1 - SLACK.min_gain) * without
    return _on_matches(strict, used, float(ladder[best]) if worthwhile else np.inf)


def _on_matches(strict: StrictField, matches: Matches, smoothing: float) -> SlackField:
    """Slack fitted to all the given matches with λ = smoothing; infinite: no slack."""
    if np.isinf(smoothing):
        none = ThinPlateSpline(np.empty((0, 2)), np.empty((0, 2)), np.zeros((3, 2)), np.zeros(2), 1.0)
        return SlackField(strict, none, smoothing, 0.0, SLACK.min_fade_px * matches.scale)
    spline = _problem(strict, matches).solve(_residuals_across(strict, matches), smoothing)[0]
    slack_px = SLACK.max_length * float(np.percentile(np.linalg.norm(spline.at(matches.x), axis=1), 98))
    fade_px = max(SLACK.fade_length * slack_px, SLACK.min_fade_px * matches.scale)
    return SlackField(strict, spline, smoothing, slack_px, fade_px)


def _problem(strict: StrictField, matches: Matches) -> SmoothingProblem:
    """The smoothing problem of values at the matches, λ in units of W·H."""
    unit = float(np.sqrt(strict.size[0] * strict.size[1]))
    # in the strict spline's coordinates, so that one kernel serves both
    centre = strict.spline.centre if len(strict.spline.centres) else None
    return SmoothingProblem.build(matches.x, 1 / np.sqrt(matches.weights), unit, centre)


def _residuals_across(strict: StrictField, matches: Matches) -> Array:
    """Residuals (N, 2) px of the strict field across its epipolar lines; whole residuals where there are no lines.

    Along the lines depth explains them: a depth edge that the spline smooths away is no error of the lens.
    """
    predicted = strict.predict(matches.x)
    residual = matches.y - predicted
    residual = np.where(np.isfinite(residual), residual, 0.0)  # predicted behind the camera
    e = strict.two_view.e_prime
    if not e.any():
        return residual
    line = np.cross(homogeneous(np.where(np.isfinite(predicted), predicted, 0.0)), e)
    normal = line[:, :2] / np.maximum(np.linalg.norm(line[:, :2], axis=1, keepdims=True), 1e-300)
    result: Array = np.sum(residual * normal, axis=1, keepdims=True) * normal
    return result
