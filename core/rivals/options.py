"""What was chosen where the papers of the rivals leave it open, or where following them would do them wrong."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HomographyOptions:
    """One homography for the whole picture (`homography`). px are in units of the matches' scale."""

    inlier_px: float = 10.0
    """px from the homography beyond which a match has no say. Parallax is noise to a homography: with the few px of a
    keypoint's own noise it would hold on to one plane of the scene, far from the best for all of it."""

    min_matches: int = 6
    """Matches below which no homography is fitted: four determine it, two more say something about the fit."""

    max_reweightings: int = 300
    """Reweighted fits at most; many are needed where the inliers change slowly."""

    settled: float = 1e-12
    """Change of an entry, relative to the largest one, at which reweighting ends."""

    magsac_iterations: int = 10_000
    """Samples that MAGSAC++ draws at most."""

    magsac_confidence: float = 0.999
    """Probability at which MAGSAC++ ends before."""


@dataclass(frozen=True)
class ApapOptions:
    """Moving direct linear transformation (`apap`; Zaragoza et al., CVPR 2013)."""

    sigma: float = 0.05
    """σ of the weights in units of √(W·H) of the reference: the paper's code has 50 to 140 px for pictures of 1 to 3
    megapixels."""

    gamma: float = 0.0025
    """γ, the least weight of a match: from the same code."""

    weights_at_once: int = 4_000_000
    """Weights held in memory at once: 32 MB in float64. Results do not depend on it."""


@dataclass(frozen=True)
class RewOptions:
    """Robust elastic warping (`rew`; Li et al., IEEE TMM 2018). px are in units of the matches' scale."""

    max_zoom: float = 2.0
    """Factor within which the focal lengths are known: without a bound parallax may drive them anywhere."""

    max_error_px: float = 1e4
    """px (of the picture) at which the distance of a match is cut off, and what one behind the camera counts."""

    max_evaluations: int = 100
    """Evaluations of the least-squares fit at most."""

    noise_floor_px: float = 0.1
    """px: the scale of the robust loss is never smaller."""

    max_error_ratio: float = 1.2
    """Factor by which a rotation, with less freedom, may miss the matches further than a homography and be kept."""

    max_rotation_px: float = 0.5
    """px that a rotation may miss them by in any case."""


@dataclass(frozen=True)
class LineOptions:
    """Straight lines of two pictures, matched and joined (`lines`). px are in units of the matches' scale."""

    neighbours: int = 8
    """Matches beside a line's end that say where it lies on the reference: enough for a median."""

    turn_deg: float = 4.0
    """Degrees by which the same line may differ in direction: detection is off by one, and parallax turns lines."""

    off_px: float = 6.0
    """px by which its ends may be off the other's line: what matches beside it are uncertain by at a jump of depth."""

    shared: float = 0.5
    """Share of the shorter of two lines that both must have in common along it."""

    joined_px: float = 2.0
    """px by which both ends of a piece may be off the line that it is joined to."""

    joined_deg: float = 1.5
    """Degrees by which a piece may be turned from it."""


@dataclass(frozen=True)
class LineMethod:
    """Cells and weights of SPW or LPC, as in the authors' published programs. Weights are of squared px; matched
    points have 1."""

    cell_px: float
    """px of a cell's side."""

    even: float
    """Even division of lines that converge, beyond the overlap."""

    pieces: float
    """Detected segments that keep the slope which the homography gives them."""

    least_diagonals: float
    """Diagonals of a cell below which a segment is left out."""

    long: float | None
    """The same of long lines, detected or joined of pieces; None: nothing is joined, and all count as pieces."""

    long_diagonals: float = 2.0
    """Diagonals of a cell from which a line is long."""

    lines: float = 5.0
    """Both ends of matched lines meet the other's line."""

    slopes: float = 50.0
    """Cross lines keep their slopes; those that stay parallel are evenly divided, too."""


@dataclass(frozen=True)
class LineMeshOptions:
    """Meshes of SPW (Liao and Li, IEEE TIP 2020) and LPC (Jia et al., CVPR 2021).

    px are in units of the matches' scale.
    """

    max_nodes: int = 6000
    """Nodes at most: cells of large pictures are larger, and the mesh as fine as in the papers' pictures."""

    samples_per_cell: int = 2
    """Points along a line, and cross lines, to a cell's side: as in both programs."""

    least_ahead: float = 0.05
    """Third coordinate of a corner, relative to the middle's, below which a homography has no use as a start."""

    ridge: float = 1e-4
    """Weight of a node's way from where the homography has it: less than any match counts, it settles only nodes that
    nothing else speaks of."""

    homography_steps: int = 5
    """Gauss-Newton steps of the homography of points and lines; it starts next to its end."""

    far_px: float = 1e7
    """px outside the picture at which a point behind the camera is put."""

    spw: LineMethod = LineMethod(cell_px=40.0, even=5.0, pieces=5.0, least_diagonals=1.0, long=None)
    """SPW's program."""

    lpc: LineMethod = LineMethod(cell_px=50.0, even=100.0, pieces=50.0, least_diagonals=0.5, long=100.0)
    """LPC's."""


LINES = LineOptions()
LINE_MESH = LineMeshOptions()
HOMOGRAPHY = HomographyOptions()
APAP = ApapOptions()
REW = RewOptions()
