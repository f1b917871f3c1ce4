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


HOMOGRAPHY = HomographyOptions()
APAP = ApapOptions()
REW = RewOptions()
