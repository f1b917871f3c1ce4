"""What was chosen in fitting a field on the sphere: each value with its unit, and why it is what it is.

Angles are in units of the side √(W·H) / f of the middle picture, in radians: long lenses see smaller things.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..raster.arrays import Array
from .options import decades


@dataclass(frozen=True)
class SphereOptions:
    """Fitting inverse range to the points of N pictures (`sphere_field`). px are those of a picture with a longest side
    of `usual_side`."""

    max_centres: int = 1500
    """Points that the spline stands on at most: its time grows with their cube, its quality hardly with more."""

    min_centres: int = 8
    """Points below which no field is fitted, and all is taken to be infinitely far."""

    usual_side: float = 1500.0
    """px: features are sought on pictures of about this size, and are less precise on larger ones."""

    spacing: float = 1 / 200
    """Where points are thinned: the side of the cells that keep one point each, to begin with."""

    max_error_px: float = 4.0
    """px by which a point may be off in the worst of its pictures."""

    min_relative_sensitivity: float = 0.005
    """px per unit of inverse range, relative to the median point: below, a point says nothing about its range. Pictures
    close to the viewpoint have far less than others, and are the only ones there."""

    noise_range: tuple[float, float] = (0.2, 20.0)
    """Bounds of a point's noise relative to the median point's: a few points with long baselines shall not decide."""

    judging_smoothings: tuple[float, ...] = (1e-3, 1e-5)
    """λ of the splines that gross errors are found by: only what stands out from all is one. From a stiff one things in
    front of others stand out too, and beside what a flexible one follows well so do all edges of depth."""

    smoothing_decades: tuple[float, float] = (-7.0, -1.0)
    """Powers of ten between which leave-one-out looks for the best λ, by halves: from hardly any smoothing to almost a
    plane."""

    gross_error_medians: float = 10.0
    """Medians of the leave-one-out errors beyond which a point is a gross error."""

    gross_error_floor_px: float = 3.0
    """px: an error this small is never one."""

    neighbours: int = 8
    """Nearest points that a point is compared with before it is dropped."""

    agreeing_neighbours: int = 3
    """Neighbours that have to agree with a point to protect it: fewer happen by chance, and small things have few."""

    agreement_px: float = 2.0
    """px within which neighbours agree."""

    fade_reach: float = 0.15
    """Distance from the nearest point where what the spline says begins to fade."""

    fade: float = 0.3
    """Distance over which it fades to what anchors hold."""

    anchor_spacing: float = 0.15
    """Distance between the anchors that hold d where no points are."""

    anchor_reach: float = 2.0
    """Spacings of the anchors beside all points beyond which there are any: so far a spline continues well."""

    anchor_stiffness: float = 0.3
    """Distance over which d goes over from what the last points say to what the anchors do."""

    anchor_neighbours: int = 20
    """Nearest points whose median inverse range an anchor has."""

    anchor_margin: float = 0.2
    """Share of a picture's longer side around it within which there are anchors."""

    outer_percents: tuple[float, float] = (0.5, 99.5)
    """Percentiles of the points' inverse range that bound the field's, the upper one times `nearest`."""

    nearest: float = 1.5
    """Times that percentile that the field may come near."""

    doubt_reach: float = 0.1
    """Distance over which the errors of points around a ray tell how sure the field is there."""

    values_at_once: int = 2_000_000
    """Values of weights that are held in memory at once: 16 MB. Results do not depend on it."""

    deep_px: float = 2.0
    """px of leave-one-out error, in the median, beyond which the scene is too deep for the points that were found."""

    @property
    def smoothing_ladder(self) -> Array:
        """The λ (n,) that leave-one-out chooses from."""
        return decades(*self.smoothing_decades)


@dataclass(frozen=True)
class SphereSlackOptions:
    """What each picture's own points leave (`sphere_slack`). px as in `SphereOptions`."""

    max_centres: int = 500
    """Points that the spline of one picture stands on at most."""

    min_centres: int = 20
    """Points below which a picture has no slack."""

    gross_error_px: float = 40.0
    """px beyond which what is left is an error of matching."""

    outlier_sigmas: float = 3.0
    """Standard deviations of the spline's residuals beyond which a point is dropped: the usual three."""

    outlier_floor_px: float = 1.0
    """px: a residual this small is never dropped."""

    smoothing_decades: tuple[float, float] = (-5.0, 0.0)
    """Powers of ten between which leave-one-out looks for the best λ, by halves."""

    min_gain: float = 0.03
    """Share by which slack has to lower the mean square of the leave-one-out errors: less is chance."""

    max_px: float = 12.0
    """px that slack may move a pixel at most."""

    reach: float = 0.1
    """Distance from the nearest point where slack begins to fade."""

    fade: float = 0.3
    """Distance over which it fades."""

    @property
    def smoothing_ladder(self) -> Array:
        """The λ (n,) that leave-one-out chooses from."""
        return decades(*self.smoothing_decades)


SPHERE = SphereOptions()
SPHERE_SLACK = SphereSlackOptions()
