"""What was chosen in making large sets: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DraftOptions:
    """Decisions about a large set at a fraction of its size (`draft`, `enlarged`)."""

    most_pixels: int = 48_000_000
    """Pixels of all pictures together up to which a set is decided about at its own size: each takes about 75 bytes in
    maps, layers and overlaps then, 3.6 GB in all."""

    most_times: int = 16
    """How many px of the panorama lie along one of a draft's at most: of the largest sets that can be read."""

    tile_rows: int = 128
    """Rows of the parts that are worked out at once: what a part needs of a picture is decoded with it, and beside a
    much flatter part a rounded horizon would have most of that decoded in vain."""

    tile_columns: int = 1024
    """Columns of these parts."""

    outline_px: int = 64
    """px of the draft a side of the blocks in which the outline is looked for: most hold none."""


@dataclass(frozen=True)
class MemoryOptions:
    """What a stitch takes at its peak, measured on thirty pictures of 12 MP (`memory_need`)."""

    # Bytes of the program and its libraries.
    program_bytes: int = 250_000_000
    # Bytes a pixel, and pixels at most, of a picture whose features are looked for, and bytes of all at once: see
    # `pose.options.FEATURES`.
    features_bytes: int = 230
    features_pixels: int = 3_200_000
    features_at_once: int = 1_200_000_000
    # Bytes for each pixel of all pictures, as decided about: maps, layers, overlaps and the panorama.
    decided_bytes: int = 75
    # The same for each of all pictures in full, of a large set: the panorama's outline, with all that they overlap.
    enlarged_bytes: float = 0.5
    # Bytes of each thread's strips while a panorama is composed and written.
    strip_bytes: int = 100_000_000
    # Bytes a pixel of a float picture and its view, and of one of 16 bits and its view.
    float_bytes: int = 15
    deep_bytes: int = 9
    # The same of camera RAW, which is developed in a process of its own: as much again, of as many as are read at once.
    raw_bytes: int = 20
    # Bytes a pixel that merging the exposures of one view takes beside them, its outcome among them: 38 were measured
    # of 24 MP.
    merging_bytes: int = 40


DRAFT = DraftOptions()
MEMORY = MemoryOptions()
