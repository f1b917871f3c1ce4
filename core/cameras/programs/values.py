"""Numbers and names as other programs write them, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...system.errors import BadRequest, UnreadableImage
from ...system.text_files import read_with_end

# Files of cameras are lists of numbers; sixty pictures with a million points take less.
MOST_BYTES = 1 << 30
# Sides of a picture, px, that no camera exceeds.
MOST_PX = 1 << 20


def read_data(path: Path) -> bytes:
    """A file's bytes. Raises UnreadableImage where it cannot be read, BadRequest where it is far too large."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise BadRequest(f"{path}: {path.stat().st_size >> 20} MB are more than a file of cameras takes")
        return read_with_end(path)
    except (OSError, ValueError) as error:
        raise UnreadableImage(f"the camera file cannot be read: {error}") from error


def number(value: Any, what: str, place: str) -> float:
    """A finite number out of a word or a number. Raises BadRequest."""
    try:
        found = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise BadRequest(f"{place}: {what} is {shortened(value)}; a number is needed")
    return found


def whole(value: Any, what: str, place: str) -> int:
    """A whole number, likewise."""
    found = number(value, what, place)
    if found != int(found) or abs(found) > 2**53:
        raise BadRequest(f"{place}: {what} is {shortened(value)}; a whole number is needed")
    return int(found)


def size_of(width: Any, height: Any, place: str) -> tuple[int, int]:
    """(W, H) px of a picture, likewise."""
    size = whole(width, "the width", place), whole(height, "the height", place)
    if not all(0 < side <= MOST_PX for side in size):
        raise BadRequest(f"{place}: a picture of {size[0]} × {size[1]} px; both must be above 0 and at most {MOST_PX}")
    return size


def focal(value: Any, place: str) -> float:
    """A focal length in px, above 0."""
    found = number(value, "the focal length", place)
    if found <= 0:
        raise BadRequest(f"{place}: the focal length is {found:g}; it must be above 0")
    return found


def shortened(value: Any) -> str:
    """A value as messages show it."""
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "…"


def by_our_names(entries: Mapping[str, Any], names: Sequence[str], place: str) -> dict[str, Any]:
    """What a program says of pictures by its names, by ours: a picture is meant by the end of its path, with or
    without suffix, where no other is. Names that mean none of ours stay.

    Raises BadRequest where a picture is meant by several of equal right.
    """
    found: dict[str, Any] = {}
    used: set[str] = set()
    by_stem: dict[str, list[str]] = {}
    for given in entries:
        by_stem.setdefault(_stem(given), []).append(given)
    for name in names:
        ranks = {given: _likeness(given, name) for given in by_stem.get(_stem(name), ())}
        best = max(ranks.values(), default=(0, 0, 0))
        if not best[0]:
            continue
        meant = [given for given, rank in ranks.items() if rank == best]
        if len(meant) > 1:
            raise BadRequest(f"{place}: {name} may be {', '.join(meant[:5])}; rename the pictures so that one is meant")
        found[name] = entries[meant[0]]
        used.add(meant[0])
    return found | {given: entry for given, entry in entries.items() if given not in used and given not in found}


def _parts(name: str) -> list[str]:
    """A path as these programs write it, by folders, without regard to case."""
    return [part for part in name.replace("\\", "/").casefold().split("/") if part not in ("", ".")]


def _stem(name: str) -> str:
    """What two names share of which one may mean the other's picture: the last part, without its suffix."""
    return Path((_parts(name) or [""])[-1]).stem


def _likeness(given: str, name: str) -> tuple[int, int, int]:
    """How well a name means a picture: whether at all, with the suffix, and by how many folders."""
    first, second = _parts(given), _parts(name)
    if not first or not second:
        return 0, 0, 0
    same_suffix = first[-1] == second[-1]
    if not same_suffix:
        first[-1], second[-1] = (Path(one).stem for one in (first[-1], second[-1]))
    count = 0
    for one, other in zip(reversed(first), reversed(second), strict=False):
        if one != other:
            break
        count += 1
    return int(count > 0), int(same_suffix), count
