"""Robust refinement of (f, f', R, t) on the Sampson distance, with a prior on the focal length.

Levenberg-Marquardt on iteratively reweighted residuals (Cauchy loss), 6 or 7 unknowns. Written on NumPy alone because
scipy.optimize takes longer to load than this takes to run, and a stitch is a short-lived process.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera, zoomed
from ..cameras.matches import Matches
from ..cameras.projective import (
    fundamental_from_pose,
    homogeneous,
    in_front,
    infinite_homography,
    inverse_intrinsics,
    poses_from_fundamental,
    rotation_from_vector,
    sampson_residuals,
    skew,
)
from ..raster.arrays import Array
from .options import REFINEMENT

# [e_i]ₓ of the three axes: where a small rotation takes a vector.
_TURNS = np.array([skew(axis) for axis in np.eye(3)])


@dataclass(frozen=True)
class Pose:
    """K, K_prime (3, 3) px, R (3, 3), t (3,) with |t| = 1: the target camera sees X at R X + t."""

    K: Array
    K_prime: Array
    R: Array
    t: Array

    @property
    def F(self) -> Array:
        """The fundamental matrix of the pose, x'ᵀ F x = 0."""
        return fundamental_from_pose(self.K, self.K_prime, self.R, self.t)

    def in_front(self, matches: Matches) -> NDArray[np.bool_]:
        """Which matches (N,) triangulate in front of both cameras, or have too little parallax to say."""
        return in_front(self.K, self.K_prime, self.R, self.t, matches.x, matches.y, REFINEMENT.min_parallax)


def pose_of_fundamental(matches: Matches, F: Array, K: Array, K_prime: Array, threshold: float) -> Pose:
    """The pose of F that has most of the matches within `threshold` px of their lines in front of both cameras."""
    near = matches.subset(np.abs(sampson_residuals(F, matches.x, matches.y)) < threshold)
    poses = poses_from_fundamental(F, K, K_prime)
    return max((Pose(K, K_prime, R, t) for R, t in poses), key=lambda pose: pose.in_front(near).sum())


def refine_pose(
    matches: Matches,
    pose: Pose,
    camera: Camera,
    camera_prime: Camera,
    sigma: float,
    zoom: bool = False,
    iterations: int = 100,
) -> tuple[Pose, float]:
    """The pose that minimises Σ log(1 + (r/σ)² + (c/σ')²) + priors of the calibration, and that cost.

    r: Sampson distances, c: `cheirality_residual`, px. sigma: noise of a Sampson distance in px. zoom: the second focal
    length is an unknown of its own. A fixed focal length stays.
    """
    problem = _Problem(matches, camera, camera_prime, sigma, zoom)
    cost, damping = problem.cost(pose), 1e-3
    for _ in range(iterations):
        normal, gradient = problem.normal_equations(pose)
        improved = False
        while damping < 1e4:
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
            candidate = problem.updated(pose, step)
            new_cost = problem.cost(candidate)
            if new_cost < cost:
                improved = True
                break
            damping *= 10
        if not improved:
            break
        gain, pose, cost, damping = cost - new_cost, candidate, new_cost, max(damping / 10, 1e-9)
        if gain < 1e-5 * cost + 1e-12:
            break
    return pose, cost


def pose_at_focal(
    matches: Matches, pose: Pose, cameras: Sequence[Camera], factor: float, sigma: float
) -> tuple[Pose, float]:
    """The pose that fits matches best with both its focal lengths times a factor, and its cost (see `refine_pose`)."""
    first, second = (
        replace(camera.with_focal_held(), K=zoomed(K, factor), principal_sigma=0.0)
        for camera, K in zip(cameras, (pose.K, pose.K_prime), strict=True)
    )
    return refine_pose(matches, replace(pose, K=first.K, K_prime=second.K), first, second, sigma)


def focal_deviations(
    matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, sigma: float, zoom: bool
) -> tuple[float, float]:
    """Standard deviations of log f at the optimum: by matches and prior, and by the matches alone.

    From the normal matrix; infinite where nothing tells. Both cameras' focal lengths are free.
    """
    problem = _Problem(matches, camera, camera_prime, sigma, zoom)
    normal, _ = problem.normal_equations(pose)
    by_prior = problem.priors(pose)[0][1][0] ** 2
    with_prior = float(1 / np.sqrt(max(_left_of_first(normal), 1e-300)))
    normal[0, 0] -= by_prior
    left = _left_of_first(normal)
    return with_prior, float(1 / np.sqrt(left)) if left > 1e-12 else float("inf")


def _left_of_first(normal: Array) -> float:
    """What the first unknown's diagonal has left when all others are solved for (a Schur complement)."""
    rest = normal[1:, 1:] + 1e-12 * np.trace(normal[1:, 1:]) * np.eye(len(normal) - 1)
    return float(normal[0, 0] - normal[0, 1:] @ np.linalg.solve(rest, normal[1:, 0]))


def cheirality_residual(pose: Pose, x: Array, y: Array) -> Array:
    """How far (N,) px, negative, each match lies along its line on the wrong side of its point at infinity; 0 in front.

    F alone hardly distinguishes a change of focal length from one of rotation. Without this term a pair of cameras with
    nearly parallel axes can end with most of its points behind them.
    """
    return _beyond(pose, homogeneous(x).T, np.asarray(y).T)


def _beyond(pose: Pose, x: Array, y: Array) -> Array:
    """`cheirality_residual` of homogeneous x (3, N), y (2 or 3, N)."""
    q = infinite_homography(pose.K, pose.K_prime, pose.R) @ x
    e = pose.K_prime @ pose.t
    direction = (e[:2, None] * q[2] - q[:2] * e[2]) * np.sign(q[2])
    length = np.maximum(np.hypot(direction[0], direction[1]), 1e-12)
    along = ((y[:2] - q[:2] / q[2]) * direction).sum(axis=0) / length
    behind: Array = np.minimum(along, 0.0)
    return behind


def shared_focal_sigma(camera: Camera, camera_prime: Camera) -> float:
    """Standard deviation of the log of the factor that both focal lengths share, by what is known of each.

    Each camera counts by its precision. Two that are known in the same way are not independent (one lens, one maker's
    rounding): the more precise one counts alone.
    """
    first, second = camera.log_sigma, camera_prime.log_sigma
    if camera.knowledge == camera_prime.knowledge or not first * second:
        return min(first, second)
    return 1 / math.hypot(1 / first, 1 / second)


class _Problem:
    """The least-squares problem around a pose: unknowns [log f,] [log f',] [principal point (2) in units of
    its prior,] rotation (3), direction of t (2)."""

    def __init__(self, matches: Matches, camera: Camera, camera_prime: Camera, sigma: float, zoom: bool) -> None:
        self.matches, self.camera, self.camera_prime = matches, camera, camera_prime
        self.sigma = sigma
        self.sigma_beyond = REFINEMENT.cheirality_sigma_px * matches.scale
        self.focal_free = not (camera.fixed or camera_prime.fixed)
        self.zoom = zoom and self.focal_free
        self.assumed = camera.assumed and camera_prime.assumed
        self.focal_sigma = camera.log_sigma if self.zoom else shared_focal_sigma(camera, camera_prime)
        # share the principal point only where both pictures have the same size
        believed_off = min(camera.principal_sigma, camera_prime.principal_sigma)
        self.principal_free = believed_off > 0 and camera.size == camera_prime.size
        self.principal_sigma = believed_off * max(camera.size)
        self.size = 5 + self.focal_free + self.zoom + 2 * self.principal_free
        # against the prior, residuals never count as more precise than lens distortion leaves them
        systematic_px = REFINEMENT.systematic_guess_px if self.assumed else REFINEMENT.systematic_px
        believed = max(sigma, systematic_px * matches.scale)
        tempered = min(1.0, REFINEMENT.effective_matches / max(1, len(matches))) * (sigma / believed) ** 2
        self.weight = tempered * matches.weights / max(float(matches.weights.mean()), 1e-300)
        # (3, N): long rows are what NumPy is quick with
        self.x, self.y = (np.ascontiguousarray(homogeneous(points).T) for points in (matches.x, matches.y))

    def updated(self, pose: Pose, step: Array) -> Pose:
        """The pose after a step in the unknowns."""
        K, K_prime = pose.K, pose.K_prime
        if self.focal_free:
            most = REFINEMENT.max_focal_step
            K = zoomed(K, np.exp(np.clip(step[0], -most, most)))
            factor = step[1] if self.zoom else step[0]
            K_prime = zoomed(K_prime, np.exp(np.clip(factor, -most, most)))
        if self.principal_free:
            aside = np.zeros((3, 3))
            aside[:2, 2] = self.principal_sigma * step[-7:-5]
            K, K_prime = K + aside, K_prime + aside
        omega, tangent = step[-5:-2], step[-2:]
        t = pose.t + _tangent_basis(pose.t) @ tangent
        return Pose(K, K_prime, rotation_from_vector(omega) @ pose.R, t / np.linalg.norm(t))

    def cost(self, pose: Pose) -> float:
        """What is minimised."""
        r = self._sampson(pose.F)[0] / self.sigma
        c = _beyond(pose, self.x, self.y) / self.sigma_beyond
        # one loss for both: an outlier of the Sampson distance does not count for cheirality either
        return float(self.weight @ np.log1p(r * r + c * c) + sum(e * e for e, _ in self.priors(pose)))

    def _focal_prior(self, off: float) -> tuple[float, float]:
        """Residual of log f, `off` from its prior, and its derivative.

        An assumed focal length has the prior of a Student distribution, which pulls less the further away f is: it must
        not override matches that determine f.
        """
        z = off / self.focal_sigma
        if not self.assumed or z == 0:
            return z, 1 / self.focal_sigma
        freedom = REFINEMENT.prior_freedom
        value = np.sign(z) * np.sqrt(freedom * np.log1p(z * z / freedom))
        return float(value), float(z / (1 + z * z / freedom) / value / self.focal_sigma)

    def priors(self, pose: Pose) -> list[tuple[float, Array]]:
        """Residuals of the priors with their derivatives by the unknowns; a second focal length has one on its ratio
        to the first."""
        size, out = self.size, []
        off = np.log(pose.K[0, 0] / self.camera.focal)
        if self.focal_free:
            at, slope = self._focal_prior(off)
            d_first = np.zeros(size)
            d_first[0] = slope
            out.append((at, d_first))
        if self.zoom:
            ratio = np.log(pose.K_prime[0, 0] / self.camera_prime.focal) - off
            d_ratio = np.zeros(size)
            d_ratio[:2] = (-1 / REFINEMENT.zoom_sigma, 1 / REFINEMENT.zoom_sigma)
            out.append((ratio / REFINEMENT.zoom_sigma, d_ratio))
            if self.camera.knowledge != self.camera_prime.knowledge:
                d_second = np.zeros(size)
                d_second[1] = 1 / self.camera_prime.log_sigma
                out.append((np.log(pose.K_prime[0, 0] / self.camera_prime.focal) * d_second[1], d_second))
        if self.principal_free:
            shift = (pose.K - self.camera.K)[:2, 2] / self.principal_sigma
            out += [(float(shift[i]), np.eye(size)[size - 7 + i]) for i in (0, 1)]
        return out

    def normal_equations(self, pose: Pose) -> tuple[Array, Array]:
        """Gauss-Newton normal matrix and gradient (of half the cost), residuals reweighted by the Cauchy loss."""
        size = self.size
        F, by_unknowns = self._F_and_derivatives(pose)
        residual, by_F = self._residuals_and_derivative(F)
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        beyond = _beyond(pose, self.x, self.y)
        far = (beyond / self.sigma_beyond) ** 2
        loss = self.weight / (1 + (residual / self.sigma) ** 2 + far)
        _add(normal, gradient, residual, by_unknowns.T @ by_F, loss / self.sigma**2)
        # those far off their lines are left out: their weight is negligible
        behind = far * loss > REFINEMENT.negligible_cheirality * self.weight
        if behind.any():
            derivative = self._beyond_derivative(pose, behind)
            _add(normal, gradient, beyond[behind], derivative, loss[behind] / self.sigma_beyond**2)
        for e, d in self.priors(pose):
            normal += np.outer(d, d)
            gradient += e * d
        return normal, gradient

    def _beyond_derivative(self, pose: Pose, which: NDArray[np.bool_]) -> Array:
        """Derivatives (size, n) of `cheirality_residual` of some matches on the wrong side by the unknowns."""
        dH, de = self._infinity_derivatives(pose)
        x, y = self.x[:, which], self.y[:2, which]
        q, e = infinite_homography(pose.K, pose.K_prime, pose.R) @ x, pose.K_prime @ pose.t
        side = np.sign(q[2])
        direction = (e[:2, None] * q[2] - q[:2] * e[2]) * side
        length = np.maximum(np.hypot(direction[0], direction[1]), 1e-12)
        place = q[:2] / q[2]
        away = y - place
        along = (away * direction).sum(axis=0) / length
        dq, de = dH @ x, de[:, :, None]  # (size, 3, n), (size, 3, 1)
        d_point = (dq[:, :2] - place * dq[:, 2:]) / q[2]
        d_direction = e[:2, None] * dq[:, 2:] + de[:, :2] * q[2] - dq[:, :2] * e[2] - q[:2] * de[:, 2:]
        d_direction *= side
        moved = (away * d_direction - d_point * direction).sum(axis=1) / length
        derivative: Array = moved - along * (direction * d_direction).sum(axis=1) / length**2
        return derivative

    def _infinity_derivatives(self, pose: Pose) -> tuple[Array, Array]:
        """Derivatives of H_inf (size, 3, 3) and e' (size, 3) by the unknowns."""
        K_inv, K_prime, R, t = inverse_intrinsics(pose.K), pose.K_prime, pose.R, pose.t
        right, nothing = R @ K_inv, np.zeros(3)
        found: list[tuple[Array, Array]] = []
        if self.focal_free:
            keep = np.diag([1.0, 1.0, 0.0])
            by_first = -K_prime @ R @ keep @ K_inv, nothing
            by_second = K_prime @ keep @ right, K_prime @ keep @ t
            both = (by_first[0] + by_second[0], by_second[1])
            found = [by_first, by_second] if self.zoom else [both]
        if self.principal_free:
            for i in (0, 1):
                shift: Array = np.outer(np.eye(3)[i], np.eye(3)[2])
                back: Array = R @ _third_column(K_inv[:, i])
                by_both = self.principal_sigma * (K_prime @ back + shift @ right)
                found.append((by_both, self.principal_sigma * shift @ t))
        found += [(turned, nothing) for turned in K_prime @ _TURNS @ right]
        found += [(np.zeros((3, 3)), moved) for moved in (K_prime @ _tangent_basis(t)).T]
        return np.array([dH for dH, _ in found]), np.array([de for _, de in found])

    def _F_and_derivatives(self, pose: Pose) -> tuple[Array, Array]:
        """F = K'⁻ᵀ [t]ₓ R K⁻¹ (not normalised) and the derivatives (9, size) of its entries by the unknowns."""
        K_inv, K_prime_inv = inverse_intrinsics(pose.K), inverse_intrinsics(pose.K_prime)
        left, right = K_prime_inv.T @ skew(pose.t), pose.R @ K_inv
        derivatives = []
        if self.focal_free:
            # a focal length scales the first two rows of K⁻¹ by its inverse
            shrink = np.diag([-1.0, -1.0, 0.0])
            by_first = left @ pose.R @ shrink @ K_inv
            by_second = K_prime_inv.T @ shrink @ skew(pose.t) @ right
            derivatives = [by_first, by_second] if self.zoom else [by_first + by_second]
        if self.principal_free:
            for i in (0, 1):
                # the third column of K⁻¹ is −K⁻¹ times the principal point
                aside, aside_prime = (_third_column(inverse[:, i]) for inverse in (K_inv, K_prime_inv))
                by_both = left @ pose.R @ aside + aside_prime.T @ skew(pose.t) @ right
                derivatives.append(self.principal_sigma * by_both)
        derivatives += [*(left @ _TURNS @ right)]
        derivatives += [*(K_prime_inv.T @ np.tensordot(_tangent_basis(pose.t).T, _TURNS, 1) @ right)]
        return left @ right, np.array(derivatives).reshape(len(derivatives), 9).T

    def _sampson(self, F: Array) -> tuple[Array, Array, Array, Array]:
        """Sampson residuals (N,), the lines (3, N) in the target and in the reference, and the length (N,) of what is
        divided by."""
        line_y, line_x = F @ self.x, F.T @ self.y
        squared = line_y[0] ** 2 + line_y[1] ** 2 + line_x[0] ** 2 + line_x[1] ** 2
        root = np.sqrt(np.maximum(squared, 1e-300))
        return (self.y * line_y).sum(axis=0) / root, line_y, line_x, root

    def _residuals_and_derivative(self, F: Array) -> tuple[Array, Array]:
        """Sampson residuals (N,) and their derivatives by the nine entries of F (9, N)."""
        residual, line_y, line_x, root = self._sampson(F)
        shrinks = residual / root**2
        by_line = self.y / root
        by_line[:2] -= shrinks * line_y[:2]
        derivative = by_line[:, None] * self.x
        derivative[:, :2] -= self.y[:, None] * (shrinks * line_x[:2])
        return residual, derivative.reshape(9, -1)


def _add(normal: Array, gradient: Array, values: Array, jacobian: Array, weight: Array) -> None:
    """Adds what residuals (n,) with derivatives (size, n) and weights (n,) contribute."""
    normal += (jacobian * weight) @ jacobian.T
    gradient += jacobian @ (weight * values)


def _third_column(v: Array) -> Array:
    """−[0 0 v] (3, 3)."""
    out = np.zeros((3, 3))
    out[:, 2] = -v
    return out


def _tangent_basis(t: Array) -> Array:
    """Two unit vectors (3, 2) perpendicular to t."""
    across = skew(t)
    first = across[:, int(np.argmin(np.abs(t)))]  # t × the axis it is least along
    first = first / math.sqrt(first @ first)
    return np.array([first, across @ first]).T
