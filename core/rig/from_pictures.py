"""From pictures in any order to their rig: features, matches, registration; each kept in the cache."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..cameras.bodies import Bodies, bodies_of
from ..cameras.camera import Camera
from ..cameras.rig import PictureMatches, Registration, Rig
from ..pictures.picture import Picture
from ..pose.mirrored import OFTEN_SO, enough_to_trust, mirrored_among
from ..system.cache import Cache
from ..system.progress import ReportProgress
from ..system.threads import ask
from .averaging.pairs import chosen_pairs
from .matching import Matched, content_key, found_features, found_matches
from .registration import register


def content_order(pictures: Sequence[Picture]) -> list[int]:
    """Numbers of the pictures in an order that is the same however they are given."""
    keys = []
    for picture in pictures:
        ask()
        keys.append(content_key(picture))
    return sorted(range(len(pictures)), key=keys.__getitem__)


def matched_pictures(
    pictures: Sequence[Picture], order: Sequence[int], bodies: Bodies, quick: bool, cache: Cache,
    progress: ReportProgress,
) -> Matched:  # fmt: skip
    """What pictures have in common.

    Parameters
    ----------
    pictures : sequence of Picture
    order : sequence of int
        See `content_order`.
    bodies : Bodies
        Of the pictures: views of one sphere are not compared with each other.
    quick : bool
        Whether a preview's few features will do.
    cache : Cache
    progress : callable
        progress(stage, share of that stage that is done).

    Returns
    -------
    Matched
        The same in whatever order the pictures are given, but for their numbers.
    """
    progress("features", 0.0)
    seen = found_features(
        [pictures[number] for number in order], quick, cache, lambda share: progress("features", share)
    )
    progress("matches", 0.0)
    body = bodies.of[list(order)]
    pairs = [(i, j) for i, j in chosen_pairs(seen) if body[i] != body[j]]
    found = found_matches(seen, pairs, cache, lambda share: progress("matches", share))
    return renumbered(found, order)


def registered(
    pictures: Sequence[Picture], order: Sequence[int], cameras: Sequence[Camera], matched: Matched, seed: int,
    cache: Cache, progress: ReportProgress,
) -> Registration:  # fmt: skip
    """The rig of pictures.

    Parameters
    ----------
    pictures : sequence of Picture
    order : sequence of int
        See `content_order`.
    cameras : sequence of Camera
        What is known of them.
    matched : Matched
        What they have in common.
    seed : int
        Of random choices.
    cache : Cache
    progress : callable
        progress(stage, share of that stage that is done).

    Returns
    -------
    Registration
        The same in whatever order the pictures are given, but for their numbers: those that connect come in the order
        of their content, and the first one's frame is the rig's (`reframing.seen_from` gives it the viewpoint's).
    """
    mirrored = _mirrored(pictures, matched)
    right = tuple(one for one in matched.matches if mirrored.keys().isdisjoint((one.i, one.j)))
    matched = replace(matched, matches=right)
    inner = renumbered(matched, np.argsort(order).tolist())
    first_of_body = bodies_of(cameras).of.tolist()
    cameras = tuple(cameras[number] for number in order)
    names = tuple(
        pictures[number].name if camera.view_of is None else camera.view_of.name
        for number, camera in zip(order, cameras, strict=True)
    )

    def found() -> _Kept:
        one = register(cameras, inner.points, inner.matches, inner.scale, seed, progress, names)
        return _Kept(one.rig, one.numbers, tuple(one.left_out.items()))

    progress("geometry", 0.0)
    kept = cache.remember("registration", (cameras, inner.points, inner.matches, inner.scale, seed, names), found)
    numbers = tuple(order[number] for number in kept.numbers)
    left_out = {first_of_body[order[number]]: why for number, why in kept.left_out}
    left_out = dict(sorted(left_out.items())) | {first_of_body[number]: why for number, why in mirrored.items()}
    return Registration(kept.rig, numbers, left_out)


def _mirrored(pictures: Sequence[Picture], matched: Matched) -> dict[int, str]:
    """Which pictures are mirrored, of those that have few matches with any other, and what is said of them."""
    most = [0] * len(pictures)
    for one in matched.matches:
        for number in (one.i, one.j):
            most[number] = max(most[number], len(one.index))
    asked = [number for number, picture in enumerate(pictures) if most[number] < enough_to_trust(picture)]
    return {
        number: f"it is mirrored: {points} points of {pictures[other].name} agree with it only if it is flipped left "
        f"to right; flip it ({OFTEN_SO})"
        for number, (other, points) in mirrored_among(pictures, [] if matched.given else asked).items()
    }


def renumbered(matched: Matched, numbers: Sequence[int]) -> Matched:
    """What was matched with other numbers of the pictures: numbers[n] is the new one of picture n."""
    points = [matched.points[old] for old in np.argsort(numbers)]
    matches = []
    for one in matched.matches:
        i, j = numbers[one.i], numbers[one.j]
        matches.append(PictureMatches(i, j, one.index) if i < j else PictureMatches(j, i, one.index[:, ::-1]))
    return replace(matched, points=tuple(points), matches=tuple(sorted(matches, key=lambda one: (one.i, one.j))))


@dataclass(frozen=True, eq=False)
class _Kept:
    """A Registration in a form that the cache holds; left_out: numbers, and why."""

    rig: Rig
    numbers: tuple[int, ...]
    left_out: tuple[tuple[int, str], ...]
