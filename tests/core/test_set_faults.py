"""What befalls sets from outside: files that never end or go, disks that fill up, memory that is not there, processes
that are killed or meet. All that was asked for is there then, or nothing, and one sentence says why."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture

from ..sets import make_set

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="file systems, signals and limits as Linux has them")
# seconds of wall clock until what waits for somebody counts as waiting for ever
PATIENCE = 100


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with 1.png to 3.png. Nothing is to be written there."""
    folder = tmp_path_factory.mktemp("three")
    for picture in make_set(3, size=(240, 180)).pictures:
        (folder / picture.name).write_bytes(encode_picture(picture.pixels, None, 8, ".png")[0])
    return folder


@pytest.fixture
def soon() -> Iterator[None]:
    """Ends a test that waits."""

    def late(*_: object) -> None:
        raise AssertionError("it waits for ever")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("suffix", [".png", ".dng"])
def test_a_pipe_that_nobody_writes_into_is_no_picture(
    three: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], count: int, suffix: str
) -> None:
    os.mkfifo(tmp_path / f"pipe{suffix}")
    pictures = [str(three / f"{number}.png") for number in range(1, count)]
    code = main(["stitch", *pictures, str(tmp_path / f"pipe{suffix}"), "-o", str(tmp_path / "out.png"), "--quiet"])
    said = capfd.readouterr().err
    assert code == 4 and said == f"edf: {tmp_path}/pipe{suffix}: not a regular file; copy the picture into one\n"
    assert {path.name for path in tmp_path.iterdir()} == {f"pipe{suffix}"}


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("option", ["--matches", "--cameras", "--config"])
def test_a_device_without_an_end_is_not_read(
    three: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], option: str
) -> None:
    pictures = [str(three / f"{number}.png") for number in (1, 2, 3)]
    code = main(["stitch", *pictures, option, "/dev/zero", "-o", str(tmp_path / "out.png"), "--quiet"])
    said = capfd.readouterr().err
    assert code == 4 and said.count("\n") == 1 and "/dev/zero is a device, not a file; name a file" in said
    assert not list(tmp_path.iterdir())
