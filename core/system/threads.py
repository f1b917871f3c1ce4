"""Work on independent parts by several threads at once; NumPy, OpenCV and zlib release the interpreter lock.

As many threads as OpenCV uses (`cv2.setNumThreads`). Results do not depend on their number, for parts are cut by size
alone.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

import cv2

from .errors import Cancelled
from .options import SYSTEM
from .progress import Tick, unwatched

Part = TypeVar("Part")
Result = TypeVar("Result")
_here = threading.local()
_asking: ContextVar[Tick] = ContextVar("asking", default=unwatched)
_most: ContextVar[int] = ContextVar("most", default=SYSTEM.max_threads)


def ask() -> None:
    """Ask whether to stop, between steps that take long; see `asking`."""
    _asking.get()()


@contextmanager
def asking(cancelled: Callable[[], bool] | None) -> Iterator[None]:
    """Within this, `ask` and whoever waits for parts of work raise Cancelled where asked to stop; parts that are begun
    are not waited for: these end by themselves, and what they make is not wanted."""

    def stop_if_asked() -> None:
        if cancelled is not None and cancelled():
            raise Cancelled()

    before = _asking.set(stop_if_asked)
    try:
        yield
    finally:
        _asking.reset(before)


@contextmanager
def at_most(threads: int) -> Iterator[None]:
    """Within this, no more than so many threads work at once, each of which holds a part of its own."""
    before = _most.set(min(_most.get(), threads))
    try:
        yield
    finally:
        _most.reset(before)


def count() -> int:
    """How many threads work at once: one inside the work of another call, or there would be too many."""
    return 1 if getattr(_here, "working", False) else max(1, min(_most.get(), cv2.getNumThreads()))


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
        is raised when it is its turn; then, or if no more results are asked for, no further part is begun. Cancelled is
        raised as soon as it is asked for (see `asking`).
    """
    at_once = count()
    if at_once == 1:
        for part in parts:
            ask()
            yield work(part)
        return
    begun: deque[Future[Result]] = deque()
    pool, is_wanted = ThreadPoolExecutor(at_once, "edf", _start), True
    try:
        for part in parts:
            if len(begun) == at_once:
                yield _waited_for(begun.popleft())
            begun.append(pool.submit(work, part))
        while begun:
            yield _waited_for(begun.popleft())
    except (Cancelled, KeyboardInterrupt):
        is_wanted = False
        raise
    finally:
        pool.shutdown(wait=is_wanted, cancel_futures=True)


def _waited_for(begun: Future[Result]) -> Result:
    """What a part gives, asking meanwhile whether to go on."""
    ask()
    while not wait([begun], SYSTEM.ask_seconds).done:
        ask()
    return begun.result()


def beside(work: Callable[[], Result]) -> Result:
    """What one long call gives that leaves the interpreter lock to others; Cancelled is raised as soon as it is asked
    for (see `asking`), and the call then ends by itself."""
    if getattr(_here, "working", False):  # whoever waits for this thread asks
        return work()
    pool = ThreadPoolExecutor(1, "edf", _start)
    try:
        return _waited_for(pool.submit(work))
    finally:
        pool.shutdown(wait=False)


def each(work: Callable[[Part], object], parts: Iterable[Part]) -> None:
    """Does the work on each part, for what it writes."""
    for _ in in_order(work, parts):
        pass


def _start() -> None:
    _here.working = True
