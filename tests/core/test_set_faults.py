"""What befalls sets from outside: files that never end or go, disks that fill up, memory that is not there, processes
that are killed or meet. All that was asked for is there then, or nothing, and one sentence says why."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.outputs import OutputRequest, check, write
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.system import output_files
from edf_stitch.core.system.errors import UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles

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


@pytest.fixture(scope="module")
def of_three(three: Path) -> StitchResult:
    return stitch(sorted(three.iterdir()), StitchOptions(dense=False))


class FullDisk:
    """A file on a disk that is full when so many writes are left, of all files together."""

    left = 0

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        FullDisk.left -= 1
        if FullDisk.left == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return self._file.write(data)

    def __enter__(self) -> FullDisk:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


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
def test_what_may_have_no_end_is_not_read(
    three: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], option: str
) -> None:
    pictures = [str(three / f"{number}.png") for number in (1, 2, 3)]
    code = main(["stitch", *pictures, option, "/dev/zero", "-o", str(tmp_path / "out.png"), "--quiet"])
    said = capfd.readouterr().err
    assert code == 4 and said.count("\n") == 1 and "/dev/zero is a device, not a file; name a file" in said
    assert not list(tmp_path.iterdir())
    os.mkfifo(tmp_path / "pipe")
    code = main(["stitch", *pictures, option, str(tmp_path / "pipe"), "-o", str(tmp_path / "out.png"), "--quiet"])
    said = capfd.readouterr().err
    assert code == 4 and said.count("\n") == 1 and "pipe is a named pipe, not a file; name a file" in said
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_with_no_room_for_the_program_nothing_is_begun(three: Path, tmp_path: Path) -> None:
    """OpenBLAS asked for its buffers for ever."""
    limited = "import resource, sys\nresource.setrlimit(resource.RLIMIT_AS, (300_000_000,) * 2)\n"
    run = "from edf_stitch.core.commands.cli import main\nsys.exit(main(sys.argv[1:]))"
    words = ["stitch", *(str(three / f"{number}.png") for number in (1, 2)), "-o", str(tmp_path / "out.png")]
    done = subprocess.run(
        [sys.executable, "-c", limited + run, *words], capture_output=True, text=True, timeout=PATIENCE
    )  # fmt: skip
    assert done.returncode == 3 and not list(tmp_path.iterdir())
    assert done.stderr.count("\n") == 1 and "may map 300 MB (ulimit -v), and the program alone takes" in done.stderr


@pytest.mark.parametrize(("suffix", "cameras", "step"), [
    (".png", "cameras.json", 80),
    *(pytest.param(*kinds, 1, marks=(pytest.mark.slow, pytest.mark.soak)) for kinds in (
        (".png", "cameras.json"), (".exr", "colmap"), (".tif", "c.pto"), (".jpg", "c.chan"),
        (".hdr", "transforms.json"),
    )),
])  # fmt: skip
def test_a_disk_that_is_full_at_any_write(
    of_three: StitchResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, cameras: str,
    step: int,
) -> None:  # fmt: skip
    """With everything asked for that a set can leave; all are tried by `make soak`."""
    request = OutputRequest(
        tmp_path / f"out{suffix}", tmp_path / "r.json", tmp_path / "layers", tmp_path / "w.npz", tmp_path / cameras,
        tmp_path / "d.exr", tmp_path / "m.glb",
    )  # fmt: skip

    def written() -> None:
        with OutputFiles() as files:
            check(request, files, [picture.name for picture in of_three.pictures])
            write(of_three, request, files)

    monkeypatch.setattr(output_files, "open", lambda *how: FullDisk(open(*how)), raising=False)
    FullDisk.left = 0
    written()
    count, whole = -FullDisk.left, sorted(tmp_path.rglob("*"))
    assert count > 50 and len(whole) > 15
    shutil.rmtree(tmp_path)
    tmp_path.mkdir()
    for number in range(1, count + 1, step):
        FullDisk.left = number
        with pytest.raises(UnwritableOutput, match="No space left on device; free some space or choose another disk"):
            written()
        assert not list(tmp_path.iterdir()), number
