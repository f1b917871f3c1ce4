"""What two layers show in common, as means over small blocks: what exposure and tone are measured on.

The means forgive an alignment that is a pixel off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...raster.arrays import Array, bounds
from ...raster.options import PARTS
from ...raster.picture_map import CanvasMap
from ...system.threads import in_order
from ..options import EXPOSURE, OVERLAP


@dataclass(frozen=True)
class Blocks:
    """Blocks of the canvas that two layers show opaque and unclipped.

    Attributes
    ----------
    means : pair of (N, C) arrays
        Mean light of the panorama before and of the added layer.
    at : (N, 2) int array
        Row and column of each block, in blocks.
    overexposed : (float, float)
        Share of what both show that is clipped in one of them alone: in the panorama before, in the added layer.
    """

    means: tuple[Array, Array]
    at: NDArray[np.intp]
    overexposed: tuple[float, float]

    def __len__(self) -> int:
        return len(self.at)

    def subset(self, chosen: NDArray[np.bool_] | slice) -> Blocks:
        """Only the chosen blocks (N,)."""
        before, added = (one[chosen] for one in self.means)
        return Blocks((before, added), self.at[chosen], self.overexposed)

    def radii(self, picture_map: CanvasMap) -> Array:
        """How far (N,) the middle of each block is from the middle of a picture, squared; 1 at its corners."""
        block, middle = EXPOSURE.block_px, EXPOSURE.block_px // 2
        first, last = self.at.min(axis=0), self.at.max(axis=0)
        left, width = block * int(first[1]), block * int(last[1] - first[1] + 1)
        # a line at a time: all of the map at once would take as much memory as the overlap
        lines = [
            picture_map.within((left, block * row + middle, width, 1)).arrays().from_middle(np.s_[:, middle::block])
            for row in range(int(first[0]), int(last[0]) + 1)
        ]
        rows, columns = (self.at - first).T
        radii: Array = np.concatenate(lines)[rows, columns].astype(np.float64)
        return radii


def shared_blocks(
    before: Layer, layer: Layer, hidden: NDArray[np.bool_], floats: tuple[bool, bool]
) -> Blocks | None:
    """Measure blocks of what the panorama before and an added layer both show.

    Parameters
    ----------
    before, layer : Layer
        On the same canvas.
    hidden : (H, W) bool array
        What the added picture cannot see, and so shows something else.
    floats : (bool, bool)
        Whether the two come from float pictures, which do not clip.

    Returns
    -------
    Blocks or None
        None where the layers do not meet.
    """
    shown = (before.alpha > OVERLAP.opaque_alpha) & (layer.alpha > OVERLAP.opaque_alpha) & ~hidden
    box = bounds(shown)
    if box is None:
        return None
    block = EXPOSURE.block_px
    # whole blocks of the canvas
    rows, columns = (slice(part.start - part.start % block, part.stop + -part.stop % block) for part in box)
    at_once = block * max(1, PARTS.strip_pixels // (block * (columns.stop - columns.start)))

    def means_of(top: int) -> tuple[list[Array], NDArray[np.intp], list[int]]:
        part = slice(top, min(rows.stop, top + at_once)), columns
        pixels, both = [one.light[part] for one in (before, layer)], shown[part]
        unclipped = [unclipped_in(light, both, is_float) for light, is_float in zip(pixels, floats, strict=True)]
        counts = unclipped[0] & unclipped[1]
        number = int(counts.sum())
        alone = [int(other.sum()) - number for other in reversed(unclipped)]
        share, enough = block_shares(counts)
        at = np.argwhere(enough) + (top // block, columns.start // block)
        return [block_means(light, counts, share, enough) for light in pixels], at, [*alone, int(both.sum())]

    parts = list(in_order(means_of, range(rows.start, rows.stop, at_once)))
    first, second = (np.concatenate([part[0][k] for part in parts]) for k in range(2))
    clipped_before, clipped, total = np.sum([part[2] for part in parts], axis=0).tolist()
    at = np.concatenate([part[1] for part in parts])
    return Blocks((first, second), at, (clipped_before / max(total, 1), clipped / max(total, 1)))


def unclipped_in(light: NDArray[np.float32], both: NDArray[np.bool_], is_float: bool) -> NDArray[np.bool_]:
    """What both show (H, W) and light has unclipped in every channel."""
    if not is_float:
        for k in range(light.shape[2]):
            both = both & (light[..., k] < EXPOSURE.clipped_light)
    return both


def block_shares(
    counts: NDArray[np.bool_], least: float = EXPOSURE.min_block_share
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The share of each block (h, w) that counts, and where that is `least` or more."""
    block = EXPOSURE.block_px
    height, width = (block * (side // block) for side in counts.shape)
    if not height or not width:
        return np.zeros((0, 0), np.float32), np.zeros((0, 0), bool)
    size = (width // block, height // block)
    share = cv2.resize(counts[:height, :width].astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return share, share >= least


def block_means(
    pixels: NDArray[np.float32], counts: NDArray[np.bool_], share: NDArray[np.float32], enough: NDArray[np.bool_]
) -> Array:
    """Means (N, C) over the blocks, of what counts, where enough of a block does."""
    block = EXPOSURE.block_px
    height, width = (block * side for side in share.shape)
    if not share.size:
        return np.zeros((0, pixels.shape[2]))
    weight = counts[:height, :width].astype(np.float32)
    means = [
        cv2.resize(pixels[:height, :width, k] * weight, share.shape[::-1], interpolation=cv2.INTER_AREA)[enough]
        / share[enough]
        for k in range(pixels.shape[2])
    ]
    stacked: Array = np.stack(means, axis=-1).astype(np.float64)
    return stacked


def bright_blocks(blocks: Blocks) -> Blocks:
    """The blocks that have no channel that is dark compared with the median block, in either layer."""
    first, second = (bright(means) for means in blocks.means)
    return blocks.subset(first & second)


def block_weights(blocks: Blocks) -> Array:
    """How much the error of each block (N,) counts: as the eye sees it, for tones grow about as the root of light."""
    return tone_weights(blocks.means[0])


def tone_weights(means: Array) -> Array:
    """The same (N,) by the means (N, C) of one picture."""
    weights: Array = np.sqrt(means.mean(axis=1))
    return weights


def weighted_median(values: Array, weights: Array) -> float:
    """The median of values (N,) by weights (N,)."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def log_ratios(means: Sequence[Array]) -> Array:
    """Logarithm (N, C) of how much brighter blocks are in the first than in the second."""
    ratios: Array = np.log(means[0]) - np.log(means[1])
    return ratios


def bright(means: Array) -> NDArray[np.bool_]:
    """Which blocks (N,) have no channel that is dark compared with the median block."""
    typical = float(np.median(means.mean(axis=1))) if len(means) else 0.0
    enough: NDArray[np.bool_] = means.min(axis=1, initial=np.inf) > max(EXPOSURE.min_brightness * typical, 0.0)
    return enough
