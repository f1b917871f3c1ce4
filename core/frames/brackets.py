"""Which pictures are exposures of one view: found in any order, or told by the user, every N of them.

Two exposures of one view differ in their light, show the same, and one homography near the identity joins them.
Pictures of a panorama whose exposure happens to differ do not: they overlap in part, or were taken from different
places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from ..pictures.picture import Picture
from ..raster.arrays import Array
from ..system.errors import BadRequest
from ..system.threads import in_order
from .exposures import Relation, SmallCopy, relation_of, stops_told
from .options import BRACKETS


@dataclass(frozen=True, eq=False)
class Bracket:
    """Exposures of one view.

    Attributes
    ----------
    numbers : tuple of int
        Of the pictures, the darkest exposure first.
    stops : tuple of float
        By how many each is brighter than the middle one.
    homographies : tuple of (3, 3) arrays
        From px of the middle one to px of each.
    shift : float
        How far a corner moves between two of them at most, as a share of the diagonal.
    """

    numbers: tuple[int, ...]
    stops: tuple[float, ...]
    homographies: tuple[Array, ...]
    shift: float

    @property
    def middle(self) -> int:
        """Which of the exposures, by its place among them, is the middle one."""
        return len(self.numbers) // 2


def brackets_in(pictures: Sequence[Picture], asked: str | int) -> list[Bracket]:
    """The brackets among pictures.

    Parameters
    ----------
    pictures : sequence of Picture
    asked : int, "auto" or "off"
        How many in a row are one bracket; "auto" looks for them among more than two pictures.

    Raises
    ------
    BadRequest
        Pictures that are said to be one bracket show no single view, or are no exposures.
    """
    if isinstance(asked, int):
        return _in_a_row(pictures, asked)
    return _found(pictures) if asked == "auto" and len(pictures) > 2 else []


def _in_a_row(pictures: Sequence[Picture], count: int) -> list[Bracket]:
    """The brackets of so many pictures each."""
    brackets = []
    for first in range(0, len(pictures), count):
        numbers = range(first, first + count)
        for number in numbers:
            if not _is_exposure(pictures[number]):
                raise BadRequest(
                    f"--brackets {count}: {pictures[number].name} is no exposure of a camera: it holds floats, or is "
                    "transparent in part"
                )
        copies = {number: SmallCopy.of(pictures[number], BRACKETS.working_px) for number in numbers}
        order = _by_exposure(pictures, copies)
        relations = []
        for one, other in pairwise(order):
            relation, why = relation_of(copies[one], copies[other], _stops_between(pictures, one, other), given=True)
            if relation is None:
                raise BadRequest(
                    f"--brackets {count}: {pictures[one].name} and {pictures[other].name} are no exposures of one "
                    f"view: {why}; name the pictures bracket by bracket, or leave the option out"
                )
            relations.append(relation)
        brackets.append(_bracket(order, relations))
    return brackets


def _found(pictures: Sequence[Picture]) -> list[Bracket]:
    """The brackets among pictures in any order."""
    candidates = _candidates(pictures)
    if not candidates:
        return []
    wanted = sorted({number for pair in candidates for number in pair})
    copies = dict(zip(wanted, in_order(lambda k: SmallCopy.of(pictures[k], BRACKETS.working_px), wanted), strict=True))

    def related(pair: tuple[int, int]) -> bool:
        relation, _ = relation_of(copies[pair[0]], copies[pair[1]], _stops_between(pictures, *pair))
        return relation is not None and abs(relation.stops) >= BRACKETS.least_stops

    joined = [pair for pair, is_so in zip(candidates, in_order(related, candidates), strict=True) if is_so]
    brackets: list[Bracket] = []
    for group in _groups(joined):
        order = _by_exposure(pictures, {number: copies[number] for number in group})
        brackets += _chains(pictures, copies, order)
    return sorted(brackets, key=lambda bracket: min(bracket.numbers))


def _is_exposure(picture: Picture) -> bool:
    return (picture.bits < 32 or picture.is_raw) and picture.alpha is None


def _stops_between(pictures: Sequence[Picture], one: int, other: int) -> float | None:
    """By how many stops another picture is brighter by what it says of itself; None where one says nothing."""
    before, after = stops_told(pictures[one]), stops_told(pictures[other])
    # RAW files that do not say how they were exposed were developed as if they had been exposed alike
    if before is None or after is None or (before == after and pictures[one].is_raw):
        return None
    return after - before


def _candidates(pictures: Sequence[Picture]) -> list[tuple[int, int]]:
    """Pairs that may be exposures of one view: of one camera, alike, and not equally bright."""
    kinds: dict[tuple[object, ...], list[int]] = {}
    for number, picture in enumerate(pictures):
        if _is_exposure(picture):
            exif = picture.exif
            kind = (picture.view.shape, picture.bits, picture.icc, exif.make, exif.model, exif.focal_mm)
            kinds.setdefault(kind, []).append(number)
    out = []
    for numbers in kinds.values():
        copied = in_order(lambda number: SmallCopy.of(pictures[number], BRACKETS.thumbnail_px), numbers)
        small = dict(zip(numbers, copied, strict=True))
        out += [pair for pair in combinations(numbers, 2)
                if _may_be_one_view(small[pair[0]], small[pair[1]], _stops_between(pictures, *pair))]  # fmt: skip
    return out


def _may_be_one_view(one: SmallCopy, other: SmallCopy, told: float | None) -> bool:
    """Whether two thumbnails rise and fall together where both are well exposed, and differ in brightness."""
    both = one.usable & other.usable
    if both.mean() < BRACKETS.least_usable or (told is not None and abs(told) < BRACKETS.least_stops):
        return False
    first, second = np.log2(one.gray[both]), np.log2(other.gray[both])
    # a shift by a pixel between them changes the median a little
    if told is None and abs(np.median(second - first)) < BRACKETS.least_stops / 2:
        return False
    first, second = first - first.mean(), second - second.mean()
    return bool(first @ second >= BRACKETS.alike * np.sqrt((first @ first) * (second @ second)))


def _groups(pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """The numbers that pairs connect, group by group."""
    group_of: dict[int, set[int]] = {}
    for one, other in pairs:
        both = group_of.get(one, {one}) | group_of.get(other, {other})
        group_of |= dict.fromkeys(both, both)
    return [sorted(group) for group in {id(group): group for group in group_of.values()}.values()]


def _by_exposure(pictures: Sequence[Picture], copies: dict[int, SmallCopy]) -> list[int]:
    """The numbers of exposures of one view, the darkest first."""
    told = {number: stops_told(pictures[number]) for number in copies}
    if None in told.values() or len(set(told.values())) == 1:
        told = {number: float(copy.gray.mean()) for number, copy in copies.items()}
    return sorted(copies, key=lambda number: (told[number], number))


def _chains(pictures: Sequence[Picture], copies: dict[int, SmallCopy], order: Sequence[int]) -> list[Bracket]:
    """Brackets of exposures of one view, the darkest first; each exposure is taken once, and where two neighbours do
    not go together another bracket begins."""
    brackets: list[Bracket] = []
    numbers, relations = [order[0]], list[Relation]()
    for other in order[1:]:
        relation, _ = relation_of(copies[numbers[-1]], copies[other], _stops_between(pictures, numbers[-1], other))
        if relation is not None and relation.stops < BRACKETS.least_stops:
            continue
        if relation is None:
            brackets += [_bracket(numbers, relations)] if relations else []
            numbers, relations = [other], []
        else:
            numbers.append(other)
            relations.append(relation)
    return brackets + ([_bracket(numbers, relations)] if relations else [])


def _bracket(numbers: Sequence[int], relations: Sequence[Relation]) -> Bracket:
    """The bracket of exposures, the darkest first, and of what lies between each and the next."""
    stops = np.concatenate([[0.0], np.cumsum([relation.stops for relation in relations])])
    from_first = [np.eye(3)]
    for relation in relations:
        from_first.append(relation.homography @ from_first[-1])
    middle = len(numbers) // 2
    to_first = np.linalg.inv(from_first[middle])
    homographies = [np.eye(3) if number == middle else h @ to_first for number, h in enumerate(from_first)]
    return Bracket(
        tuple(numbers), tuple((stops - stops[middle]).tolist()), tuple(h / h[2, 2] for h in homographies),
        max(relation.shift for relation in relations),
    )  # fmt: skip
