"""Work on independent parts by several threads at once; NumPy, OpenCV and zlib release the interpreter lock.

As many threads as OpenCV uses (`cv2.setNumThreads`). Results do not depend on their number, for parts are cut by size
alone.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import cv2

from .options import SYSTEM

Part = TypeVar("Part")
Result = TypeVar("Result")
_here = threading.local()


def count() -> int:
    """How many threads work at once: one inside the work of another call, or there would be too many."""
    return 1 if getattr(_here, "working", False) else max(1, min(SYSTEM.max_threads, cv2.getNumThreads()))


def in_order(work: Callable[[Part], Result], parts: Iterable[Part]) -> Iterator[Result]:
    """Results of `work` for each part, in the order of the parts, computed by several threads.

    Parameters
    ----------
    work : callable
        Called with one part.
    parts : iterable

    Yields
    ------
    result
        At most `count()` results are begun or waiting, so that memory stays bounded. The first error among the parts
        is raised when it is its turn; then, or if no more results are asked for, no further part is begun.
    """
    at_once = count()
    if at_once == 1:
        yield from map(work, parts)
        return
    begun: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(at_once, "edf", _start) as pool:
        try:
            for part in parts:
                if len(begun) == at_once:
                    yield begun.popleft().result()
                begun.append(pool.submit(work, part))
            while begun:
                yield begun.popleft().result()
        finally:
            for waiting in begun:
                waiting.cancel()


def each(work: Callable[[Part], object], parts: Iterable[Part]) -> None:
    """Does the work on each part, for what it writes."""
    for _ in in_order(work, parts):
        pass


def _start() -> None:
    _here.working = True
