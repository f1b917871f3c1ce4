"""What each picture shows, as means over small blocks of the canvas: every overlap is then measured without its pixels.

With N pictures there are up to N²/2 overlaps; each picture is read once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...raster.arrays import Array, Part, bounds, meet
from ...raster.options import PARTS
from ...raster.picture_map import CanvasMap
from ..options import EXPOSURE, OVERLAP
from .graph_options import GRAPH_EXPOSURE
from .tone_blocks import Blocks, block_means, block_shares, bright, tone_weights, unclipped_in


@dataclass(frozen=True)
class PictureBlocks:
    """One picture in blocks.

    Attributes
    ----------
    at : (int, int)
        Row and column of the first block, in blocks of the canvas.
    means : (h, w, C) float32 array
        Mean light.
    known : (h, w) bool array
        Where the block is opaque and unclipped.
    shown, clipped : (h, w) float32 arrays
        Share of the block that is opaque, and that is opaque and clipped.
    radii : (h, w) float32 array
        How far its middle is from the middle of the picture, squared; 1 at its corners.
    """

    at: tuple[int, int]
    means: NDArray[np.float32]
    known: NDArray[np.bool_]
    shown: NDArray[np.float32]
    clipped: NDArray[np.float32]
    radii: NDArray[np.float32]

    def meeting(self, other: PictureBlocks) -> tuple[Part, Part] | None:
        """The blocks that both boxes hold, in this one and in the other; None where they do not meet."""
        height, width = self.known.shape
        row, column = (there - here for here, there in zip(self.at, other.at, strict=True))
        return meet((slice(0, height), slice(0, width)), (height, width), (row, column), other.known.shape)


def picture_blocks(
    layer: Layer, picture_map: CanvasMap, hidden: NDArray[np.bool_], is_float: bool
) -> PictureBlocks | None:
    """Measure a picture in blocks.

    Parameters
    ----------
    layer : Layer
    picture_map : CanvasMap
        Where the canvas shows the picture.
    hidden : (H, W) bool array
        What it cannot see, and so shows something else.
    is_float : bool
        Whether it comes from a float picture, which does not clip.

    Returns
    -------
    PictureBlocks or None
        None if it shows nothing.
    """
    shown = (layer.alpha > OVERLAP.opaque_alpha) & ~hidden
    box = bounds(shown)
    if box is None:
        return None
    block = EXPOSURE.block_px
    rows, columns = (
        slice(part.start - part.start % block, min(part.stop + -part.stop % block, side - side % block))
        for part, side in zip(box, shown.shape, strict=True)
    )
    if rows.stop <= rows.start or columns.stop <= columns.start:
        return None
    at_once = block * max(1, PARTS.strip_pixels // (block * (columns.stop - columns.start)))

    def measured(top: int) -> tuple[NDArray[np.generic], ...]:
        part = slice(top, min(rows.stop, top + at_once)), columns
        light, opaque = layer.light[part], shown[part]
        unclipped = unclipped_in(light, opaque, is_float)
        share, known = block_shares(unclipped, GRAPH_EXPOSURE.min_block_share)
        there, _ = block_shares(opaque)
        means = np.zeros((*known.shape, light.shape[2]), np.float32)
        means[known] = block_means(light, unclipped, share, known)
        return means, known, there, there - share

    parts = [measured(top) for top in range(rows.start, rows.stop, at_once)]
    means, known, there, clipped = (np.concatenate(values) for values in zip(*parts, strict=True))
    middles = [
        picture_map.within((columns.start, top + block // 2, columns.stop - columns.start, 1)).arrays()
        .from_middle(np.s_[:, block // 2 :: block])
        for top in range(rows.start, rows.stop, block)
    ]  # fmt: skip
    return PictureBlocks(
        (rows.start // block, columns.start // block), means, known, there, clipped, np.concatenate(middles)
    )


def blocks_meet(first: PictureBlocks | None, second: PictureBlocks | None) -> bool:
    """Whether two pictures show anything in the same place."""
    meeting = None if first is None or second is None else first.meeting(second)
    if first is None or second is None or meeting is None:
        return False
    return bool(((first.shown[meeting[0]] > 0) & (second.shown[meeting[1]] > 0)).any())


@dataclass(frozen=True)
class SharedBlocks:
    """Blocks that pictures i and j both show, none of them dark; radii: pair of (N,) arrays, see `PictureBlocks`."""

    i: int
    j: int
    blocks: Blocks
    radii: tuple[Array, Array]

    @property
    def weights(self) -> Array:
        """How much the error of each block (N,) counts, by both pictures alike, whichever of them is i."""
        first, second = (tone_weights(means) for means in self.blocks.means)
        return (first + second) / 2

    def thinned(self, most: int) -> SharedBlocks:
        """At most so many of them."""
        every = slice(None, None, -(-len(self.blocks) // most))
        first, second = (one[every] for one in self.radii)
        return SharedBlocks(self.i, self.j, self.blocks.subset(every), (first, second))


def overlaps_of(pictures: Sequence[PictureBlocks | None]) -> list[SharedBlocks]:
    """All overlaps that have enough blocks to measure exposure by."""
    found = []
    for j, second in enumerate(pictures):
        for i, first in enumerate(pictures[:j]):
            meeting = None if first is None or second is None else first.meeting(second)
            if meeting is None or first is None or second is None:
                continue
            here, there = meeting
            both = first.known[here] & second.known[there]
            if np.count_nonzero(both) < EXPOSURE.min_blocks:
                continue
            (near, far), radii = (
                [getattr(one, name)[part][both].astype(np.float64) for one, part in ((first, here), (second, there))]
                for name in ("means", "radii")
            )
            kept = bright(near) & bright(far)
            if np.count_nonzero(kept) < EXPOSURE.min_blocks:
                continue
            at = np.argwhere(both)[kept] + (first.at[0] + here[0].start, first.at[1] + here[1].start)
            blocks = Blocks((near[kept], far[kept]), at, (0.0, 0.0))
            found.append(SharedBlocks(i, j, blocks, (radii[0][kept], radii[1][kept])))
    return found
