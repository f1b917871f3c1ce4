"""When pictures that connect with no others are too many."""

from __future__ import annotations

from collections.abc import Sequence

from ..cameras.camera import Camera
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


def left_out_warnings(found: Registration, cameras: Sequence[Camera], names: Sequence[str]) -> list[str]:
    """What is said of pictures that are left out.

    Parameters
    ----------
    found : Registration
    cameras : sequence of Camera
        Of all pictures, as known before matching.
    names : sequence of str
        Of all pictures.

    Returns
    -------
    list of str
        Why each is, and whose focal length the others began with.
    """
    out = [f"{names[number]} is left out: {why}" for number, why in found.left_out.items()]
    lenders = {names[number] for number in found.left_out} & {cameras[number].lens_of for number in found.numbers}
    for name in sorted(lenders):
        own = cameras[list(names).index(name)]
        out.append(
            f"{name} is left out, and the focal length of others that have none of their own was first taken from it "
            f"({own.focal:.0f} px, {own.source}): if another lens took them, give theirs (--focal35, --focal-px)"
        )
    return out
