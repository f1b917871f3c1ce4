"""Threads: the parts' order, no more of them at once than there are threads, and errors that come through."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from edf_stitch.core.system import threads
from edf_stitch.core.system.errors import Cancelled
from edf_stitch.core.system.threads import asking, at_most, beside, count, each, in_order


@pytest.fixture(autouse=True, params=[1, 3])
def at_once(request: pytest.FixtureRequest) -> Iterator[int]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(request.param)
    yield request.param
    cv2.setNumThreads(before)


def test_results_come_in_the_parts_order_however_long_each_takes(at_once: int) -> None:
    def slow(part: int) -> int:
        time.sleep(0.01 * (part % 3 == 0))
        return part * part

    assert count() == at_once
    assert list(in_order(slow, range(12))) == [part * part for part in range(12)]
    assert list(in_order(slow, [])) == []


def test_no_more_is_begun_than_there_are_threads(at_once: int) -> None:
    begun: list[int] = []
    results = in_order(lambda part: begun.append(part), range(20))
    assert begun == []
    for taken, _ in enumerate(results, 1):
        # what is taken makes room for one more, once the next is asked for
        assert len(begun) <= taken + at_once
    assert sorted(begun) == list(range(20))


def test_the_first_error_in_the_parts_order_comes_through_and_nothing_is_begun_after_it() -> None:
    begun = []

    def work(part: int) -> None:
        begun.append(part)
        if part >= 2:
            raise ValueError(str(part))

    with pytest.raises(ValueError, match="2"):
        each(work, range(50))
    assert max(begun) <= 2 + threads.SYSTEM.max_threads


def test_work_within_work_is_done_by_the_thread_it_is_in(at_once: int) -> None:
    def outer(part: int) -> tuple[int, set[str]]:
        within = set(in_order(lambda _: threading.current_thread().name, range(4)))
        return part, within

    for part, (number, names) in enumerate(in_order(outer, range(6))):
        assert number == part and len(names) == 1
    assert count() == at_once


def test_threads_are_gone_when_nobody_asks_for_more() -> None:
    before = threading.active_count()
    results = in_order(lambda part: part, range(50))
    assert next(results) == 0
    results.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_who_waits_for_a_long_part_stops_when_asked_to(at_once: int) -> None:
    """Without waiting for what is begun; a single thread asks between parts."""
    begun: list[int] = []
    since = time.monotonic()

    def slow(part: int) -> None:
        begun.append(part)
        time.sleep(0.6)

    with pytest.raises(Cancelled), asking(lambda: time.monotonic() > since + 0.1):
        each(slow, range(9))
    assert len(begun) <= at_once
    assert time.monotonic() < since + (0.4 if at_once > 1 else 0.9)
    assert list(in_order(lambda part: part, range(3))) == [0, 1, 2], "only within"


def test_who_waits_for_one_long_call_stops_when_asked_to() -> None:
    since = time.monotonic()
    with pytest.raises(Cancelled), asking(lambda: time.monotonic() > since + 0.1):
        beside(lambda: time.sleep(0.6))
    assert time.monotonic() < since + 0.4
    with pytest.raises(ZeroDivisionError):
        beside(lambda: 1 // 0)
    before = threading.active_count()
    assert list(in_order(lambda part: beside(lambda: (part, count())), range(3))) == [(0, 1), (1, 1), (2, 1)]
    while threading.active_count() > before and time.monotonic() < since + 10:  # one may still be ending
        time.sleep(0.01)
    assert threading.active_count() <= before


def test_what_is_written_by_parts_is_whole() -> None:
    out = np.zeros(1000, int)

    def put(start: int) -> None:
        out[start : start + 100] = np.arange(start, start + 100)

    each(put, range(0, 1000, 100))
    assert (out == np.arange(1000)).all()


def test_no_more_threads_work_than_may() -> None:
    with at_most(1):
        assert count() == 1
        with at_most(5):
            assert count() == 1, "the least counts"
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(3)
        with at_most(2):
            assert count() == 2
        assert count() == 3
    finally:
        cv2.setNumThreads(before)
