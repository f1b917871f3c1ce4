"""A viewpoint that slides among the places of N pictures: from where each direction of a panorama is seen.

A ray r of the panorama starts at C(r) = s1 Σ_j w_j(r) c_j, with the pictures' places c_j and the first one's at the
origin, and shows the point C + r / d. The weights w_j are a smooth partition of unity over the headings that the
pictures show, 1 where one shows them alone: with s1 = 1 each is shown there as it was taken. They depend on nothing
else: what changed along gravity would make uprights lean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..field.fade import fading
from ..raster.arrays import Array, angle_of
from ..raster.grid import Grid
from .projection import Projection, round_projection
from .rig_options import RIG_SLIDE

if TYPE_CHECKING:
    from ..field.sphere_field import SphereField


@dataclass(frozen=True, eq=False)
class RigViewpoint:
    """Where the viewpoint is for each direction.

    Attributes
    ----------
    s1 : float
        How far it slides, 0 to 1 of the way to the pictures' places.
    rotation : (3, 3) array
        From axes of its own (y along gravity) to those of the first picture.
    places : (M, 3) array
        Where it is for s1 = 1, at M headings evenly from straight behind around.
    """

    s1: float
    rotation: Array
    places: Array

    def sliding(self, s1: float) -> RigViewpoint:
        """The same viewpoint that slides further or less."""
        return replace(self, s1=s1)

    def place(self, rays: NDArray[Any]) -> Array:
        """C (…, 3) from where rays (…, 3) of any length are seen."""
        if self.s1 == 0:
            return np.zeros(rays.shape)
        x, _, z = np.moveaxis(rays @ self.rotation, -1, 0)
        count = len(self.places)
        at = (angle_of(x, z) + np.pi) * (count / (2 * np.pi))
        before = np.floor(at).astype(int)
        share = (at - before)[..., None]
        near, far = self.places[before % count], self.places[(before + 1) % count]
        places: Array = self.s1 * (near + share * (far - near))
        return places

    def seen_from(self, directions: Array, inverse_depth: Array) -> tuple[Array, Array]:
        """Where points q / d appear, for directions q (…, 3) of any length and d (…) from the first picture's place:
        unit rays u (…, 3) with q / d = C(u) + u / d_u, and d_u (…)."""
        moved = directions
        for _ in range(RIG_SLIDE.steps):
            target = directions - inverse_depth[..., None] * self.place(moved)
            moved = moved + RIG_SLIDE.damping * (target - moved)
        moved = directions - inverse_depth[..., None] * self.place(moved)
        length = np.maximum(np.linalg.norm(moved, axis=-1), RIG_SLIDE.least_range)
        return moved / length[..., None], inverse_depth / length

    def shows_twice(self, directions: Array, inverse_depth: Array) -> NDArray[np.bool_]:
        """Which points q / d (…) the panorama shows more than once: those that several headings look at, each from its
        own place."""
        own = directions @ self.rotation
        reach = np.linalg.norm(directions, axis=-1)
        times = np.zeros(inverse_depth.shape, int)
        step = max(1, len(self.places) // RIG_SLIDE.looks)
        headings = np.arange(0, len(self.places) + 1, step) * (2 * np.pi / len(self.places)) - np.pi
        places = self.s1 * self.places[np.arange(0, len(self.places) + 1, step) % len(self.places)] @ self.rotation
        before = None
        for heading, place in zip(headings, places, strict=True):
            x, z = (own[..., k] - inverse_depth * place[k] for k in (0, 2))
            # how far to the right of the heading the point lies; only what is ahead of it counts
            beside = x * np.cos(heading) - z * np.sin(heading)
            ahead = x * np.sin(heading) + z * np.cos(heading) > RIG_SLIDE.least_range * reach
            if before is not None:
                times += ahead & (before > 0) & (beside <= 0)
            before = beside
        return times > 1


@dataclass(frozen=True, eq=False)
class CarriedDepth:
    """Inverse range from a viewpoint that slides, by a field that is known from the first picture's place.

    nodes (rows, columns): of a grid over a sphere, with the viewpoint's axes.
    """

    viewpoint: RigViewpoint
    sphere: Projection
    grid: Grid
    nodes: Array

    @staticmethod
    def of(field: SphereField, views: Sequence[View], viewpoint: RigViewpoint) -> CarriedDepth:
        """The depth of a field."""
        sphere = round_projection("equirectangular", views[0].K, viewpoint.rotation, RIG_SLIDE.px_per_radian)
        assert sphere.sphere is not None
        grid = Grid.over(*sphere.sphere, RIG_SLIDE.nodes)
        return CarriedDepth(viewpoint, sphere, grid, field.at(sphere.rays(grid.points)))

    def at(self, rays: Array) -> tuple[Array, Array]:
        """Inverse range d (…) along unit rays (…, 3) from their viewpoints; and d C (…, 3).

        The point of a ray lies on the surface where its own direction from the first place has its range: a fixed
        point, since the field is smooth.
        """
        places = self.viewpoint.place(rays)
        d = self._first(rays)
        for _ in range(RIG_SLIDE.steps):
            from_first = rays + d[..., None] * places
            d = d + RIG_SLIDE.damping * (np.linalg.norm(from_first, axis=-1) * self._first(from_first) - d)
        return d, d[..., None] * places

    def _first(self, rays: Array) -> Array:
        """Inverse range (…) along rays (…, 3) of any length from the first picture's place."""
        return self.grid.at(self.nodes, self.sphere.points(rays))


def rig_viewpoint(
    views: Sequence[View], outlines: Sequence[Array], upright_axes: Array
) -> RigViewpoint:
    """How the viewpoint slides to each picture's place, all the way.

    Parameters
    ----------
    views : sequence of View
        Of all pictures, the first one's R = I and t = 0.
    outlines : sequence of (N, 3) arrays
        Rays from the first place to what each picture shows along its border, in order.
    upright_axes : (3, 3) array
        From axes with y along gravity to those of the first picture.

    Returns
    -------
    RigViewpoint
        With s1 = 1.
    """
    count = RIG_SLIDE.headings
    headings = (np.arange(count) / count - 0.5) * 2 * np.pi
    weights, centres = [], []
    for view, outline in zip(views, outlines, strict=True):
        # headings are counted from the picture's own, which its outline lies about
        x, _, z = (view.R[2] @ upright_axes)
        middle = float(np.arctan2(x, z))
        own = outline @ upright_axes
        around = _wrapped(angle_of(own[:, 0], own[:, 2]) - middle)
        left, right = np.percentile(around, RIG_SLIDE.percentiles)
        half = max((right - left) / 2, RIG_SLIDE.least_half)
        off = np.abs(_wrapped(headings - middle - (left + right) / 2))
        weights.append(fading(off, half))
        centres.append(off / half)
    shown = np.array(weights)
    # where no picture shows anything, the one that ends nearest
    nearest = np.argmin(np.array(centres), axis=0)
    shown[nearest, np.arange(count)] += np.where(shown.sum(axis=0) > 0, 0, 1)
    shown /= shown.sum(axis=0)
    places = shown.T @ np.stack([-view.R.T @ view.t for view in views])
    return RigViewpoint(1.0, upright_axes, _smoothed(places))


def _smoothed(places: Array) -> Array:
    """Places (M, 3) around a circle, without kinks."""
    count = len(places)
    width = RIG_SLIDE.smooth_deg / 360 * count
    frequencies = np.fft.rfftfreq(count) * 2 * np.pi
    kernel = np.exp(-0.5 * (frequencies * width) ** 2)
    smooth: Array = np.fft.irfft(np.fft.rfft(places, axis=0) * kernel[:, None], count, axis=0)
    return smooth


def _wrapped(angles: Array) -> Array:
    """Angles (…) from −π to π."""
    wrapped: Array = (angles + np.pi) % (2 * np.pi) - np.pi
    return wrapped
