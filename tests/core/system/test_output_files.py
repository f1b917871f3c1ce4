"""Outputs appear whole or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from edf_stitch.core.system.errors import BadRequest, UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles, temporary_folder


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_files_appear_together_at_the_end(tmp_path: Path) -> None:
    with OutputFiles() as files:
        files.add(tmp_path / "a.png", b"one")
        files.add_to_folder(tmp_path / "layers" / "deep", "b.png", b"two")
        assert not (tmp_path / "a.png").exists() and not (tmp_path / "layers" / "deep" / "b.png").exists()
    assert everything(tmp_path) == {"a.png", "layers", "layers/deep", "layers/deep/b.png"}
    assert (tmp_path / "a.png").read_bytes() == b"one"


@pytest.mark.parametrize("trouble", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_nothing_is_left_behind_after(trouble: type[BaseException], tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(trouble), OutputFiles() as files:
        files.add(tmp_path / "a.png", b"one")
        files.add_to_folder(tmp_path / "new" / "deep", "b.png", b"two")
        files.add_to_folder(tmp_path / "there", "c.png", b"three")
        raise trouble
    assert everything(tmp_path) == {"there"}


def test_a_folder_someone_else_used_meanwhile_stays(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), OutputFiles() as files:
        files.add_to_folder(tmp_path / "new", "b.png", b"two")
        (tmp_path / "new" / "theirs.txt").write_text("x")
        raise RuntimeError
    assert everything(tmp_path) == {"new", "new/theirs.txt"}


def test_existing_files_are_refused_before_the_work_and_again_at_its_end(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    target.write_bytes(b"old")
    with pytest.raises(UnwritableOutput, match=r"a\.png exists: use --overwrite or choose another name"):
        OutputFiles().check(target)
    with pytest.raises(UnwritableOutput, match="exists"):
        OutputFiles().check_folder(tmp_path, ["a.png"])
    target.unlink()
    with pytest.raises(UnwritableOutput, match="exists"), OutputFiles() as files:
        files.check(target)
        files.add(target, b"new")
        files.add(tmp_path / "b.png", b"new")
        target.write_bytes(b"somebody else's")
    assert target.read_bytes() == b"somebody else's"
    assert everything(tmp_path) == {"a.png"}


def test_overwrite_replaces(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    target.write_bytes(b"old")
    with OutputFiles(overwrite=True) as files:
        files.check(target)
        files.add(target, b"new")
        assert target.read_bytes() == b"old"
    assert target.read_bytes() == b"new"
    assert everything(tmp_path) == {"a.png"}


def test_a_missing_folder_is_an_error_for_files_and_made_for_folders(tmp_path: Path) -> None:
    with pytest.raises(UnwritableOutput, match="no folder .*missing; create it"):
        OutputFiles().check(tmp_path / "missing" / "a.png")
    OutputFiles().check_folder(tmp_path / "missing" / "deep", ["a.png"])
    assert everything(tmp_path) == set(), "asking leaves nothing behind"
    with pytest.raises(UnwritableOutput, match="cannot be written"), OutputFiles() as files:
        files.add(tmp_path / "missing" / "a.png", b"one")
    assert everything(tmp_path) == set()


def test_what_is_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(UnwritableOutput, match="folder of this name"):
        OutputFiles(overwrite=True).check(tmp_path / "folder")
    with pytest.raises(UnwritableOutput, match="is a file, not a folder"):
        OutputFiles(overwrite=True).check_folder(tmp_path / "file" / "deep")
    with pytest.raises(UnwritableOutput, match="cannot be written"), OutputFiles() as files:
        files.add_to_folder(tmp_path / "file", "a.png", b"")
    if os.path.exists("/dev/null"):
        with pytest.raises(UnwritableOutput, match="not a regular file"):
            OutputFiles(overwrite=True).check("/dev/null")


def test_two_outputs_of_one_name_are_a_bad_call(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="two outputs"):
        OutputFiles(overwrite=True).check(tmp_path / "a.png", tmp_path / "x" / ".." / "a.png")
    with pytest.raises(BadRequest, match="two outputs"), OutputFiles() as files:
        files.add(tmp_path / "a.png", b"1")
        files.add(tmp_path / "a.png", b"2")
    assert everything(tmp_path) == set()


def test_links_are_written_through(tmp_path: Path) -> None:
    (tmp_path / "real.png").write_bytes(b"old")
    try:
        (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    except OSError:
        pytest.skip("no symbolic links here")
    with OutputFiles(overwrite=True) as files:
        files.add(tmp_path / "link.png", b"new")
    assert (tmp_path / "link.png").is_symlink() and (tmp_path / "real.png").read_bytes() == b"new"


def test_failing_midway_takes_the_new_files_away_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails_at_b(step: Callable[[Path, Path], None]) -> Callable[[Path, Path], None]:
        def run(source: Path, target: Path) -> None:
            if Path(target).name == "b.png":
                raise OSError(errno.EACCES, "Permission denied")
            step(source, target)

        return run

    for name in ("link", "replace"):
        monkeypatch.setattr(os, name, fails_at_b(getattr(os, name)))
    with pytest.raises(UnwritableOutput, match=r"b\.png cannot be written: Permission denied"), OutputFiles() as files:
        files.add(tmp_path / "a.png", b"1")
        files.add_to_folder(tmp_path / "new", "b.png", b"2")
    assert everything(tmp_path) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_full_disk(tmp_path: Path) -> None:
    # A limit on file sizes stands for the full disk; it holds for a whole process, so it gets its own.
    program = f"""
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from edf_stitch.core.system.output_files import OutputFiles, temporary_folder
from edf_stitch.core.system.errors import UnwritableOutput
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    with OutputFiles() as files:
        files.add({str(tmp_path / "small")!r}, b"x")
        files.add({str(tmp_path / "large")!r}, b"x" * 5000)
except UnwritableOutput as error:
    print(error)
"""
    paths = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True,
                          env={**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"})
    assert "large cannot be written" in done.stdout and "free some space" in done.stdout
    assert everything(tmp_path) == set()


@pytest.mark.skipif(sys.platform == "win32" or not hasattr(os, "geteuid") or os.geteuid() == 0,
                    reason="root may write everywhere")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(UnwritableOutput, match="Permission denied"):
        OutputFiles().check(tmp_path / "locked" / "a.png")


def test_a_folder_that_cannot_be_written_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(*_args: object, **_kwargs: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "touch", read_only)
    with pytest.raises(UnwritableOutput, match="Read-only file system"):
        OutputFiles().check(tmp_path / "a.png")
    with pytest.raises(UnwritableOutput, match="Read-only file system"):
        OutputFiles().check_folder(tmp_path / "new")


def test_names_as_long_as_the_file_system_allows(tmp_path: Path) -> None:
    with OutputFiles() as files:
        files.add(tmp_path / ("ü" * 120 + ".png"), b"x")
    assert len(everything(tmp_path)) == 1


def test_a_temporary_folder_goes_in_any_case_and_that_of_a_killed_process_later(tmp_path: Path) -> None:
    with pytest.raises(KeyError), temporary_folder(tmp_path) as own, temporary_folder(tmp_path) as other:
        assert own.is_dir() and other.is_dir() and own != other
        (own / "frame.png").touch()
        with OutputFiles() as files:
            files.check_folder(tmp_path)
        assert (own / "frame.png").exists(), "its process lives"
        raise KeyError
    assert not list(tmp_path.iterdir())
    left = own.with_name(own.name.replace(f"-{os.getpid()}-", f"-{2**22 + 1}-"))  # above the highest process id
    left.mkdir()
    (left / "frame.png").touch()
    with OutputFiles() as files:
        files.check_folder(tmp_path)
    assert not list(tmp_path.iterdir())
