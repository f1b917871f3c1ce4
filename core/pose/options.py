"""Tuning values of each stage of pose estimation, with their units and why they are what they are.

Lengths called px are in px of the picture that the matches were found in: they are multiplied by `Matches.scale`.
References: Lowe, Distinctive Image Features from Scale-Invariant Keypoints, IJCV 2004; Moisan and Stival, A
Probabilistic Criterion to Detect Rigid Point Matches, IJCV 2004.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FeatureOptions:
    """Detecting and matching SIFT features (`features`)."""

    # px of a picture; larger ones are shrunk. SIFT's time and memory grow with pixels, its useful points hardly do.
    pixels: int = 3_200_000
    # px a side, likewise: SIFT doubles the picture, and OpenCV's pictures end at 32767.
    side: int = 16_000
    # px a side; below, OpenCV's pyramid has no level to stand on.
    least_side: int = 8
    # Features below which a picture itself is to blame for too few matches, and not the pair.
    scarce_points: int = 100
    # Features of a picture; matching takes time with the square of it.
    budget: int = 8000
    # The same of each of more than two pictures, which are matched with many others.
    budget_of_many: int = 4000
    # px and features for a preview: a third of the time, and at 1 MP the map's error grows by 3 to 19 %.
    preview_pixels: int = 400_000
    preview_budget: int = 3000
    # Contrast threshold (OpenCV's default is 0.04): small or flat pictures cannot do without faint points.
    contrast_threshold: float = 0.005
    # The same where there are enough stronger points: faint ones (clouds, noise) mislead.
    strong_contrast: float = 0.02
    # Points from the strongest on that are taken whatever their contrast; beyond, only strong ones.
    enough_points: int = 3000
    # Layers per octave and blur of the first one in px: Lowe 2004, section 3.
    octave_layers: int = 3
    base_sigma: float = 1.6
    # Ratio of principal curvatures above which a point counts as lying on an edge (OpenCV's default is 10).
    edge_threshold: float = 20
    # Nearest to second nearest distance, at most; Lowe 2004, section 7.1.
    ratio: float = 0.8
    # px kept clear of transparent parts: the reach of a small descriptor.
    alpha_margin: int = 8
    # Features that each cell of the grid gets of an evenly spread budget, on average.
    points_per_cell: int = 8
    # Descriptors compared at a time, so that memory stays bounded.
    rows_at_once: int = 1024
    # Bytes that a pixel takes while points are looked for (six blurs and five differences of the doubled picture, in
    # floats, with what octaves add), and that all pictures together take at once: OpenCV works with several threads on
    # each as well, so that many large ones at once gain little.
    pixel_bytes: int = 230
    bytes_at_once: int = 600_000_000


@dataclass(frozen=True)
class FundamentalOptions:
    """Robust F and homography from matches alone, and tests against chance (`fundamental`)."""

    # Matches that must agree on F: 7 do on any, and some more lie near its lines by chance.
    min_inliers: int = 15
    # The same as a share of all matches.
    min_inlier_share: float = 0.08
    # px of Sampson distance within which a match is an inlier of F; twice that of transfer error for a homography.
    inlier_px: float = 1.5
    # Thresholds tried, in units of the former: where a lens bends lines, a sharp one fits a part of the picture only.
    threshold_factors: tuple[float, ...] = (1.0, 2.0)
    # Most iterations of RANSAC for F and for a homography, and the confidence at which MAGSAC++ stops earlier.
    iterations: int = 20_000
    homography_iterations: int = 10_000
    confidence: float = 0.9999
    # px: noise is never taken to be less, for no keypoint is placed better.
    least_noise_px: float = 0.05
    # Share of the shorter side that inliers must stray from any line, or they tell no geometry.
    min_spread: float = 0.008
    # A match is off the homography beyond so many σ and so many px, and on its line within so many σ.
    off_plane_sigmas: float = 5.0
    off_plane_px: float = 0.75
    on_line_sigmas: float = 3.5
    # Matches off the homography along their lines that show parallax: so many, such a share of all on lines (feature
    # positions have heavy tails), and so many times those that are off across their lines.
    min_off_plane: int = 8
    min_off_plane_share: float = 0.025
    along_to_across: float = 3.0
    # Log of the expected number of equally good coincidences among random matches, at most (Moisan and Stival 2004
    # have 0): noise is not as random as the model.
    max_log_coincidences: float = -25.0


@dataclass(frozen=True)
class RefinementOptions:
    """Refining a pose on Sampson distances and priors (`refinement`)."""

    # Matches that count as evidence against a prior, at most: errors of neighbours go together (lens distortion,
    # rolling shutter).
    effective_matches: int = 300
    # px of systematic error a lens leaves in residuals, where they speak against a known and a guessed focal length.
    systematic_px: float = 0.5
    systematic_guess_px: float = 0.15
    # px, σ of the cheirality residual: distortion moves where infinity is seen by about this much.
    cheirality_sigma_px: float = 2.0
    # Degrees of freedom of the Student distribution of an assumed focal length.
    prior_freedom: float = 3.0
    # Radians; a point of less parallax counts as infinitely far: keypoint noise may put it behind the cameras.
    min_parallax: float = 2e-3
    # Share of a match's weight below which its cheirality residual is left out of the equations, to save time.
    negligible_cheirality: float = 1e-3
    # σ of the log of the ratio of two focal lengths to what is known of it, when the second is free.
    zoom_sigma: float = 0.3
    # Most that log f changes in a step, so that a bad step does not leave the basin.
    max_focal_step: float = 0.3


@dataclass(frozen=True)
class EstimationOptions:
    """From matches to a TwoView (`estimation`)."""

    # Matches below which nothing is tried: with fewer, agreement can be chance.
    min_matches: int = 16
    # px, σ of the first refinement of every start.
    start_sigma_px: float = 1.0
    # px within which a match is an inlier of the pose, at least, however sharp the noise; at most half as much more.
    inlier_px: float = 2.0
    # A second F is sought with a threshold of so many σ of the first pose, at most this share of RANSAC's: a wide one
    # lets in stray matches that the pose bends to.
    sharp_sigmas: float = 3.0
    sharp_share: float = 0.4
    # A rotation may explain a homography's matches so many times worse, or by so many px: lenses are not perfect.
    rotation_factor: float = 1.6
    rotation_px: float = 0.75
    # px beyond noise that matches must move, or both pictures show the same.
    same_view_px: float = 0.5
    # Share of the homography's inliers that a pose must explain where there is no parallax, or the plane is all there
    # is.
    plane_inlier_share: float = 0.8
    # Given cameras contradict the matches if they explain less than this share of what a free F does, or with so many
    # times its noise.
    given_inlier_share: float = 0.75
    given_noise_factor: float = 1.6
    # px off its line from which a given match is reported, and within which given cameras explain a match.
    given_match_px: float = 3.0
    given_camera_px: float = 3.0
    # Share of what a free F explains that given cameras must explain, and px that their noise is never below.
    given_camera_share: float = 0.5
    given_camera_noise_px: float = 0.1
    # Share of a picture's longer side by which near things may be off where cameras are given at one place: a head that
    # is off the lens's centre, or a hand, moves them. Cameras of other pictures are further off: those overlap in part.
    given_place_share: float = 0.05
    # Share of consistent points that must lie in front of both cameras.
    min_front_share: float = 0.5
    # Share of matches on one homography from which its own poses are tried too: F is unstable on a plane.
    plane_start_share: float = 0.5
    # Rounds of refining and choosing inliers anew, at most.
    rounds: int = 8
    # Matches that choose among starts, and matches that refine: more take time and change nothing.
    start_matches: int = 400
    refinement_matches: int = 1500
    # Focal lengths in units of the longer side, tried when nothing is known: 19 mm to 200 mm on a 36 mm frame.
    focal_ladder: tuple[float, ...] = (0.5, 0.7, 0.9, 1.2, 1.6, 2.2, 3.2, 5.0)
    # σ of log f from which the ladder is tried: what is known better needs no search.
    ladder_sigma: float = 0.1


@dataclass(frozen=True)
class FocalOptions:
    """What is said about the focal length (`focal`)."""

    # σ of log f by the matches alone above which they do not determine it.
    undetermined: float = 0.1
    # Matches that follow when the focal length is moved to see how far H_inf goes: few suffice for a figure.
    spread_matches: int = 200
    # σ by which a focal length must have been moved from what the file claims to be reported.
    contradiction_sigmas: float = 2.0


@dataclass(frozen=True)
class EdgeFocalOptions:
    """The focal length by straight edges (`edge_focal`). Weights and threshold: on photographs whose EXIF was hidden,
    where matches alone were off by up to a factor of two; none came out worse."""

    # Focal lengths in units of the longer side, tried in steps of log f: 18 mm to 90 mm on a 36 mm frame.
    sides: tuple[float, float] = (0.5, 2.6)
    log_step: float = 0.09
    # Matches that follow each, and edges of each picture, the longest, by which directions are sought first.
    matches: int = 250
    first_edges: int = 200
    # Degrees, σ, within which an edge runs to its vanishing point, and share of the edges that run to any of the three.
    edge_sigma_deg: float = 0.6
    aligned_share: float = 0.3
    # Degrees of pitch and roll, reach and step, at which down is sought first, and steps of yaw after it.
    upright_grid_deg: tuple[tuple[float, float], tuple[float, float]] = ((40.0, 2.5), (12.0, 1.5))
    yaw_step_deg: float = 1.5
    # Directions down, so many degrees apart, that are followed; steps of following are to one side, or half as wide.
    starts: int = 2
    apart_deg: float = 5.0
    steps: int = 16
    # What the edges' evidence and the matches' cost count: neighbours among both err together, matches the most.
    edge_weight: float = 2.0
    match_weight: float = 0.1
    # By how much another focal length has to be better than that of the matches. Where it was right to change it, the
    # gain was 12 or more; where it was not, 1 or less.
    min_gain: float = 11.0
    # Share of the matches explained before that have to be explained with it.
    inlier_share: float = 0.85
    # σ of log f by edges, from what they were off by, and how the report names them.
    log_sigma: float = 0.12
    source: str = "straight edges of both pictures"


@dataclass(frozen=True)
class RotationOptions:
    """Two pictures from the same place (`rotation`)."""

    # Matches that take part: a rotation and two focal lengths need no more.
    matches: int = 300
    # Focal lengths to start from in units of the longer side, where nothing is known: the cost has several minima.
    focal_starts: tuple[float, ...] = (0.6, 0.9, 1.4, 2.2, 4.0)
    # σ of the difference of the logs of both changes of focal length: one lens took both more often than not.
    common_focal_sigma: float = 0.05
    # σ of noise; residuals are cut off here, and points behind the camera have this one.
    max_residual: float = 1e4
    # Evaluations of the residuals for each start, at most.
    evaluations: int = 100


@dataclass(frozen=True)
class ZoomOptions:
    """A second focal length (`zoom`)."""

    # Matches that are looked at: more take time and change nothing.
    matches: int = 400
    # px of Sampson distance within which a match counts as explained.
    explained_px: float = 3.0
    # Share of the robust residuals of a common focal length that two may leave. A second one also soaks up lens
    # distortion and then leads astray outside the overlap, so it must be worth much.
    max_residual_share: float = 0.4
    # Starts: first focal length in units of the assumed one, and second in units of the first. A start from the pose
    # with a common one would not leave its minimum.
    focal_starts: tuple[float, ...] = (0.7, 1.0, 1.4)
    ratio_starts: tuple[float, ...] = (0.55, 0.75, 1.33, 1.8)
    # Iterations of refining each start.
    iterations: int = 20


@dataclass(frozen=True)
class ExifDoubtOptions:
    """When the matches overrule a focal length by EXIF (`exif_doubt`); measured on 12 pairs with EXIF as it is, and
    multiplied by 0.5 to 2."""

    # Times the noise of the matches about a free fundamental matrix from which the start without EXIF is tried: right
    # EXIF gave 0.92 to 1.21 and once 1.57, wrong 1.25 to 2.7 where it did harm.
    noise_factor: float = 1.15
    # Times the cost without EXIF from which that is taken: right EXIF gave 1.11 at most (lens distortion), EXIF that
    # was off by a factor of 2 gave 1.3 to 2.6.
    cost_factor: float = 1.15
    # The same as a difference, in squared units of noise: fewer matches than some dozen decide nothing.
    least_gain: float = 50.0
    # Deviation of log f without EXIF, at most: else the matches do not know it.
    most_deviation: float = 0.1
    # Difference of log f, at least: what is less is within what EXIF rounds.
    apart: float = 0.12
    # Pairs of a set that are asked: those with the most matches.
    pairs_asked: int = 3
    # Difference of the logarithms of two pictures' width / height, at most, for one to be a copy of the other's size.
    same_shape: float = 0.01


@dataclass(frozen=True)
class MirrorOptions:
    """When a picture is taken for mirrored (`mirrored`)."""

    # Inliers from which nobody asks: a symmetric front has fewer with its mirror image.
    enough: int = 250
    # px of the reference for each of these, in smaller pictures.
    px_for_one: int = 500
    # Matches of the mirrored picture, at least, and times as many as of the picture as it is: symmetric scenes have
    # half as many, of others a few agree by chance.
    least: int = 40
    factor: float = 1.5


FEATURES = FeatureOptions()
FUNDAMENTAL = FundamentalOptions()
REFINEMENT = RefinementOptions()
ESTIMATION = EstimationOptions()
FOCAL = FocalOptions()
EDGE_FOCAL = EdgeFocalOptions()
MIRROR = MirrorOptions()
EXIF_DOUBT = ExifDoubtOptions()
ROTATION = RotationOptions()
ZOOM = ZoomOptions()
