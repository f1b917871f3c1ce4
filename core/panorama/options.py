"""What was chosen in laying out a panorama, stage by stage: each value with its unit, and why it is what it is.

Values without a source were chosen on photographs and rendered scenes: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CanvasOptions:
    """How large a canvas gets (`canvas`)."""

    max_stretch: float = 4.0
    """Canvas px per px of a picture, in length: beyond, the reference's plane shows blur and is cut off."""

    max_reach: float = 3.0
    """Longer sides of the largest picture by which a flat canvas goes beyond the reference at most: near the horizon of
    the reference's plane it would have no end."""

    max_pixels: int = 1_000_000_000
    """Pixels of a panorama: at float32 and three channels, more than 12 GB for its light alone."""

    margin: float = 0.1
    """Share of the reference's longer side that is searched around where the pictures are expected: this is by the
    field's plane alone."""

    outline_points: int = 32
    """Points along each side of a picture that stand for its border, which lenses and round panoramas bend."""

    search_nodes: int = 2000
    """Nodes of the grid on which the pictures' bounds are looked for: a tenth of a map's, for nothing is shown yet."""


@dataclass(frozen=True)
class WarpOptions:
    """Maps of all pictures (`warp`)."""

    max_fade: float = 3.0
    """Longer sides of the reference beside it within which fields end in their plane, in round panoramas: the grid that
    is laid over the reference's plane has to end somewhere."""

    max_node_factor: float = 4.0
    """Nodes of that grid at most, in units of those of any other grid: time and memory grow with it."""

    node_share: float = 0.5
    """Distance between nodes of that grid at least, in those between the canvas's own: a coarse map needs fewer."""


@dataclass(frozen=True)
class LayerOptions:
    """Fetching pictures through their maps (`layers`)."""

    min_alpha: float = 1e-2
    """Alpha (0..1) below which a pixel counts as transparent: its colour, divided by so little, would be rounding."""

    held_values: int = 16_000_000
    """Values of light that are kept once they were fetched: 64 MB of a picture. Larger ones are fetched again where
    they are read, which costs less than their memory."""


@dataclass(frozen=True)
class ProjectionOptions:
    """Surfaces of a panorama (`projection`)."""

    max_slope: float = 3.0
    """Focal lengths from the middle at which a plane, Pannini's projection and the height of a cylinder are cut off (a
    plane at 72°): they grow without end."""

    least_forward: float = 1e-9
    """Cosines below which a ray counts as one that a plane, Pannini's projection or a cylinder cannot show."""


@dataclass(frozen=True)
class LevellingOptions:
    """Finding which way is down (`levelling`)."""

    roll_sigma_deg: float = 1.5
    """Degrees of roll, σ: people see a tilted horizon and avoid it."""

    pitch_sigma_deg: float = 20.0
    """Degrees of pitch, σ: people look up and down on purpose."""

    iterations: int = 50
    """Reweighted eigenvectors for what the cameras' poses alone say: far more than it takes to settle."""

    guided_share: float = 1e-4
    """Weight of down as it is found otherwise beside one given line: it decides only what the lines leave open."""

    contradicting_deg: float = 3.0
    """Degrees by which a given line may miss the way that is down by all of them: who draws one is a degree off."""

    overturned_deg: float = 25.0
    """Degrees by which given lines may turn what is down otherwise: cameras are held better than that."""

    pitch_reach_deg: float = 45.0
    """Degrees of pitch to either side of a camera's own axes within which down is looked for by edges: most of what is
    photographed, with 2 σ to spare."""

    roll_reach_deg: float = 25.0
    """The same of roll: a camera that was held askew, but not on its side."""

    search_steps_deg: tuple[tuple[float, float], ...] = ((1.0, 1.0), (0.2, 0.5), (0.04, 0.35))
    """Rounds of that search: degrees between directions, and degrees, σ, that upright edges may be off. Each round
    looks around the best of the last; edges are found to about a third of a degree."""

    narrowing: float = 1.5
    """Steps of the last round to either side of its best direction that the next round searches."""

    edge_weight: float = 2.0
    """What an edge as long as the picture counts, in cameras."""

    sideways_deg: float = 45.0
    """Degrees of roll from which a camera counts as turned on its side."""

    chance_factor: float = 1.0
    """Edges of any direction favour some direction by about the root of the sum of their squared lengths. Only beyond
    so many times that do edges have a say."""

    confirming_tilts_deg: tuple[float, float] = (20.0, 1.5)
    """Degrees off upright within which edges are asked whether down is right, and within which they say so: trunks of
    palms lean any way, walls do not."""

    confirming_share: float = 0.4
    """Share of the length of those asked that has to say so; at random it would be a thirteenth."""

    confirming_length: float = 0.5
    """Length of the edges that say so at least, in shares of a picture's longer side."""


@dataclass(frozen=True)
class EdgeOptions:
    """Straight edges that show what is upright (`upright_edges`)."""

    side_px: int = 1000
    """px of the picture's longer side at which edges are detected: long ones are what tells, and they survive."""

    min_length: float = 0.025
    """Share of the longer side below which an edge is left out: its direction is uncertain by more than a degree."""

    max_edges: int = 1000
    """Edges that are used at most, the longest: the search takes time with each."""

    alpha_margin_px: int = 3
    """px, at that size, around what is transparent in which edges are left out: they are the mask's."""

    upright_share: float = 0.3
    """Share of the edges that are upright, in a usual picture, beside the density (per rad) of those that are not."""


@dataclass(frozen=True)
class StraightnessOptions:
    """How straight a panorama keeps an edge (`straightness`)."""

    points: int = 16
    """Places along an edge that are looked up: its shape between them is smooth."""

    end_margin: float = 0.02
    """Share of an edge at either end that is left out: detection ends it a little beyond what it lies on."""

    percentile: float = 90.0
    """Percentile of a place's distance from the edge's plane that counts as its bend: a single place at a jump of depth
    does not make it crooked."""


@dataclass(frozen=True)
class OwnDepthOptions:
    """Depth along each picture's own rays (`own_depth`)."""

    rounds: int = 2
    """Times that a depth is looked up again where the last one leads: more change nothing on surfaces."""

    same_share: float = 0.03
    """Share of an inverse range by which two may differ and still be one surface's."""

    same_parallax: float = 5e-4
    """The same in radians of parallax, in addition: half a pixel of a picture of 900."""


@dataclass(frozen=True)
class ChoiceOptions:
    """Choosing how far the viewpoint slides (`choosing_slide`). Prices are in px of bend, and were chosen so that the
    least cost is what the eye prefers on 33 pairs of photographs."""

    candidates: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Slides that are tried: the cost is smooth between them."""

    seam_candidates: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Slides at which a seam is cut and holes are counted, which takes longest; interpolated between."""

    parts: tuple[tuple[float, float], ...] = ((0.25, 0.75), (0.0, 0.5), (0.5, 1.0))
    """Parts of the way across the overlap within which the whole slide is tried as well. Beside them each picture is
    shown as it was taken, so that near things there stay whole; within them lines bend more."""

    least_cost: float = 0.25
    """Cost from which these are tried: below it hardly anything is bent or cut."""

    base_px_per_radian: float = 250.0
    """Resolution of the coarse map, and of the pictures through which a seam is cut: at 150 what a slide tears is not
    seen, twice as fine it takes three times as long."""

    px_per_radian: float = 900.0
    """Resolution in whose px bends and seams are given: about that of a picture that fills a screen."""

    least_length: float = 0.05
    """Share of a picture's longer side from which an edge counts: of a shorter one nobody sees the bend."""

    max_bend_px: float = 6.0
    """px of bend that an edge counts at most: more of it is a wrong depth, which no slide mends."""

    upright_within: float = 0.012
    """Radians off gravity within which an edge is upright, as its own picture shows it."""

    least_upright: float = 0.5
    """Length of all upright edges together, in longer sides, below which their lean counts for less: two or three may
    be something else."""

    max_lean_deg: float = 8.0
    """Degrees of lean that an edge counts at most."""

    per_lean_deg: float = 0.25
    """Price of a degree of mean lean."""

    max_enlarged: float = 1.3
    """Canvas px per px of a picture, in length, from which a cell is enlarged."""

    per_enlarged: float = 6.0
    """Price of all being enlarged."""

    least_area: float = 0.05
    """Share of its area in the picture below which a cell is folded, or about to."""

    per_folded: float = 15.0
    """Price of all being folded."""

    fold_steps: int = 9
    """Viewpoints along the way from which it is looked whether a thing is seen more than once."""

    same_slide: float = 1e-6
    """Slides that differ by no more are the same: rounding."""

    max_folded: float = 0.01
    """Share of folded cells, more than without any slide, from which a slide is out of the question."""

    max_stretched: float = 0.05
    """Share of enlarged cells, more than without any slide, from which a slide is out of the question: the parallax is
    too large for so short a way."""

    per_seam_px: float = 0.0044
    """Price of a px of seam that is seen."""

    max_seam_px: float = 175.0
    """px of such seam that count at most: of two bad ones, the longer is no worse."""

    per_hole: float = 40.0
    """Price of all being holes."""

    others_cost: float = 1.5
    """Times its cost up to which others are made where the panorama is torn: so much two sets of matches of one pair
    differ in what they say of a slide."""

    most_others: int = 2
    """Others that are made at most: each takes about a quarter of the time of all."""

    unlike: float = 0.5
    """Slides of the same part of the way that differ by less make much the same panorama."""

    hole_radius: float = 0.03
    """Radians from what is shown within which what is not shown, on all sides, is a hole."""

    tie_px: float = 0.03
    """Cost by which candidates may differ and still be as good: the one that slides least is taken, since what moved or
    has no depth of its own is torn by a slide."""

    tie_share: float = 0.03
    """The same as a share of the least cost; the larger counts."""

    cells: int = 90
    """Cells along a picture's longer side in which enlargement and folds are looked at."""

    smoothing: float = 0.006
    """σ, in longer sides, of the blur over depth before that: noise in depth is no fold that anyone sees."""

    least_jump_px: float = 4.0
    """px of parallax across a cell below which it lies on one surface, at `px_per_radian`."""

    jump_share: float = 0.12
    """The same as a share of its parallax, in addition: surfaces that are seen at a slant."""


@dataclass(frozen=True)
class SlideOptions:
    """How the viewpoint slides (`viewpoint`)."""

    percentiles: tuple[float, float] = (1.5, 98.5)
    """Per cent of the overlap, along the line between the pictures' centres, between which it slides: its corners do
    not count."""

    margin: float = 0.04
    """Share of that range by which the slide ends sooner on either side: what lies there is seen best."""

    straightened: float = 2.0
    """How many times as far apart in heading as in elevation (or the reverse) the centres are for the slide to go by
    that alone: then uprights stay upright."""

    least_apart: float = 0.02
    """Radians between the pictures' centres: of closer ones, neither has a side."""

    least_alone: float = 0.03
    """Share of each picture that it alone shows: with less the other one surrounds it."""

    inner: float = 0.5
    """Share of each side of the pictures, about their middle, in which a direction along the baseline lies well inside:
    nearer to their borders there is still room to slide past it."""

    nodes: int = 400
    """Nodes along the longer side of the base at which the overlap is looked at."""

    rounds: int = 4
    """Steps of false position for s: below a thousandth where the parallax is no more than the width of the slide."""

    least_range: float = 1e-9
    """Range, in that of the reference, of a point that the viewpoint slides through."""


@dataclass(frozen=True)
class UncoveredOptions:
    """What a sliding viewpoint uncovers or hides (`slid_warp`)."""

    least_behind_px: int = 3
    """px, side of the square below which what the reference cannot see is rounding."""

    same_share: float = 0.03
    """Share of d, with `same_px` px of parallax, by which a surface may differ from what was carried over."""

    same_px: float = 1.5
    """See `same_share`."""

    behind_share: float = 0.05
    """Share of its inverse depth, with `behind_px` px of parallax, by which a surface hides what lies behind it."""

    behind_px: float = 2.0
    """See `behind_share`."""

    reach_nodes: int = 200
    """Nodes along the longer side of the base at which the pictures' bounds are looked for."""

    most_beyond: float = 0.01
    """Share of what is shown that may lie beyond the projection's limits without a word: stray points do."""


CANVAS = CanvasOptions()
WARP = WarpOptions()
LAYER = LayerOptions()
PROJECTION = ProjectionOptions()
LEVELLING = LevellingOptions()
EDGES = EdgeOptions()
STRAIGHTNESS = StraightnessOptions()
OWN_DEPTH = OwnDepthOptions()
CHOICE = ChoiceOptions()
SLIDE = SlideOptions()
UNCOVERED = UncoveredOptions()
