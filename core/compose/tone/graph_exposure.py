"""One exposure for a set of pictures, over the graph of all their overlaps, before any of them is added.

Matching each picture to the panorama so far would add up errors from one to the next, and the last would not meet the
first. Here the logarithms of all gains are solved for at once:

    g = argmin Σ n_ij / σ_ij² (g_i − g_j + q_ij)²

over all overlaps, with n_ij blocks whose log ratio is q_ij in the median and spreads by σ_ij, channel by channel.
Views of one sphere are one picture: they have one gain, and what they share tells nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ...cameras.bodies import bodies_of
from ...cameras.camera import Camera
from ...choices import Exposing
from ...panorama.layers import Layer
from ...raster.arrays import Array
from ...raster.picture_map import CanvasMap
from ..options import OVERLAP
from .clipped import ClippedLight, ToldLight, clipped_light
from .exposure import TOO_LITTLE, Exposure, too_different, unchanged
from .graph_options import GRAPH_EXPOSURE
from .graph_vignetting import fit_vignetting
from .picture_blocks import PictureBlocks, SharedBlocks, blocks_meet, overlaps_of, picture_blocks
from .tone_blocks import log_ratios, weighted_median
from .tone_options import CLIPPED
from .toned import NO_VIGNETTING, Vignetting


@dataclass(frozen=True)
class _Ratio:
    """How much brighter picture i is than j, as logarithms (C,), their spread (C,), and by how many blocks."""

    i: int
    j: int
    middle: Array
    spread: Array
    blocks: int

    def between(self, body: NDArray[np.intp]) -> _Ratio:
        """The same of the bodies (numbers of all, N) that the two pictures are views of."""
        return replace(self, i=int(body[self.i]), j=int(body[self.j]))


def graph_exposures(
    layers: Sequence[Layer], maps: Sequence[CanvasMap], cameras: Sequence[Camera],
    hidden: Sequence[NDArray[np.bool_]], floats: Sequence[bool], wanted: Exposing, progress: Callable[[float], None],
) -> tuple[Exposure, ...]:  # fmt: skip
    """What is done to the light of each picture of a set.

    Parameters
    ----------
    layers : sequence of Layer
        On the same canvas, the reference's first.
    maps : sequence of CanvasMap
        Where the canvas shows each picture.
    cameras : sequence of Camera
        Those with the same intrinsics share a lens, and its vignetting; views of one sphere have neither, and one
        exposure.
    hidden : sequence of (H, W) bool arrays
        What each picture cannot see, and so shows something else.
    floats : sequence of bool
        Whether they come from float pictures. With one among them radiance is kept: no highlight is rolled off, and all
        come to the exposure of the reference.
    wanted : str or float
        See `StitchOptions.exposure`. By "auto", and by a number of stops beside it, all come to the median of the set,
        which does not depend on which picture is the reference.
    progress : callable
        Called with the share that is done.

    Returns
    -------
    tuple of Exposure
    """
    channels, radiance = layers[0].light.shape[2], any(floats)
    if wanted == "none":
        return (unchanged(channels),) * len(layers)
    blocks = []
    for number, about_one in enumerate(zip(layers, maps, hidden, floats, strict=True)):
        progress(number / len(layers))
        blocks.append(picture_blocks(*about_one))
    body = _body_of(cameras)
    overlaps = [one for one in overlaps_of(blocks) if body[one.i] != body[one.j]]
    kept = radiance or wanted == "reference"
    lenses = fit_vignetting(overlaps, lenses_of(cameras)) if wanted != "reference" else (NO_VIGNETTING,) * len(layers)
    ratios = [_ratio(one, lenses) for one in overlaps]
    usable = [one for one in ratios if np.abs(one.middle).max() <= np.log(GRAPH_EXPOSURE.max_gain)]
    overexposed = [] if kept else [_overexposed(blocks, body, number) for number in range(body.max() + 1)]
    well = None if kept else np.array([1 - min(one[0] / GRAPH_EXPOSURE.worse_exposed, 1) for one in overexposed])
    gains = _solved([one.between(body) for one in usable], body.max() + 1, channels, well)
    gains += np.log(2) * (0.0 if isinstance(wanted, str) else wanted)
    exposures = []
    for number in range(len(layers)):
        views = np.flatnonzero(body == body[number]).tolist()
        own, all_own = ([one for one in some if one.i in views or one.j in views] for some in (usable, ratios))
        others = [one for k, one in enumerate(blocks) if k not in views]
        why_not = ""
        if not own and any(blocks_meet(blocks[view], one) for view in views for one in others):
            why_not = too_different(np.exp(all_own[0].middle)) if all_own else TOO_LITTLE
        counts = [one.blocks for one in own]
        spread = np.average([one.spread for one in own], axis=0, weights=counts) if own else np.full(channels, np.nan)
        exposures.append(Exposure(
            np.exp(gains[body[number]]).astype(np.float32), spread.astype(np.float32), sum(counts), lenses[number],
            keeps_white=not kept, why_not=why_not,
        ))  # fmt: skip
    return tuple(exposures) if kept else _with_clipped(exposures, body, overexposed, layers, maps, hidden)


def lenses_of(cameras: Sequence[Camera]) -> list[int | None]:
    """The number of each camera's lens: those of one size and the same intrinsics share one; views of a sphere, whose
    program has done away with what lenses did, have none."""
    numbers: dict[tuple[object, ...], int] = {}
    return [
        None if one.view_of is not None
        else numbers.setdefault((one.size, one.K.tobytes(), one.distortion.tobytes(), one.lens), len(numbers))
        for one in cameras
    ]  # fmt: skip


def _body_of(cameras: Sequence[Camera]) -> NDArray[np.intp]:
    """Of each picture (N,) the number of its body; 0 is the reference's."""
    return np.unique(bodies_of(cameras).of, return_inverse=True)[1].astype(np.intp)


def _ratio(shared: SharedBlocks, lenses: Sequence[Vignetting]) -> _Ratio:
    """How much brighter one picture is than the other, without their vignetting."""
    lost = [lenses[number].at(radii) for number, radii in zip((shared.i, shared.j), shared.radii, strict=True)]
    ratios = log_ratios(shared.blocks.means) - (lost[0] - lost[1])[:, None]
    middle = np.array([weighted_median(column, shared.weights) for column in ratios.T])
    spread = np.maximum(np.median(np.abs(ratios - middle), axis=0), GRAPH_EXPOSURE.least_spread)
    return _Ratio(shared.i, shared.j, middle, spread, len(shared.blocks))


def _solved(ratios: Sequence[_Ratio], count: int, channels: int, well: Array | None) -> Array:
    """Logarithms (N, C) of the gains; the median of the pictures that hang together stays as it is, each counted by how
    well (N,) it is exposed, 0 to 1, or without that the reference."""
    first, second = (np.array([getattr(one, name) for one in ratios], np.intp) for name in ("i", "j"))
    links = coo_matrix((np.ones(len(ratios)), (first, second)), shape=(count, count))
    groups, group = connected_components(links, directed=False)
    # one picture of each group is held; which one is of no consequence
    free = np.setdiff1d(np.arange(count), [np.flatnonzero(group == number)[0] for number in range(groups)])
    gains, trust = np.zeros((count, channels)), np.ones(len(ratios))
    for scale in (*GRAPH_EXPOSURE.outlier_logs, None):
        for k in range(channels):
            matrix, right = np.zeros((count, count)), np.zeros(count)
            for one, share in zip(ratios, trust, strict=True):
                weight, ends = share * one.blocks / one.spread[k] ** 2, [one.i, one.j]
                matrix[np.ix_(ends, ends)] += weight * np.array([[1, -1], [-1, 1]])
                right[ends] += weight * one.middle[k] * np.array([-1, 1])
            gains[free, k] = np.linalg.solve(matrix[np.ix_(free, free)], right[free])
        if scale is not None:
            left = [np.abs(gains[one.i] - gains[one.j] + one.middle).mean() for one in ratios]
            trust = 1 / (1 + (np.array(left) / scale) ** 2) ** 2
    for number in range(groups):
        own = group == number
        gains[own] -= gains[0] if well is None and own[0] else _median(gains[own], None if well is None else well[own])
    return gains


def _median(values: Array, weights: Array | None) -> Array:
    """The median (C,) of values (N, C) by weights (N,), as the mean of a narrow middle so that no weight makes it jump;
    without weights, or where none is above 0, all count alike."""
    if weights is None or not weights.any():
        weights = np.ones(len(values))
    order = np.argsort(values, axis=0, kind="stable")
    upper = np.cumsum(weights[order], axis=0) / weights.sum()
    lower = np.vstack([np.zeros(values.shape[1]), upper[:-1]])
    middle = 0.5 - GRAPH_EXPOSURE.middle / 2, 0.5 + GRAPH_EXPOSURE.middle / 2
    share = np.maximum(np.minimum(upper, middle[1]) - np.maximum(lower, middle[0]), 0) / GRAPH_EXPOSURE.middle
    median: Array = (share * np.take_along_axis(values, order, axis=0)).sum(axis=0)
    return median


def _with_clipped(
    exposures: Sequence[Exposure], body: NDArray[np.intp], overexposed: Sequence[tuple[float, list[tuple[int, int]]]],
    layers: Sequence[Layer], maps: Sequence[CanvasMap], hidden: Sequence[NDArray[np.bool_]],
) -> tuple[Exposure, ...]:  # fmt: skip
    """The same with how much of each picture is over-exposed, and what others tell of its clipped light; overexposed:
    see `_overexposed`, for each body."""

    def told_of(number: int, other: int) -> ToldLight:
        shown = [(layers[k].alpha > OVERLAP.opaque_alpha) & ~hidden[k] for k in (number, other)]
        toned, reference = (exposures[k].applied(layers[k], maps[k]).light for k in (number, other))
        return ToldLight(layers[number].light, toned, reference, shown[0] & shown[1])

    found: dict[int, tuple[float, ClippedLight | None]] = {}
    for number, (share, tellers) in enumerate(overexposed):
        told = clipped_light(told_of(*both) for both in tellers) if share >= CLIPPED.least_share else None
        found[number] = share, told
    return tuple(
        replace(one, overexposed=found[number][0], clipped=found[number][1])
        for one, number in zip(exposures, body.tolist(), strict=True)
    )


def _overexposed(
    blocks: Sequence[PictureBlocks | None], body: NDArray[np.intp], which: int
) -> tuple[float, list[tuple[int, int]]]:
    """Share of what a body and other pictures show that is clipped in it alone; of each of its views that is, with the
    other that tells most of it."""
    clipped_alone, shown_by_both, tellers = 0.0, 0.0, []
    for number in np.flatnonzero(body == which).tolist():
        own = blocks[number]
        if own is None:
            continue
        alone, shown = (np.zeros(own.known.shape, np.float32) for _ in range(2))
        most, teller = 0.0, number
        for k, other in enumerate(blocks):
            meeting = None if other is None or body[k] == which else own.meeting(other)
            if other is None or meeting is None:
                continue
            here, there = meeting
            both = np.minimum(own.shown[here], other.shown[there])
            unclipped = np.clip(own.clipped[here] - other.clipped[there], 0, both)
            alone[here], shown[here] = np.maximum(alone[here], unclipped), np.maximum(shown[here], both)
            if unclipped.sum() > most:
                most, teller = float(unclipped.sum()), k
        clipped_alone, shown_by_both = clipped_alone + float(alone.sum()), shown_by_both + float(shown.sum())
        tellers += [(number, teller)] if teller != number else []
    return clipped_alone / max(shown_by_both, 1.0), tellers
