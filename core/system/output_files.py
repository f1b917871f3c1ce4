"""Results appear whole or not at all: everything is written beside its place first, then renamed together."""

from __future__ import annotations

import errno
import os
import platform
import re
import secrets
import shutil
import signal
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import IO, TypeVar

from .errors import BadRequest, UnwritableOutput
from .options import SYSTEM

Made = TypeVar("Made")
# .edf-HOST-PROCESS-RANDOM.tmp: whose it is can be told when its process was killed
_TEMPORARY = re.compile(r"\.edf-([0-9a-f]{8})-(\d+)-[0-9a-f]{12}\.tmp")
_HOST = f"{zlib.crc32(platform.node().encode()):08x}"


class OutputFiles:
    """The files of one piece of work. Leaving the `with` block puts all in place; an exception removes every trace.

    overwrite: whether existing files may be replaced; inputs: files that the work reads, never replaced. All methods
    raise UnwritableOutput with the path and the reason, and BadRequest where an output would replace an input. A file
    that stood there before is replaced in one step and never half written; if putting several in place fails midway,
    the new ones among them are taken away again.
    """

    def __init__(self, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> None:
        self._overwrite = overwrite
        self._inputs = tuple(Path(path) for path in inputs)
        self._staged: dict[Path, Path] = {}  # target: temporary file beside it
        self._made: list[Path] = []  # folders, outermost first

    def __enter__(self) -> OutputFiles:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.commit()
        else:
            self.discard()

    def check(self, *paths: str | Path) -> None:
        """Asks before the work whether these files could be written: folder there and writable, nothing in the way.

        Raises BadRequest where two of the paths are the same file.
        """
        targets = [_real(path) for path in paths]
        for target in targets:
            if targets.count(target) > 1:
                raise BadRequest(f"{target}: named for two outputs; give each its own name")
            there = _existing(target.parent)
            if not there.is_dir():
                raise UnwritableOutput(f"{target}: {there} is a file, not a folder; choose another name")
            if there != target.parent:
                raise UnwritableOutput(f"{target}: no folder {target.parent}; create it or choose another")
            self._check_free(target)
            _probe(target.parent)

    def check_folder(self, folder: str | Path, names: Iterable[str] = ()) -> None:
        """Asks before the work whether these files could be written into a folder, which may be yet to come."""
        root = _real(folder)
        for name in names:
            self._check_free(root / name)
        there = _existing(root)
        if not there.is_dir():
            raise UnwritableOutput(f"{root}: {there} is a file, not a folder; choose another name")
        _probe(there)

    def add(self, path: str | Path, data: bytes) -> None:
        """Stages a file in a folder that exists."""
        self.add_by(path, lambda file: file.write(data))

    def add_by(self, path: str | Path, make: Callable[[IO[bytes]], Made]) -> Made:
        """Stages a file in a folder that exists, which `make` writes into, so that it need not be held as a whole; what
        that returns."""
        target = _real(path)
        if target in self._staged:
            raise BadRequest(f"{target}: named for two outputs; give each its own name")
        self._check_free(target)
        temporary = _temporary_in(target.parent)
        self._staged[target] = temporary
        try:
            with open(temporary, "xb") as file:
                return make(file)
        except OSError as error:
            raise _unwritable(target, error) from error

    def add_to_folder(self, folder: str | Path, name: str, data: bytes) -> None:
        """Stages a file in a folder that is made where it is missing."""
        self.make_folder(folder)
        self.add(_real(folder) / name, data)

    def make_folder(self, folder: str | Path) -> None:
        """Makes a folder where it is missing, with those that it lies in."""
        root = _real(folder)
        missing = [parent for parent in (root, *root.parents) if not _exists(parent)]
        for one in reversed(missing):
            try:
                one.mkdir()
            except FileExistsError:  # somebody else's, in this moment
                continue
            except OSError as error:
                raise _unwritable(one, error) from error
            self._made.append(one)

    def staged(self, path: str | Path) -> Path:
        """The temporary file that is put in this place."""
        return self._staged[_real(path)]

    def commit(self) -> None:
        """Puts all staged files in place, or none."""
        with undisturbed():
            self._commit()

    def _commit(self) -> None:
        new: list[Path] = []
        try:
            for target in self._staged:
                self._check_free(target)
            new = [target for target in self._staged if not target.exists()]
            for target, temporary in self._staged.items():
                try:
                    self._place(temporary, target)
                except OSError as error:
                    raise _unwritable(target, error) from error
        except BaseException:
            for target in new:
                if not self._staged[target].exists() or _same_file(self._staged[target], target):  # ours, in place
                    _quietly(target.unlink)
            self.discard()
            raise
        self._staged.clear()
        self._made.clear()

    def _place(self, temporary: Path, target: Path) -> None:
        """One step, which replaces nothing where nothing may be replaced: another process may have been faster."""
        if self._overwrite:
            os.replace(temporary, target)
            return
        try:
            os.link(temporary, target)  # unlike a rename it fails where something stands
        except FileExistsError:
            self._check_free(target)
            raise
        except OSError:  # a file system without links: look once more, then rename
            self._check_free(target)
            os.replace(temporary, target)
        else:
            _quietly(temporary.unlink)

    def discard(self) -> None:
        """Removes everything staged, and the folders made for it as far as they are empty."""
        with undisturbed():
            for temporary in self._staged.values():
                _quietly(temporary.unlink)
            for folder in reversed(self._made):
                _quietly(folder.rmdir)
            self._staged.clear()
            self._made.clear()

    def _check_free(self, target: Path) -> None:
        if not _exists(target):
            return
        if target.is_dir():
            raise UnwritableOutput(f"{target}: a folder of this name exists; choose another name")
        if not target.is_file():  # /dev/null would be replaced by a file
            raise UnwritableOutput(f"{target}: not a regular file; choose another name")
        if any(_same_file(path, target) for path in self._inputs):
            raise BadRequest(f"{target} is read by this work and would be replaced by it; choose another name")
        if not self._overwrite:
            raise UnwritableOutput(f"{target} exists: use --overwrite or choose another name")


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:  # a name too long, a folder that may not be looked into
        raise _unwritable(path, error) from error


def _same_file(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # one of them is not there
        return False


def _existing(path: Path) -> Path:
    """The path itself or its nearest parent that is there."""
    return next((one for one in (path, *path.parents) if _exists(one)), path)


def _real(path: str | Path) -> Path:
    """Links followed, so that a link is written through and not replaced."""
    return Path(os.path.realpath(path))


def _probe(folder: Path) -> None:
    """Writes and removes a file: asking the permissions is wrong on Windows, for root and on read-only mounts. Removes
    what processes that were killed have left."""
    trial = _temporary_in(folder)
    try:
        trial.touch(exist_ok=False)
        trial.unlink()
        left = [Path(entry) for entry in os.scandir(folder) if _is_left(entry)]
    except OSError as error:
        raise _unwritable(folder, error) from error
    for path in left:
        _quietly(partial(shutil.rmtree, path) if path.is_dir() else path.unlink)


def _temporary_in(folder: Path) -> Path:
    """Hidden, and without the target's name, which may be as long as the file system allows."""
    return folder / f".edf-{_HOST}-{os.getpid()}-{secrets.token_hex(6)}.tmp"


def _is_left(entry: os.DirEntry[str]) -> bool:
    """Whether this is a temporary file or folder of a process that is no more."""
    named = _TEMPORARY.fullmatch(entry.name)
    if named is None:
        return False
    try:
        if named[1] != _HOST or sys.platform == "win32":
            return time.time() - entry.stat(follow_symlinks=False).st_mtime > SYSTEM.stale_seconds
        os.kill(int(named[2]), 0)  # asks only
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # somebody else's process, or gone already
        return False
    return False


@contextmanager
def temporary_folder(folder: Path) -> Iterator[Path]:
    """A folder of one's own in a folder that exists, for files that need its space; gone in the end. One that a killed
    process left goes when somebody asks next whether files could be written beside it."""
    own = _temporary_in(folder)
    try:
        own.mkdir()
        yield own
    finally:
        shutil.rmtree(own, ignore_errors=True)


@contextmanager
def undisturbed() -> Iterator[None]:
    """SIGINT and SIGTERM wait until the end of this context, so that a second Ctrl-C leaves nothing half done."""
    if threading.current_thread() is not threading.main_thread():  # signals never come here
        yield
        return
    came: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    # a handler of None is not Python's and could not be put back: Blender's
    before = {number: handler for number, handler in before.items() if handler is not None}
    try:  # from here on: the first one's handler is put back where the second one comes just now
        for number in before:
            signal.signal(number, lambda number, _frame: came.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for late in came:
            signal.raise_signal(late)


def _quietly(remove: Callable[[], None]) -> None:
    try:
        remove()
    except OSError:
        pass  # gone already, or not ours any more: the first error is the one to tell


def _unwritable(path: Path, error: OSError) -> UnwritableOutput:
    full = error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", None), errno.EFBIG)
    other = "a shorter name" if error.errno == errno.ENAMETOOLONG else "another place"
    advice = "free some space or choose another disk" if full else f"choose {other}"
    return UnwritableOutput(f"{path} cannot be written: {error.strerror or error}; {advice}")
