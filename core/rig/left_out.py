"""When pictures that connect with no others are too many."""

from __future__ import annotations

from collections.abc import Sequence

from ..cameras.rig import Registration
from ..system.errors import NoOverlap

_ADVICE = "take pictures between them and the others, from places closer together, with half of each picture shared"


def check_connected(found: Registration, names: Sequence[str], require_all: bool) -> None:
    """Refuse what cannot be stitched, or not as asked for.

    Parameters
    ----------
    found : Registration
    names : sequence of str
        Of all pictures.
    require_all : bool
        Whether none may be left out.

    Raises
    ------
    NoOverlap
        Fewer than two pictures connect, or one is left out that may not be.
    """
    reasons = [f"{names[number]}: {why}" for number, why in found.left_out.items()]
    if len(found.numbers) < 2:
        raise NoOverlap(f"no two of these {len(names)} pictures connect ({'; '.join(reasons)}); {_ADVICE}")
    if reasons and require_all:
        raise NoOverlap(
            f"{len(reasons)} of {len(names)} pictures do not connect with the others ({'; '.join(reasons)}); "
            f"{_ADVICE}, or leave --require-all out"
        )
