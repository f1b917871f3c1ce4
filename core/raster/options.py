"""Tuning values of the raster room, with their units and why they are what they are."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PartOptions:
    """How pictures are cut up to be worked on part by part."""

    # Pixels of a strip of rows: enough for threads to be worth it, few enough to bound memory.
    strip_pixels: int = 1_000_000
    # Times that strips are smaller which go through many hands: so they stay in the processor's cache.
    smaller_strips: int = 16
    # px, side of the tiles in which a map is sampled: keeps OpenCV's working memory small.
    tile_side: int = 1024
    # px, longest side handed to cv2.remap, which wants every side below 32767.
    max_remap_side: int = 32_000
    # Values encoded at a time: the index arrays stay small beside a picture of 400 megapixels.
    values_at_once: int = 1 << 20


@dataclass(frozen=True)
class GridOptions:
    """Grids of nodes that carry smooth functions (`grid`)."""

    # Nodes of a grid at any picture size: displacement fields are smooth.
    nodes: int = 20_000
    # px between nodes, at least: finer than this, nodes cost as much as pixels.
    least_step: int = 4
    # Cells of one axis whose pixels are interpolated at once: products with far nodes are saved.
    cells_at_once: int = 8


@dataclass(frozen=True)
class MaskOptions:
    """Cleaning masks."""

    # px, side of the square below which a part of a mask is a speck.
    speck_side: int = 7


PARTS = PartOptions()
GRID = GridOptions()
MASKS = MaskOptions()
