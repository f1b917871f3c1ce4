"""What was chosen in measuring a stitch: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HeldOutOptions:
    """Errors at matches that the field was not fitted to (`held_out`)."""

    folds: int = 5
    """Parts that the matches are split into at random, each predicted from the others (Stone 1974)."""

    strip_share: float = 0.2
    """Share of the matches, nearest to what only the target shows, that are predicted from the rest."""

    min_beyond_share: float = 0.01
    """Share of what the canvas shows of the target that has to lie outside the reference: a sliver has no direction."""


@dataclass(frozen=True)
class QualityOptions:
    """Similarity of pictures, and samples of a map (`metrics`)."""

    ssim_c1: float = (0.01 * 255) ** 2
    """Constant C₁ of the structural similarity for 8 bit (Wang et al., IEEE TIP 2004, section III-B)."""

    ssim_c2: float = (0.03 * 255) ** 2
    """Constant C₂ from there."""

    map_samples: int = 20_000
    """Canvas pixels, evenly spread, that say how far a map leaves the epipolar lines: a field is smooth."""

    inverse_step: int = 4
    """px between the nodes from which it is looked for where a canvas shows a picture's pixel: maps are smooth but at
    depth edges."""

    inverse_steps: int = 4
    """Newton's steps from there."""

    inverse_error_px: float = 0.5
    """px by which what is found may miss the picture's pixel: more, and the canvas does not show it."""

    least_area: float = 1e-3
    """px² of the picture for each of the canvas, below which a step would have no direction."""


@dataclass(frozen=True)
class IndependentOptions:
    """F estimated once more, by other means (`projectivity`)."""

    min_matches: int = 16
    """Matches that F is fitted to at least: twice what the eight-point algorithm needs."""

    inlier_px: float = 2.0
    """px, in units of the matches' scale, within which a match counts; `pose.fundamental` takes 1.5 and 3."""

    draws: int = 5
    """Times that MAGSAC++ is run: it ends in one of several minima, and a single run leaves to chance in which."""

    fits: int = 10
    """Reweighted fits after each."""

    magsac_iterations: int = 10_000
    """Samples that MAGSAC++ draws at most."""

    magsac_confidence: float = 0.9999
    """Probability at which MAGSAC++ ends before."""


@dataclass(frozen=True)
class FocalDoubtOptions:
    """How sure a focal length is, and what that does to the picture (`focal_doubt`)."""

    by_matches: float = 0.17
    """Share that a focal length by matches alone is off by, at least: the median over photographs whose EXIF was
    hidden. Their own estimate of it does not know of lenses and of scenes that hardly determine it."""

    matches: int = 200
    """Matches that follow when the focal length is moved: few suffice for a figure."""

    columns: int = 9
    rows: int = 7
    """Places of the target at which the lean is looked at."""

    step_px: float = 5.0
    """px up and down from each, between which its lean is measured."""

    percentile: float = 95.0
    """% of the places that lean no more."""


@dataclass(frozen=True)
class WarningOptions:
    """From what on a figure becomes a warning of the report (`report`)."""

    behind_infinity_share: float = 0.02
    """Share of the matches with d < 0: more of them mean that the focal length, and H_inf with it, is doubtful."""

    hole_share: float = 1e-4
    """Share of the canvas: larger holes can be seen in the panorama as a whole."""

    lean_deg: float = 0.7
    """Degrees by which uprights may lean for want of a focal length: what is seen at once beside straight ones."""

    fold_share: float = 0.005
    """Share of what is shown of the target: more folds show as doubled or torn things."""

    overexposed_share: float = 0.05
    """Share of what both pictures show that is clipped in one alone: a sky is more, lamps and glints are less."""


HELD_OUT = HeldOutOptions()
QUALITY = QualityOptions()
INDEPENDENT = IndependentOptions()
FOCAL_DOUBT = FocalDoubtOptions()
WARNING = WarningOptions()
