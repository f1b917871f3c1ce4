"""The slack field: the strict one, and a stiff two-component spline of what the matches leave across their lines.

x' = π(H_inf p + d e') + s(p) (DESIGN 1, "Slack"). It buys back what lens distortion and errors in F cost; outside the
overlap s fades to nothing, and the field keeps to its epipolar lines.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .canvas import Grid
from .displacement import FieldValues, Fit, StrictField, on_nodes
from .epipolar import Array
from .features import Matches
from .spline import SmoothingProblem, ThinPlateSpline
from .two_view import TwoView

# s is so much smoother than the strict field's spline.
STIFFER = 10.0


@dataclass(frozen=True)
class SlackField:
    """The strict field and s(p): a spline of two components in target px."""

    strict: StrictField
    spline: ThinPlateSpline

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
        if not len(bend.centres):
            slack, bent = on_nodes(mine, grid, ideal), None
        else:  # both stand on the same centres: their kernel, which is what costs time, is worked out once
            weights, affine = (
                np.column_stack(both) for both in ((mine.weights, bend.weights), (mine.affine, bend.affine))
            )
            values = on_nodes(replace(mine, weights=weights, affine=affine), grid, ideal)
            slack, bent = values[..., :2], values[..., 2]
        inverse_depth, alpha = self.strict.with_fade(grid, ideal, bent)
        return FieldValues(inverse_depth, alpha[..., None] * slack, self.strict.far)

    def sends(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades."""
        return self.strict.sends(points) + self.spline.at(points)

    def refitted(self, matches: Matches) -> SlackField:
        """Both parts on other matches of the pair, all kept, at the same λ. Raises DegenerateGeometry."""
        return fit_slack(self.strict.refitted(matches), matches)


def fit_slack(strict: StrictField, matches: Matches) -> SlackField:
    """Slack for a strict field, from the matches that it was fitted to: the same centres, ten times its smoothing."""
    kept = matches.subset(strict.fit.kept)
    left = kept.y - strict.sends(kept.x)
    left = np.where(np.isfinite(left), left, 0.0)  # bent behind the camera: nothing to say
    unit = float(np.sqrt(strict.size[0] * strict.size[1]))
    # in the strict field's own coordinates, so that one kernel serves both
    centre = strict.spline.centre if len(strict.spline.centres) else None
    problem = SmoothingProblem.build(kept.x, 1 / np.sqrt(kept.weights), unit, centre)
    return SlackField(strict, problem.solve(left, STIFFER * strict.fit.smoothing)[0])
