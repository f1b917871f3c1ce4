"""What befalls a stitch from outside: disks, folders, names, other processes, signals. Whole files or none at all."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.system.errors import UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles, undisturbed

from ...pairs import KNOWN_WORDS

INTERRUPTIONS = int(os.environ.get("EDF_SOAK_INTERRUPTIONS", 50))

linux = pytest.mark.skipif(sys.platform != "linux", reason="file systems and signals as Linux has them")


def start(pair: Path, *arguments: str | Path, cwd: Path, **environment: str | None) -> subprocess.Popen[str]:
    """`edf stitch` of a folder's pair, begun."""
    env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment}
    pictures = [pair / "reference.png", pair / "target.png"]
    line = [sys.executable, "-m", "edf_stitch", "stitch", *pictures, *arguments, *KNOWN_WORDS]
    return subprocess.Popen(
        list(map(str, line)), cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={name: value for name, value in env.items() if value is not None},
    )  # fmt: skip


def end(job: subprocess.Popen[str]) -> tuple[int, str]:
    """Its exit code and its last line."""
    out, err = job.communicate(timeout=120)
    assert out == "" and "Traceback" not in err and "internal error" not in err, err
    return job.returncode, (err.splitlines() or [""])[-1]


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


# --- disks and folders ----------------------------------------------------------------------------------------------


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 200 kB of its own."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = [shutil.which("mount") or "false", "-t", "tmpfs", "-o", "size=200k", "none", place]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=True)


@linux
@pytest.mark.usefixtures("with_cache")
def test_a_disk_that_fills_up(folder: Path, tmp_path: Path, disk: Path) -> None:
    wanted = ["-o", disk / "out.png", "--layers", disk / "layers", "--warp", disk / "warp.npz"]
    code, last = end(start(folder, *wanted, cwd=tmp_path))
    assert code == 4 and "No space left on device; free some space or choose another disk" in last
    assert names(disk) == set()


@linux
@pytest.mark.usefixtures("with_cache")
def test_a_disk_that_may_only_be_read(folder: Path, tmp_path: Path, disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    code, last = end(start(folder, "-o", disk / "out.png", cwd=tmp_path))
    assert code == 4 and last == f"edf: {disk} cannot be written: Read-only file system; choose another place"


@pytest.mark.usefixtures("with_cache")
def test_names_in_any_script_long_relative_and_through_links(folder: Path, tmp_path: Path) -> None:
    deep = tmp_path / "\u5199\u771f \U0001f4f7 \u00fc e\u0301" / ("x" * 200) / ("y" * 200)
    deep.mkdir(parents=True)
    for name in ("reference.png", "target.png"):
        (deep / name).symlink_to(folder / name)
    (deep / "link.png").symlink_to(tmp_path / "behind the link.png")
    for out in (Path("..") / "\u00f6.jpg", Path("link.png")):
        assert end(start(Path("."), "-o", out, "--quiet", cwd=deep)) == (0, "")
    assert (deep.parent / "\u00f6.jpg").stat().st_size > 1000 and (deep / "link.png").is_symlink()
    assert load_picture(tmp_path / "behind the link.png").view.shape[1] > 240


@linux
def test_a_path_longer_than_any_may_be(folder: Path, tmp_path: Path) -> None:
    code, last = end(start(folder, "-o", Path("/".join(["z" * 100] * 60)) / "o.png", cwd=tmp_path))
    assert code == 4 and "File name too long; choose a shorter name" in last


@linux
def test_a_pipe_is_no_place_for_a_picture(folder: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    code, last = end(start(folder, "-o", tmp_path / "pipe.png", "--overwrite", cwd=tmp_path))
    assert code == 4 and "not a regular file; choose another name" in last


def test_nobodys_home(folder: Path, tmp_path: Path) -> None:
    nothing = dict.fromkeys(("HOME", "USERPROFILE", "XDG_CACHE_HOME", "LOCALAPPDATA", "TMPDIR", "USER", "LOGNAME"))
    assert end(start(folder, "-o", "out.png", "--quiet", cwd=tmp_path, **nothing)) == (0, "")
    assert names(tmp_path) == {"out.png"}


# --- other processes ------------------------------------------------------------------------------------------------


def test_of_two_at_once_the_later_one_replaces_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link = os.link

    def just_too_late(source: Path, target: Path) -> None:
        if target.name == "b.png":
            target.write_bytes(b"another's")
        link(source, target)

    monkeypatch.setattr(os, "link", just_too_late)
    with pytest.raises(UnwritableOutput, match="b.png exists: use --overwrite"), OutputFiles() as files:
        files.add(tmp_path / "a.png", b"ours")
        files.add(tmp_path / "b.png", b"ours")
    assert names(tmp_path) == {"b.png"} and (tmp_path / "b.png").read_bytes() == b"another's"


def test_where_there_are_no_links_files_are_renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_links(*_: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    with OutputFiles() as files:
        files.add(tmp_path / "a.png", b"ours")
    assert names(tmp_path) == {"a.png"}


@pytest.mark.usefixtures("with_cache")
def test_two_processes_on_one_output(folder: Path, tmp_path: Path) -> None:
    jobs = [start(folder, "-o", tmp_path / "out.png", "--quiet", cwd=tmp_path) for _ in range(2)]
    ends = sorted(end(job) for job in jobs)
    assert ends[0] == (0, "") and ends[1][0] == 4 and "exists: use --overwrite" in ends[1][1]
    assert names(tmp_path) == {"out.png"} and load_picture(tmp_path / "out.png").view.shape[1] > 240


KILLED = """
import os, signal, sys
from edf_stitch.core.system.output_files import OutputFiles
with OutputFiles() as files:
    files.add(sys.argv[1], b"whole")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@linux
def test_what_a_killed_process_left_goes_with_the_next_one(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED, tmp_path / "a.png"], timeout=60)
    (left,) = names(tmp_path)
    assert left.startswith(".edf-") and left.endswith(".tmp")
    ours = left.replace(f"-{left.split('-')[2]}-", f"-{os.getpid()}-")
    others = [ours, ".edf-00000000-1-0123456789ab.tmp", ".edf-x.tmp"]
    for name in others:  # of one that lives, another host's, and somebody else's
        (tmp_path / name).touch()
    with OutputFiles() as files:
        files.check(tmp_path / "a.png")
        files.add(tmp_path / "a.png", b"new")
    assert names(tmp_path) == {"a.png", *others}
    os.utime(tmp_path / others[1], (0, 0))
    OutputFiles().check(tmp_path / "b.png")
    assert names(tmp_path) == {"a.png", others[0], others[2]}


# --- signals --------------------------------------------------------------------------------------------------------


def test_signals_wait_while_files_are_put_in_place() -> None:
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append("handled"))
    try:
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            assert came == []
        assert came == ["handled", "handled"]
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_second_interruption_leaves_nothing_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unlink = Path.unlink

    def impatient(path: Path, **options: bool) -> None:
        if path.suffix == ".tmp":
            signal.raise_signal(signal.SIGINT)
        unlink(path, **options)

    with pytest.raises(KeyboardInterrupt), OutputFiles() as files:  # noqa: PT012
        files.add_to_folder(tmp_path / "new", "a.png", b"a")
        files.add_to_folder(tmp_path / "new", "b.png", b"b")
        monkeypatch.setattr(Path, "unlink", impatient)
        raise KeyboardInterrupt
    assert names(tmp_path) == set()


def interrupted(pair: Path, place: Path, seeds: range) -> list[int]:
    """The exit codes of as many stitches, each interrupted at random; asserts that all is there then, or nothing."""
    wanted = ["-o", "out.png", "--report", "r.json", "--layers", "new", "--warp", "w.npz"]
    place.mkdir()
    began = time.perf_counter()
    assert end(start(pair, *wanted, cwd=place))[0] == 0
    whole, everything = time.perf_counter() - began, names(place)
    assert len(everything) >= 8
    codes = []
    for seed in seeds:
        shutil.rmtree(place)
        place.mkdir()
        chance = random.Random(seed)
        began, job = time.perf_counter(), start(pair, *wanted, cwd=place)
        for moment in sorted(chance.uniform(0, whole) for _ in range(chance.choice((1, 1, 2, 3)))):
            try:
                job.wait(max(0.0, began + moment - time.perf_counter()))
            except subprocess.TimeoutExpired:
                job.send_signal(chance.choice((signal.SIGINT, signal.SIGTERM)))
        _, err = job.communicate(timeout=120)
        codes.append(job.returncode)
        left = names(place)
        assert left in (everything, set()), (seed, job.returncode, left, err)
        assert "internal error" not in err, (seed, err)
        if "edf: " in err:  # else it came before the first line of ours, and Python has its own words
            # or by the signal itself: it came after the last one
            ends = (0 if left else 130, -signal.SIGINT, -signal.SIGTERM)
            assert job.returncode in ends and "Traceback" not in err, (seed, job.returncode, left, err)
    return codes


@linux
@pytest.mark.slow
def test_interrupted_at_random_a_few_times(folder: Path, tmp_path: Path) -> None:
    codes = interrupted(folder, tmp_path / "out", range(6))
    assert any(codes)


@linux
@pytest.mark.slow
@pytest.mark.soak
def test_interrupted_at_random_many_times(folder: Path, tmp_path: Path) -> None:
    codes = interrupted(folder, tmp_path / "out", range(100, 100 + INTERRUPTIONS))
    assert codes.count(130) > INTERRUPTIONS / 2
