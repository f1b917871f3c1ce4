"""What is freed is used again within a stage, and goes back to the system before the next one asks for other sizes.

glibc gives large arrays back at once, and the system has to wipe the pages of the next one: a tenth of a stitch's time.
What it does keep, between other blocks and for each thread, it keeps for ever: after dense refinement of 24 MP half a
gigabyte that nobody uses. Nothing of this is done where the allocator is another one.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import lru_cache

# mallopt's names (malloc.h) for from where on an array has pages of its own, and for how much may stay free on top.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_LARGE = 1 << 30


def use_again() -> None:
    """For the whole process, which has to be ours: freed memory is kept for the next array until `give_back`."""
    for name in (_MMAP_THRESHOLD, _TRIM_THRESHOLD):
        _of_glibc("mallopt")(name, _LARGE)


def give_back() -> None:
    """Returns freed memory to the system, in about a millisecond."""
    _of_glibc("malloc_trim")(0)


@lru_cache(maxsize=2)
def _of_glibc(name: str) -> Callable[..., object]:
    """A function of glibc; one that does nothing where there is none."""
    there = sys.platform == "linux" and hasattr(ctypes.CDLL(None), name)
    return getattr(ctypes.CDLL(None), name) if there else _nothing


def _nothing(*_: int) -> None:
    pass
