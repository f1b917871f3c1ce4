"""Formulas of two-view geometry: F, H_inf, the epipole, distances, cheirality.

Convention, everywhere: pixel centres are integers; the target camera sees a world point X of the reference camera's
frame at R X + t; x' is a target pixel, x a reference pixel; x'ᵀ F x = 0. Source of the formulas: Hartley and Zisserman,
Multiple View Geometry, 2nd ed., chapters 9 (F, epipoles, pose from E), 11.4 (Sampson distance) and 13.1 (H_inf).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Blender renders with these, and has no OpenCV
    from ..raster.arrays import Array

# The third homogeneous coordinate of a point in front of its camera, relative to the larger of the other two.
LEAST_AHEAD = 1e-6


def homogeneous(points: NDArray[Any]) -> Array:
    """(…, 2) points as (…, 3) with a one behind."""
    points = np.asarray(points, np.float64)
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)


def project(rays: Array) -> Array:
    """π(a, b, c) = (a/c, b/c) of (…, 3) vectors; c > 0 is not checked."""
    return rays[..., :2] / rays[..., 2:]


def ahead_of_camera(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[np.bool_]:
    """Which homogeneous pixels (a, b, c) of unchanged sign lie in front of their camera; False for NaN.

    What is less than LEAST_AHEAD in front, relative to its own length, would be shown outside any picture.
    """
    ahead: NDArray[np.bool_] = c > LEAST_AHEAD * np.maximum(np.abs(a), np.abs(b))
    return ahead


def normalisation(points: Array) -> Array:
    """The similarity (3, 3) that moves points to mean 0 and mean distance √2 (H&Z 4.4.4)."""
    centre = points.mean(axis=0)
    scale = np.sqrt(2) / max(float(np.linalg.norm(points - centre, axis=1).mean()), 1e-12)
    return np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1.0]])


def skew(v: Array) -> Array:
    """The matrices (…, 3, 3) that take the cross product with vectors (…, 3) from the left."""
    out = np.zeros((*v.shape, 3))
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def down_at(pitch: Array, roll: Array) -> Array:
    """Unit vectors (M, 3) down, in a camera's axes, where it is pitched and rolled by so much (M,), rad."""
    return np.column_stack([np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch), np.sin(pitch)])


def rotation_from_vector(omega: Array) -> Array:
    """Rodrigues' formula: rotation vector in radians (3,) to a rotation matrix (3, 3)."""
    angle = float(np.linalg.norm(omega))
    if angle < 1e-12:
        return np.eye(3) + skew(omega)
    axis = skew(omega / angle)
    R: Array = np.eye(3) + np.sin(angle) * axis + (1 - np.cos(angle)) * axis @ axis
    return R


def rotation_from_angles(yaw: float, pitch: float, roll: float) -> Array:
    """The rotation (3, 3) from the axes of a camera at these angles (degrees) to those of the panorama."""
    (sy, sp, sr), (cy, cp, cr) = (f(np.radians([yaw, pitch, roll])) for f in (np.sin, np.cos))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    rotation: Array = about_y @ about_x @ about_z
    return rotation


def rotation_angle(R1: Array, R2: Array) -> float:
    """Angle between two rotations in degrees; 2·asin form, exact to rounding for small angles."""
    return float(np.degrees(2 * np.arcsin(min(1.0, np.linalg.norm(R1 - R2) / (2 * np.sqrt(2))))))


def inverse_intrinsics(K: Array) -> Array:
    """K⁻¹ of [[fx, s, cx], [0, fy, cy], [0, 0, 1]], written out: a refinement asks for it thousands of times."""
    fx, s, cx, fy, cy = K[0, 0], K[0, 1], K[0, 2], K[1, 1], K[1, 2]
    return np.array([[1 / fx, -s / (fx * fy), (s * cy - cx * fy) / (fx * fy)], [0, 1 / fy, -cy / fy], [0, 0, 1]])


def infinite_homography(K: Array, K_prime: Array, R: Array) -> Array:
    """H_inf = K' R K⁻¹, not normalised: the third part of H_inf p is positive in front of the target camera."""
    return K_prime @ R @ inverse_intrinsics(K)


def fundamental_from_pose(K: Array, K_prime: Array, R: Array, t: Array) -> Array:
    """F = K'⁻ᵀ [t]ₓ R K⁻¹, scaled to Frobenius norm 1."""
    F = inverse_intrinsics(K_prime).T @ skew(t) @ R @ inverse_intrinsics(K)
    return F / np.linalg.norm(F)


def sampson_residuals(F: Array, x: Array, y: Array) -> Array:
    """Signed first-order distance in px of matches x ↔ y (N, 2) from satisfying yᵀ F x = 0 (H&Z eq. 11.9, rooted)."""
    line_y, line_x, algebraic = _lines(F, x, y)
    gradient = line_y[:, 0] ** 2 + line_y[:, 1] ** 2 + line_x[:, 0] ** 2 + line_x[:, 1] ** 2
    residuals: Array = algebraic / np.sqrt(np.maximum(gradient, 1e-300))
    return residuals


def distance_to_line(F: Array, x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Distance in px of each target point y from the epipolar line F x of its reference point x."""
    line_y, _, algebraic = _lines(F, x, y)
    distances: Array = np.abs(algebraic) / np.maximum(np.hypot(line_y[:, 0], line_y[:, 1]), 1e-300)
    return distances


def _lines(F: Array, x: NDArray[Any], y: NDArray[Any]) -> tuple[Array, Array, Array]:
    a, b = homogeneous(x), homogeneous(y)
    line_y, line_x = a @ F.T, b @ F
    return line_y, line_x, np.sum(b * line_y, axis=1)


def poses_from_fundamental(F: Array, K: Array, K_prime: Array) -> list[tuple[Array, Array]]:
    """The four (R, t) of E = K'ᵀ F K (H&Z result 9.19), |t| = 1; `pose_of_fundamental` picks among them."""
    U, _, Vt = np.linalg.svd(K_prime.T @ F @ K)
    U *= np.sign(np.linalg.det(U))
    Vt *= np.sign(np.linalg.det(Vt))
    W = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    t = U[:, 2]
    return [(R, sign * t) for R in (U @ W @ Vt, U @ W.T @ Vt) for sign in (1.0, -1.0)]


def in_front(K: Array, K_prime: Array, R: Array, t: Array, x: Array, y: Array, slack: float = 0.0) -> NDArray[np.bool_]:
    """Which matches triangulate in front of both cameras, by the closest points of their two rays.

    Parameters
    ----------
    K, K_prime : (3, 3)
        Intrinsics, px.
    R, t : (3, 3), (3,)
        Reference to target camera.
    x, y : (N, 2)
        px of the reference and of the target.
    slack : float
        Sine of the parallax angle below which a point counts as infinitely far, hence in front, if its rays agree in
        direction.

    Returns
    -------
    (N,) bool
    """
    ray = homogeneous(x) @ inverse_intrinsics(K).T
    ray_prime = homogeneous(y) @ inverse_intrinsics(K_prime).T
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    ray_prime /= np.linalg.norm(ray_prime, axis=1, keepdims=True)
    turned = ray @ R.T
    cosine = np.sum(turned * ray_prime, axis=1)
    along, along_prime = turned @ t, ray_prime @ t
    # Z turned + t = Z' r' in least squares: both depths times (1 − cos²)
    depth = cosine * along_prime - along
    depth_prime = along_prime - cosine * along
    far = (1 - cosine**2 < slack**2) & (cosine > 0)
    front: NDArray[np.bool_] = far | ((depth > 0) & (depth_prime > 0))
    return front
