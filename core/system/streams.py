"""Standard streams that lose their other end: a terminal that was closed, a pipe nobody reads, a full disk."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO


class _Unheard:
    """Passes everything on to a stream; what cannot be written is dropped, and all that follows."""

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
    """While it lasts, sys.stderr may be missing or broken: nobody's work is lost for want of a listener."""
    _fill_closed()
    before = sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        sys.stderr = _Unheard(before if before is not None else nowhere)
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
    """Leads a broken stream nowhere, so that what is left in its buffer troubles nobody at the end of the process."""
    with suppress(OSError, ValueError), open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())
        stream.flush()
