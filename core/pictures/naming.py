"""Which of several pictures a name means."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..system.errors import BadRequest


def number_of(name: str, names: Sequence[str], asked_by: str) -> int:
    """The number of the picture that has a name, with or without its suffix.

    Parameters
    ----------
    name : str
    names : sequence of str
        Of all pictures.
    asked_by : str
        What names the picture, for messages.

    Returns
    -------
    int

    Raises
    ------
    BadRequest
        No picture has that name, or several.
    """
    found = [number for number, one in enumerate(names) if one == name]
    found = found or [number for number, one in enumerate(names) if Path(one).stem == name]
    if len(found) == 1:
        return found[0]
    if found:
        raise BadRequest(f"{asked_by}: {len(found)} pictures are called {name!r}; rename all but one")
    listed = ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
    raise BadRequest(f"{asked_by}: no picture is called {name!r}; there are: {listed}")
