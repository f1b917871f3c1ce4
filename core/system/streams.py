"""Standard streams that lose their other end (a terminal that was closed, a pipe nobody reads, a full disk), and what
libraries print on them."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO


class _MayBreak:
    """Passes everything on to a stream; from the first failure on, all is dropped."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """As the stream's own, but never raises."""
        try:
            return self._stream.write(text)
        except (OSError, ValueError):  # ValueError: closed by somebody
            silence(self._stream)
            return len(text)

    def flush(self) -> None:
        """As the stream's own, but never raises."""
        try:
            self._stream.flush()
        except (OSError, ValueError):
            silence(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def messages_may_be_lost() -> Iterator[None]:
    """In this context a missing or broken sys.stderr does no harm: messages are dropped and the work goes on."""
    _fill_closed()
    before = sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        sys.stderr = _MayBreak(before if before is not None else nowhere)
        try:
            yield
        finally:
            sys.stderr = before


def _fill_closed() -> None:
    """Puts something behind standard files that are closed: the next file opened, a panorama, would get their number,
    and whatever a library prints."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def silence(stream: TextIO) -> None:
    """Redirects a broken stream to nowhere, so that flushing its buffer at exit raises nothing."""
    with suppress(OSError, ValueError), open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())
        stream.flush()


_ERRORS = 2  # the file number of standard error, which libraries in C write to
_LISTENING = threading.Lock()


@contextmanager
def overheard(belongs: Callable[[str], bool]) -> Iterator[list[str]]:
    """What libraries print on standard error in this context: filled into the list that is given, when it ends.

    Parameters
    ----------
    belongs : callable
        Whether a line is a library's. All others, of other threads, are passed on when the context ends.

    Notes
    -----
    Where standard error cannot be redirected nothing is heard. One thread listens at a time.
    """
    lines: list[str] = []
    with _LISTENING:
        try:
            shown, kept = os.dup(_ERRORS), tempfile.TemporaryFile()
        except OSError:
            yield lines
            return
        with kept:
            os.dup2(kept.fileno(), _ERRORS)
            try:
                yield lines
            finally:
                os.dup2(shown, _ERRORS)
                os.close(shown)
                kept.seek(0)
                for raw in kept.read().splitlines(keepends=True):
                    line = raw.decode(errors="replace")
                    if belongs(line):
                        lines.append(line.strip())
                    else:
                        with suppress(OSError):
                            os.write(_ERRORS, raw)
