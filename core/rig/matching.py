"""Features of each picture, found once, and the matches of pairs of pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from ..cameras.rig import PictureMatches
from ..pictures.picture import Picture
from ..pose import features
from ..pose.features import Features
from ..pose.options import FEATURES
from ..raster.arrays import Array
from ..system.cache import Cache
from ..system.threads import at_most, in_order


@dataclass(frozen=True, eq=False)
class Matched:
    """What pictures have in common.

    Attributes
    ----------
    points : tuple of (K, 2) arrays
        Of each picture its features, px of the picture.
    matches : tuple of PictureMatches
        Of each pair that was compared and has any.
    scale : float
        px by which thresholds are multiplied (see `Matches`).
    given : bool
        Whether the matches were given by the user.
    """

    points: tuple[Array, ...]
    matches: tuple[PictureMatches, ...]
    scale: float
    given: bool = False


def content_key(picture: Picture) -> bytes:
    """A digest of what a picture shows: sorted by it, pictures have one order however they were given."""
    digest = blake2b(f"{picture.view.shape}".encode(), digest_size=20)
    digest.update(np.ascontiguousarray(picture.view).data)
    if picture.alpha is not None:
        digest.update(np.ascontiguousarray(picture.alpha).data)
    return digest.digest()


def found_features(
    pictures: Sequence[Picture], quick: bool, cache: Cache, progress: Callable[[float], None]
) -> list[Features]:
    """The features of each picture.

    Parameters
    ----------
    pictures : sequence of Picture
    quick : bool
        Whether a preview's few will do.
    cache : Cache
        Each picture's are kept apart from the others'.
    progress : callable
        progress(share that is done), called after each picture.

    Returns
    -------
    list of Features
    """
    most = (
        (FEATURES.preview_budget, FEATURES.preview_pixels) if quick else (FEATURES.budget_of_many, FEATURES.pixels)
    )

    def of_one(picture: Picture) -> Features:
        return cache.remember(
            "features", (picture.view, picture.alpha, most),
            lambda: features.detect(picture.view, picture.alpha, *most),
        )  # fmt: skip

    found = []
    with at_most(features.at_once(most[1], [picture.view[..., 0].size for picture in pictures])):
        for one in in_order(of_one, pictures):
            found.append(one)
            progress(len(found) / len(pictures))
    return found


def found_matches(
    seen: Sequence[Features], pairs: Sequence[tuple[int, int]], cache: Cache, progress: Callable[[float], None]
) -> Matched:
    """The matches of pairs of pictures.

    Parameters
    ----------
    seen : sequence of Features
        Of all pictures.
    pairs : sequence of (i, j)
        Pictures to compare, i < j.
    cache : Cache
        Each pair's are kept: of a picture that is added, only its own are new.
    progress : callable
        progress(share that is done), called after each pair.

    Returns
    -------
    Matched
    """

    def of_one(pair: tuple[int, int]) -> PictureMatches:
        a, b = (seen[number] for number in pair)
        return PictureMatches(*pair, cache.remember("pair", (a, b), lambda: features.match_index(a, b)))

    found = []
    for number, one in enumerate(in_order(of_one, pairs), 1):
        found += [one] if len(one) else []
        progress(number / len(pairs))
    return Matched(tuple(one.points for one in seen), tuple(found), max(one.scale for one in seen))
