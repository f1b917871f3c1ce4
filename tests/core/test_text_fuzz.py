"""Damaged texts end in what they say or in one sentence: quickly, and without taking memory."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest
from edf_stitch.core.system.errors import StitchError

from .text_fuzz import case, kinds

CASES = int(os.environ.get("EDF_SOAK_TEXTS", 40_000))
# What reading a file of a few kB may take at most: s, on a busy machine; kB of the process's growth over all cases.
SECONDS, GROWTH_KB = 20.0, 150_000


def tried(folder: Path, numbers: range) -> dict[str, int]:
    """How many of these cases of each kind were read; asserts that the others were refused in a sentence."""
    resource = pytest.importorskip("resource")
    (folder / "whole").mkdir()
    (folder / "damaged").mkdir()
    whole = kinds(folder / "whole")
    read = dict.fromkeys(whole, 0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in numbers:
        name, work = case(whole, number, folder / "damaged")
        began = time.monotonic()
        try:
            work()
            read[name] += 1
        except StitchError as error:
            said = str(error)
            assert error.exit_code in (2, 3, 4) and "\n" not in said, (number, name, said)
            assert 10 < len(said) < 1500 + len(str(folder)), (number, name, said)
        except Exception as error:
            raise AssertionError(f"case {number}, {name}") from error
        assert time.monotonic() - began < SECONDS, (number, name)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < GROWTH_KB * (1024 if sys.platform == "darwin" else 1), grown
    return read


def test_whole_texts_are_read(tmp_path: Path) -> None:
    for name, kind in kinds(tmp_path).items():
        for file, data in kind.files.items():
            (tmp_path / file).write_bytes(data)
        assert kind.read(tmp_path / next(iter(kind.files))) is not None, name


def test_damaged_texts_are_read_or_refused(tmp_path: Path) -> None:
    read = tried(tmp_path, range(800))
    assert len(read) == 19 and 50 < sum(read.values()) < 600, "both ends are tried"


@pytest.mark.slow
@pytest.mark.soak
def test_many_damaged_texts_are_read_or_refused(tmp_path: Path) -> None:
    tried(tmp_path, range(800, 800 + CASES))
