"""Settings of glibc's allocator, so that freed memory is reused instead of given back to the system.

By default glibc unmaps large arrays at once and keeps a heap for each thread; clearing the pages of the next array then
took a fifth of a stitch's time. Other allocators are left alone.
"""

from __future__ import annotations

import ctypes
import sys

from .options import SYSTEM

# mallopt's names (malloc.h) for from where on an array has pages of its own, how much may stay free on top, and the
# number of heaps.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8


def use_again() -> None:
    """One heap that keeps what is freed, for the whole process; to be called before it starts threads."""
    if sys.platform != "linux":
        return
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):
        large = SYSTEM.large_bytes
        for name, value in ((_MMAP_THRESHOLD, large), (_TRIM_THRESHOLD, large), (_ARENA_MAX, 1)):
            libc.mallopt(name, value)


def give_back() -> None:
    """Gives back to the system what is free within the heap: after work whose arrays lie between others that stay."""
    if sys.platform != "linux":
        return
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):
        libc.malloc_trim(0)
