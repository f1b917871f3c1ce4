"""Which plane goes on where beyond the overlap, or none: a labelling of the nodes by belief propagation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Part
from ..system.threads import ask
from .options import LABELS, PLANES
from .planes import ScenePlane
from .samples import Samples, Seen
from .target_grid import TargetGrid


def labelled(
    grid: TargetGrid, planes: Sequence[ScenePlane], seen: Seen, colours: Array, smooth: Array, most: float
) -> tuple[NDArray[np.intp], Array]:
    """Which plane every node lies on.

    Parameters
    ----------
    grid : TargetGrid
    planes : sequence of ScenePlane
    seen : Seen
        What both pictures say at the nodes.
    colours : (rows, columns, 3) array
        luma and chroma, 0 to 255, at the nodes.
    smooth : (rows, columns) array
        δ of the smooth continuation, which stands for no plane.
    most : float
        δ above which a plane is impossible.

    Returns
    -------
    label : (rows, columns) array
        −1 for none.
    values : (rows, columns, K) array
        δ of all planes.
    """
    values = np.stack([grid.rays @ plane.normal for plane in planes], axis=-1)
    values = _within_experience(values, planes, grid, seen)
    every = LABELS.coarsening
    coarse = _Coarse(
        np.concatenate([values, smooth[..., None]], axis=-1)[::every, ::every], grid.sensitivity[::every, ::every],
        seen.inside[::every, ::every], colours[::every, ::every],
    )  # fmt: skip
    cost = _costs(coarse, planes, seen.inverse_depth[::every, ::every], seen.trust[::every, ::every], most)
    pairs = coarse.pair_costs(np.s_[:-1, :], np.s_[1:, :]), coarse.pair_costs(np.s_[:, :-1], np.s_[:, 1:])
    label = _best(cost, *pairs)
    for _ in range(2):
        islands = _islands(label, coarse.inside, len(planes))
        if not islands.any():
            break
        cost[..., : len(planes)] += LABELS.island * islands
        label = _best(cost, *pairs)
    label = np.where(label == len(planes), -1, label)
    rows, columns = (np.arange(side) // every for side in grid.shape)
    return label[np.ix_(rows, columns)], values


def agreement(
    grid: TargetGrid, samples: Samples, seen: Seen, planes: Sequence[ScenePlane], label: NDArray[np.intp]
) -> Array:
    """How far (N,), 0 to 1, samples agree with a plane that goes on next to them beyond the overlap; 1 where none does.

    Of leaves in front of a wall the wall goes on: what lies off it must not pull it along. label: see `labelled`.
    """
    beyond = grid.in_picture & ~seen.inside
    _, part = cv2.distanceTransformWithLabels(
        (~beyond).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # the node beyond the overlap that is nearest to each
    nearest = np.zeros(int(part.max()) + 1, np.intp)
    nearest[part[beyond]] = np.flatnonzero(beyond)
    window = np.ones((2 * LABELS.agreeing_nodes + 1,) * 2, np.uint8)
    place = np.rint((samples.points - [grid.grid.xs[0], grid.grid.ys[0]]) / grid.grid.step).astype(np.intp)
    column, row = (np.clip(place[:, k], 0, side - 1) for k, side in ((0, grid.grid.columns), (1, grid.grid.rows)))
    at = nearest[part[row, column]]
    rays = grid.rays_of(samples.points)
    s = grid.sensitivity_of(rays) / (LABELS.agreeing_factor * PLANES.tolerance_px)
    misfit = np.full(len(samples.points), np.inf)
    for k, plane in enumerate(planes):
        goes_on = cv2.dilate((beyond & (label == k)).astype(np.uint8), window).ravel()[at] > 0
        misfit = np.where(goes_on, np.minimum(misfit, np.abs(rays @ plane.normal - samples.inverse_depth) * s), misfit)
    none = (label.ravel()[at] < 0) | np.isinf(misfit)
    return np.where(none, 1.0, 1 / np.square(1 + np.square(np.where(none, 0, misfit))))


@dataclass(frozen=True)
class _Coarse:
    """Every few nodes: δ of all planes and of none (m, n, K + 1), px per unit of δ (m, n), which both pictures see
    (m, n), colours (m, n, 3)."""

    values: Array
    sensitivity: Array
    inside: NDArray[np.bool_]
    colours: Array

    def pair_costs(self, a: Part, b: Part) -> NDArray[np.float32]:
        """What neighbours a and b (…) cost for each two labels (…, K + 1, K + 1): a jump, and any border; less where
        the colour changes too."""
        values, s = (self.values[a] + self.values[b]) / 2, (self.sensitivity[a] + self.sensitivity[b]) / 2
        jump = np.abs(values[..., :, None] - values[..., None, :]) * s[..., None, None] / PLANES.tolerance_px
        cost = np.minimum(jump, LABELS.max_misfit) + LABELS.border * (1 - np.eye(values.shape[-1]))
        contrast = np.linalg.norm(self.colours[a] - self.colours[b], axis=-1) / LABELS.contrast
        alike = np.maximum(1 / (1 + contrast**2), LABELS.min_contrast)
        weighed: NDArray[np.float32] = (alike[..., None, None] * cost).astype(np.float32)
        return weighed


def _within_experience(values: Array, planes: Sequence[ScenePlane], grid: TargetGrid, seen: Seen) -> Array:
    """δ of planes (rows, columns, K); those of unknown direction no nearer or farther than where they were seen."""
    misfit = np.abs(values - seen.inverse_depth[..., None]) * grid.sensitivity[..., None] / PLANES.tolerance_px
    values = values.copy()
    for k, plane in enumerate(planes):
        fits = seen.inside & (misfit[..., k] < 1)
        if plane.kind == "free" and np.count_nonzero(fits) > 5:
            low, high = np.percentile(values[..., k][fits], [3, 97])
            values[..., k] = np.clip(values[..., k], low / LABELS.nearest_factor, high * LABELS.nearest_factor)
    return values


def _costs(
    coarse: _Coarse, planes: Sequence[ScenePlane], inverse_depth: Array, trust: Array, most: float
) -> NDArray[np.float32]:
    """What each label costs at each node by itself (m, n, K + 1); inverse_depth, trust (m, n): what was seen."""
    known, inside = len(planes), coarse.inside[..., None]
    values, s = coarse.values[..., :known], coarse.sensitivity[..., None]
    misfit = np.minimum(np.abs(values - inverse_depth[..., None]) * s / PLANES.tolerance_px, LABELS.max_misfit)
    at_most_infinity = values * s >= -0.5 * PLANES.tolerance_px
    impossible = LABELS.impossible * (~at_most_infinity | (values > LABELS.nearest_factor * most))
    none = np.full((*inside.shape[:2], 1), LABELS.none_seen)
    first = np.concatenate([misfit, none], axis=-1).argmin(axis=-1)
    first = np.where(coarse.inside, first, -1)
    unseen = impossible + _order(coarse, first, planes)
    sure = np.clip(trust, 0.05, 1)[..., None]
    cost = np.concatenate([
        np.where(inside, misfit * sure, unseen), np.where(inside, LABELS.none_seen * sure, LABELS.none_unseen)
    ], axis=-1)  # fmt: skip
    cost += np.where(inside, 0, LABELS.colour * _unlikely(coarse, cost.argmin(axis=-1)))
    rounded: NDArray[np.float32] = cost.astype(np.float32)
    return rounded


def _order(coarse: _Coarse, first: NDArray[np.intp], planes: Sequence[ScenePlane]) -> Array:
    """What planes (m, n, K) cost because another one is in front of them, or behind them; first (m, n): the plane that
    fits best where both pictures see, else −1."""
    cost = np.zeros((*first.shape, len(planes)))
    for a in range(len(planes)):
        for b in range(len(planes)):
            if a == b:
                continue
            nearer = (coarse.values[..., b] - coarse.values[..., a]) * coarse.sensitivity
            apart = np.abs(nearer) > PLANES.tolerance_px
            on = [(first == k) & apart for k in (a, b)]
            count = [np.count_nonzero(one) for one in on]
            if min(count) < LABELS.order_nodes:
                continue
            nearer_wins = np.count_nonzero((on[1] & (nearer > 0)) | (on[0] & (nearer < 0))) / sum(count)
            if nearer_wins > LABELS.order_share:
                cost[..., a] += LABELS.order * (nearer > PLANES.tolerance_px)
            elif nearer_wins < 1 - LABELS.order_share:
                cost[..., a] += LABELS.order * (nearer < -PLANES.tolerance_px)
    return cost


def _unlikely(coarse: _Coarse, label: NDArray[np.intp]) -> Array:
    """−ln of how likely each label has a node's colour (m, n, K + 1), learnt where both pictures see."""
    bins = np.array(LABELS.colour_bins)
    cell = np.clip((coarse.colours / 256 * bins).astype(np.intp), 0, bins - 1)
    place = (cell[..., 0] * bins[1] + cell[..., 1]) * bins[2] + cell[..., 2]
    likely = []
    for k in range(coarse.values.shape[-1]):
        where = place[coarse.inside & (label == k)]
        counts = np.bincount(where, minlength=int(bins.prod())).reshape(bins).astype(np.float64)
        for axis in range(3):
            counts = _blurred(counts, axis)
        likely.append(counts.ravel() + 0.02)
    share = np.stack(likely) / np.sum(likely, axis=0)
    unlikely: Array = -np.log(np.moveaxis(share[:, place], 0, -1) + LABELS.colour_floor)
    return unlikely


def _blurred(counts: Array, axis: int) -> Array:
    """Counts smoothed along an axis by (¼, ½, ¼) twice: about a Gaussian of one bin."""
    for _ in range(2):
        padded = np.pad(counts, [(1, 1) if k == axis else (0, 0) for k in range(counts.ndim)], mode="edge")
        size = np.arange(counts.shape[axis])
        before, here, after = (np.take(padded, size + k, axis=axis) for k in range(3))
        counts = before / 4 + here / 2 + after / 4
    return counts


def _best(
    cost: NDArray[np.float32], down: NDArray[np.float32], across: NDArray[np.float32]
) -> NDArray[np.intp]:
    """The labels (m, n) of low cost (m, n, K) and pair costs to the next row (m − 1, n, K, K) and column (m, n − 1, K,
    K), by min-sum belief propagation.

    Messages pass through the whole grid in one direction after the other, as Felzenszwalb and Huttenlocher (IJCV 2006)
    pass them between neighbours.
    """
    m, n, _ = cost.shape
    from_above, from_below, from_left, from_right = (np.zeros_like(cost) for _ in range(4))

    def swept(belief: NDArray[np.float32], pair: NDArray[np.float32]) -> NDArray[np.float32]:
        """Messages (p, q, K) from each of p lines to the next; belief (p, q, K) without them."""
        out = np.zeros_like(belief)
        for k in range(1, len(belief)):
            message = ((belief[k - 1] + out[k - 1])[:, :, None] + pair[k - 1]).min(axis=1)
            out[k] = message - message.min(axis=1, keepdims=True)
        return out

    turned = down.swapaxes(2, 3)[::-1]
    mirrored = across.swapaxes(2, 3)[:, ::-1].swapaxes(0, 1)
    straight = across.swapaxes(0, 1)
    for _ in range(LABELS.sweeps):
        ask()
        sideways = cost + from_left + from_right
        from_above = swept(sideways, down)
        from_below = swept(sideways[::-1], turned)[::-1]
        upright = cost + from_above + from_below
        from_left = swept(upright.swapaxes(0, 1), straight).swapaxes(0, 1)
        from_right = swept(upright[:, ::-1].swapaxes(0, 1), mirrored).swapaxes(0, 1)[:, ::-1]
    label: NDArray[np.intp] = (cost + from_above + from_below + from_left + from_right).argmin(axis=-1)
    return label


def _islands(label: NDArray[np.intp], inside: NDArray[np.bool_], planes: int) -> NDArray[np.bool_]:
    """Where (m, n, K) a plane's nodes and their neighbours are not connected to any that both pictures see on it."""
    out = np.zeros((*label.shape, planes), bool)
    for k in range(planes):
        own = (label == k).astype(np.uint8)
        part = cv2.connectedComponents(own, connectivity=4)[1]
        lost = (own > 0) & ~np.isin(part, np.unique(part[inside & (own > 0)]))
        out[..., k] = (cv2.dilate(lost.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~inside
    return out
