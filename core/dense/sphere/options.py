"""What was chosen in dense refinement on the sphere: each value with its unit, and why it is what it is.

Values without a source were chosen on rendered sets and photographs: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ChartOptions:
    """Nodes on the sphere, and the patches that are worked on at once (`patch`, `refine_sphere`)."""

    max_nodes: float = 2e6
    """Nodes that several pictures show, at most: beyond, nodes lie further apart than the pictures' pixels."""

    rough_height: int = 180
    """Nodes from pole to pole of the chart that says where pictures show anything."""

    cell: int = 8
    """Nodes of the side of cells that say how many pictures show them. All measures of a chart are multiples of it."""

    margin_cells: int = 4
    """Such cells around what pictures show that a chart holds as well."""

    field_nodes: int = 60_000
    """Nodes of the grid that the smooth field is worked out on."""

    deviation_nodes: int = 4_000
    """The same of the grid that its deviation is worked out on: it changes slowly."""

    side: int = 512
    """Nodes of the side of a patch. The result depends on it, and on nothing that a machine has more or less of."""

    margin: int = 64
    """Nodes around a patch that are worked on with it: what is decided further away hardly reaches it."""

    beyond_cells: int = 8
    """Cells around what a picture shows best that are refined from its place as well: near things lie beside where the
    field has them."""

    field_steps: int = 8
    """Steps in which the field is carried to another place."""

    field_damping: float = 0.5
    """Share of each of them that is taken."""

    least_along: float = 0.05
    """The least range of a point of the field from another place, in that from the viewpoint."""

    coarse_step: int = 4
    """Nodes between places where what is smooth is worked out; between them it is interpolated."""

    least_share: float = 0.005
    """Share of a patch that several pictures have to show for it to be worth looking at."""

    lens_points: int = 17
    """Points along each side of a picture that tell how far its lens moves its border."""

    coarse_share: float = 0.25
    """Share of the time that the search at half the size takes."""


@dataclass(frozen=True)
class ChoiceOptions:
    """Which pictures are compared on a patch, and around which inverse range (`choice`)."""

    most: int = 4
    """Pictures that are compared at most: two or three beside the one that shows a node best."""

    least_share: float = 0.02
    """Share of a patch that a picture has to show."""

    border_px: int = 2
    """px, of the picture, from its border within which it is not looked at."""

    base_sigma: float = 0.05
    """Radians, σ, over which the field is smoothed before it is searched around: bends at the edges of near things
    would disturb the comparison."""

    least_parallax: float = 0.1
    """Length of the baseline across a ray, at least, as a share of the longest on the patch: it is divided by."""

    least_parallax_px: float = 0.5
    """px of parallax, at least, that the nearest point would have: below, the range makes no difference."""

    tone_px: int = 500
    """px that two pictures have to share at least for one to be given the tones of the other."""


@dataclass(frozen=True)
class SweepOptions:
    """The costs of all inverse ranges (`sweep`), and the search through them (`semi_global`, `search`). Levels are gray
    levels, 0 to 255; px are those of the longest parallax on a patch."""

    coarse_range_px: tuple[int, int] = (-24, 48)
    """px, at half the size, that are searched there: towards infinity, and towards the viewpoint."""

    margin_px: float = 6.0
    """px that are searched beyond what the points and the search at half the size ask for."""

    least_range_px: int = 16
    """px that are searched in either direction at least."""

    most_range_px: int = 96
    """The same at most."""

    range_percent: float = 0.3
    """% at either end of what was found at half the size that may lie beyond: errors."""

    points_percent: float = 0.5
    """The same of the points of the rig."""

    least_found: int = 50
    """Nodes that have to be found at half the size to tell a range."""

    most_levels: int = 24
    """Levels of difference at and above which all count alike: what is hidden may look like anything."""

    window: int = 3
    """Nodes of the side of the window that is compared: the smallest that averages noise."""

    prior_levels: float = 2.0
    """What it costs to lie away from the field: little, it only decides where the pictures do not."""

    rim_levels: float = 8.0
    """What it costs more at the very rim of what several pictures show, where there is no texture."""

    rim_levels_textured: float = 4.0
    """The same where there is much."""

    prior_px: float = 4.0
    """px from the field from which on this is so."""

    step_cost: int = 3
    """P1 of semi-global matching, levels: a change by one px between neighbours."""

    jump_cost: float = 16.0
    """P2 of the same, levels: any larger change where the picture has no edge."""

    edge_levels: float = 12.0
    """Levels of the gradient at which a jump costs half."""

    uniqueness: float = 1.02
    """Factor, of the summed costs, by which the second place has to be worse than the best."""

    beside: int = 2
    """px around the best place that belong to it."""

    agreement_px: float = 1.0
    """px by which nodes that fall on one pixel of a picture may lie apart to be one surface."""

    least_cost: float = 6.0
    """Levels of difference up to which a node may count as found whatever is usual: noise."""

    usual_percent: float = 80.0
    """% of the differences of found nodes that lie below the usual one."""

    usual_factor: float = 1.5
    """The largest difference of a found node, in usual ones: what is hidden is not found."""

    noise_px: float = 0.3
    """px, σ, of what is found: what rendered sets have."""

    speckle: float = 7.5
    """Nodes of the side of the largest piece that is taken for an error."""

    speckle_px: float = 2.0
    """px between neighbours of one such piece at most."""

    island: float = 64.0
    """The same of pieces that have to speak for themselves."""

    island_gain: float = 3.0
    """Levels, in the mean, by which an island has to be more alike than the field is at its place."""

    island_cost: float = 4.0
    """The largest mean difference of an island, in medians of all that was found."""

    island_floor: float = 3.0
    """That median at least, levels."""

    rim: float = 0.09
    """Radians from where only one picture goes on, within which nodes have to lie near the field."""

    rim_px: float = 3.0
    """px that they may lie away from it there, unless a surface from further inside goes on, or the pictures speak for
    it."""

    rim_gain: float = 8.0
    """Levels, in the mean, by which such nodes have to make the pictures more alike than the field does."""

    rim_cost: float = 2.0
    """The largest mean difference of theirs, in medians of all that was found."""


@dataclass(frozen=True)
class SphereOutlinesOptions:
    """Putting edges of depth where the pictures have an edge (`sphere_outlines`), as `outlines` does for a pair."""

    rounds: int = 2
    """Times that is done: what moves uncovers what is behind it."""

    reach: int = 5
    """Nodes from a jump within which nodes are looked at: what a picture cannot see beside a near thing took its range.
    """

    cell_px: float = 3.0
    """px of the side of the cells of a picture in which the nearest is looked for."""


@dataclass(frozen=True)
class ImprovedOptions:
    """Going back to the field (`improved`). Levels are gray levels, in the mean around a node."""

    smoothness: float = 30.0
    """λ, of the gain, along the edges of the picture."""

    most_levels: float = 8.0
    """The largest gain or loss of a node: what is hidden counts for no more."""

    doubt_levels: float = 0.25
    """Levels of loss at which all goes back to the field; with less, a share of it."""

    least_share: float = 1e-3
    """Share, of what is around a node, that is added to what several pictures show: it is divided by."""


CHART = ChartOptions()
CHOICE = ChoiceOptions()
SWEEP = SweepOptions()
SPHERE_OUTLINES = SphereOutlinesOptions()
IMPROVED = ImprovedOptions()
