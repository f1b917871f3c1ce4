"""Whether a picture is mirrored beside others: a symmetric scene is stitched all the same, any other has no matches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np

from ..cameras.edge import Edge
from ..pictures.picture import Picture
from ..system.errors import DegenerateGeometry, NoOverlap, TooFewMatches
from . import features
from .fundamental import explained_by, fundamental_candidates
from .options import ESTIMATION, FEATURES, MIRROR

# Which pictures are mirrored, in a message.
OFTEN_SO = "scans of slides and selfies are often so"


class _Found(Protocol):
    @property
    def edges(self) -> tuple[Edge, ...]: ...


Found = TypeVar("Found", bound=_Found)


def unless_mirrored(pictures: Sequence[Picture], make: Callable[[], Found], by_all: bool = True) -> Found:
    """What is made of two pictures; where hardly anything agrees, it is asked whether the target is mirrored.

    Parameters
    ----------
    pictures : sequence of two Pictures
    make : callable
    by_all : bool
        Whether it is made by all features: of a preview's few only a failure counts.

    Raises
    ------
    DegenerateGeometry
        The target is mirrored; and what `make` raises.
    """
    try:
        found = make()
    except (TooFewMatches, NoOverlap, DegenerateGeometry):
        _refuse_mirrored(pictures)
        raise
    if by_all and found.edges[0].two_view.inliers.sum() < enough_to_trust(pictures[0]):
        _refuse_mirrored(pictures)
    return found


def enough_to_trust(picture: Picture) -> int:
    """As many matches that agree as no mirror image has."""
    return min(MIRROR.enough, picture.view[..., 0].size // MIRROR.px_for_one)


def mirrored_among(pictures: Sequence[Picture], asked: Sequence[int]) -> dict[int, tuple[int, int]]:
    """Which pictures (numbers) are mirrored beside others, of those that are asked about.

    Returns
    -------
    dict
        Of each the number of one that it agrees with only if it is flipped, and by how many points. Beside each other
        both are mirrored: what is so beside most comes first, and then counts no more.
    """
    plain = [_few_features(picture) for picture in pictures] if asked else []
    agree: dict[int, dict[int, int]] = {}
    for number in asked:
        mirror_image = _few_features(pictures[number], True)
        for other, features_of_it in enumerate(plain):
            mirrored = 0 if other == number else _agreeing(features_of_it, mirror_image)
            if mirrored < MIRROR.least:
                continue
            if mirrored >= MIRROR.factor * _agreeing(features_of_it, plain[number]):
                agree.setdefault(number, {})[other] = mirrored
                agree.setdefault(other, {})[number] = mirrored
    out = {}
    while any(agree.values()):
        worst = max(agree, key=lambda number: (len(agree[number]), sum(agree[number].values()), -number))
        out[worst] = max(agree[worst].items(), key=lambda found: found[1])
        for other in agree.pop(worst):
            del agree[other][worst]
    return out


def _refuse_mirrored(pictures: Sequence[Picture]) -> None:
    found = mirrored_among(pictures, [1])
    if found:
        ((_, points),) = found.values()
        raise DegenerateGeometry(
            f"one of the pictures is mirrored: {points} points of the reference agree with the target only if it is "
            f"flipped left to right; flip one of them ({OFTEN_SO})"
        )


def _few_features(picture: Picture, flipped: bool = False) -> features.Features:
    """As many as a preview has, of a picture or its mirror image."""
    step = -1 if flipped else 1
    view = np.ascontiguousarray(picture.view[:, ::step])
    alpha = None if picture.alpha is None else np.ascontiguousarray(picture.alpha[:, ::step])
    return features.detect(view, alpha, FEATURES.preview_budget, FEATURES.preview_pixels)


def _agreeing(first: features.Features, second: features.Features) -> int:
    """How many of few features agree on one geometry."""
    matches = features.match(first, second)
    if len(matches) < max(ESTIMATION.min_matches, MIRROR.least):
        return 0
    try:
        F = fundamental_candidates(matches, 0)[0]
    except NoOverlap:
        return 0
    return int(explained_by(F, matches)[0].sum())
