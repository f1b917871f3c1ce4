"""What was chosen in fitting a field and reading its maps, stage by stage: each value with its unit, and why it is what
it is.

May import nothing of the project but raster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..raster.arrays import Array


@dataclass(frozen=True)
class StrictOptions:
    """Fitting inverse depth to matches (`strict`). px are in units of the matches' scale."""

    max_centres: int = 1000
    """Matches that the spline stands on at most: its time grows with their cube, its quality hardly with more."""

    min_centres: int = 8
    """Matches below which no field is fitted: a plane takes three, and leave-one-out needs some to spare."""

    thinning_cells: float = 200.0
    """Where matches are thinned: cells along the side √(W·H) of the picture that keep one match each, to begin with."""

    initial_smoothing: float = 1e-3
    """λ, in units of W·H of the reference, of the first spline, by which gross errors are found: stiff enough that
    they stand out."""

    smoothing_decades: tuple[float, float] = (-3.0, 2.0)
    """Powers of ten, relative to `initial_smoothing`, between which leave-one-out looks for the best λ, by halves."""

    gross_error_sigmas: float = 10.0
    """Robust standard deviations of the leave-one-out errors beyond which a match is a gross error."""

    outlier_sigmas: float = 3.0
    """Standard deviations of the residuals beyond which a match is an outlier: the usual three."""

    outlier_floor_px: float = 1.0
    """px: an error this small is never an outlier, whatever the standard deviation; keypoints lie no better."""

    neighbours: int = 8
    """Nearest matches that a match is compared with before it is dropped."""

    agreeing_neighbours: int = 3
    """Neighbours that have to agree with a match to protect it: fewer happen by chance, and small objects have few."""

    noise_floor_px: float = 0.1
    """px: the noise of the matches is never taken to be smaller where a plane is fitted."""

    plane_noise_px: float = 0.3
    """px: real surfaces are flat to this much at least where a plane to continue is sought."""

    min_relative_sensitivity: float = 1e-3
    """px per unit of d, relative to the median match: below, the line is seen end-on and says nothing about d."""

    @property
    def smoothing_ladder(self) -> Array:
        """The λ (n,) that leave-one-out chooses from."""
        return decades(*self.smoothing_decades) * self.initial_smoothing


@dataclass(frozen=True)
class SlackOptions:
    """Fitting what matches leave across their epipolar lines (`slack`)."""

    min_relative_smoothing: float = 10.0
    """λ at least, in units of the strict spline's λ: the lens bends more slowly than the scene."""

    smoothing_decades: tuple[float, float] = (-5.0, 2.0)
    """Powers of ten between which λ, in units of W·H, is looked for, by halves: from hardly any smoothing to almost a
    plane."""

    min_gain: float = 0.03
    """Share by which slack has to lower the mean square of the leave-one-out errors: less is chance."""

    deciding_matches: int = 500
    """Matches that decide about λ: more hardly move it, and the time goes with their cube."""

    max_length: float = 2.0
    """The longest slack, in units of the 98th percentile over the matches: a spline knows no bounds away from them."""

    fade_length: float = 10.0
    """Width of the fade outside the overlap, in units of the longest slack: straight lines bend by little over that."""

    min_fade_px: float = 16.0
    """px of that width at least, in units of the matches' scale."""

    @property
    def smoothing_ladder(self) -> Array:
        """The λ (n,) that leave-one-out chooses from."""
        return decades(*self.smoothing_decades)


@dataclass(frozen=True)
class SplineOptions:
    """Evaluating thin-plate splines (`spline`)."""

    kernel_values_at_once: int = 2_000_000
    """Kernel values that are held in memory at once: 16 MB in float64. Results do not depend on it."""

    line_values_at_once: int = 200_000
    """The same on a grid, in float32: few enough to stay in the processor's cache, which halves the time."""

    points_at_once: int = 10_000
    """Points whose nearest centre is sought before somebody may ask to stop: some hundredths of a second."""


@dataclass(frozen=True)
class RefinedOptions:
    """Sampling what dense refinement found (`refined_depth`)."""

    together_nodes: int = 4_000_000
    """Nodes of which a copy is kept with all values side by side: 64 MB. Of more, each value is sampled by itself."""


@dataclass(frozen=True)
class PlaneOptions:
    """The plane that a field continues as outside the overlap (`plane`)."""

    draws: int = 400
    """Planes through three matches that are tried: one that holds a fifth of the area is then met with 96 %."""

    nearby: float = 0.2
    """Share of the picture's side over which the say of a match falls by e with its distance from where the target
    goes on."""

    cell: float = 1 / 16
    """Share of the picture's side of the cells in which all matches together count as one: area counts, not texture."""

    target_nodes: int = 24
    """Points along each side of the target that say where it goes on beyond the reference."""

    max_reweightings: int = 50
    """Reweighted least-squares steps at most: a guard, they end where the plane no longer changes."""


@dataclass(frozen=True)
class FadeOptions:
    """How a field fades outside the overlap (`fade`)."""

    length: float = 5.0
    """Width of the fade in units of how far the field moves its matches (98th percentile): it falls by at most
    0.3 px a px then, and cannot fold."""

    min_px: float = 8.0
    """px of that width at least, in units of the matches' scale."""


@dataclass(frozen=True)
class VisibilityOptions:
    """What a picture cannot see (`visibility`)."""

    coarsest_level: int = 4
    """log2 of the largest side, in px, of the z-buffer's cells: they are as wide as the canvas samples the picture."""

    sampling_margin: float = 1.1
    """Factor by which that sampling may exceed a cell before a coarser one is taken."""

    surface_cells: float = 1.45
    """Cells that the map may stray between two points that share one, if these lie on one surface: its diagonal."""

    between: tuple[float, ...] = (0.25, 0.5, 0.75)
    """Places between the two, as shares of the way, where that is looked at."""

    block_level: int = 4
    """log2 of the side, in px, of the blocks that folds are known to: with its neighbours, wider than any cell."""

    strip_pixels: int = 125_000
    """Pixels that a thread looks at at once: what is worked out of them stays in the processor's cache. No result
    depends on it."""

    agreed_confidence: float = 0.5
    """Confidence (0..1) of dense refinement above which both pictures see a point."""

    alone_confidence: float = 0.3
    """The same below which only one of them does, if it lies beside what the depth order says is hidden."""

    max_growth: float = 1 / 200
    """Share of the picture's longer side by which what is hidden may reach beyond what the depth order says."""


@dataclass(frozen=True)
class FoldingOptions:
    """Where a map turns over (`folding`)."""

    hidden_margin_px: int = 3
    """px around what is hidden in which folds do not count: occlusion is known to this much."""

    strip_pixels: int = 2_000_000
    """Pixels that a thread looks at at once. No result depends on it."""


@dataclass(frozen=True)
class CarryOptions:
    """A surface seen from another place (`carried_surface`)."""

    rounding: float = 1e-6
    """Nodes by which a point may lie before a node that it lies on."""

    same_surface_px: float = 1.5
    """px of parallax within which what a ray shows lies on the surface that is known around it."""

    jump_px: float = 6.0
    """px of parallax between neighbours, with `jump_share` of the nearer one's, from which they lie on two surfaces."""

    jump_share: float = 0.06
    """See `jump_px`: what is near has steeper slopes."""

    jump_side: int = 7
    """px, side of the square in which depth differs hardly more at a jump than between neighbours."""

    jump_growth: float = 2.0
    """Times that it differs more there: on a steep surface it is three times."""

    sharpenings: int = 2
    """Rounds in which pixels between two surfaces are given to the nearer in depth; a jump is 2 to 4 px wide."""

    speck_px: int = 5
    """px, side of the median that takes single points out of the surface that they fall on."""

    beside_nodes: int = 64
    """Nodes beyond either end of a sphere that gaps are filled by: it goes on there."""

    widest_gap_px: int = 256
    """px of a gap between two surfaces at most that is filled from the farther one."""

    rounds: int = 2
    """px by which what is left open goes on from around at each size."""

    halvings: int = 6
    """Times that the canvas is halved for what is still open: up to 2 · 2⁶ px wide."""


def decades(low: float, high: float) -> Array:
    """Powers of ten (n,) from 10**low to 10**high, two to each decade."""
    return np.asarray(10.0 ** np.arange(low, high + 0.01, 0.5))


STRICT = StrictOptions()
SLACK = SlackOptions()
SPLINE = SplineOptions()
REFINED = RefinedOptions()
PLANE = PlaneOptions()
FADE = FadeOptions()
VISIBILITY = VisibilityOptions()
FOLDING = FoldingOptions()
CARRY = CarryOptions()
