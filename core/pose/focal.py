"""How well the matches determine the focal length, and warnings about it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..cameras.camera import Camera, zoomed
from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, infinite_homography, project
from .options import FOCAL
from .refinement import Pose, focal_deviations, refine_pose


@dataclass(frozen=True)
class KnownFocal:
    """source: where the focal length comes from, in words; deviation: of log f, by matches and prior; h_inf_spread: px
    that H_inf moves within two deviations (median over the target); warnings."""

    source: str
    deviation: float
    h_inf_spread: float
    warnings: tuple[str, ...] = ()


def known_focal(
    matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, sigma: float, zoom: bool
) -> KnownFocal:
    """The uncertainty of the focal length of a refined pose, from its inlier matches; sigma: their noise in px."""
    if camera.fixed or camera_prime.fixed:
        return KnownFocal(camera.source, 0.0, 0.0)
    with_prior, alone = focal_deviations(matches, pose, camera, camera_prime, sigma, zoom)
    spread = _spread(matches.thinned(FOCAL.spread_matches), pose, camera, camera_prime, sigma, 2 * with_prior)
    if alone <= FOCAL.undetermined:
        source = f"the matches, from {camera.source}" if camera.assumed else camera.source
        return KnownFocal(source, with_prior, spread)
    if not camera.assumed:
        return KnownFocal(camera.source, with_prior, spread)
    return KnownFocal(
        f"not determined by the matches, {camera.source}", with_prior, spread,
        (
            f"the focal length is not determined by the matches ({pose.K[0, 0]:.0f} px ± {with_prior:.0%} is taken): "
            f"what is at infinity may lie {spread:.0f} px off; the overlap hardly depends on it, depth does; give "
            "the focal length (--focal35, --focal-px) if you know it",
        ),
    )  # fmt: skip


def held_focal(matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, sigma: float) -> KnownFocal:
    """The same for a focal length that was not refined: its uncertainty is the prior's."""
    deviation = max(camera.log_sigma, camera_prime.log_sigma)
    few = matches.thinned(FOCAL.spread_matches)
    spread = _spread(few, pose, camera, camera_prime, sigma, 2 * deviation) if deviation else 0.0
    return KnownFocal(camera.source, deviation, spread)


def _spread(
    matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, sigma: float, change: float
) -> float:
    """How far (px) H_inf moves, in the median over the target, when log f changes by ± change and the pose follows."""
    width, height = camera_prime.size
    u, v = np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 7))
    there = homogeneous(np.column_stack([u.ravel(), v.ravel()]))
    back = there @ np.linalg.inv(infinite_homography(pose.K, pose.K_prime, pose.R)).T
    moved = []
    for factor in (math.exp(-change), math.exp(change)):
        held = (camera, pose.K), (camera_prime, pose.K_prime)
        first, second = (replace(c.with_focal_held(), K=zoomed(K, factor)) for c, K in held)
        other, _ = refine_pose(matches, Pose(first.K, second.K, pose.R, pose.t), first, second, sigma)
        away = project(back @ infinite_homography(other.K, other.K_prime, other.R).T) - there[:, :2]
        moved.append(float(np.median(np.linalg.norm(away, axis=1))))
    return max(moved)


def focal_warnings(pose: Pose, camera: Camera, camera_prime: Camera) -> list[str]:
    """Warnings where the matches moved a focal length far from what the file claims."""
    out = []
    for name, K, cam in (("reference", pose.K, camera), ("target", pose.K_prime, camera_prime)):
        moved = K[0, 0] / cam.focal - 1
        if not cam.assumed and not cam.fixed and abs(moved) > FOCAL.contradiction_sigmas * cam.log_sigma:
            out.append(
                f"the matches contradict the {name}'s focal length: {cam.focal:.0f} px from {cam.source}, "
                f"{K[0, 0]:.0f} px ({moved:+.0%}) from the matches; was the picture cropped? "
                "give it with --focal-px if you know it"
            )
    return out
