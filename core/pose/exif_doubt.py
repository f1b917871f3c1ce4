"""Whether the matches of a pair clearly prefer another focal length than EXIF gives.

A wrong 35 mm equivalent (of a crop, of a digital zoom, of another sensor) pulls the pose, whose prior it is: the
inliers stay, and their residuals grow. So where these are clearly larger than by the fundamental matrix alone, which
knows no focal length, the start without EXIF is made as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..cameras.camera import Camera, Knowledge
from ..cameras.from_exif import without_exif
from ..cameras.matches import Matches
from ..cameras.projective import sampson_residuals
from ..cameras.two_view import TwoView
from ..system.errors import StitchError
from .fundamental import explained_by, fundamental_candidates
from .options import EXIF_DOUBT

Estimate = Callable[[Matches, Sequence[Camera]], TwoView]


def by_exif_or_without(
    matches: Matches, cameras: Sequence[Camera], seed: int, estimate: Estimate
) -> tuple[TwoView, tuple[Camera, ...]]:
    """The geometry of a pair, by its focal lengths of EXIF unless the matches clearly prefer others.

    Parameters
    ----------
    matches : Matches
        Ideal px.
    cameras : sequence of two Cameras
        As they are known.
    seed : int
        Of RANSAC.
    estimate : callable
        From matches and two cameras to the geometry; its errors pass, those of the start without EXIF do not.

    Returns
    -------
    TwoView
    (Camera, Camera)
        Those that it was found with: where EXIF was not believed, without it, and with a warning.
    """
    by_exif = estimate(matches, cameras)
    known = {camera.knowledge for camera in cameras}
    if known - {Knowledge.EXIF, Knowledge.ASSUMED} or Knowledge.EXIF not in known or len(matches) == 0:
        return by_exif, tuple(cameras)
    if not _doubtful(matches, by_exif, seed):
        return by_exif, tuple(cameras)
    free = tuple(without_exif(camera) for camera in cameras)
    try:
        without = estimate(matches, free)
    except StitchError:
        return by_exif, tuple(cameras)
    if not _clearly_better(matches, without, by_exif):
        return by_exif, tuple(cameras)
    told = exif_warning("the pictures", cameras[0], without.K[0, 0])
    return replace(without, warnings=(told, *without.warnings)), free


def preferred(
    matches: Matches, cameras: Sequence[Camera], instead: Sequence[Camera], seed: int, estimate: Estimate
) -> bool:
    """Whether the matches of a pair clearly prefer other cameras, of which as much is known, to those by EXIF.

    Parameters
    ----------
    matches : Matches
        Ideal px.
    cameras, instead : sequence of two Cameras
        As EXIF has them, and the others.
    seed, estimate
        As for `by_exif_or_without`; errors of the first cameras count for the others, errors of the others pass.

    Returns
    -------
    bool
    """
    other = estimate(matches, instead)
    try:
        by_exif = estimate(matches, cameras)
    except StitchError:
        return other.model == "general"
    if by_exif.model != "general" or other.model != "general" or not _doubtful(matches, by_exif, seed):
        return False
    return _costs_more(matches, by_exif, other)


def exif_warning(names: str, camera: Camera, focal: float) -> str:
    """What is said where EXIF was not believed; names: of the pictures; focal: what was taken, px."""
    return (
        f"the focal length in the EXIF of {names} ({camera.focal:.0f} px, {camera.source}) contradicts the matches, "
        f"which give {focal:.0f} px: that is used; a crop or a digital zoom since makes EXIF wrong; give it "
        "(--focal35, --focal-px) if you know it"
    )


def _doubtful(matches: Matches, by_exif: TwoView, seed: int) -> bool:
    """Whether the matches lie clearly nearer to the lines of a free fundamental matrix, or are said to be on a plane,
    which a wrong focal length makes of a rotation."""
    if by_exif.model != "general":
        return by_exif.model == "plane"
    noise = explained_by(fundamental_candidates(matches, seed)[0], matches)[1]
    return by_exif.sigma > EXIF_DOUBT.noise_factor * noise


def _clearly_better(matches: Matches, without: TwoView, by_exif: TwoView) -> bool:
    if by_exif.model == "plane":
        return without.model == "rotation"
    if without.model != "general" or not without.focal_deviation <= EXIF_DOUBT.most_deviation:
        return False
    apart = max(abs(np.log(K[0, 0] / other[0, 0])) for K, other in (
        (without.K, by_exif.K), (without.K_prime, by_exif.K_prime)
    ))  # fmt: skip
    return bool(apart > EXIF_DOUBT.apart) and _costs_more(matches, by_exif, without)


def _costs_more(matches: Matches, by_exif: TwoView, other: TwoView) -> bool:
    """Whether the matches clearly contradict one geometry beside another one."""
    sigma = min(other.sigma, by_exif.sigma)
    cost, cost_by_exif = (_cost(matches, one, sigma) for one in (other, by_exif))
    return cost_by_exif > EXIF_DOUBT.cost_factor * cost and cost_by_exif - cost > EXIF_DOUBT.least_gain


def _cost(matches: Matches, view: TwoView, sigma: float) -> float:
    """Squared residuals of all matches in units of their noise, each 9 at most."""
    squared = np.square(sampson_residuals(view.F, matches.x, matches.y) / sigma)
    return float(np.minimum(squared, 9.0).sum())
