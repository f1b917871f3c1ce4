"""Matches of many pairs in one array, as rays through a lens whose focal length and k1 all pictures share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...cameras.camera import Camera
from ...cameras.lens import undistort
from ...cameras.projective import homogeneous, inverse_intrinsics
from ...raster.arrays import Array
from .averaged import Verified, first_is
from .options import PAIR_FIT
from .turns import dot


@dataclass(frozen=True)
class SharedLens:
    """What all pictures share: a factor on the focal lengths that are not given, and k1 of lenses that are not."""

    factor: float = 1.0
    k1: float = 0.0

    def of(self, camera: Camera) -> Camera:
        """The camera with this lens; a given distortion still moves the same pixels."""
        if camera.fixed:
            return camera
        zoomed = camera.zoomed(self.factor)
        return zoomed if camera.lens_known else replace(zoomed, distortion=np.array([self.k1, 0.0, 0, 0, 0]))


@dataclass(frozen=True, eq=False)
class Rays:
    """Matches seen through a lens: a, b (O, 3) with third coordinate 1, focal (2, O) px of both pictures."""

    a: Array
    b: Array
    focal: Array

    def of(self, rows: slice) -> Rays:
        """Those of some matches."""
        return Rays(self.a[rows], self.b[rows], self.focal[:, rows])

    def unit(self) -> tuple[Array, Array]:
        """Both as unit vectors (O, 3)."""
        a, b = (ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in (self.a, self.b))
        return a, b


@dataclass(frozen=True, eq=False)
class MatchedRays:
    """Matches of P pairs, one pair after the other.

    x, y (O, 2): points of both pictures over the focal length that was known before, from the principal point; focal,
    zooms, bends (2, O): that focal length in px, and whether the picture's focal length and k1 are shared (1) or given
    (0); starts (P + 1,): where each pair begins, none is empty; turns: of all pairs, before any was left out, the
    rotation that is given to begin with, None where there is none.
    """

    x: Array
    y: Array
    focal: Array
    zooms: Array
    bends: Array
    starts: NDArray[np.intp]
    turns: tuple[Array | None, ...] = ()
    # what `undistorted` found last: refining poses asks for it again and again
    _last: list[tuple[SharedLens, Rays]] = field(default_factory=list, repr=False)

    def __len__(self) -> int:
        return len(self.starts) - 1

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """The pair of every match (O,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    @property
    def counts(self) -> NDArray[np.intp]:
        """Matches of every pair (P,)."""
        return np.diff(self.starts)

    def sums(self, values: Array) -> Array:
        """Sums (P, …) over each pair's matches of values (O, …)."""
        total: Array = np.add.reduceat(values, self.starts[:-1], axis=0)
        return total

    def where(self, mask: NDArray[np.bool_]) -> MatchedRays:
        """Only those matches (O,); every pair keeps some."""
        return self._rows(np.flatnonzero(mask), self.sums(mask.astype(np.intp)))

    def of_pairs(self, numbers: Sequence[int] | NDArray[np.intp]) -> MatchedRays:
        """Those pairs, in this order; one may come several times."""
        rows = [np.arange(self.starts[k], self.starts[k + 1]) for k in numbers]
        return self._rows(np.concatenate([np.zeros(0, np.intp), *rows]), np.array([len(row) for row in rows], np.intp))

    def thinned(self, most: int) -> MatchedRays:
        """At most so many matches of each pair, evenly."""
        keep = np.zeros(len(self.owner), bool)
        for start, end in zip(self.starts[:-1], self.starts[1:], strict=True):
            keep[np.linspace(start, end - 1, min(end - start, most)).astype(int)] = True
        return self.where(keep)

    def _rows(self, rows: NDArray[np.intp], counts: Array | NDArray[np.intp]) -> MatchedRays:
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        return MatchedRays(
            self.x[rows], self.y[rows], self.focal[:, rows], self.zooms[:, rows], self.bends[:, rows], starts
        )

    @property
    def anything_free(self) -> tuple[bool, bool]:
        """Whether some focal length, and some k1, is not given."""
        return bool(self.zooms.any()), bool(self.bends.any())

    def undistorted(self, lens: SharedLens) -> Rays:
        """The matches without the lens's distortion."""
        if self._last and self._last[0][0] == lens:
            return self._last[0][1]
        factor, k1 = self._of_rows(lens)
        sides = zip((self.x, self.y), factor, k1, strict=True)
        a, b = (homogeneous(_unbent(points / f[:, None], k)) for points, f, k in sides)
        self._last[:] = [(lens, Rays(a, b, self.focal * factor))]
        return self._last[0][1]

    def derivatives(self, lens: SharedLens, rays: Rays) -> Array:
        """What a step of log factor and of k1 multiplies a and b (…, 2) with: (2 pictures, O, 2 parameters)."""
        _, k1 = self._of_rows(lens)
        r2 = np.stack([dot(ray[:, :2], ray[:, :2]) for ray in (rays.a, rays.b)])
        by = np.stack([self.zooms * (1 + k1 * r2), self.bends * r2], axis=-1)
        out: Array = -by / np.maximum(1 + 3 * k1 * r2, 0.05)[..., None]
        return out

    def within_limits(self, lens: SharedLens) -> SharedLens:
        """The lens with a k1 that folds nowhere inside a picture: r + k1 r³ turns back at 2/3 √(1 / (3 |k1|))."""
        sides = zip((self.x, self.y), self.bends, strict=True)
        most = max(float((bend * dot(points, points)).max()) for points, bend in sides)
        least = -PAIR_FIT.fold_share * 4 * lens.factor**2 / (27 * max(most, 1e-12))
        return SharedLens(lens.factor, float(np.clip(lens.k1, max(least, -PAIR_FIT.most_k1), PAIR_FIT.most_k1)))

    def _of_rows(self, lens: SharedLens) -> tuple[Array, Array]:
        return lens.factor**self.zooms, lens.k1 * self.bends


def _unbent(raw: Array, k1: Array) -> Array:
    """Undo r → r (1 + k1 r²) on (O, 2) by Newton's iteration: from r itself it comes nearer from one side only."""
    if not k1.any():
        return raw
    radius = np.sqrt(dot(raw, raw))
    ideal = radius.copy()
    for _ in range(PAIR_FIT.lens_iterations):
        bend = k1 * ideal * ideal
        ideal -= (ideal * (1 + bend) - radius) / np.maximum(1 + 3 * bend, 0.05)
    unbent: Array = raw * (ideal / np.maximum(radius, 1e-12))[:, None]
    return unbent


def matched_rays(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified
) -> tuple[MatchedRays, NDArray[np.intp]]:
    """All verified matches as rays, and from which picture to which each pair goes (P, 2): by content, not by number.

    points: raw px of the pictures.
    """
    normalised, flags = [], []
    for camera, raw in zip(cameras, points, strict=True):
        ideal = homogeneous(undistort(raw, camera)) @ inverse_intrinsics(camera.K).T
        normalised.append(ideal[:, :2])
        flags.append((camera.focal, float(not camera.fixed), float(not (camera.fixed or camera.lens_known))))
    ends, sides = [], []
    for pair in verified.pairs:
        columns = first_is(points, pair)
        ends.append([(pair.i, pair.j)[c] for c in columns])
        sides.append([normalised[end][pair.index[:, c]] for end, c in zip(ends[-1], columns, strict=True)])
    counts = np.array([len(pair) for pair in verified.pairs])
    known = np.repeat(np.array(flags)[np.array(ends)], counts, axis=0)  # (O, 2 pictures, 3)
    x, y = (np.concatenate([side[c] for side in sides]) for c in (0, 1))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
    focal, zooms, bends = (np.ascontiguousarray(known[:, :, k].T) for k in range(3))
    given = [[cameras[end].start for end in pair] for pair in ends]
    turns = tuple(None if a is None or b is None else b @ a.T for a, b in given)
    return MatchedRays(x, y, focal, zooms, bends, starts, turns), np.array(ends, np.intp)
