"""What the light of two pictures differs by, fitted on the blocks that both show: gains, vignetting, a tone curve.

    ln before − ln added = V(r before) − V(r added) + g + p (s − s0)

per block and channel. V: one vignetting for both lenses, the same in all channels; g: the gain of a channel; p: the
slope of a curve against s, the mean of both logarithms without vignetting, which noise in either does not bend; it is
the same in all channels, so that gray stays gray. Robust least squares, by
reweighting. Vignetting and curve are kept only if they earn it on blocks that they were not fitted on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from ..options import EXPOSURE
from .tone_blocks import Blocks, block_weights, weighted_median
from .tone_options import TONE
from .toned import NO_VIGNETTING, ToneCurve, Vignetting


@dataclass(frozen=True)
class ToneFit:
    """By what an added picture's light comes to that of the panorama before.

    Attributes
    ----------
    gain, spread : (C,) arrays
        Its gain, and the median absolute deviation of the blocks' log ratios from it.
    vignetting : Vignetting
        Of both pictures.
    curve : ToneCurve or None
        Of the added picture, with the gain taken where that changes nothing.
    """

    gain: Array
    spread: Array
    vignetting: Vignetting
    curve: ToneCurve | None


@dataclass(frozen=True)
class _Seen:
    """Blocks (N): log light (N, C) of both, squared distances (N,) from the middles of both pictures, weights (N,)."""

    logs: tuple[Array, Array]
    radii: tuple[Array, Array]
    weights: Array

    def subset(self, chosen: NDArray[np.bool_]) -> _Seen:
        before, added = (one[chosen] for one in self.logs)
        near, far = (one[chosen] for one in self.radii)
        return _Seen((before, added), (near, far), self.weights[chosen])

    def without(self, vignetting: Vignetting) -> tuple[Array, Array]:
        """The logarithms with vignetting given back."""
        before, added = (
            log - vignetting.at(radius)[:, None] for log, radius in zip(self.logs, self.radii, strict=True)
        )
        return before, added


@dataclass(frozen=True)
class _Model:
    """Parameters: gains g (C,), slope p and middle s0 of a curve."""

    vignetting: Vignetting
    gains: Array
    slope: float
    middle: float

    def residuals(self, seen: _Seen) -> Array:
        """What is left (N, C) of the difference of log light."""
        before, added = seen.without(self.vignetting)
        left: Array = before - added - self.gains - self.slope * ((before + added) / 2 - self.middle)
        return left


def fit_tone(blocks: Blocks, radii: tuple[Array, Array], with_curve: bool) -> ToneFit:
    """Fit gains, and vignetting and a curve where they earn it.

    Parameters
    ----------
    blocks : Blocks
        None of them dark.
    radii : pair of (N,) arrays
        Squared distances of the blocks from the middles of both pictures (see `Blocks.radii`).
    with_curve : bool
        Whether a curve is tried: light that is linear has none.

    Returns
    -------
    ToneFit
    """
    before, added = (np.log(means) for means in blocks.means)
    seen = _Seen((before, added), radii, block_weights(blocks))
    model = _chosen(seen, blocks.at, with_curve) if len(blocks) >= TONE.min_blocks else _fitted(seen, False, False)
    spread = np.median(np.abs(model.residuals(seen)), axis=0)
    if not model.slope:
        return ToneFit(np.exp(model.gains), spread, model.vignetting, None)
    curve, gains = _curve_of(model, seen)
    return ToneFit(np.exp(gains), spread, model.vignetting, curve)


def _chosen(seen: _Seen, at: NDArray[np.intp], with_curve: bool) -> _Model:
    """The model with as many parts as earn it on blocks not fitted on."""
    black = (at // TONE.tile_blocks).sum(axis=1) % 2 == 0
    light = (seen.logs[0] + seen.logs[1]).mean(axis=1)
    ends = np.quantile(light, [1 / 3, 2 / 3])
    thirds = light < ends[0], light > ends[1]
    best, least = (False, False), np.inf
    tried: dict[tuple[bool, bool], tuple[float, Array]] = {}
    for parts in ((False, False), (True, False), (False, True), (True, True)):
        if parts[1] and not with_curve:
            continue
        left = _left_over(seen, black, parts)
        score = weighted_median(left, seen.weights)
        in_thirds = np.array([weighted_median(left[third], seen.weights[third]) for third in thirds])
        tried[parts] = score, in_thirds
        if parts[1] and (in_thirds > (1 - TONE.min_third_improvement) * tried[parts[0], False][1]).any():
            continue
        if parts[0] and not is_lens(_fitted(seen, *parts).vignetting):
            continue
        more = sum(parts) - sum(best)
        if score < (1 - TONE.min_improvement) ** max(more, 0) * least:
            best, least = parts, score
    return _fitted(seen, *best)


def _left_over(seen: _Seen, black: NDArray[np.bool_], parts: tuple[bool, bool]) -> Array:
    """What a model fitted on the other tiles leaves of each block's difference (N,)."""
    left = np.zeros(len(black))
    for here in (black, ~black):
        if here.any() and not here.all():
            left[here] = np.abs(_fitted(seen.subset(~here), *parts).residuals(seen.subset(here))).mean(axis=1)
        else:
            left[here] = np.inf  # nothing to try it on
    return left


def _fitted(seen: _Seen, vignetting: bool, curve: bool) -> _Model:
    """The model with or without vignetting and curve."""
    parts = _parts(seen, vignetting, curve)
    before, added = seen.without(parts.vignetting)
    differences = before - added - parts.slope * ((before + added) / 2 - parts.middle)
    gains = [weighted_median(column, seen.weights) for column in differences.T]
    return replace(parts, gains=np.array(gains))


def _parts(seen: _Seen, vignetting: bool, curve: bool) -> _Model:
    """Vignetting and curve that fit the mean of all channels best, beside a gain."""
    (before, added), (near, far) = seen.logs, seen.radii
    light = ((before + added) / 2).mean(axis=1)
    middle = float(np.median(light))
    columns = [np.ones(len(light))]
    columns += [near - far, near**2 - far**2] if vignetting else []
    columns += [light - middle] if curve else []
    _, *found = _robust(np.column_stack(columns), (before - added).mean(axis=1), seen.weights).tolist()
    slope = float(np.clip(found.pop(), -TONE.max_slope, TONE.max_slope)) if curve else 0.0
    lens = Vignetting(found[0] / 2 + found[1] / 4, found[0] + found[1]) if vignetting else NO_VIGNETTING
    return _Model(lens, np.zeros(before.shape[1]), slope, middle)


def _robust(columns: Array, values: Array, weights: Array) -> Array:
    """Least absolute differences (least squares where they are small), all but the first column held back a little."""
    prior = np.diag([0.0] + [TONE.prior * weights.sum()] * (columns.shape[1] - 1))
    prior[0, 0] = 1e-12  # all blocks without weight: nothing to solve
    now, found = weights, np.zeros(columns.shape[1])
    for _ in range(TONE.rounds):
        found = np.linalg.solve(columns.T @ (columns * now[:, None]) + prior, columns.T @ (now * values))
        now = weights * TONE.robust_log / np.maximum(np.abs(values - columns @ found), TONE.robust_log)
    return found


def is_lens(vignetting: Vignetting) -> bool:
    """Whether a lens takes off light like this: ever more towards the corners, and not all."""
    lost = vignetting.at(np.linspace(0, 1, 11))
    falls = np.diff(lost).max() <= TONE.max_rise and lost.max() <= TONE.max_rise
    return bool(falls and TONE.least_corner <= lost.min() and lost[-1] <= TONE.most_corner)


def _curve_of(model: _Model, seen: _Seen) -> tuple[ToneCurve, Array]:
    """The curve of the added picture, and the logarithms of its gains (C,) where the curve changes nothing.

    ln before = ln added + g + p (s − s0) with s their mean, solved for ln before.
    """
    added = seen.without(model.vignetting)[1].mean(axis=1)
    dark, bright = np.minimum(np.percentile(added, TONE.curve_ends), np.log(EXPOSURE.clipped_light)).tolist()
    slope = model.slope / (1 - model.slope / 2)
    gains = (model.gains - model.slope * model.middle) / (1 - model.slope / 2) + slope * (dark + bright) / 2
    return ToneCurve(slope, dark, bright), gains
