"""Tuning values from averaged rotations to a bundled rig, with their units and why they are what they are.

Lengths called px are in px of the pictures that the features were found in: they are multiplied by the scale that
`registration.register` is given. References: Jiang, Cui and Tan, A Global Linear Method for Camera Pose Registration,
ICCV 2013; Pan et al., Global Structure-from-Motion Revisited, ECCV 2024; Triggs et al., Bundle Adjustment: A Modern
Synthesis, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrackOptions:
    """Which pairs' matches become tracks (`tracks`)."""

    # Degrees, and standard deviations of its own rotation, that a pair may be off the averaged rotations: the larger of
    # both counts. What is further off shows something else, and its matches would join what does not belong together.
    most_degrees: float = 2.0
    most_sigmas: float = 4.0


@dataclass(frozen=True)
class PositionOptions:
    """Places of the pictures by linear equations (`positions`, `continuity`)."""

    # Rounds at most, and the round from which steps of Gauss-Newton replace solving anew: the first rounds need no
    # start, but parts of free scale shrink in them, without the projector.
    rounds: int = 32
    newton_round: int = 8
    # Rounds at which every track chooses its two views of most parallax again, now that outliers are known.
    choosing_rounds: tuple[int, ...] = (4, 10, 16)
    # Ends the rounds when places move less than this share of their extent, from this round on.
    tolerance: float = 1e-5
    least_rounds: int = 22
    # Parallax in standard deviations from which a track's depth counts as measured, and from which it counts fully
    # where the scale is held.
    measured_sigmas: float = 4.0
    sure_sigmas: float = 10.0
    # σ within which the Cauchy weight is flat, at first, by which factor it falls each round, and where it ends.
    first_kernel_sigmas: float = 8.0
    kernel_decay: float = 0.7
    last_kernel_sigmas: float = 2.0
    # Residual in σ that a view behind which a point lies has at least, and weight below which a view is not chosen.
    behind_sigmas: float = 3.0
    least_weight: float = 0.2
    # Distances are never taken to be less than this share of the median depth: residuals are divided by them.
    least_distance: float = 1e-3
    # A step changes depths by at most this share (85th percentile), and is at most this share of Gauss-Newton's.
    most_change: float = 0.4
    most_step: float = 0.8
    change_percentile: float = 85.0
    # Stiffness that keeps the scale during steps, and what keeps the equations regular, in units of the mean diagonal.
    scale_stiffness: float = 1e6
    regular: float = 1e-10
    # A pair that a pure rotation explains pulls its places together by its matches, at most so many, each with this
    # share of its weight; by more than so many σ of parallax it lets go.
    station_matches: int = 200
    station_share: float = 1 / 6
    station_sigmas: float = 2.0


@dataclass(frozen=True)
class ContinuityOptions:
    """Equal depth of neighbours in a picture where too few points are seen by three (`continuity`, `parts`)."""

    # σ of the log of the ratio of two neighbours' depths, and how many equations all of a picture's count as.
    log_sigma: float = 0.5
    weight: float = 4.0
    # Neighbours that are taken of a picture and two parts of the rig, the nearest ones.
    most: int = 40


@dataclass(frozen=True)
class BundleOptions:
    """The bundle (`bundle`, `reprojection`)."""

    # px, the scale of the Cauchy cost: wide at first with the lenses held, then with all free.
    first_kernel_px: float = 4.0
    kernel_px: float = 2.0
    # The same at last, in σ of the noise (3: for normal noise 97 % as good as least squares), and px at least: with a
    # wider one matches that are a little wrong, as many are, turn cameras by a tenth of a degree.
    last_kernel_sigmas: float = 3.0
    least_kernel_px: float = 0.2
    # σ of k1 and px of noise that priors are weighed with: errors of a lens that the model leaves go together, so that
    # thousands of observations do not outweigh a prior as independent ones would.
    k1_sigma: float = 0.05
    prior_noise_px: float = 1.0
    # Iterations that undo a distortion.
    undistorting: int = 8
    # Residual px of what lies behind a camera, and the third coordinate of |r| = 1 from which a point is before it.
    behind_px: float = 1e3
    least_ahead: float = 1e-3
    # Levenberg's damping: at first, its factors after a good and a bad step, its least, and tries at most.
    damping: float = 1e-4
    damping_down: float = 0.1
    damping_up: float = 8.0
    least_damping: float = 1e-9
    tries: int = 8
    # Most that log f changes in a step.
    most_log_focal: float = 0.2
    # ρ, in units of one by the largest distance of a place, up to which a triangulated point is believed.
    most_inverse_range: float = 1e4
    # Rounds of the robust mean of rays from one place that see a point: two of three outvote a wrong one by then.
    mean_rounds: int = 4
    # What keeps the equations regular, and stiffness that keeps the scale, in units of their mean diagonal.
    regular: float = 1e-15
    scale_stiffness: float = 1e3


@dataclass(frozen=True)
class PolishingOptions:
    """Bundling, leaving out what does not fit, bundling again (`polishing`)."""

    # Iterations at most and relative change of the cost that ends each round: the last is the result. The first rounds
    # begin with all observations again.
    first_iterations: int = 15
    first_tolerance: float = 1e-4
    revived_iterations: tuple[int, ...] = (25, 30)
    revived_tolerances: tuple[float, ...] = (1e-4, 1e-4)
    iterations: int = 60
    tolerances: tuple[float, ...] = (1e-6, 1e-7)
    # Then once more with a kernel as wide as the noise, unless some picture loses more than this share of what fitted:
    # where the model of the lens is not good enough, it would fit a part of the pictures and lose the rest.
    sharp_loss: float = 0.1
    # Robust σ beyond which an observation is left out, and px below which none is.
    prune_sigmas: float = 4.0
    prune_px: float = 1.5
    # px from which a point's worst observation has it triangulated anew.
    retriangulate_px: float = 8.0
    # Done when so small a share was left out and the cost fell by less than this share.
    settled_pruned: float = 0.002
    settled_cost: float = 0.001
    # Rotations alone: px of the Cauchy cost in turn, iterations and σ at which observations are left out.
    rotation_kernels_px: tuple[float, ...] = (8.0, 2.0)
    rotation_iterations: int = 30
    rotation_tolerance: float = 1e-8
    rotation_prune_sigmas: float = 5.0
    # Neighbours whose median ρ draws a point, and σ of that in units of the 90th percentile of |ρ|: it only holds
    # points that have no parallax.
    prior_neighbours: int = 8
    prior_share: float = 1.0
    prior_percentile: float = 90.0
    prior_least_points: int = 20


@dataclass(frozen=True)
class ValleyOptions:
    """Other minima along an unsure focal length (`valley`)."""

    # Deviation of log f from which others are tried, the step, and steps at most in each direction.
    unsure: float = 0.001
    log_step: float = 0.03
    steps: int = 3
    # Share of the cost that a step saves at least, and of the points that may lie beyond infinity after it; how often
    # it is bundled again with points anew where more do.
    least_gain: float = 0.002
    most_behind: float = 0.05
    anew: int = 2


@dataclass(frozen=True)
class JudgeOptions:
    """Comparing hypotheses, and what is said of the result (`registration`, `stations`)."""

    # Log f by which the bundle may move it before pairs are estimated again with the bundle's, and passes at most.
    most_log_focal: float = 0.01
    passes: int = 3
    # Kernel widths squared beyond which nothing costs more: 5 kernels off.
    missed_kernels: float = 25.0
    # px: kernel of the cost that hypotheses are compared by, about as wide as the noise of features is.
    kernel_px: float = 0.5
    # Relative cost within which hypotheses are reported as possible, and log f within which two are the same.
    possible: float = 0.05
    same_log_focal: float = 0.002
    # Points that three pictures see from which the lengths between them are in a measured proportion: one wrong point
    # fits any proportion exactly.
    three_view_points: int = 4
    # Parallax is little where this percentile of errors of rotations alone is below so many σ.
    little_parallax_percentile: float = 80.0
    little_parallax_sigmas: float = 6.0
    # Places are found anew from the bundle's rotations, and bundled from there, where they differ from its places by
    # more than this share of their extent: it has not come out of a wrong start then. At most so many times.
    astray: float = 0.1
    most_anew: int = 3
    # Times the cost up to which places found anew are taken where no points tie all lengths: the bundle leaves those
    # lengths where it began, which by averaged rotations was anywhere, and its cost does not tell.
    as_cheap: float = 1.002
    # No parallax can be seen where these percentiles of them are below so many px each: matches of pixels err by that
    # much, a few of a hundred by more. A skyline from places far apart has 0.55 and 0.9 px, and keeps its places.
    no_parallax_percentiles: tuple[float, ...] = (80.0, 95.0)
    no_parallax_px: tuple[float, ...] = (0.4, 1.0)
    # px that rotations leave of half of all matches up to which that is tried: with a wrong focal length, too.
    hardly_apart_px: float = 3.0
    # px: where costs are weighed against numbers of parameters, noise is never taken to be less.
    least_noise_px: float = 0.1


TRACKS = TrackOptions()
POSITIONS = PositionOptions()
CONTINUITY = ContinuityOptions()
BUNDLE = BundleOptions()
POLISHING = PolishingOptions()
VALLEY = ValleyOptions()
JUDGE = JudgeOptions()
