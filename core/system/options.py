"""Tuning values of the system room, with their units and why they are what they are."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SystemOptions:
    """Threads, memory, cache and temporary files."""

    # Threads at once: more would wait for memory, and each holds a part of it.
    max_threads: int = 8
    # Seconds after which one who waits for a part of work asks again whether to stop: nobody notices so few.
    ask_seconds: float = 0.05
    # Bytes from which the allocator gives an array pages of its own, and that it keeps when they are freed.
    large_bytes: int = 1 << 30
    # Bytes of address space below which nothing is begun: the libraries map 0.4 GB, and OpenBLAS further buffers.
    least_address_bytes: int = 500_000_000
    # Bytes of all cache entries together; the least recently used go first.
    cache_bytes: int = 2 << 30
    # An entry takes at most one part in so many of the former: a larger one would drive out most others.
    cache_entry_part: int = 4
    # Seconds after which a temporary file is a dead process's, where nobody can say whether that lives (another host's,
    # Windows): a day, which no stitch takes.
    stale_seconds: int = 86_400


SYSTEM = SystemOptions()
