"""The sliding viewpoint: from where each direction of a panorama is seen (docs/method.md, 6).

Across the overlap the viewpoint moves from the reference's place (0) to the target's (c, |c| = 1): a ray r of the
panorama starts at C(r) = s(r) c and shows the point C + r / d. s goes from 0 to s1 by a smooth step along the line
between the pictures' centres, and depends on nothing else: what changed along gravity would make uprights lean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.projective import ahead_of_camera, homogeneous, inverse_intrinsics, project, rotation_from_vector
from ..cameras.view import View
from ..raster.arrays import Array, angle_of
from ..raster.picture_map import falls_inside
from .options import SLIDE

if TYPE_CHECKING:
    from .warp import Warp


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where the viewpoint is for each direction.

    Attributes
    ----------
    s1 : float
        How far it slides, 0 to 1 of the way to the target's place.
    c : (3,) array
        The target's place in the reference camera's frame, in baselines.
    rotation : (3, 3) array
        From axes of its own (x right, y along gravity, z midway between the pictures' centres) to the reference's.
    along : (2,) array
        Unit vector, in heading and elevation, along which s grows.
    ends : (float, float)
        Radians along it at which s leaves 0 and reaches s1.
    """

    s1: float
    c: Array
    rotation: Array
    along: Array
    ends: tuple[float, float]

    def sliding(self, s1: float) -> Viewpoint:
        """The same viewpoint that slides further or less."""
        return replace(self, s1=s1)

    def within(self, part: tuple[float, float]) -> Viewpoint:
        """The same viewpoint that slides within a part, from and to shares, of the way that it has."""
        start, end = self.ends
        return replace(self, ends=(start + part[0] * (end - start), start + part[1] * (end - start)))

    def slide_at(self, rays: NDArray[Any]) -> NDArray[Any]:
        """s (…) of rays (…, 3) of any length, in the reference camera's frame."""
        return self.slide_of(*np.moveaxis(rays @ self.rotation.astype(rays.dtype), -1, 0))

    def place(self, rays: NDArray[Any]) -> NDArray[Any]:
        """C (…, 3), in baselines, from where rays (…, 3) are seen."""
        places: NDArray[Any] = self.slide_at(rays)[..., None] * self.c.astype(rays.dtype)
        return places

    def way_of(self, x: NDArray[Any], y: NDArray[Any], z: NDArray[Any]) -> NDArray[Any]:
        """How far along (…), radians, rays of any length in the viewpoint's own axes point."""
        kind = np.result_type(x, y, z).type
        heading, elevation = (kind(part) for part in self.along)
        if not elevation:
            return np.asarray(heading * angle_of(x, z))
        rise = elevation * angle_of(y, np.hypot(x, z))
        return np.asarray(rise + heading * angle_of(x, z) if heading else rise)

    def slide_of(self, x: NDArray[Any], y: NDArray[Any], z: NDArray[Any]) -> NDArray[Any]:
        """s (…) of rays of any length in the viewpoint's own axes."""
        start, end = self.ends
        share = self.way_of(x, y, z)
        kind = share.dtype.type
        share = np.clip((share - kind(start)) * kind(1 / (end - start)), 0, 1)
        slide: NDArray[Any] = kind(self.s1) * (share * share * (3 - 2 * share))
        return slide

    def seen_from(
        self, directions: NDArray[Any], inverse_depth: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Where points q / d of the reference's frame appear from the sliding viewpoint.

        Parameters
        ----------
        directions : (…, 3) array
            q, of any length.
        inverse_depth : (…) array
            d ≥ 0.

        Returns
        -------
        (…, 3) array
            Unit rays u with q / d = s(u) c + u / d_u.
        (…) array
            d_u, the inverse range from there.
        """
        turn = self.rotation.astype(directions.dtype)
        x, y, z = np.moveaxis(directions @ turn, -1, 0)
        moved, length = self.shifted((x, y, z), inverse_depth)
        rays: NDArray[Any] = (np.stack(moved, axis=-1) / length[..., None]) @ turn.T
        return rays, inverse_depth / length

    def shifted(
        self, own: tuple[NDArray[Any], NDArray[Any], NDArray[Any]], inverse_depth: NDArray[Any]
    ) -> tuple[list[NDArray[Any]], NDArray[Any]]:
        """q − s d c (three arrays) for directions q (three arrays), both in the viewpoint's own axes, with the s of its
        own direction; and its length.

        Where both ends of the range of s agree, that is it. Elsewhere there is a solution between them, however large
        the parallax.
        """
        kind = np.result_type(own[0], inverse_depth).type
        steps = [inverse_depth * kind(part) for part in self.rotation.T @ self.c]
        end = kind(self.s1)
        at_start = self.slide_of(*own)
        at_end = self.slide_of(*(q - end * step for q, step in zip(own, steps, strict=True)))
        slide = np.where((at_start > 0) & (at_end >= end), end, kind(0))
        between = np.flatnonzero((at_start > 0) & (at_end < end))
        if between.size:
            parts = [
                (np.broadcast_to(q, slide.shape).ravel()[between], step.ravel()[between])
                for q, step in zip(own, steps, strict=True)
            ]
            slide.ravel()[between] = self._slide_between(parts)
        moved = [q - slide * step for q, step in zip(own, steps, strict=True)]
        length = np.sqrt(moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2)
        return moved, np.maximum(length, kind(SLIDE.least_range))

    def _slide_between(self, parts: Sequence[tuple[NDArray[Any], NDArray[Any]]]) -> NDArray[Any]:
        """The s (N,) at which the direction of q − s step has that s, for three pairs (q, step) of (N,) arrays.

        False position; an end that stays twice counts half (the Illinois rule).
        """
        kind = parts[0][0].dtype.type

        def off_at(slide: NDArray[Any]) -> NDArray[Any]:
            off: NDArray[Any] = self.slide_of(*(q - slide * step for q, step in parts)) - slide
            return off

        low, high = np.zeros_like(parts[0][0]), np.full_like(parts[0][0], self.s1)
        off_low, off_high = off_at(low), off_at(high)
        before = np.zeros(low.shape, np.int8)
        slide = low
        for _ in range(SLIDE.rounds):
            slide = low + (high - low) * (off_low / np.maximum(off_low - off_high, np.finfo(kind).tiny))
            off = off_at(slide)
            above = off > 0
            off_high = np.where(above, np.where(before > 0, off_high / 2, off_high), off)
            off_low = np.where(above, off, np.where(before < 0, off_low / 2, off_low))
            low, high = np.where(above, slide, low), np.where(above, high, slide)
            before = np.where(above, np.int8(1), np.int8(-1))
        return slide


def viewpoint_between(base: Warp, views: Sequence[View]) -> Viewpoint | None:
    """How the viewpoint slides from the reference to picture 1, all the way.

    Parameters
    ----------
    base : Warp
        Of both pictures, seen from the reference's place, on a levelled cylinder or sphere. It may be coarse.
    views : sequence of View
        What is known of the pictures, the reference first.

    Returns
    -------
    Viewpoint or None
        With s1 = 1; None where there is nothing to slide along: no baseline, one picture surrounds the other, or they
        look along the baseline.
    """
    reference, target = views[0], views[1]
    projection = base.canvas.projection
    if projection is None or not np.isfinite(target.t).all() or not target.t.any() or not np.isfinite(target.R).all():
        return None
    c = -target.R.T @ target.t
    rays, both, alone = _overlap(base, reference)
    if not both.any() or min(alone) < SLIDE.least_alone or _sees_baseline(reference, target, c):
        return None
    centres = np.stack([_centre(reference), target.R.T @ _centre(target)]) @ projection.rotation
    heading, elevation = np.arctan2(centres[:, 0], centres[:, 2]), np.arctan2(centres[:, 1], np.hypot(*centres.T[::2]))
    across = (heading[1] - heading[0] + np.pi) % (2 * np.pi) - np.pi
    along = np.array([across, elevation[1] - elevation[0]])
    if np.linalg.norm(along) < SLIDE.least_apart:
        return None
    along /= np.linalg.norm(along)
    main = int(np.abs(along).argmax())
    if abs(along[main]) > SLIDE.straightened * abs(along[1 - main]):
        along = np.eye(2)[main] * np.sign(along[main])
    turned = rotation_from_vector(np.array([0.0, heading[0] + across / 2, 0.0]))
    unscaled = Viewpoint(1.0, c, projection.rotation @ turned, along, (-np.pi, np.pi))
    low, high = np.percentile(unscaled.way_of(*(rays[both] @ unscaled.rotation).T), SLIDE.percentiles)
    margin = SLIDE.margin * (high - low)
    return replace(unscaled, ends=(low + margin, high - margin)) if high > low else None


def _overlap(base: Warp, reference: View) -> tuple[Array, NDArray[np.bool_], tuple[float, float]]:
    """Rays (h, w, 3) at nodes of the base's canvas, which of them both pictures show (h, w), and the share of the
    reference and of picture 1 that it alone shows."""
    canvas = base.canvas
    step = max(1, max(canvas.width, canvas.height) // SLIDE.nodes)
    xs, ys = canvas.xs[::step], canvas.ys[::step]
    to_ray = inverse_intrinsics(reference.K)
    rays = np.stack(canvas.project_rows(to_ray, xs, ys, reference.camera), axis=-1)
    places, _ = canvas.on_reference(xs, ys, reference.camera)
    target = base.maps[1].arrays()
    shown = [falls_inside(places[..., 0], places[..., 1], reference.size)]
    shown.append(falls_inside(target.x[::step, ::step], target.y[::step, ::step], target.size))
    both = shown[0] & shown[1]
    alone = [1 - int(both.sum()) / max(1, int(one.sum())) for one in shown]
    return rays, both, (alone[0], alone[1])


def _centre(view: View) -> Array:
    """The ray (3,) of the middle of a picture, in its camera's frame."""
    middle: Array = inverse_intrinsics(view.K) @ homogeneous((np.array(view.size) - 1) / 2)
    return middle


def _sees_baseline(reference: View, target: View, c: Array) -> bool:
    """Whether some direction along the baseline lies well inside both pictures: around it no viewpoint can slide."""

    def sees(view: View, direction: Array) -> bool:
        point = view.K @ view.R @ direction
        if not ahead_of_camera(*point):
            return False
        place, size = project(point), np.array(view.size)
        return bool((np.abs(place - (size - 1) / 2) < SLIDE.inner * size / 2).all())

    return any(sees(reference, direction) and sees(target, direction) for direction in (c, -c))
