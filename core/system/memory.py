"""What is freed is used again by whatever asks next, in a process that is ours.

glibc gives large arrays back at once, and keeps a heap for each thread, which goes with it: the system has to wipe the
pages of the next one, which took a fifth of a stitch's time. Nothing of this is done where the allocator is another.
"""

from __future__ import annotations

import ctypes
import sys

from .options import SYSTEM

# mallopt's names (malloc.h) for from where on an array has pages of its own, how much may stay free on top, and the
# number of heaps.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8


def use_again() -> None:
    """For the whole process, before it starts threads: one heap, which keeps what is freed."""
    if sys.platform != "linux":
        return
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):
        large = SYSTEM.large_bytes
        for name, value in ((_MMAP_THRESHOLD, large), (_TRIM_THRESHOLD, large), (_ARENA_MAX, 1)):
            libc.mallopt(name, value)
