"""Freed memory: the next array takes it, whatever its thread, and nothing happens where glibc is not there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.core.system import memory

FREE_AND_ASK_AGAIN = """
import threading
import numpy as np
from edf_stitch.core.system.memory import use_again
def held():
    return int(next(l.split()[1] for l in open("/proc/self/status") if l.startswith("VmRSS"))) // 1024
use_again()
empty = held()
arrays = [np.ones(4 << 20, np.uint8) for _ in range(50)]  # 200 MB
full = held()
del arrays
kept = held()
def ask_again():
    global again
    arrays = [np.ones(3 << 20, np.uint8) for _ in range(60)]
    again = held()
thread = threading.Thread(target=ask_again)
thread.start()
thread.join()
print(full - empty, kept - empty, again - empty)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists() or sys.platform != "linux", reason="asks Linux")
def test_freed_memory_is_kept_for_the_next_array_of_any_thread() -> None:
    done = subprocess.run([sys.executable, "-c", FREE_AND_ASK_AGAIN], capture_output=True, text=True, check=True)
    full, kept, again = map(int, done.stdout.split())
    assert full > 190
    assert kept > 150, "not given back"
    assert again < full + 20, "used again"


GIVE_BACK = """
import numpy as np
from edf_stitch.core.system.memory import give_back, use_again
def held():
    return int(next(l.split()[1] for l in open("/proc/self/status") if l.startswith("VmRSS"))) // 1024
use_again()
work, stays = [], []
for _ in range(50):
    work.append(np.ones(4 << 20, np.uint8))
    stays.append(np.ones(4 << 10, np.uint8))
work.clear()
free = held()
give_back()
print(free - held(), all((one == 1).all() for one in stays))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists() or sys.platform != "linux", reason="asks Linux")
def test_what_is_free_between_what_stays_can_be_given_back() -> None:
    done = subprocess.run([sys.executable, "-c", GIVE_BACK], capture_output=True, text=True, check=True)
    given, kept = done.stdout.split()
    assert int(given) > 150
    assert kept == "True"


def test_nothing_happens_where_there_is_no_glibc(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_library(_: object) -> None:
        raise AssertionError("asked for a C library")

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(memory.ctypes, "CDLL", no_library)
    memory.use_again()
    memory.give_back()


def test_what_is_free_is_bounded_by_the_address_space() -> None:
    """Of the machine, its control group and `ulimit -v` the least counts."""
    resource = pytest.importorskip("resource")
    if memory.free_bytes() is None:
        pytest.skip("cannot be told here")
    asked = "from edf_stitch.core.system.memory import free_bytes; print(free_bytes())"
    limit = 600_000_000

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, preexec_fn=limited)
    assert 0 < int(done.stdout) < limit


def test_limits_of_control_groups_are_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "memory.max").write_text("5000000\n")
    (tmp_path / "memory.current").write_text("2000000\n")
    monkeypatch.setattr(memory, "Path", lambda first, *more: tmp_path.joinpath(*more) if more else Path(first))
    if sys.platform == "linux":
        assert memory._group_limits()[0] == (5_000_000, 2_000_000) and memory.free_bytes() == 3_000_000
        (tmp_path / "memory.max").write_text("max\n")
        assert memory._group_limits() == []
