"""What was chosen in dense refinement, step by step: each value with its unit, and why it is what it is.

Values without a source were chosen on photographs and rendered scenes: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RefineOptions:
    """The order of the work, and what guides the smoothing (`refine`)."""

    max_searched_px: float = 1.5e6
    """Pixels of the overlap that are searched at most: beyond, both pictures are shrunk for it."""

    max_refined_px: float = 3e6
    """Pixels of the overlap that get a node of their own at most: beyond, nodes lie further apart than pixels."""

    min_reach_px: float = 24.0
    """px, of the shrunk pictures, that are searched along the lines in either direction at least."""

    max_reach_px: float = 96.0
    """The same at most: time and memory grow with it, and so do false matches."""

    edge_levels: float = 4.0
    """Gray levels between neighbours at which their connection falls by e; noise is blurred away before."""

    smoothness: float = 5.0
    """λ of the smoothing that fills what was not found, relative to a pixel found at full size."""

    field_confidence: float = 1e-2
    """What the sparse field counts where nothing was found, relative to a found pixel: it decides only where there is
    nothing else."""

    depth_edge_px: float = 0.3
    """px between the moves of neighbours at which their connection falls to half where the guide has an edge, too."""

    half_texture: float = 1.0
    """Squared gradient along the line, (gray levels per px)², at which a surface counts as half textured."""

    plain_strength: float = 15.0
    """What is added to the connection of neighbours (1 by the usual) that are half textured; where there is nothing to
    match, `SmoothingOptions.max_plain_odds` times as much."""

    plain_doubt: float = 0.99
    """Share by which what was found there counts less, unless both pictures look alike there: noise does not, a soft
    surface does."""

    confidence_nodes: int = 9
    """Nodes of the side of the window in which confidence is the share that was found."""

    overlap_nodes: int = 64
    """Nodes along the longer side of the reference that say where the overlap lies."""

    min_overlap_px: int = 32
    """px of the shorter side of the overlap below which nothing is refined."""


@dataclass(frozen=True)
class MatchingOptions:
    """Semi-global matching along rectified rows (`matching`; Hirschmüller, IEEE TPAMI 2008)."""

    block_px: int = 3
    """px of the side of a block that is compared: the smallest that averages noise; larger ones widen near things."""

    step_cost: int = 8
    """P1 of the paper, per pixel of a block: cost of a change by one px between neighbours. OpenCV's documentation
    suggests 8 for each channel."""

    jump_cost: int = 48
    """P2 of the paper, per pixel of a block: cost of any larger change. Six times P1, where OpenCV suggests four: the
    field is nearly right already, and jumps are few."""

    uniqueness_percent: int = 2
    """% by which the best place has to beat the second best: low, since the check from the other side follows."""

    costs_at_once: int = 100_000_000
    """Costs (of a pixel at a place) held at once, four bytes each: more rows are matched band by band."""

    band_margin_rows: int = 32
    """Rows beside a band that are matched with it: paths of the matcher forget where they came from within these."""

    coarse_smoothness: int = 4
    """Factor of both costs at half the size, where what was not found at full size is looked for."""

    coarse_confidence: float = 0.1
    """What is found only there counts, relative to what is found at full size."""

    wide_texture: int = 16
    """Gray levels, in a Sobel filter's units, along the row that a point has to have for what is found further away to
    count: in a sky anything is found."""

    range_share: float = 0.05
    """% of such points, at either end, that may lie beyond what is searched at full size: errors."""

    range_margin_px: float = 8.0
    """px that are searched beyond the others."""

    wide_share: float = 0.2
    """% of such points, at either end, that may lie further away than is searched at full size."""

    max_wide_share: float = 0.05
    """Share of them, 0 to 1, from which on the geometry is doubted rather than the range."""

    speckle_side: float = 0.012
    """Side of the largest patch that is taken for an error, as a share of the side of the rows' picture."""

    speckle_range_px: int = 2
    """px between neighbours of one such patch at most."""

    sublevels: int = 32
    """Steps of a gray level in which the target is resampled before its tones become the reference's: its curve may be
    steep."""

    tone_quantiles: int = 64
    """Quantiles of the histograms that the tone curve between the pictures goes through."""

    bend_sizes: tuple[float, ...] = (0.2, 0.1, 0.05, 0.025, 0.0)
    """Shares of the picture's side: bends of the field finer than this are taken out before the search. The first, and
    so the smoothest, that leaves all within reach is used; 0: none are taken out."""

    reach_percentile: float = 99.5
    """% of the matches that have to lie within reach: the last few are outliers."""

    reach_factor: float = 1.25
    """What lies between the matches may be so many times further from the field than they are."""

    reach_margin_px: float = 8.0
    """px, of the full picture, that are searched beyond that in any case."""


@dataclass(frozen=True)
class LinesOptions:
    """Evaluating epipolar lines and rows (`epipolar_lines`, `epipolar_rows`)."""

    strip_rows: int = 32
    """Rows of nodes that a thread works on at once, so that they stay near the processor. No result depends on it."""

    max_epipole_distance: float = 1e6
    """Sides of the picture at which an epipole at infinity is put: lines of a picture 10 000 px wide then spread by a
    hundredth of a px."""


@dataclass(frozen=True)
class SmoothingOptions:
    """The fast global smoother (`edge_aware_smoothing`; Min et al., IEEE TIP 2014)."""

    passes: int = 2
    """Times that rows and columns are smoothed: the paper's third changes nothing that could be measured here."""

    attenuation: float = 4.0
    """Factor by which λ falls from pass to pass, of the paper's equation 11."""

    edge_reach_px: int = 7
    """px of the side of the window in which an edge of the guide is looked for beside a jump in the values."""

    max_plain_odds: float = 20.0
    """Where there is no texture, neighbours are strengthened by so many times what half a texture gives: a bound."""


@dataclass(frozen=True)
class OutlinesOptions:
    """Putting edges of depth where the reference has an edge (`outlines`). Gray levels are 0 to 255."""

    reach: int = 2
    """Nodes from a jump within which nodes are looked at: windows make near things wider by less."""

    jump_nodes: int = 5
    """Nodes of the side of the window in which moves jump."""

    jump_px: float = 2.0
    """px of the moves between a node and its neighbours from which on they jump."""

    median_nodes: int = 5
    """Nodes of the side of the median's window that takes out specks; OpenCV has 3 or 5 for floats."""

    example: float = 0.05
    """How surely a node has to be found at least to be an example for others."""

    max_levels: float = 24.0
    """Gray levels of difference at and above which all count alike."""

    usual_percentile: float = 80.0
    """% of the differences at sure nodes that lie below the usual one."""

    behind: float = 2.6
    """What a node costs that lies behind something nearer, in usual differences: nearer nodes have to match so well to
    be preferred."""

    min_behind: float = 4.0
    """The same at least, gray levels: noise."""

    sure: float = 0.99
    """How surely a node was found at least that says what is usual."""

    same_px: float = 1.5
    """px along the line by which something has to be nearer at least to hide a node."""

    cell_px: float = 4.0
    """px of the side of the cells of the target in which the nearest is looked for."""

    every: int = 3
    """One node in so many rows and columns says what is nearest and what is usual: at most a cell apart."""

    row: int = 1024
    """Nodes that are looked at in a row. No result depends on it."""

    smoothness: float = 6.0
    """λ of the edge-aware average of differences."""

    least_gain: float = 0.5
    """Gray levels by which the pictures have to be more alike for a node to change."""

    least_px: float = 1.0
    """px of change that is worth it: less is left to `polish`."""


@dataclass(frozen=True)
class UnfoldingOptions:
    """Taking out folds that are not occlusions (`unfolding`)."""

    rounds: int = 2
    """Times that occlusion is looked at: unfolding uncovers what seemed hidden."""

    median_steps: int = 4
    """Smoothing steps by medians a round, which leave what is right as it is."""

    mean_steps: int = 4
    """Smoothing steps by means after them, which end what is left."""

    median_nodes: int = 5
    """Nodes of the side of a median's window; OpenCV has 3 or 5 for floats."""

    min_mean_sigma: float = 1.5
    """Nodes: σ of the first mean."""

    means_per_doubling: int = 6
    """Steps by means over which σ doubles: what does not help is done more widely."""

    max_move_px: float = 8.0
    """px: more than noise moves a node by. Smoothing that would move any node of a patch further has met the rim of a
    near thing that occlusion did not find, and the patch stays as it was."""

    min_relative_area: float = 0.1
    """Area, relative to the usual, that a cell of nodes takes up in the target at least where it is not folded."""

    occlusion_margin: int = 5
    """Nodes of the side of the window around occluded ones in which nothing is smoothed."""

    usual_area_every: int = 17
    """One node in so many says what area is usual; a prime divides few widths, so that all columns have their say."""

    smoothing_reach: int = 12
    """Nodes beyond a fold, on each side, that are smoothed with it: more than the widest mean looks at."""

    strip_rows: int = 128
    """Rows of nodes that a thread looks at at once. No result depends on it."""


@dataclass(frozen=True)
class PolishOptions:
    """The last fraction of a pixel (`polish`; Lucas and Kanade, IJCAI 1981). Gray levels are 0 to 255."""

    schedule: tuple[tuple[float, int], ...] = ((1.0, 2), (0.6, 1))
    """σ in px that both pictures are blurred by, and Gauss-Newton steps at it: smoother ones reach further."""

    window_px: int = 5
    """px of the side of the window whose pixels move alike: the smallest that averages noise."""

    surroundings_px: int = 15
    """px of the side of the window over which gain and bias between the pictures are constant."""

    strip_rows: int = 128
    """Rows of nodes that a thread works on at once, so that they stay near the processor. No result depends on it."""

    max_step_px: float = 1.0
    """px that a node moves in a step at most: gradients hold no further."""

    smoothness: float = 1.5
    """λ of the edge-aware smoothing between the steps."""

    half_evidence: float = 25.0
    """Squared gradient, (gray levels per px)², at which a node counts about half among its neighbours."""

    start_evidence: float = 15.0
    """The same unit: what the moves count that polishing starts at."""

    min_evidence: float = 10.0
    """The same unit: what a node counts among its neighbours at least."""

    damping: float = 1.0
    """The same unit: added to what divides a step, so that it stays finite."""

    min_confidence: float = 1e-4
    """What a node counts in the smoothing at least, so that it has a solution everywhere."""

    gain_noise: float = 25.0
    """Variance in gray levels squared that noise has: below, the gain between the pictures tends to 1."""

    max_gain: float = 2.0
    """Factor of contrast, either way, that the pictures may differ by around a node."""

    min_half_residual: float = 2.0
    """Gray levels at which a residual counts half, at least: noise of a usual picture."""

    half_residual_factor: float = 1.5
    """The same in medians of the residuals' magnitudes: about their standard deviation."""

    across_width: float = 0.03
    """Share of the picture's side, σ, over which moves across the lines vary: a lens bends slowly."""

    across_step: int = 8
    """Nodes between places where these moves are worked out: they are smooth."""

    across_damping: float = 0.5
    """Share of the mean evidence that is added to what divides these moves: where there is little, little is done."""


REFINE = RefineOptions()
MATCHING = MatchingOptions()
LINES = LinesOptions()
SMOOTHING = SmoothingOptions()
OUTLINES = OutlinesOptions()
UNFOLDING = UnfoldingOptions()
POLISH = PolishOptions()
