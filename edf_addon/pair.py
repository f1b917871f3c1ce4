"""The pictures that are chosen in the panel, and the list of matches, which belongs to two of them alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from . import earlier, status

# The settings whose pictures are being chosen one after the other.
_choosing: list[Any] = []


@contextmanager
def choosing(settings: Any) -> Iterator[None]:
    """Pictures are chosen at once, however many steps that takes; in the end the list of matches goes if nobody
    has said that it is theirs."""
    _choosing.append(settings)
    try:
        yield
    finally:
        _choosing.pop()
        chosen(settings, None)


def chosen(settings: Any, _context: Any) -> None:
    """A picture was chosen: the list of matches goes if it belongs to others, with a word."""
    earlier.mark(settings)
    if _choosing or (settings.reference, settings.target) == (settings.matches_reference, settings.matches_target):
        return
    if count := len(settings.matches):
        status.say(f"The list's {count} matches are gone: they belonged to other pictures than are chosen now.")
    settings.matches.clear()
    settings.match_index = -1
    settings.edited_matches = False
    owns_matches(settings)


def owns_matches(settings: Any) -> None:
    """The list of matches is that of the pictures that are chosen now."""
    settings.matches_reference, settings.matches_target = settings.reference, settings.target
