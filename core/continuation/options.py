"""What was chosen in continuing inverse depth beyond the overlap: each value with its unit, and why it is what it is.

Errors are in px of a picture whose longer side has 900 px (see `TargetGrid.sensitivity`), so that no value depends on
the size. Values without a source were chosen on photographs and rendered scenes: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GridOptions:
    """The nodes over the target (`target_grid`), and what is known of them (`samples`)."""

    nodes: int = 64
    """Nodes along the target's longer side: surfaces are simple, and a solution takes time with their square."""

    margin: float = 0.12
    """Share of the longer side by which the nodes reach over the target's border, so that nothing is extrapolated."""

    side_px: float = 900.0
    """px of the longer side in which errors are measured."""

    min_sensitivity: float = 0.15
    """Share of the greatest px per unit of inverse depth that a node has at least: near the epipole depth is invisible,
    and the surface has to stay whole."""

    samples: int = 40_000
    """Pixels of the whole reference whose inverse depth is looked at: some ten for each node."""

    field_nodes: int = 4_000
    """Nodes at which the field is evaluated for them: its spline is smooth."""

    min_confidence: float = 0.03
    """What a pixel counts at least, however doubtful dense refinement was of it."""

    full_confidence: float = 0.5
    """Confidence from which it counts fully."""

    seen_share: float = 0.35
    """Share of the usual number of samples from which a node counts as seen by both pictures."""

    min_samples: int = 200
    """Fewer samples than this say nothing, and nothing is continued."""

    far_nodes: float = 1e4
    """Nodes to the nearest of a kind that there is none of: further than any."""


@dataclass(frozen=True)
class PlanesOptions:
    """Finding the planes next to the overlap's border (`planes`)."""

    most: int = 5
    """Planes at most: more are parts of the same."""

    samples: int = 2_000
    """Samples that the planes are fitted to, drawn with a preference for those near the border."""

    nearby: float = 0.2
    """Share of the longer side over which the say of a sample falls by e with its distance from the border."""

    draws: tuple[int, int, int] = (100, 200, 250)
    """Level, upright and free planes that are tried each time, through one, two and three samples."""

    tolerance_px: float = 1.5
    """Error at which a sample no longer speaks for a plane."""

    inlier_factor: float = 1.5
    """Tolerances within which a sample belongs to a plane once that is fitted."""

    min_share: float = 0.04
    """Share of all samples that a plane holds at least."""

    free_factor: float = 0.85
    """What a free plane's score is multiplied by: one of unknown direction fits more by chance."""

    snap_deg: float = 15.0
    """Degrees from level or upright within which a free plane is made level or upright, if it fits about as well."""

    snap_factor: float = 1.5
    """Factor by which the median error may grow by that; and the tolerances' share that may be added."""

    snap_slack: float = 0.35
    """See `snap_factor`."""

    refits: int = 4
    """Least-squares fits to the inliers, which settle by then."""


@dataclass(frozen=True)
class LabelOptions:
    """Which plane goes on where (`plane_labels`). Costs; a sample that is off by the tolerance costs 1."""

    max_misfit: float = 3.0
    """Cost of a plane that does not fit at all."""

    none_seen: float = 1.2
    """Cost of no plane where both pictures see: a plane has to fit about to the tolerance."""

    none_unseen: float = 0.9
    """The same elsewhere."""

    impossible: float = 4.0
    """Cost of a plane beyond infinity, or far nearer than anything that was seen."""

    nearest_factor: float = 1.3
    """Factor by which a plane may be nearer than what was seen; a free plane keeps to that of its own."""

    order: float = 0.5
    """Cost of the plane that the order of two planes says is not seen: in a room the nearer one hides the other, of a
    box the farther one does."""

    order_share: float = 0.85
    """Share of the nodes on two planes that have to agree on that order."""

    order_nodes: int = 8
    """Nodes on each of both that it takes to say so."""

    colour: float = 0.2
    """Weight of the logarithm of how likely a plane has a node's colour."""

    colour_bins: tuple[int, int, int] = (8, 16, 16)
    """Bins of luma and of both chroma."""

    colour_floor: float = 0.03
    """Probability that is added to each colour."""

    contrast: float = 10.0
    """Difference in colour (luma and chroma of 8 bit) over which a border between planes costs half."""

    min_contrast: float = 0.15
    """Share that it costs at least."""

    border: float = 0.3
    """Cost of any border between planes."""

    island: float = 2.5
    """Cost of a plane where it is not connected to where it was seen: planes go on, and do not appear."""

    agreeing_nodes: int = 2
    """Nodes around the nearest one beyond the overlap whose planes a sample may agree with: creases lie there."""

    agreeing_factor: float = 2.0
    """Tolerances at which a sample that lies off these planes counts a quarter."""

    sweeps: int = 5
    """Rounds of messages through the grid, in four directions each."""

    coarsening: int = 2
    """Nodes to a side that share one label: borders are known no better."""


@dataclass(frozen=True)
class SystemOptions:
    """The least squares that continues inverse depth (`system`). Weights are relative to one sample's."""

    membrane: float = 0.015
    """Weight of differences to the plane that goes on there, from node to node."""

    carried_slope: float = 0.2
    """Share of the longer side over which slopes carry on."""

    lines: float = 2.0
    """Weight of straight lines, in units of the membrane's times the square of that length."""

    uprights: float = 600.0
    """Weight of upright edges where gravity is confirmed, in units of the membrane's."""

    doubtful_uprights: float = 10.0
    """The same where it is not."""

    upright_px: float = 4.0
    """px a step from which an upright edge gives way: it was none."""

    min_line: float = 0.025
    """Share of the longer side from which an edge is kept straight."""

    upright_tilt: float = 0.03
    """rad that an edge may lean and still count as upright."""

    along_gravity: float = 3.0
    """Factor of the membrane along gravity: walls are upright more often than level."""

    attraction: float = 0.008
    """Weight of the attraction to the plane."""

    free_attraction: float = 0.5
    """Share of it for a plane of unknown direction."""

    attraction_ramp: float = 0.12
    """Share of the longer side from the border over which it grows to that."""

    border_weight: float = 3.0
    """What samples at the border of the overlap count beside those inside, beyond 1."""

    border_nodes: float = 2.5
    """Nodes over which that falls by e."""

    sample_px: float = 1.5
    """Error from which a sample counts linearly (Huber)."""

    bend_px: float = 0.3
    """Second difference from which the surface may bend."""

    bending_rounds: int = 3
    """Rounds in which bends are still looked for."""

    max_factor: float = 1.6
    """Factor by which anything may be nearer than the nearest that was seen."""

    bound_weight: float = 100.0
    """Weight that holds inverse depth between 0 and that."""

    crease: float = 0.05
    """Share of the stiffness that is left where two planes meet without a jump."""

    crease_px: float = 4.0
    """A jump larger than this is none that the surface may bend over."""

    contrast: float = 10.0
    """Difference in colour (luma and chroma of 8 bit) over which neighbours are tied half as much."""

    min_contrast: float = 0.05
    """Share that they are tied at least."""

    rounds: int = 6
    """Reweighted solutions."""

    first_rounds: int = 2
    """The same of the smooth surface that is there before any plane."""

    areas: tuple[float, float] = (0.35, 2.2)
    """Area that a node's cell may take up in the panorama, in units of that at infinity; outside, it is stiffened."""

    allowed_areas: tuple[float, float] = (0.1, 4.0)
    """The same that is allowed in the end: what is left outside is smoothed."""

    smoothing_steps: int = 60
    """Steps of that at most."""

    smoothing_nodes: float = 1.0
    """Nodes, σ, of each."""

    stiffening: float = 4.0
    """Factor by which, each round."""

    max_stiffening: float = 256.0
    """The same in all."""


@dataclass(frozen=True)
class TakeoverOptions:
    """Over how much the continuation takes over from the field beyond the reference's border (`continuation`)."""

    shares: tuple[float, float] = (0.015, 0.15)
    """Shares of the reference's longer side: the usual one, which hides errors at the border, and the most. Beyond the
    border the field knows less than the continuation: dense refinement ends there, and it fades to its plane."""

    px_per_px: float = 1.7
    """px of it at least for each px by which the two differ at the border: a smooth transition has a slope of 1.5, and
    the map folds where that takes up all there is."""

    percentile: float = 98.0
    """Percentile of these differences that counts."""

    near_nodes: float = 2.0
    """Nodes within which the target has to go on beyond a point of the border for it to count."""


@dataclass(frozen=True)
class LookupOptions:
    """Looking rays up in the surface (`continuation`)."""

    oversampling: int = 4
    """Values between nodes, per node, that rays are looked up in."""

    scan: int = 24
    """Inverse depths at which a ray is held against the surface before the nearest crossing is narrowed down."""

    narrowing: int = 10
    """Steps of that."""


GRID = GridOptions()
PLANES = PlanesOptions()
LABELS = LabelOptions()
SYSTEM = SystemOptions()
TAKEOVER = TakeoverOptions()
LOOKUP = LookupOptions()
