"""How a round panorama is turned: its horizon by upright edges and by how the pictures were held, or by hand.

Angles are those of Hugin and PTGui: where the reference camera looks in the panorama. Yaw to the right of its middle,
pitch above its horizon, roll clockwise, in degrees.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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


def rotation_for(level: Level, rotations: Sequence[Array], edges: tuple[Array, Array] | None = None) -> Array:
    """The rotation (3, 3) from the panorama's axes to the reference camera's.

    level: `auto`, `none` (the reference looks straight ahead) or yaw, pitch, roll; rotations (3, 3): see
    `gravity`; edges: see `gravity_by_edges`.
    """
    if level == "auto":
        return upright(gravity(rotations) if edges is None else gravity_by_edges(rotations, *edges))
    return turned(*(0.0, 0.0, 0.0) if isinstance(level, str) else level)


def gravity(rotations: Sequence[Array]) -> Array:
    """The direction down (3,) in the reference camera's frame, from how the cameras were held.

    rotations (3, 3): from the reference camera to each that is known, itself (I) among them; their rows are the x, y
    and z axes of a camera in the reference's frame.

    Brown and Lowe (IJCV 2007, section 4) take the direction that is square to all cameras' x axes, which nobody tilts
    on purpose. With cameras that look almost the same way that is anything, so here each camera counts as level too,
    far more loosely: u minimises Σ ln(1 + (x_i·u)² / σ_roll²) + (z_i·u)² / σ_pitch². The logarithm lets go of a camera
    that was turned on its side.
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
    """The direction down (3,) in the reference camera's frame: of those near `gravity` the likeliest by how the
    cameras were held and by the upright edges that they saw.

    normals (N, 3), in the reference's frame, and lengths (N,): see `upright_edges.edges`. All uprights meet in one
    point of the picture, which is where down is: that tells pitch, too, where there are some to the left and to the
    right.
    """
    held = gravity(rotations)
    if not len(normals):
        return held
    # from the camera's own axes, but where it was turned on its side
    base = np.eye(3) if held[1] > np.cos(np.radians(LEVELLING.sideways_deg)) else upright(held)
    roll_sigma, pitch_sigma = np.radians([LEVELLING.roll_sigma_deg, LEVELLING.pitch_sigma_deg])
    middle, pitch_reach, roll_reach = (0.0, 0.0), LEVELLING.pitch_reach_deg, LEVELLING.roll_reach_deg
    best = held
    for number, (step, off) in enumerate(LEVELLING.search_steps_deg):
        pitch, roll = (
            values.ravel() for values in np.radians(np.meshgrid(
                middle[0] + np.arange(-pitch_reach, pitch_reach + step / 2, step),
                middle[1] + np.arange(-roll_reach, roll_reach + step / 2, step),
            ))
        )  # fmt: skip
        down = np.column_stack([np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch), np.sin(pitch)]) @ base.T
        unlikely = sum(
            np.log1p(np.square(down @ a[0]) / roll_sigma**2) + np.square(down @ a[2]) / pitch_sigma**2
            for a in rotations
        )
        speaks = agreement(down, normals, lengths, float(np.radians(off)))
        chance = LEVELLING.chance_factor * np.linalg.norm(lengths)
        if number == 0 and speaks.max() - np.median(speaks) < chance:
            return held
        found = int(np.argmin(unlikely - 2 * LEVELLING.edge_weight * speaks))
        best, middle = down[found], (float(np.degrees(pitch[found])), float(np.degrees(roll[found])))
        pitch_reach = roll_reach = LEVELLING.narrowing * step
    return best


def upright(down: Array) -> Array:
    """The rotation (3, 3) from a panorama whose y axis is `down` (3,), in the reference's frame, and in whose middle
    the reference's direction lies."""
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.column_stack([np.cross(down, ahead), down, ahead])


def turned(yaw: float, pitch: float, roll: float) -> Array:
    """The rotation (3, 3) from the panorama's axes to those of a camera at these angles (degrees)."""
    (sy, sp, sr), (cy, cp, cr) = (f(np.radians([yaw, pitch, roll])) for f in (np.sin, np.cos))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    rotation: Array = (about_y @ about_x @ about_z).T
    return rotation


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """yaw, pitch, roll in degrees of a rotation (3, 3): the inverse of `turned`; straight up or down, roll is 0."""
    to_panorama = rotation.T
    pitch = np.arcsin(np.clip(-to_panorama[1, 2], -1, 1))
    if abs(to_panorama[1, 2]) > 1 - 1e-12:
        yaw, roll = np.arctan2(-to_panorama[2, 0], to_panorama[0, 0]), 0.0
    else:
        yaw = np.arctan2(to_panorama[0, 2], to_panorama[2, 2])
        roll = np.arctan2(to_panorama[1, 0], to_panorama[1, 1])
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))
