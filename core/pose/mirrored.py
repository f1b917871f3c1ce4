"""Whether one of two pictures is mirrored: a symmetric scene is stitched all the same, and any other has no matches."""

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
    enough = min(MIRROR.enough, pictures[0].view[..., 0].size // MIRROR.px_for_one)
    if by_all and found.edges[0].two_view.inliers.sum() < enough:
        _refuse_mirrored(pictures)
    return found


def _refuse_mirrored(pictures: Sequence[Picture]) -> None:
    mirrored = _agreeing(pictures, True)
    as_it_is = _agreeing(pictures, False) if mirrored >= MIRROR.least else 0
    if mirrored >= max(MIRROR.least, MIRROR.factor * as_it_is):
        raise DegenerateGeometry(
            f"one of the pictures is mirrored: {mirrored} points of the reference agree with the target if it is "
            f"flipped left to right, {as_it_is} as it is; flip one of them (scans of slides and selfies are often so)"
        )


def _agreeing(pictures: Sequence[Picture], flipped: bool) -> int:
    """How many of few features agree on one geometry, with the target mirrored or not."""
    views = [(picture.view, picture.alpha) for picture in pictures]
    if flipped:
        view, alpha = views[1]
        views[1] = np.ascontiguousarray(view[:, ::-1]), None if alpha is None else np.ascontiguousarray(alpha[:, ::-1])
    first, second = (
        features.detect(view, alpha, FEATURES.preview_budget, FEATURES.preview_pixels) for view, alpha in views
    )
    matches = features.match(first, second)
    if len(matches) < ESTIMATION.min_matches:
        return 0
    try:
        F = fundamental_candidates(matches, 0)[0]
    except NoOverlap:
        return 0
    return int(explained_by(F, matches)[0].sum())
