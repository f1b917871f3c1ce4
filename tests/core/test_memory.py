"""Freed memory: none of it stays once it is given back, and nothing happens where glibc is not there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.core import memory

HOLD_AND_FREE = """
import numpy as np
from edf_stitch.core.memory import give_back, use_again
def held():
    return int(next(l.split()[1] for l in open("/proc/self/status") if l.startswith("VmRSS"))) // 1024
use_again()
empty = held()
arrays = [np.ones(4 << 20, np.uint8) for _ in range(50)]  # 200 MB
last = np.ones(1000, np.uint8)
full = held()
del arrays
kept = held()
give_back()
print(full - empty, kept - empty, held() - empty)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists() or sys.platform != "linux", reason="asks Linux")
def test_freed_memory_is_kept_for_the_next_array_and_given_back_when_that_is_asked_for() -> None:
    done = subprocess.run([sys.executable, "-c", HOLD_AND_FREE], capture_output=True, text=True, check=True)
    full, kept, back = map(int, done.stdout.split())
    assert full > 190
    assert kept > 150, "used again"
    assert back < 20, "given back"


def test_nothing_happens_where_there_is_no_glibc(monkeypatch: pytest.MonkeyPatch) -> None:
    memory._of_glibc.cache_clear()
    monkeypatch.setattr(sys, "platform", "darwin")
    try:
        assert memory._of_glibc("malloc_trim") is memory._nothing
        memory.use_again()
        memory.give_back()
    finally:
        memory._of_glibc.cache_clear()
