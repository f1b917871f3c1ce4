"""SPW and LPC: meshes that keep straight lines straight (Liao and Li, IEEE TIP 2020; Jia et al., CVPR 2021).

Both start from a homography of points and lines (dual features), and then seek a mesh over the target: matched points
and the ends of matched lines meet; cross lines keep the slopes that the homography gives them; those that stay parallel
are evenly divided everywhere, those that converge beyond the overlap, where a homography stretches most; detected lines
keep their slopes. LPC tells short lines from long ones, detected or joined of pieces. Terms and weights are those of
the authors' published programs (`LineMethod`; docs/method.md, 4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, project
from ..cameras.two_view import TwoView
from ..field.field import FieldValues, Fit
from ..field.options import FADE
from ..field.strict import StrictField
from ..field.transfer import target_points
from ..raster.arrays import Array
from ..raster.grid import Grid
from .homography import direct_linear, knowing_only
from .line_mesh import Mesh, Terms
from .lines import MatchedLines, PairLines, joined, matched_lines
from .options import LINE_MESH, LineMethod


@dataclass(frozen=True, eq=False)
class LineField:
    """x' = π(H p) + r(p): H of points and lines stands in two_view in place of H_inf; r is linear between the mesh's
    nodes, which lie at places (n, 2) px of the reference's plane and show nodes (n, 2) of the target."""

    name: str
    two_view: TwoView
    size: tuple[int, int]
    target_size: tuple[int, int]
    lines: PairLines
    nodes: Array
    places: Array
    fit: Fit

    @property
    def plane(self) -> Array:
        """0 (3,): it has no depth to end in."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H p) at a grid's nodes; d is NaN."""
        points = grid.points if ideal is None else ideal
        shift = self._residual(points.reshape(-1, 2)).reshape(points.shape)
        return FieldValues(np.full(points.shape[:2], np.nan), shift)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px."""
        return _by_homography(self.two_view, points) + self._residual(points)

    def refitted(self, matches: Matches) -> LineField:
        """The same kind of field fitted to other matches, none dropped. Raises DegenerateGeometry."""
        every = np.full(len(matches), True)
        return _field(self.name, self.two_view, self.size, self.target_size, matches, self.lines, every)

    @cached_property
    def _between(self) -> tuple[Any, Any]:
        """Interpolations of r among the mesh's nodes, and beyond it."""
        # takes long to load, and other fields do without
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

        off = self.nodes - _by_homography(self.two_view, self.places)
        return LinearNDInterpolator(self.places, off), NearestNDInterpolator(self.places, off)

    def _residual(self, points: Array) -> Array:
        inner, outer = self._between
        found: Array = inner(points)
        beyond = ~np.isfinite(found).all(axis=1)
        if beyond.any():
            found[beyond] = outer(points[beyond])
        return found


def fit_line_field(name: str, strict: StrictField, matches: Matches, lines: PairLines) -> LineField:
    """Fits SPW or LPC to the matches of the strict field, which have no gross outliers left.

    Parameters
    ----------
    name : {"spw", "lpc"}
    strict : StrictField
    matches : Matches
        The matches that `strict` was given, ideal px.
    lines : PairLines
        Straight segments of both pictures; without any only points and shape are left.

    Returns
    -------
    LineField

    Raises
    ------
    DegenerateGeometry
        The matches do not determine a homography, or it sends part of the target to infinity.

    References
    ----------
    Liao and Li, Single-perspective warps in natural image stitching, IEEE Transactions on Image Processing 29, 2020.
    Jia et al., Leveraging line-point consistence to preserve structures for wide parallax image stitching, CVPR 2021.
    """
    used = strict.fit.inliers_used
    return _field(name, strict.two_view, strict.size, strict.target_size, matches, lines, used)


def _field(
    name: str, view: TwoView, size: tuple[int, int], target_size: tuple[int, int], matches: Matches, lines: PairLines,
    inliers_used: NDArray[np.bool_],
) -> LineField:  # fmt: skip
    used = matches.subset(inliers_used)
    alone = direct_linear(used.y, used.x, used.weights)
    same = matched_lines(lines, used, alone)
    method = LINE_MESH.spw if name == "spw" else LINE_MESH.lpc
    mesh = Mesh.over(target_size, _with_lines(used, same, alone), method.cell_px * matches.scale)
    places = _terms(method, mesh, used, same, lines, size).solved()
    H = np.linalg.inv(mesh.G)
    H *= np.sign(np.median(homogeneous(used.x) @ H[2])) / np.linalg.norm(H)
    fit = Fit(inliers_used, np.nan, FADE.min_px * matches.scale, np.nan, np.nan, np.nan)
    found = LineField(name, knowing_only(view, H), size, target_size, lines, mesh.nodes, places, fit)
    rms = float(np.sqrt(np.mean(np.sum((found.predict(used.x) - used.y) ** 2, axis=1))))
    return replace(found, fit=replace(fit, residual_px=rms))


def _terms(
    method: LineMethod, mesh: Mesh, matches: Matches, same: MatchedLines, lines: PairLines, size: tuple[int, int]
) -> Terms:
    """The energy of a method; see above."""
    terms, (u, v) = Terms(mesh), mesh.cross_lines()
    terms.points(matches.y, matches.x, matches.weights)
    terms.on_lines(same.ends, same.lines, method.lines)
    terms.straight(np.concatenate([u, v]), method.slopes)
    terms.evenly_divided(u, method.slopes)
    terms.evenly_divided(v, method.even, beyond=size)
    every = lines.target if method.long is None else np.concatenate([lines.target, joined(lines.target, matches.scale)])
    lengths = np.linalg.norm(every[:, 1] - every[:, 0], axis=1) / np.linalg.norm(mesh.cell)
    is_long = lengths >= (np.inf if method.long is None else method.long_diagonals)
    terms.straight(every[(lengths >= method.least_diagonals) & ~is_long], method.pieces)
    if method.long is not None:
        terms.straight(every[is_long], method.long)
    return terms


def _with_lines(matches: Matches, same: MatchedLines, G: Array) -> Array:
    """G (3, 3), target to reference, refined so that matched lines meet too: Gauss-Newton on both distances, px."""
    if not len(same.ends):
        return G
    ends = same.ends.reshape(-1, 2)
    lines = np.repeat(same.lines, 2, axis=0)
    unit = max(float(np.abs(matches.y).max()), 1.0)
    T = np.diag([1 / unit, 1 / unit, 1.0])
    h = (G @ np.linalg.inv(T)).ravel()
    for _ in range(LINE_MESH.homography_steps):
        h = h / np.linalg.norm(h)
        rows, off = [], []
        for points, normals in ((matches.y, None), (ends, lines)):
            p = homogeneous(points) @ T.T
            q = p @ h.reshape(3, 3).T
            at = project(q)
            zero = np.zeros_like(p)
            by_x = np.hstack([p, zero, -at[:, :1] * p]) / q[:, 2:]
            by_y = np.hstack([zero, p, -at[:, 1:] * p]) / q[:, 2:]
            if normals is None:
                root = np.sqrt(matches.weights)[:, None]
                rows += [by_x * root, by_y * root]
                off += [(at - matches.x)[:, axis] * root[:, 0] for axis in (0, 1)]
            else:
                rows.append(normals[:, :1] * by_x + normals[:, 1:2] * by_y)
                off.append(np.sum(normals[:, :2] * at, axis=1) + normals[:, 2])
        h = h - np.linalg.lstsq(np.vstack(rows), np.concatenate(off), rcond=1e-12)[0]
    return np.asarray(h.reshape(3, 3) @ T / np.linalg.norm(h))


def _by_homography(view: TwoView, points: Array) -> Array:
    """π(H p) (N, 2), finite everywhere: what lies behind the camera is far outside the picture."""
    c = target_points(view, points, np.full(len(points), np.nan))
    return np.where(np.isfinite(c), c, LINE_MESH.far_px)
