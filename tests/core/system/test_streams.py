"""Streams without anybody at the other end: the work goes on, and what was asked for on stdout is an error if lost."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.core.system.streams import messages_may_be_lost

posix = pytest.mark.skipif(sys.platform == "win32", reason="pipes and closed streams as POSIX has them")


def test_messages_pass_through_and_the_stream_is_put_back(capsys: pytest.CaptureFixture[str]) -> None:
    before = sys.stderr
    with messages_may_be_lost():
        print("heard", file=sys.stderr, flush=True)
        assert sys.stderr.isatty() == before.isatty()
    assert sys.stderr is before and capsys.readouterr().err == "heard\n"


class Broken(io.StringIO):
    def write(self, _text: str = "") -> int:
        raise BrokenPipeError(32, "Broken pipe")

    flush = write  # type: ignore[assignment]


@pytest.mark.parametrize("stream", [None, Broken()])
def test_without_a_listener_nothing_happens(stream: io.StringIO | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    with messages_may_be_lost():
        print("unheard", file=sys.stderr, flush=True)
        assert sys.stderr.isatty() is False
    assert sys.stderr is stream


def edf(arguments: str, redirect: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """`edf ARGUMENTS` under a shell's redirections."""
    line = f"'{sys.executable}' -m edf_stitch {arguments} {redirect}"
    return subprocess.run(
        ["/bin/sh", "-c", line], cwd=folder, capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip


@posix
@pytest.mark.usefixtures("with_cache")
@pytest.mark.parametrize("redirect", ["<&-", "2>&-", "<&- >&- 2>&-", "2>/dev/full"])
def test_a_stitch_needs_nobody_to_listen(folder: Path, tmp_path: Path, redirect: str) -> None:
    pair = f"'{folder / 'reference.png'}' '{folder / 'target.png'}'"
    done = edf(f"stitch {pair} --focal-px 228 -o out.png --verbose", redirect, tmp_path)
    assert done.returncode == 0 and done.stdout == "" and "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]


@posix
@pytest.mark.usefixtures("with_cache")
def test_a_stitch_outlives_who_reads_its_messages(folder: Path, tmp_path: Path) -> None:
    pair = f"'{folder / 'reference.png'}' '{folder / 'target.png'}'"
    edf(f"stitch {pair} --focal-px 228 -o out.png", "2>&1 | head -n 1", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]


@posix
def test_what_was_asked_for_and_is_lost_is_an_error(tmp_path: Path) -> None:
    done = edf("--version", "> /dev/full", tmp_path)
    assert done.returncode == 4 and done.stderr == (
        "edf: cannot be read or written: the output: No space left on device\n"
    )
    done = edf("--version", "| true; exit 7", tmp_path)
    assert done.returncode == 7 and "Traceback" not in done.stderr and "Exception" not in done.stderr


@posix
def test_no_file_gets_the_number_of_a_closed_stream(tmp_path: Path) -> None:
    """OpenEXR prints to stream 2 by itself: the panorama must not be what stands there."""
    code = (
        "import os; from edf_stitch.core.system.streams import messages_may_be_lost\n"
        "with messages_may_be_lost(): assert os.open('file', os.O_CREAT) > 2"
    )
    line = f"'{sys.executable}' -c \"{code}\" <&- >&- 2>&-"
    assert subprocess.run(["/bin/sh", "-c", line], cwd=tmp_path, timeout=60).returncode == 0
