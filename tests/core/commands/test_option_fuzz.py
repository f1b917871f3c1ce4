"""Whatever is asked for, in whatever combination: all files that were asked for, or none and one sentence; and a long
series of stitches leaves nothing behind, neither memory nor handles nor files."""

from __future__ import annotations

import gc
import os
import re
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.output.json_file import json_bytes
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.raster.arrays import Array

from ...sets import make_set
from .random_words import random_words

LINES = int(os.environ.get("EDF_SOAK_LINES", 1000))
# CPU seconds that a stitch of such small pictures may take.
SECONDS = 60.0
# Stitches before memory is measured, and the share that it may grow by after them.
WARM, GROWTH = 40, 0.05

linux = pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with 1.png to 4.png, a mask and their cameras."""
    folder = tmp_path_factory.mktemp("four")
    made = make_set(4, size=(240, 180))
    entries = {}
    for picture, camera in zip(made.pictures, made.cameras, strict=True):
        (folder / picture.name).write_bytes(encode_picture(picture.pixels, None, 8, ".png")[0])
        entries[picture.name] = {"K": camera.K}
    mask: Array = make_set(1, size=(240, 180)).pictures[0].pixels[..., :1] * 0
    mask[40:90, 60:120] = 1
    (folder / "mask.png").write_bytes(encode_picture(mask, None, 8, ".png")[0])
    (folder / "cameras.json").write_bytes(json_bytes({"cameras": entries}))
    return folder


def tried(number: int, folder: Path, out: Path, capfd: pytest.CaptureFixture[str]) -> int:
    """The exit code of a line; asserts what everybody may rely on."""
    words = random_words(number, folder, out)
    began = time.process_time()
    code = main(words)
    said = capfd.readouterr()
    told = f"line {number}: edf {' '.join(words)}: {code}\n{said.err}"
    assert code in (0, 2, 3, 4) and "Traceback" not in said.err and "internal error" not in said.err, told
    assert "Warning" not in said.err and time.process_time() - began < SECONDS, told
    left = {path.name for path in out.iterdir()}
    asked = {Path(word.rpartition("=")[2]).name for word in words if str(out) in word}
    if code == 0:
        assert asked <= left, (told, left)
    else:
        assert not left and said.err.splitlines()[-1].startswith("edf"), (told, left)
    return code


def emptied(folder: Path) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()


@pytest.mark.parametrize("number", range(1, 5))
def test_options_in_any_combination(
    four: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], number: int
) -> None:
    tried(number, four, tmp_path, capfd)


def resident_kb() -> int:
    gc.collect()
    return int(re.findall(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[0])


@linux
@pytest.mark.slow
@pytest.mark.soak
def test_many_lines_in_one_process_leave_nothing(
    four: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "temporary").mkdir()
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    codes, memory = [], []
    for number in range(6, 6 + LINES):
        codes.append(tried(number, four, out, capfd))
        emptied(out)
        if number == WARM:
            files, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
        if number >= WARM:
            memory.append(resident_kb())
            assert len(os.listdir("/proc/self/fd")) <= files and threading.active_count() <= threads, number
        assert not list((tmp_path / "temporary").iterdir()), number
    assert codes.count(0) > LINES / 3 and codes.count(2) > LINES / 20, codes
    # the most that was held, of halves: what a single stitch takes differs
    half = len(memory) // 2
    assert max(memory[half:]) < (1 + GROWTH) * max(memory[:half]), (max(memory[:half]), max(memory[half:]))
