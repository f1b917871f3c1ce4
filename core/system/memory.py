"""Memory: how much is free, and settings of glibc's allocator, so that what is freed is used again.

By default glibc unmaps large arrays at once and keeps a heap for each thread; clearing the pages of the next array then
took a fifth of a stitch's time. Other allocators are left alone.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

from .errors import NotEnoughMemory
from .options import SYSTEM

# mallopt's names (malloc.h) for from where on an array has pages of its own, how much may stay free on top, and the
# number of heaps.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8


def check_address_space() -> None:
    """Raises NotEnoughMemory where this process may not even map the program's libraries, to be called before they are
    loaded: OpenBLAS asks for its buffers again and again, without an end, where it gets none."""
    if sys.platform == "win32":
        return
    import resource

    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY and most < SYSTEM.least_address_bytes:
        raise NotEnoughMemory(
            f"this process may map {most / 1e6:.0f} MB (ulimit -v), and the program alone takes "
            f"{SYSTEM.least_address_bytes / 1e6:.0f} MB: raise the limit, and use --memory to bound what a stitch takes"
        )


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


def free_bytes() -> int | None:
    """How many bytes this process may take beside those it has: what the machine has free, within the limits of its
    control group and of its address space; None where that cannot be told."""
    if sys.platform != "linux":
        return None
    import resource

    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        known = [1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    except (OSError, ValueError, IndexError):
        known = []
    known += [most - used for most, used in _group_limits()]
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
        known.append(most - pages * resource.getpagesize())
    return max(0, min(known)) if known else None


def _group_limits() -> list[tuple[int, int]]:
    """Bytes that the process's control group may hold and does hold (versions 2 and 1), where it is limited."""
    found = []
    for folder, most, used in (
        ("/sys/fs/cgroup", "memory.max", "memory.current"),
        ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
    ):
        try:
            found.append((int(Path(folder, most).read_text("ascii")), int(Path(folder, used).read_text("ascii"))))
        except (OSError, ValueError):  # no such version, or "max"
            continue
    return found
