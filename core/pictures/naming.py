"""Which of several pictures a name means."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..system.errors import BadRequest

# What the flat views of a sphere are called: six around, each to the right of the one before, and two at the poles.
VIEWS = ("front", "front right", "back right", "back", "back left", "front left", "up", "down")


def view_name(sphere: str, view: str) -> str:
    """What a view of the picture of this name is called."""
    path = Path(sphere)
    return path.with_name(f"{path.stem} ({view}){path.suffix}").as_posix()


def number_of(name: str, names: Sequence[str], asked_by: str) -> int:
    """The number of the picture that has a name.

    Parameters
    ----------
    name : str
        A picture's name, or the end of its path from any folder on, with or without the suffix. Upper and lower case
        are one where no picture has it as it is written.
    names : sequence of str
        Of all pictures, or their paths.
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
    if names.count(name) == 1:  # files of matches ask for each of their lines
        return names.index(name)
    for asked, known in ((name, names), (name.casefold(), [one.casefold() for one in names])):
        paths = [Path(one) for one in known]
        for candidates in (paths, [path.with_suffix("") for path in paths]):
            found = [number for number, path in enumerate(candidates) if _ends_in(path, Path(asked))]
            if len(found) > 1:
                meant = ", ".join(told_apart(names)[number] for number in found[:8])
                raise BadRequest(f"{asked_by}: {len(found)} pictures are called {name!r} ({meant}); say which")
            if found:
                return found[0]
    listed = ", ".join(told_apart(names)[:8]) + (", …" if len(names) > 8 else "")
    raise BadRequest(f"{asked_by}: no picture is called {name[:80]!r}; there are: {listed}")


def told_apart(names: Sequence[str]) -> list[str]:
    """The last part of each of these paths, and as many folders before it as tell it from all other paths."""
    paths = [Path(one) for one in names]
    different = set(paths)

    def apart(path: Path) -> str:
        ends = [Path(*path.parts[-count:]) for count in range(1, len(path.parts) + 1)]
        alone = (end for end in ends if sum(_ends_in(other, end) for other in different) == 1)
        return str(next(alone, path))

    return [apart(path) for path in paths]


def _ends_in(path: Path, end: Path) -> bool:
    return bool(end.parts) and path.parts[-len(end.parts) :] == end.parts


def in_words(names: Sequence[str]) -> str:
    """The names of pictures; of more than two only how many they are."""
    return " and ".join(names) if len(names) <= 2 else f"{len(names)} pictures"
