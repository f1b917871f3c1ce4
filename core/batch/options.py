"""What was chosen for batches."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClipOptions:
    """Clips of cameras that stand still."""

    max_frames: int = 1_000_000
    """Frames of one clip at most: more are a slip in the list, and would fill the memory with their names."""

    aligned_frames: int = 5
    """Frames, evenly spread, that exposure and seam of a clip are decided over at most, and of two cameras the
    alignment: each adds its matches and time."""

    alignment_weight: float = 3.0
    """What aligning a clip takes of the progress bar, in stitches of a pair."""

    frame_weight: float = 0.3
    """What each frame of a clip takes of it, in the same unit."""

    unit_frames: int = 50
    """Frames of a clip that a farm's task makes, its report counting as one: each task aligns the clip anew, which
    takes as long as 10 to 15 frames (by the two figures above), a fifth of its time."""


@dataclass(frozen=True)
class UnitOptions:
    """What the units of a plan are said to take. Figures of pairs: docs/performance.md, upwards of all that was
    measured from 0.3 to 50 MP."""

    pair_bytes: float = 0.3e9
    """Bytes of a stitch of two pictures, however small."""

    pair_pixel_bytes: float = 550.0
    """Bytes for each pixel of its larger picture, of the first `pair_pixels` of them."""

    pair_pixels: float = 2.2e6
    """Pixels whose features and dense matching take so much: these do not grow beyond."""

    pair_further_bytes: float = 48.0
    """Bytes for each further pixel."""

    core_bytes: float = 2e9
    """Bytes of memory that a machine of a farm has for each core, or more: a unit that takes more keeps other cores
    idle anyway, so it is given these."""

    max_cores: int = 8
    """Cores that a stitch makes use of at most (`SystemOptions.max_threads`)."""


CLIP = ClipOptions()
UNIT = UnitOptions()


@dataclass(frozen=True)
class NameOptions:
    """What outputs may be called (`list`)."""

    max_bytes: int = 230
    """Bytes of a name in UTF-8: file systems take 255, and endings like .matches.csv and numbers of frames follow."""


NAME = NameOptions()
