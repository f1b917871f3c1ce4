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


CLIP = ClipOptions()
