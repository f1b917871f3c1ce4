"""How a panorama is levelled: by upright edges and by how the cameras were held, or by given angles.

Angles are those of Hugin and PTGui, in degrees: where the reference camera looks in the panorama. Yaw is to the right
of its middle, pitch above its horizon, roll clockwise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..cameras.projective import down_at, rotation_from_angles
from ..choices import LEVELS, Level
from ..raster.arrays import Array
from ..system.errors import BadRequest
from .options import LEVELLING
from .upright_edges import agreement


def parse_level(text: str) -> Level:
    """One of LEVELS, or (yaw, pitch, roll), from the command line's word. Raises BadRequest."""
    if text in LEVELS:
        return text
    try:
        yaw, pitch, roll = (float(part) for part in text.split(","))
    except ValueError:
        raise BadRequest(
            f"the level {text!r} is not known; choose from: {', '.join(LEVELS)}, or give YAW,PITCH,ROLL in degrees"
        ) from None
    return yaw, pitch, roll


def gravity(rotations: Sequence[Array]) -> Array:
    """Estimate which way is down from how the cameras were held.

    Brown and Lowe [1]_ take the direction perpendicular to all cameras' x axes, which nobody tilts on purpose. Cameras
    that look almost the same way do not determine it, so here each camera is also expected to look level, far more
    loosely: u minimises Σ ln(1 + (x_i·u)² / σ_roll²) + (z_i·u)² / σ_pitch². The logarithm ignores a camera that was
    turned on its side.

    Parameters
    ----------
    rotations : sequence of (3, 3) arrays
        From the reference camera to each that is known, itself (I) among them. Their rows are the x, y and z axes of
        that camera in the reference's frame.

    Returns
    -------
    (3,) array
        The unit vector down in the reference camera's frame.

    References
    ----------
    .. [1] Brown and Lowe, Automatic Panoramic Image Stitching using Invariant Features, IJCV 2007, section 4.
    """
    mean = sum(a[1] for a in rotations)
    down = mean / np.linalg.norm(mean) if mean[1] > 0.5 else np.array([0.0, 1.0, 0.0])
    roll_sigma, pitch_sigma = np.radians([LEVELLING.roll_sigma_deg, LEVELLING.pitch_sigma_deg])
    for _ in range(LEVELLING.iterations):
        cost = sum(
            np.outer(a[0], a[0]) / (roll_sigma**2 + (a[0] @ down) ** 2) + np.outer(a[2], a[2]) / pitch_sigma**2
            for a in rotations
        )
        least = np.linalg.eigh(cost)[1][:, 0]
        down = least * np.sign(least @ down)
    return down


def gravity_by_edges(rotations: Sequence[Array], normals: Array, lengths: Array) -> Array:
    """Estimate which way is down from how the cameras were held and from the upright edges that they saw.

    All upright edges meet in one point of the picture, the one straight down. Where some lie on the left and some on
    the right, that tells pitch as well as roll. The likeliest direction is searched for on a grid, from coarse to fine.

    Parameters
    ----------
    rotations : sequence of (3, 3) arrays
        See `gravity`.
    normals, lengths : (N, 3) and (N,) arrays
        Of straight edges, in the reference's frame (see `upright_edges.straight_edges`).

    Returns
    -------
    (3,) array
        The unit vector down in the reference camera's frame; that of `gravity` where edges agree on none.
    """
    by_pose = gravity(rotations)
    if not len(normals):
        return by_pose
    # directions around the camera's own axes, unless it was turned on its side
    base = np.eye(3) if by_pose[1] > np.cos(np.radians(LEVELLING.sideways_deg)) else upright(by_pose)
    roll_sigma, pitch_sigma = np.radians([LEVELLING.roll_sigma_deg, LEVELLING.pitch_sigma_deg])
    middle, pitch_reach, roll_reach = (0.0, 0.0), LEVELLING.pitch_reach_deg, LEVELLING.roll_reach_deg
    best = by_pose
    for number, (step, edge_sigma) in enumerate(LEVELLING.search_steps_deg):
        pitch, roll = (
            values.ravel() for values in np.radians(np.meshgrid(
                middle[0] + np.arange(-pitch_reach, pitch_reach + step / 2, step),
                middle[1] + np.arange(-roll_reach, roll_reach + step / 2, step),
            ))
        )  # fmt: skip
        down = down_at(pitch, roll) @ base.T
        pose_cost = sum(
            np.log1p(np.square(down @ a[0]) / roll_sigma**2) + np.square(down @ a[2]) / pitch_sigma**2
            for a in rotations
        )
        evidence = agreement(down, normals, lengths, float(np.radians(edge_sigma)))
        chance = LEVELLING.chance_factor * np.linalg.norm(lengths)
        if number == 0 and evidence.max() - np.median(evidence) < chance:
            return by_pose
        found = int(np.argmin(pose_cost - 2 * LEVELLING.edge_weight * evidence))
        best, middle = down[found], (float(np.degrees(pitch[found])), float(np.degrees(roll[found])))
        pitch_reach = roll_reach = LEVELLING.narrowing * step
    return best


def confirmed(down: Array, normals: Array, lengths: Array) -> bool:
    """Whether most of the edges that are nearly upright agree on which way is down (3,); normals, lengths: see
    `gravity_by_edges`."""
    tilt = np.abs(normals @ down)
    near, agreeing = (lengths[tilt < np.sin(np.radians(limit))].sum() for limit in LEVELLING.confirming_tilts_deg)
    return bool(agreeing > max(LEVELLING.confirming_share * near, LEVELLING.confirming_length))


def upright(down: Array) -> Array:
    """The rotation (3, 3) to the reference's frame from a panorama whose y axis is `down` (3,), given in that frame.

    The panorama's middle lies where the reference looks.
    """
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.column_stack([np.cross(down, ahead), down, ahead])


def turned(yaw: float, pitch: float, roll: float) -> Array:
    """The rotation (3, 3) from the panorama's axes to those of a camera at these angles (degrees)."""
    return rotation_from_angles(yaw, pitch, roll).T


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """yaw, pitch, roll in degrees of a rotation (3, 3), the inverse of `turned`; roll is 0 straight up or down."""
    to_panorama = rotation.T
    pitch = np.arcsin(np.clip(-to_panorama[1, 2], -1, 1))
    if abs(to_panorama[1, 2]) > 1 - 1e-12:
        yaw, roll = np.arctan2(-to_panorama[2, 0], to_panorama[0, 0]), 0.0
    else:
        yaw = np.arctan2(to_panorama[0, 2], to_panorama[2, 2])
        roll = np.arctan2(to_panorama[1, 0], to_panorama[1, 1])
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))
