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
class RigOptions:
    """Figures and warnings about more than two pictures (`rig_figures`, `rig_report`)."""

    weak_inliers: int = 40
    """Matches below which an edge that the rig cannot do without may be wrong: a pair has several minima then."""

    matches_looked_up: int = 300
    """Matches of each pair that are looked up in the maps: their median and 95th percentile are what is asked for."""

    same_focal: float = 0.01
    """Share by which guesses of the focal length may differ and still be one: nobody sees the difference."""

    most_named: int = 4
    """Pairs that a warning names."""

    most_place_deviation: float = 1.0
    """Deviation of a place, in units of the longest baseline, up to which anything is known of it."""


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


@dataclass(frozen=True)
class VerdictOptions:
    """What makes a panorama good, one to look at, or not usable (`verdict`).

    Chosen so that the seventeen photographed pairs of docs/validation.md and the bad ones beside them are judged as by
    eye; levels are of 255, shares are of the small copy that is looked at.
    """

    side_px: int = 600
    """Longer side of the copy at most: a seam is seen in what is larger than a pixel of that."""

    least_alpha: float = 0.5
    """Alpha from which a picture shows something."""

    focal_spread: float = 0.05
    """Share by which guesses of a set's focal length differ at least to be seen: at 4 % of skyline nothing is."""

    evened_share: float = 0.03
    """Half the width of what changes slowly, of the longer side: the bands that even out light are about as wide."""

    step: float = 30.0
    """Levels by which the pictures differ where a seam is seen: no good picture has more along as much of it."""

    seam_share: float = 0.006
    """Of the longer side: length of a part of the seam that is seen. Good pictures have up to 0.004."""

    seam_px: float = 3.0
    """px of the copy, the least length of such a part: what is smaller is noise of the resampling."""

    many_seams_share: float = 0.012
    """The same as `seam_share` among more than two pictures, across a part: of many seams one always has a speck, and
    2 × 4 px of a good panorama of 430 or 890 px, up to 0.0095 of its side, are nothing to look at."""

    together_share: float = 0.008
    """Of the longer side: what is less than twice that apart is one place."""

    rim_share: float = 0.02
    """Of the longer side: a seam so near to a picture's border is where that cuts something."""

    mostly: float = 0.3
    """Share of a place that one of the pictures cannot see, from which depth is the cause."""

    jump: float = 6.0
    """Times the median area of the picture that a pixel of the panorama shows: the map jumps there."""

    torn_step: float = 25.0
    """Levels by which the pictures differ where a fold or a jump is seen: at a true outline they agree."""

    torn_share: float = 4e-5
    """Of the longer side's square, torn so: good pictures, foliage among them, have up to 3e-5."""

    much_less: float = 0.5
    """Share of what there is to look at that another slide may leave, to be shown instead of a torn one that bends
    least."""

    least_kept: float = 0.85
    """Share of the px of that one's panorama, cropped, that the other's has at least: slides show a little more or
    less."""

    smooth_share: float = 0.012
    """Of the longer side: half the width over which a map is smoothed, outlines with it, to see where it bends."""

    squeeze: float = 1.8
    """Ratio of a map's singular values from which a picture is bent or stretched."""

    least_width: float = 0.1
    """Of a sphere's pixels beside their height, 6° from a pole: closer to it a map is smoothed over the pole."""

    bent_share: float = 0.01
    """Of the panorama, squeezed so: pictures that are right have up to 0.006, those that are bent 0.03 and more."""

    edge: int = 40
    """Levels between the brightest and the darkest pixel near by, from which a fold is seen: none is on a bare wall."""

    white: int = 250
    """Levels from which light is clipped."""

    greyed: int = 235
    """Levels below which a channel that was clipped is seen to be no longer white."""

    restored: float = 1.02
    """Times by which a clipped channel is brightened more than the others where what it lost was given back."""

    cast: float = 12.0
    """Levels by which darkened light may differ from what the other picture shows in its place."""

    compared_px: int = 20
    """px of the copy that suffice to compare them."""

    blown_share: float = 0.02
    """Of the panorama, that was not clipped and is now."""

    greyed_share: float = 0.005
    """Of the panorama, that was clipped in some channel and is now darker."""

    most_places: int = 12
    """Places that are named, the worst first."""

    folded: float = 0.03
    """Share of the target's map: a mirrored picture has 0.08, the worst of the good ones 0.005."""

    seen_seam: float = 0.1
    """Share of the seam that is seen, from which a wrong geometry shows. Pictures to look at have up to 0.19."""

    missed: float = 0.03
    """Of the longer side, by which 5 % of the matches are missed: 0.013 at most where the picture is right."""

    missed_by_far: float = 0.1
    """The same where no seam is seen, since one picture alone is shown."""

    hidden: float = 0.25
    """Share of the overlap that one picture cannot see: 0.12 at most where the picture is right."""

    contradicting: float = 0.1
    """Share of the given matches that contradict the rest, from which that is said: one in ten is no slip."""

    deep_px: float = 2.0
    """px by which half the points are off where each is predicted from the others, of more than two pictures."""

    unlike: float = 0.15
    """Share of the overlap in which the pictures differ: 0.085 at most where the picture is right."""


HELD_OUT = HeldOutOptions()
QUALITY = QualityOptions()
INDEPENDENT = IndependentOptions()
FOCAL_DOUBT = FocalDoubtOptions()
WARNING = WarningOptions()
VERDICT = VerdictOptions()
RIG = RigOptions()
