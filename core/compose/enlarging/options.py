"""What was chosen in enlarging drafts of large sets: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DraftOptions:
    """Decisions about a large set at a fraction of its size (`draft`, `enlarged`)."""

    most_pixels: int = 48_000_000
    """Pixels of all pictures together up to which a set is decided about at its own size: each takes about 40 bytes in
    maps, layers and overlaps then, 2 GB in all."""

    most_times: int = 16
    """How many px of the panorama lie along one of a draft's at most: of the largest sets that can be read."""

    tile_rows: int = 128
    """Rows of the parts that are worked out at once: what a part needs of a picture is decoded with it, and beside a
    much flatter part a rounded horizon would have most of that decoded in vain."""

    tile_columns: int = 1024
    """Columns of these parts."""

    outline_px: int = 64
    """px of the draft a side of the blocks in which the outline is looked for: most hold none."""


DRAFT = DraftOptions()
