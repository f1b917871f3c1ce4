"""Features and matches of several pictures, and what of them is kept for the next time."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pose import features
from edf_stitch.core.pose.features import Features
from edf_stitch.core.rig.matching import Matched, content_key, found_features, found_matches
from edf_stitch.core.system.cache import Cache


def textured(shift: int, seed: int = 1) -> Picture:
    """A part of a random texture, 160 × 120 px, further right by `shift` px."""
    rng = np.random.default_rng(seed)
    whole = np.kron(rng.integers(0, 255, (40, 100, 3), np.uint8), np.ones((4, 4, 1), np.uint8))
    return picture_from_array(np.ascontiguousarray(whole[:120, shift : shift + 160]), f"{shift}.png")


@pytest.fixture(scope="module")
def pictures() -> list[Picture]:
    return [textured(0), textured(20), textured(48), textured(0, seed=2)]


PAIRS = [(0, 1), (0, 2), (1, 2), (0, 3)]


def matched(pictures: list[Picture], cache: Cache, pairs: list[tuple[int, int]]) -> tuple[Matched, list[float]]:
    shares: list[float] = []
    seen = found_features(pictures, False, cache, shares.append)
    return found_matches(seen, pairs, cache, shares.append), shares


def test_indices_name_the_points_that_match(pictures: list[Picture]) -> None:
    found, shares = matched(pictures, Cache(None), PAIRS)
    assert [(one.i, one.j) for one in found.matches][:3] == PAIRS[:3]
    for one, shift in zip(found.matches, (20, 48, 28), strict=False):
        x, y = found.points[one.i][one.index[:, 0]], found.points[one.j][one.index[:, 1]]
        assert len(one) > 30
        assert np.abs(np.median(x - y, axis=0) - (shift, 0)).max() < 0.1
    assert shares == [0.25, 0.5, 0.75, 1.0] * 2


def test_they_are_those_that_a_pair_has(pictures: list[Picture]) -> None:
    a, b = (features.detect(one.view, one.alpha) for one in pictures[:2])
    pair, index = features.match(a, b), features.match_index(a, b)
    np.testing.assert_array_equal(pair.x, a.points[index[:, 0]])
    np.testing.assert_array_equal(pair.y, b.points[index[:, 1]])


def test_of_a_picture_that_is_added_only_its_own_pairs_are_new(
    pictures: list[Picture], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache, calls = Cache(tmp_path), {"detect": 0, "match_index": 0}
    for name in calls:
        def counted(*given: object, name: str = name, work: object = getattr(features, name)) -> object:
            calls[name] += 1
            return work(*given)  # type: ignore[operator]

        monkeypatch.setattr(features, name, counted)
    first, _ = matched(pictures[:3], cache, PAIRS[:3])
    assert calls == {"detect": 3, "match_index": 3}
    again, _ = matched(pictures, cache, PAIRS)
    assert calls == {"detect": 4, "match_index": 4}
    for one, other in zip(first.matches, again.matches, strict=False):
        np.testing.assert_array_equal(one.index, other.index)


def test_a_picture_is_known_by_what_it_shows(pictures: list[Picture]) -> None:
    assert content_key(pictures[0]) == content_key(textured(0))
    assert len({content_key(one) for one in pictures}) == 4
    upside_down = picture_from_array(np.ascontiguousarray(pictures[0].view[::-1]))
    masked = picture_from_array(np.dstack([pictures[0].view, np.full((120, 160), 9, np.uint8)]))
    assert len({content_key(one) for one in (pictures[0], upside_down, masked)}) == 3


@pytest.mark.parametrize(("side", "together"), [(400, 4), (2000, 1)])
def test_features_of_large_pictures_are_not_looked_for_all_at_once(
    monkeypatch: pytest.MonkeyPatch, side: int, together: int
) -> None:
    """Each takes hundreds of megabytes meanwhile, and OpenCV has threads of its own."""
    at_once, most, lock = 0, 0, threading.Lock()

    def detect(*_: object) -> Features:
        nonlocal at_once, most
        with lock:
            at_once += 1
            most = max(most, at_once)
        time.sleep(0.05)
        with lock:
            at_once -= 1
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32), 1.0)

    monkeypatch.setattr(features, "detect", detect)
    before = cv2.getNumThreads()
    cv2.setNumThreads(4)
    try:
        pictures = [picture_from_array(np.full((side, side), number, np.uint8)) for number in range(6)]
        assert len(found_features(pictures, False, Cache(None), lambda share: None)) == 6
    finally:
        cv2.setNumThreads(before)
    assert most <= together and (together == 1 or most > 1)
