"""Tuning values of the way from matches to averaged rotations, with their units and why they are what they are.

Lengths called px are in px of the picture that the features were found in: they are multiplied by `Verified.scale`.
References: Torr, Geometric Motion Segmentation and Model Selection, Phil. Trans. R. Soc. A 1998 (GRIC); Jégou et al.,
Aggregating Local Descriptors into a Compact Image Representation, CVPR 2010 (VLAD).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PairOptions:
    """Which pairs are matched, and which of them agree on some motion of the camera (`pairs`)."""

    # Pictures up to which all pairs are matched, and the most alike of each beyond.
    most_all: int = 40
    most_each: int = 20
    # The index of pictures: words, descriptors of a picture that vote, of all pictures that the words are made from,
    # and rounds of making them.
    words: int = 64
    descriptors: int = 1500
    sample: int = 20_000
    word_rounds: int = 8
    # Matches that must agree on a fundamental matrix: so many, and more than so many and this share of all.
    min_inliers: int = 24
    chance_inliers: int = 8
    chance_share: float = 0.15
    # px within which they agree, and RANSAC's iterations.
    inlier_px: float = 2.0
    iterations: int = 3000
    fewest_iterations: int = 200


@dataclass(frozen=True)
class TwinOptions:
    """Pictures that show the same from the same place (`twins`)."""

    # px within which this share of at least so many matches stay where they are. Copies with noise of 2 levels have
    # 98 % there.
    still_px: float = 1.0
    share: float = 0.9
    matches: int = 100


@dataclass(frozen=True)
class CandidateOptions:
    """The poses that the matches of a pair allow (`candidates`)."""

    # px within which a match belongs to a pose, and RANSAC's iterations.
    inlier_px: float = 2.0
    iterations: int = 1500
    fewest_iterations: int = 200
    # Matches that a pose must explain for the pair to be kept.
    min_inliers: int = 20
    # Below so many matches the deepest minimum is often the wrong one: more seeds, and the rotation with directions of
    # the baseline all around, are tried too.
    few_matches: int = 250
    seeds: int = 3
    # px within which a match belongs to a pure rotation (parallax leaves more than noise), samples, and rounds of
    # weighted fitting.
    rotation_px: float = 4.0
    rotation_samples: int = 100
    rotation_rounds: int = 15
    # Inliers of a pair that take part in refining: more take time, and errors of neighbours go together.
    most_matches: int = 1000
    # Refining starts: iterations, after which so many of each pair stay.
    refining: tuple[tuple[int, int], ...] = ((4, 6), (8, 6))
    # Candidates: at most so many, so much apart, less likely than the best by at most so much (log), and so far from
    # the best pure rotation: parallax does not turn a picture further.
    most: int = 5
    apart_degrees: float = 0.3
    log_likelihood: float = 10.0
    from_rotation_degrees: float = 25.0


@dataclass(frozen=True)
class PairFitOptions:
    """Refining all pairs at once with the focal length and k1 that they share (`pair_models`, `pair_refinement`)."""

    # px: residuals beyond count less and less (Cauchy).
    cauchy_px: float = 1.5
    # px: noise is taken to be this until it is measured, and never to be less than the second.
    start_noise_px: float = 0.5
    least_noise_px: float = 0.1
    # σ of k1, and how large it may become: phones and wide lenses without a profile have up to 0.2.
    k1_sigma: float = 0.05
    most_k1: float = 0.3
    # Share of the k1 at which the lens would fold inside a picture that it may reach.
    fold_share: float = 0.9
    # Rounds of Newton's method that take the distortion off a ray.
    lens_iterations: int = 5
    # Steps at most: of log f and k1, and of a pose (rad).
    most_lens_step: float = 0.1
    most_pose_step: float = 0.2
    iterations: int = 15
    rotation_iterations: int = 20
    # Change of the cost (log likelihood) that ends the fit: far below what any choice depends on.
    tolerance: float = 1e-6
    # A change of log f or of k1 from which candidates are sought once more, with the new lens.
    repeat_log_focal: float = 0.02
    repeat_k1: float = 0.02
    # Share of the matches that pure rotations must explain better before the focal length is taken from them: that of
    # poses without parallax is arbitrary.
    rotation_share: float = 0.3
    # Matches of each pair that take part in that test, and a change of log f that is not worth another start.
    rotation_test_matches: int = 150
    rotation_same_focal: float = 0.05
    # σ of the log of that focal length: the little parallax there is bends it.
    rotation_log_focal: float = 0.01
    # GRIC by which a rotation must explain a pair better, matches that must say so, and how near it must be to the
    # averaged rotation.
    rotation_gric: float = 20.0
    rotation_matches: int = 100
    rotation_degrees: float = 0.5
    # Share of the matches in pairs that rotate from which a set is said to be taken from one place.
    one_place_share: float = 0.7


@dataclass(frozen=True)
class LadderOptions:
    """Focal lengths that are tried where none is known (`starts`)."""

    # σ of log f up to which the known focal length is the only start.
    known_sigma: float = 0.1
    # Factors on the assumed focal length, evenly in log: 15 mm to 70 mm on a 36 mm frame.
    factors: tuple[float, float] = (0.45, 2.2)
    rungs: int = 15
    # Pairs, the strongest, and matches of each that judge; RANSAC's iterations; px within which a match counts.
    pairs: int = 12
    matches: int = 300
    iterations: int = 1000
    judged_px: float = 0.5
    # Beside the best: a barrel lens that mimics another focal length.
    barrel: tuple[float, float] = (0.9, -0.08)
    # A second minimum is followed too if it is so far off in log f and costs at most so much more.
    second_log_focal: float = 0.2
    second_share: float = 1.15
    second_extra: float = 20.0


@dataclass(frozen=True)
class AveragingOptions:
    """Averaging rotations (`triplets`, `rotation_averaging`)."""

    # A triangle of pairs closes within so many degrees and so many σ of its three rotations.
    triangle_degrees: float = 1.0
    triangle_sigmas: float = 3.0
    # Degrees that a pair's rotation errs beyond its own σ: lenses are not perfect.
    systematic_degrees: float = 0.1
    # Triangles beyond which more make a pair no more trusted.
    most_triangles: int = 5
    # Cauchy widths, σ, iteration by iteration: from wide, so that no start decides, to sharp; the last one stays.
    widths: tuple[float, ...] = (20,) * 6 + (12,) * 4 + (8,) * 4 + (5,) * 4 + (3,)
    switch_widths: tuple[float, ...] = (30, 30, 30, 12, 12, 6, 6, 3)
    iterations: int = 60
    again_iterations: int = 30
    # Steps (rad, log f) at most, and the step that ends the iteration.
    most_step: float = 0.3
    most_focal_step: float = 0.03
    tolerance: float = 1e-9
    # A pair that was dropped comes back where it agrees within so many degrees or σ.
    back_degrees: float = 0.5
    back_sigmas: float = 2.0
    # Candidates are switched one at a time if the cost (log likelihood) falls by more than this, so often at most.
    switch_gain: float = 1.0
    most_switches: int = 200
    # Switches are tried unless linear theory says that the cost rises by more than this.
    switch_slack: float = 5.0
    switch_iterations: int = 14
    # The pairs' own evidence on f counts a quarter: errors of neighbouring matches go together.
    focal_evidence: float = 0.25
    # A change of log f that needs no further round, and rounds at most.
    same_log_focal: float = 0.005
    lens_rounds: int = 4
    # Information on log f where it is held.
    held_information: float = 1e12
    # A pair agrees with the averaged rotations within so many degrees or σ.
    agrees_degrees: float = 2.0
    agrees_sigmas: float = 4.0
    # σ in degrees of rotations between views of one sphere while all others are averaged around them, far below any
    # pair's; and as how many matches one counts: more than any pair has.
    body_degrees: float = 0.01
    body_matches: int = 10_000
    # Cauchy widths beyond which a verified match costs no more, in the figure that compares starts.
    unexplained_widths: float = 5.0
    # Changes of log f, of k1 and of any rotation up to which two hypotheses are one.
    alike_log_focal: float = 0.01
    alike_k1: float = 0.01
    alike_degrees: float = 1.0
    # Iterations of refining the poses that were chosen.
    pose_iterations: int = 6


PAIRS = PairOptions()
TWINS = TwinOptions()
CANDIDATES = CandidateOptions()
PAIR_FIT = PairFitOptions()
LADDER = LadderOptions()
AVERAGING = AveragingOptions()
