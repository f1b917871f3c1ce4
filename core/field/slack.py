"""The slack field: the strict one, and a stiff spline of what the matches leave across their lines.

x' = π(H_inf p + d e') + s(p) (docs/method.md, 4). It buys back what lens distortion and errors in F cost; outside the
overlap s fades to nothing, and the field keeps to its epipolar lines. How stiff it is the matches decide: where they
tell of nothing but noise, there is no slack at all.
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
from .spline import SmoothingProblem, ThinPlateSpline
from .strict import StrictField, robust_mean

# λ of s in units of that of the strict field's spline, at least, and of W·H: the lens bends more slowly than the scene.
STIFFER = 10.0
LADDER = 10.0 ** np.arange(-5.0, 2.01, 0.5)
# Slack has to lower the mean square of what is left out by this share: less is chance.
GAIN = 0.03
# Matches that decide about λ: their number hardly moves it, and the time goes with its cube.
DECIDING = 500
# s is nowhere longer than this times what 98 % of the matches ask for: a spline knows no bounds away from them.
MOST = 2.0
# Width of the fade in units of what fades, so that straight lines bend by little; px at least, in the matches' unit.
FADE, LEAST_FADE = 10.0, 16.0


@dataclass(frozen=True)
class SlackField:
    """The strict field and s(p): a spline of two components in target px at its own λ (infinite: none).

    slack_px: how far the lines may be left at most; fade_px: the width over which that ends outside the overlap.
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
        """How the strict field came about."""
        return self.strict.fit

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Inverse depth and shift at a grid's nodes; ideal: see StrictField."""
        bend, mine = self.strict.spline, self.spline
        if not len(bend.centres) or not len(mine.centres):
            slack, bent = on_nodes(mine, grid, ideal), None
        else:  # both stand on the same centres: their kernel, which is what costs time, is worked out once
            weights, affine = (
                np.column_stack(both) for both in ((mine.weights, bend.weights), (mine.affine, bend.affine))
            )
            values = on_nodes(replace(mine, weights=weights, affine=affine), grid, ideal)
            slack, bent = values[..., :2], values[..., 2]
        inverse_depth, away = self.strict.with_fade(grid, ideal, bent)
        alpha = fading(away, self.fade_px)[..., None]
        return FieldValues(inverse_depth, alpha * self._bounded(slack), self.strict.far)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades."""
        return self.strict.predict(points) + self._bounded(self.spline.at(points))

    def refitted(self, matches: Matches) -> SlackField:
        """Both parts on other matches of the pair, all kept, at the same λ. Raises DegenerateGeometry."""
        return _on_matches(self.strict.refitted(matches), matches, self.smoothing)

    def _bounded(self, slack: Array) -> Array:
        length = np.linalg.norm(slack, axis=-1, keepdims=True)
        return slack * (self.slack_px / np.maximum(length, max(self.slack_px, 1e-300)))


def fit_slack(strict: StrictField, matches: Matches) -> SlackField:
    """Slack for a strict field, from the matches that it was fitted to.

    λ is what leave-one-out likes best of all that are STIFFER than the strict spline's; infinite where it likes none
    much better than no slack.
    """
    kept = matches.subset(strict.fit.inliers_used)
    few = kept.thinned(DECIDING)
    left = _left_across(strict, few)
    ladder = np.maximum(LADDER, STIFFER * strict.fit.smoothing)
    problem = _problem(strict, few)
    errors = np.linalg.norm(problem.held_out(left, ladder), axis=-1)
    *score, none = robust_mean(np.vstack([errors, np.linalg.norm(left, axis=1)]))
    best = int(np.argmin(score))
    return _on_matches(strict, kept, float(ladder[best]) if score[best] < (1 - GAIN) * none else np.inf)


def _on_matches(strict: StrictField, matches: Matches, smoothing: float) -> SlackField:
    """Slack of all of some matches at a λ; infinite for none."""
    if np.isinf(smoothing):
        none = ThinPlateSpline(np.empty((0, 2)), np.empty((0, 2)), np.zeros((3, 2)), np.zeros(2), 1.0)
        return SlackField(strict, none, smoothing, 0.0, LEAST_FADE * matches.scale)
    spline = _problem(strict, matches).solve(_left_across(strict, matches), smoothing)[0]
    slack_px = MOST * float(np.percentile(np.linalg.norm(spline.at(matches.x), axis=1), 98))
    return SlackField(strict, spline, smoothing, slack_px, max(FADE * slack_px, LEAST_FADE * matches.scale))


def _problem(strict: StrictField, matches: Matches) -> SmoothingProblem:
    unit = float(np.sqrt(strict.size[0] * strict.size[1]))
    # in the strict field's own coordinates, so that one kernel serves both
    centre = strict.spline.centre if len(strict.spline.centres) else None
    return SmoothingProblem.build(matches.x, 1 / np.sqrt(matches.weights), unit, centre)


def _left_across(strict: StrictField, matches: Matches) -> Array:
    """What the strict field leaves of matches across its lines, (N, 2) px; all of it where there are no lines.

    Along them d says where a point lies; a rim of depth that its spline smooths away is no error of the lens.
    """
    sent = strict.predict(matches.x)
    left = matches.y - sent
    left = np.where(np.isfinite(left), left, 0.0)  # bent behind the camera: nothing to say
    e = strict.two_view.e_prime
    if not e.any():
        return left
    line = np.cross(homogeneous(np.where(np.isfinite(sent), sent, 0.0)), e)
    normal = line[:, :2] / np.maximum(np.linalg.norm(line[:, :2], axis=1, keepdims=True), 1e-300)
    return np.sum(left * normal, axis=1, keepdims=True) * normal
