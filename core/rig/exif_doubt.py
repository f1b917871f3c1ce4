"""Whether the matches of a set clearly prefer another focal length than EXIF gives: its strongest pairs are asked.

Pictures that share a focal length by EXIF are asked among each other. A few that have another one than most are asked
beside those as well: a crop of one picture, say, whose EXIF is that of the whole, or the reverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..cameras.camera import Camera, Knowledge
from ..cameras.from_exif import without_exif
from ..cameras.lens import undistort
from ..cameras.matches import Matches
from ..cameras.rig import PictureMatches
from ..pictures.naming import in_words
from ..pose.estimation import estimate
from ..pose.exif_doubt import Estimate, by_exif_or_without, exif_warning, preferred
from ..pose.options import EXIF_DOUBT
from ..system.errors import StitchError
from .matching import Matched


@dataclass(frozen=True)
class Doubted:
    """Pictures (numbers) whose one focal length by EXIF the matches overrule; lender: the picture whose focal length
    theirs is, where it is that of others, −1 where it is not known."""

    pictures: tuple[int, ...]
    lender: int = -1


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
        One for each focal length that most matches of the strongest pairs which share it overrule. What these give
        instead need not agree: all pictures together know better.
    """
    groups, found = _of_one_focal(cameras), []
    for pictures in groups:
        if _most(_answers(pictures, cameras, matched, seed)):
            found.append(Doubted(tuple(pictures)))
    wrong = {one.pictures for one in found}
    believed = [pictures for pictures in groups if tuple(pictures) not in wrong]
    for pictures in believed:
        others = [one for one in believed if len(one) > len(pictures) and _same_shape(cameras, pictures[0], one[0])]
        if _most(_answers_beside(pictures, sum(others, []), cameras, matched, seed)):
            found.append(Doubted(tuple(pictures), max(others, key=len)[0]))
    return tuple(found)


def without_wrong_exif(
    cameras: Sequence[Camera], doubted: Sequence[Doubted], names: Sequence[str]
) -> tuple[Camera, ...]:
    """The cameras, of the doubted ones as if nothing were known but whose focal length theirs is; names: of all."""
    out = list(cameras)
    for one in doubted:
        for number in one.pictures:
            lent = None if one.lender < 0 else _with_focal_of(cameras[number], cameras[one.lender], names[one.lender])
            out[number] = without_exif(cameras[number]) if lent is None else lent
    return tuple(out)


def exif_warnings(
    cameras: Sequence[Camera], doubted: Sequence[Doubted], names: Sequence[str], found: Mapping[int, float]
) -> list[str]:
    """What is said of doubted ones; cameras, names: of all pictures, as they were known; found: focal lengths, px, of
    those that were registered."""
    out = []
    for one in doubted:
        used = [number for number in one.pictures if number in found]
        if used:
            listed = in_words([names[number] for number in one.pictures])
            out.append(exif_warning(listed, cameras[used[0]], found[used[0]]))
    return out


def _same_shape(cameras: Sequence[Camera], first: int, second: int) -> bool:
    """Whether one of two pictures may be a copy of the other's size: then one focal length may be meant."""
    shapes = [np.divide(*cameras[number].size) for number in (first, second)]
    return bool(abs(np.log(shapes[0] / shapes[1])) < EXIF_DOUBT.same_shape)


def _with_focal_of(camera: Camera, other: Camera, name: str) -> Camera:
    """A camera with the focal length of another picture (its name) of the same shape."""
    lent = camera.scaled(other.focal * camera.size[0] / other.size[0] / camera.focal)
    return replace(camera, K=lent, source=f"{name} ({other.source})", log_sigma=other.log_sigma, lens_of=name)


def _of_one_focal(cameras: Sequence[Camera]) -> list[list[int]]:
    """Numbers of the pictures that share a focal length by EXIF, and their size."""
    groups: dict[tuple[float, tuple[int, int]], list[int]] = {}
    for number, camera in enumerate(cameras):
        if camera.knowledge == Knowledge.EXIF:
            groups.setdefault((round(camera.focal, 3), camera.size), []).append(number)
    return list(groups.values())


def _answers(
    pictures: Sequence[int], cameras: Sequence[Camera], matched: Matched, seed: int
) -> Iterator[tuple[bool, int]]:
    """Of the strongest pairs among these pictures whether they overrule EXIF's focal length, and their matches."""
    for pair in _strongest([one for one in matched.matches if one.i in pictures and one.j in pictures]):
        both = cameras[pair.i], cameras[pair.j]
        with suppress(StitchError):
            used = by_exif_or_without(_ideal(pair, both, matched), both, seed, _estimate_by(seed))[1]
            yield used[0].assumed, len(pair)


def _answers_beside(
    pictures: Sequence[int], others: Sequence[int], cameras: Sequence[Camera], matched: Matched, seed: int
) -> Iterator[tuple[bool, int]]:
    """Of the strongest pairs of these pictures with others whether they clearly prefer that these have the others'
    focal length, and their matches."""
    pairs = [
        one for one in matched.matches
        if (one.i in pictures and one.j in others) or (one.i in others and one.j in pictures)
    ]  # fmt: skip
    for pair in _strongest(pairs):
        both = cameras[pair.i], cameras[pair.j]
        one, other = both if pair.i in pictures else both[::-1]
        lent = _with_focal_of(one, other, "")
        with suppress(StitchError):
            instead = (lent, other) if pair.i in pictures else (other, lent)
            yield preferred(_ideal(pair, both, matched), both, instead, seed, _estimate_by(seed)), len(pair)


def _most(answers: Iterable[tuple[bool, int]]) -> bool:
    """Whether more than half of all matches say so: pairs with few of them tell little."""
    said = list(answers)
    return sum(count for answer, count in said if answer) * 2 > sum(count for _, count in said)


def _strongest(pairs: Sequence[PictureMatches]) -> list[PictureMatches]:
    return sorted(pairs, key=lambda one: (-len(one.index), one.i, one.j))[: EXIF_DOUBT.pairs_asked]


def _ideal(pair: PictureMatches, both: tuple[Camera, Camera], matched: Matched) -> Matches:
    """The matches of a pair of pictures, ideal px."""
    x, y = (matched.points[number][pair.index[:, side]] for side, number in enumerate((pair.i, pair.j)))
    return Matches(undistort(x, both[0]), undistort(y, both[1]), matched.scale, given=matched.given)


def _estimate_by(seed: int) -> Estimate:
    return lambda matches, cameras: estimate(matches, cameras[0], cameras[1], seed=seed)
