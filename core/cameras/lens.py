"""What lenses do to pictures: between px of a pinhole camera's plane and px of the picture, safe outside of it.

Distortion is OpenCV's, in five parameters: x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + tangential terms (Brown 1971). A
polynomial says nothing beyond the radius it was fitted on and may fold back into the picture there; past the trusted
radius its displacement is carried on in proportion to the radius. So are other lenses (`lens_models`) beyond the angle
up to which they are used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array
from .camera import Camera
from .lens_models import Lens
from .options import LENS


def distort(points: Array, camera: Camera) -> Array:
    """Apply lens distortion.

    Parameters
    ----------
    points : (…, 2)
        Ideal px, as a pinhole camera with the same K would see them.
    camera : Camera
        Whose lens it is.

    Returns
    -------
    (…, 2)
        Raw px of the camera's picture.

    References
    ----------
    D. Brown, Close-Range Camera Calibration, Photogrammetric Engineering 37, 1971.
    """
    if not camera.bent:
        return points
    ideal = _normalised(points, camera)
    if camera.lens is not None:
        return _pixels(_shown(ideal, camera.lens), camera)
    return _pixels(_distorted(ideal, camera.distortion, _trusted_radius(camera)), camera)


def undistort(points: Array, camera: Camera) -> Array:
    """Remove lens distortion: the inverse of `distort`, by a damped fixed-point iteration, of a `Lens` by Newton's.

    Parameters
    ----------
    points : (…, 2)
        Raw px of the camera's picture.
    camera : Camera
        Whose lens it is.

    Returns
    -------
    (…, 2)
        Ideal px.
    """
    if not camera.bent:
        return points
    raw = _normalised(points, camera)
    if camera.lens is not None:
        return _pixels(_flattened(raw, camera.lens), camera)
    limit = _trusted_radius(camera)
    ideal = raw.copy()
    for _ in range(LENS.iterations):
        # where the lens stretches by more than 1, a full step would overshoot for ever
        step = (raw - _distorted(ideal, camera.distortion, limit)) / np.maximum(1.0, _stretch(ideal, camera, limit))
        ideal += step
        if np.nanmax(np.abs(step), initial=0.0) < LENS.tolerance:
            break
    return _pixels(ideal, camera)


def unused(camera: Camera) -> NDArray[np.bool_] | None:
    """Where a picture (H, W) shows what lies beyond the angle up to which its lens is used; None where it does not."""
    if camera.lens is None or not camera.lens.bends:
        return None
    limit = float(camera.lens.shown_at(np.array(used_angle(camera.lens))))
    if _corner_radius(camera) <= limit:
        return None
    width, height = camera.size
    rows = np.arange(height, dtype=np.float64)[:, None]
    y = (rows - camera.K[1, 2]) / camera.K[1, 1]
    x = (np.arange(width, dtype=np.float64) - camera.K[0, 2] - camera.K[0, 1] * y) / camera.K[0, 0]
    beyond: NDArray[np.bool_] = x * x + y * y > limit * limit
    return beyond if beyond.any() else None


def used_angle(lens: Lens) -> float:
    """The angle from the axis, rad, up to which a lens is used."""
    return min(lens.limit, float(np.radians(LENS.widest_used)))


def _shown(ideal: Array, lens: Lens) -> Array:
    """Where a lens shows points (…, 2) of the plane at distance 1."""
    radius = np.sqrt((ideal**2).sum(axis=-1, keepdims=True))
    inner = np.clip(radius, 1e-12, np.tan(used_angle(lens)))
    raw: Array = ideal * (lens.shown_at(np.arctan(inner)) / inner)
    return raw


def _flattened(raw: Array, lens: Lens) -> Array:
    """The inverse of `_shown`."""
    limit = used_angle(lens)
    radius = np.sqrt((raw**2).sum(axis=-1, keepdims=True))
    inner = np.clip(radius, 1e-12, float(lens.shown_at(np.array(limit))))
    ideal: Array = raw * (np.tan(np.minimum(lens.angle_at(inner), limit)) / inner)
    return ideal


def fold_radius(camera: Camera) -> tuple[float, float] | None:
    """The raw normalised radius at which the radial polynomial folds back, and that of the farthest corner, if the
    first is the smaller one: no ray is seen beyond it; else None."""
    if camera.lens is not None:
        return None
    r, slope, raw = _radial(camera)
    farthest = _corner_radius(camera)
    folded = np.flatnonzero((slope <= 0) & (np.maximum.accumulate(raw) < farthest))
    return (float(raw[: folded[0] + 1].max()), farthest) if folded.size else None


def _stretch(ideal: Array, camera: Camera, limit: float) -> Array:
    """Derivative (…, 1) of the raw radius by the ideal one."""
    k1, k2, _, _, k3 = camera.distortion
    radius = np.sqrt((ideal**2).sum(axis=-1, keepdims=True))
    r2 = np.minimum(radius, limit) ** 2
    inner = 1 + 3 * k1 * r2 + 5 * k2 * r2**2 + 7 * k3 * r2**3
    outer = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return np.where(radius < limit, inner, outer)


def _trusted_radius(camera: Camera) -> float:
    """The largest ideal normalised radius where the radial polynomial still grows by half of an ideal lens, up to where
    its raw radius is 1.2 × the corner's."""
    r, slope, raw = _radial(camera)
    return float(r[int(np.argmax((slope < LENS.least_slope) | (raw > LENS.reach * _corner_radius(camera))))])


def _corner_radius(camera: Camera) -> float:
    """The raw normalised radius of the farthest corner."""
    width, height = camera.size
    corners = _normalised(np.array([[0.0, 0], [width, 0], [0, height], [width, height]]), camera)
    return float(np.hypot(corners[:, 0], corners[:, 1]).max())


def _radial(camera: Camera) -> tuple[Array, Array, Array]:
    """Samples of the ideal normalised radius, and the slope and value there of the raw one."""
    # while the slope is at least a half, twice the reach is as far as it takes
    r = np.linspace(0, 3 * LENS.reach * _corner_radius(camera), LENS.radius_samples)
    k1, k2, _, _, k3 = camera.distortion
    with np.errstate(over="ignore", invalid="ignore"):  # coefficients of no lens fold at once, however large
        slope = 1 + 3 * k1 * r**2 + 5 * k2 * r**4 + 7 * k3 * r**6
        return r, slope, r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6)


def _distorted(ideal: Array, distortion: Array, limit: float) -> Array:
    k1, k2, p1, p2, k3 = distortion
    radius = np.sqrt((ideal**2).sum(axis=-1, keepdims=True))
    inward = np.minimum(1.0, limit / np.maximum(radius, 1e-12))
    p = ideal * inward
    x, y = p[..., :1], p[..., 1:]
    r2 = x * x + y * y
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    dx = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    dy = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    raw: Array = ideal + np.concatenate([dx, dy], axis=-1) / inward
    return raw


def _normalised(points: Array, camera: Camera) -> Array:
    K = camera.K
    y = (points[..., 1] - K[1, 2]) / K[1, 1]
    x = (points[..., 0] - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return np.stack([x, y], axis=-1)


def _pixels(normalised: Array, camera: Camera) -> Array:
    K = camera.K
    x, y = normalised[..., 0], normalised[..., 1]
    return np.stack([K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2]], axis=-1)
