"""Whether the matches of a set clearly prefer another focal length than EXIF gives: its strongest pairs are asked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..cameras.camera import Camera, Knowledge
from ..cameras.from_exif import without_exif
from ..cameras.lens import undistort
from ..cameras.matches import Matches
from ..pictures.naming import in_words
from ..pose.estimation import estimate
from ..pose.exif_doubt import by_exif_or_without, exif_warning
from ..pose.options import EXIF_DOUBT
from ..system.errors import StitchError
from .matching import Matched


@dataclass(frozen=True)
class Doubted:
    """Pictures (numbers) whose one focal length by EXIF the matches overrule, and what they give instead, px."""

    pictures: tuple[int, ...]
    focal: float


def wrong_exif(cameras: Sequence[Camera], matched: Matched, seed: int) -> tuple[Doubted, ...]:
    """Which focal lengths by EXIF the matches clearly overrule.

    Parameters
    ----------
    cameras : sequence of Camera
        As they are known.
    matched : Matched
        What the pictures have in common.
    seed : int
        Of RANSAC.

    Returns
    -------
    tuple of Doubted
        One for each focal length that most of the strongest pairs which share it overrule alike.
    """
    found = []
    for pictures in _of_one_focal(cameras):
        answers = list(_answers(pictures, cameras, matched, seed))
        other = [answer for answer in answers if answer is not None]
        if len(other) * 2 > len(answers) and np.ptp(np.log(other)) < EXIF_DOUBT.agreeing:
            found.append(Doubted(tuple(pictures), float(np.median(other))))
    return tuple(found)


def without_wrong_exif(
    cameras: Sequence[Camera], doubted: Sequence[Doubted], names: Sequence[str]
) -> tuple[tuple[Camera, ...], list[str]]:
    """The cameras, of the doubted ones as if nothing were known, and warnings; names: of all pictures."""
    wrong = {number for one in doubted for number in one.pictures}
    warnings = [
        exif_warning(in_words([names[number] for number in one.pictures]), cameras[one.pictures[0]], one.focal)
        for one in doubted
    ]
    return tuple(without_exif(one) if number in wrong else one for number, one in enumerate(cameras)), warnings


def _of_one_focal(cameras: Sequence[Camera]) -> list[list[int]]:
    """Numbers of the pictures that share a focal length by EXIF, and their size."""
    groups: dict[tuple[float, tuple[int, int]], list[int]] = {}
    for number, camera in enumerate(cameras):
        if camera.knowledge == Knowledge.EXIF:
            groups.setdefault((round(camera.focal, 3), camera.size), []).append(number)
    return list(groups.values())


def _answers(
    pictures: Sequence[int], cameras: Sequence[Camera], matched: Matched, seed: int
) -> Iterator[float | None]:
    """Of the strongest pairs among these pictures the focal length that overrules EXIF's, None where none does."""
    pairs = [one for one in matched.matches if one.i in pictures and one.j in pictures]
    strongest = sorted(pairs, key=lambda one: (-len(one.index), one.i, one.j))[: EXIF_DOUBT.pairs_asked]
    for pair in strongest:
        both = cameras[pair.i], cameras[pair.j]
        x, y = (matched.points[number][pair.index[:, side]] for side, number in enumerate((pair.i, pair.j)))
        ideal = Matches(undistort(x, both[0]), undistort(y, both[1]), matched.scale, given=matched.given)
        try:
            view, used = by_exif_or_without(
                ideal, both, seed, lambda these, known: estimate(these, known[0], known[1], seed=seed)
            )
        except StitchError:
            continue
        yield float(view.K[0, 0]) if used[0].assumed else None
