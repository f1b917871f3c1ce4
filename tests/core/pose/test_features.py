"""Features: where they lie to a fraction of a pixel, how they are spread and matched, and that they are repeatable."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.pose.features import Features, detect, match, match_index, spread_evenly
from edf_stitch.core.pose.options import FEATURES
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree


@cache
def texture(height: int, width: int, seed: int, channels: int = 3) -> np.ndarray:
    """Smooth noise in octaves, 8 bits: corners and blobs at every scale."""
    random = np.random.default_rng(seed)
    out = np.zeros((height, width), np.float32)
    for octave in range(6):
        cells = 4 * 2**octave
        shape = (max(2, height * cells // max(height, width)) + 3, max(2, width * cells // max(height, width)) + 3)
        out += cv2.resize(random.random(shape).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC) * (
            0.75**octave
        )
    out = (out - out.min()) / (out.max() - out.min())
    return np.repeat((255 * out).astype(np.uint8)[..., None], channels, axis=2)


def turned(picture: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(picture[::-1, ::-1])


def nearest(points: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to, and offset of, each point's nearest among the others."""
    distance, index = cKDTree(others).query(points)
    return distance, others[index] - points


# --- where points lie ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height, width", [(300, 400), (301, 401)])
def test_a_picture_and_its_half_turn_have_the_same_points(height: int, width: int) -> None:
    """Any fixed offset of the detector would show twice here: OpenCV's own upscaling has one of a quarter pixel."""
    picture = texture(height, width, 1)
    one, other = detect(picture), detect(turned(picture))
    distance, _ = nearest(one.points, np.array([width - 1, height - 1]) - other.points)
    assert len(one.points) > 1000
    assert np.median(distance) < 0.05
    assert np.mean(distance < 0.5) > 0.9


def test_points_are_what_they_look_like() -> None:
    """A bright disc on an exact pixel is found there."""
    centres = np.array([[40.0, 50], [120, 53], [77, 121]])
    y, x = np.mgrid[:160, :170]
    light = sum(np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * 3.0**2)) for cx, cy in centres)
    view = (40 + 200 * light[..., None].clip(0, 1)).astype(np.uint8)
    found = detect(view)
    distance, _ = nearest(centres, found.points)
    assert distance.max() < 0.05
    assert found.points.dtype == np.float64 and found.scale == 1.0
    assert found.descriptors.shape == (len(found.points), 128) and found.descriptors.dtype == np.float32
    assert np.allclose(np.linalg.norm(found.descriptors, axis=1), 1, atol=1e-5)
    assert (found.descriptors >= 0).all()


def test_a_big_picture_is_shrunk_and_its_points_come_back_to_full_size() -> None:
    """The same picture eight times as large: every point p belongs at 8 (p + ½) − ½."""
    small = texture(240, 320, 2, 1)
    times = 8
    large = cv2.resize(small, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)[..., None]
    assert large.shape[0] * large.shape[1] > 1.5 * FEATURES.pixels
    found = detect(large, budget=2000)
    assert found.scale == pytest.approx(np.sqrt(large.size / FEATURES.pixels), rel=2e-3)
    assert found.points[:, 0].max() > 0.9 * large.shape[1] and found.points[:, 1].max() > 0.9 * large.shape[0]
    distance, offset = nearest((detect(small).points + 0.5) * times - 0.5, found.points)
    same = distance < 0.25 * times
    assert same.mean() > 0.6
    # leaving the half pixels out would shift all by (scale − 1) / 2 = 0.12 px or more; points repeat to ± 0.05 × 8 px
    # each, their mean over a thousand to a hundredth
    assert same.sum() > 500
    assert np.abs(offset[same].mean(axis=0)).max() < 0.05
    assert np.abs(np.median(offset[same], axis=0)).max() < 0.05


# --- nothing to find -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (7, 100), (8, 8), (9, 30), (60, 60)])
@pytest.mark.parametrize("channels", [1, 3])
def test_tiny_or_flat_pictures_have_no_points(shape: tuple[int, int], channels: int) -> None:
    flat = np.full((*shape, channels), 128, np.uint8)
    noise = np.random.default_rng(0).integers(0, 256, (*shape, channels), dtype=np.uint8)
    for view in (flat, noise) if min(shape) < 10 else (flat,):
        found = detect(view)
        assert found.points.shape == (0, 2) and found.points.dtype == np.float64
        assert found.descriptors.shape == (0, 128) and found.descriptors.dtype == np.float32
        many = described(np.eye(128))
        for a, b in ((found, found), (found, many), (many, found)):
            none = match(a, b)
            assert len(none) == 0 and none.x.shape == none.y.shape == (0, 2)


def test_a_very_long_picture_is_no_obstacle() -> None:
    """SIFT doubles the picture, and OpenCV's pictures end at 32767 pixels."""
    long = np.ascontiguousarray(np.tile(texture(40, 400, 1, 1), (1, 100, 1)))
    found = detect(long, budget=300)
    assert long.shape == (40, 40000, 1) and len(found.points) == 300 and found.points[:, 0].max() > 39000
    assert found.scale > 1


# --- transparent parts ---------------------------------------------------------------------------------------------


def test_nothing_is_found_in_transparent_parts_nor_at_their_edge() -> None:
    view = texture(300, 400, 4).copy()
    alpha = np.ones((300, 400), np.float32)
    alpha[:, :180] = 0
    alpha[100:140, 300:340] = 0
    alpha[200:, 380:] = 0.001  # all but transparent is shown all the same
    view[alpha == 0] = 0  # a hard edge, which must not become the feature
    points = detect(view, alpha).points
    assert len(points) > 300
    assert points[:, 0].min() > 180 + 7
    hole = np.abs(points - (319.5, 119.5)).max(axis=1)
    assert hole.min() > 20 + 7
    assert ((points[:, 0] > 380) & (points[:, 1] > 200)).any()
    assert len(detect(view, np.zeros((300, 400), np.float32)).points) == 0


def test_an_opaque_alpha_changes_nothing() -> None:
    view = texture(300, 400, 4)
    plain, opaque = detect(view), detect(view, np.ones((300, 400), np.float32))
    assert np.array_equal(plain.points, opaque.points)
    assert np.array_equal(plain.descriptors, opaque.descriptors)


def test_the_alpha_of_a_shrunk_picture_lies_where_the_picture_does() -> None:
    view = cv2.resize(texture(240, 320, 2, 1), (2240, 1680), interpolation=cv2.INTER_CUBIC)[..., None]
    alpha = np.ones(view.shape[:2], np.float32)
    alpha[:, :1000] = 0
    found = detect(view, alpha, budget=1000)
    assert found.scale > 1 and len(found.points) > 100
    assert 1000 + 8 < found.points[:, 0].min() < 1000 + 60
    assert found.points[:, 0].max() > 2100


# --- spreading -----------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3000), st.integers(1, 800))
def test_spreading_keeps_the_budget_and_is_repeatable(seed: int, count: int, budget: int) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform((0, 0), (639, 479), (count, 2))
    strength = random.integers(0, 20, count).astype(float)  # many ties
    chosen = spread_evenly(points, strength, (480, 640), budget)
    assert len(chosen) == min(count, budget)
    assert (np.diff(chosen) > 0).all() and chosen.min() >= 0 and chosen.max() < count
    assert np.array_equal(chosen, spread_evenly(points, strength, (480, 640), budget))


def test_a_busy_corner_does_not_starve_the_rest() -> None:
    random = np.random.default_rng(0)
    busy = random.uniform((0, 0), (160, 120), (9000, 2))
    quiet = random.uniform((0, 0), (639, 479), (1500, 2))
    points = np.concatenate([busy, quiet])
    strength = np.concatenate([random.uniform(10, 20, 9000), random.uniform(0, 1, 1500)])
    chosen = points[spread_evenly(points, strength, (480, 640), 800)]
    in_busy = (chosen < (160, 120)).all(axis=1).mean()
    # it has a sixteenth of the area; the strongest 800 would all lie in it
    assert in_busy < 0.12
    counts = np.histogram2d(chosen[:, 0], chosen[:, 1], bins=(4, 3), range=((0, 640), (0, 480)))[0]
    assert counts.min() > 0.75 * counts.mean() and counts.max() < 1.33 * counts.mean()


def test_each_cell_gives_its_strongest_first() -> None:
    # a budget of 8 makes one cell of the whole picture
    random = np.random.default_rng(1)
    points, strength = random.uniform(0, 99, (300, 2)), random.random(300)
    chosen = spread_evenly(points, strength, (100, 100), 8)
    assert set(chosen) == set(np.argsort(-strength)[:8])
    # ties go to the first
    assert spread_evenly(points, np.ones(300), (100, 100), 8).tolist() == list(range(8))


def test_the_budget_holds_and_points_cover_the_picture() -> None:
    found = detect(texture(300, 400, 1), budget=500)
    assert len(found.points) == 500
    counts = np.histogram2d(found.points[:, 0], found.points[:, 1], bins=(4, 3), range=((0, 400), (0, 300)))[0]
    assert counts.min() > 0.5 * counts.mean()


def test_those_that_are_kept_are_described_as_if_all_were() -> None:
    """The descriptors of points found and of points chosen come from two runs of the pyramid."""
    picture = texture(300, 400, 1)
    few, all_of_them = detect(picture, budget=500), detect(picture)
    distance, index = cKDTree(all_of_them.points).query(few.points)
    assert len(few.points) == 500 and len(all_of_them.points) > 1000 and not distance.any()
    # one place may have several orientations, each a descriptor
    same = [
        np.array_equal(few.descriptors[i], all_of_them.descriptors[j])
        for i, place in enumerate(few.points) for j in np.flatnonzero((all_of_them.points == place).all(axis=1))
    ]  # fmt: skip
    assert sum(same) == 500


def test_a_picture_is_shrunk_to_as_many_pixels_as_asked() -> None:
    picture = texture(300, 400, 1)
    whole, shrunk = detect(picture), detect(picture, pixels=300 * 400 // 4)
    assert (whole.scale, shrunk.scale) == (1.0, 2.0) and 0 < len(shrunk.points) < 0.6 * len(whole.points)
    assert shrunk.points[:, 0].max() > 350 and shrunk.points[:, 1].max() > 250


# --- matching ------------------------------------------------------------------------------------------------------


def described(vectors: np.ndarray, points: np.ndarray | None = None) -> Features:
    vectors = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    if points is None:
        points = np.arange(2.0 * len(vectors)).reshape(-1, 2) * 10
    return Features(points, vectors.astype(np.float32), 1.0)


def test_matches_are_mutual_and_pass_the_ratio_test() -> None:
    """Against the definition written out over all pairs, with more points than one slab holds."""
    random = np.random.default_rng(0)
    first = np.abs(random.normal(size=(1300, 128)))
    first[1100:] = first[:200] + 0.2 * random.normal(size=(200, 128))  # two that look like one there: not mutual
    strangers = np.abs(random.normal(size=(300, 128)))
    second = np.concatenate([first[:900] + 0.5 * random.normal(size=(900, 128)), strangers])
    a, b = described(np.abs(first)), described(np.abs(random.permutation(second)))
    distance = np.sqrt(np.maximum(2 - 2 * a.descriptors.astype(float) @ b.descriptors.astype(float).T, 0))
    forward, backward = distance.argmin(axis=1), distance.argmin(axis=0)
    nearest, second = np.sort(distance, axis=1)[:, :2].T
    second_mean = np.sqrt(second * np.sort(distance, axis=0)[1, forward])
    for ratio in (0.9, 0.8):
        clear = nearest < ratio * second_mean
        assert np.abs(nearest - ratio * second_mean).min() > 1e-6  # nothing hangs on rounding
        mutual = backward[forward] == np.arange(len(forward))
        expected = np.flatnonzero(clear & mutual)
        assert 0 < len(expected) < clear.sum() < len(clear)
        found = match(a, b, ratio)
        assert np.array_equal(found.x, a.points[expected]) and np.array_equal(found.y, b.points[forward[expected]])
        back = match_index(b, a, ratio)[:, ::-1]
        assert np.array_equal(back[np.argsort(back[:, 0])], match_index(a, b, ratio))


def test_pictures_match_alike_from_either_of_them() -> None:
    whole = texture(340, 440, 5)
    one, other = (detect(np.ascontiguousarray(part)) for part in (whole[:300, :400], whole[30:330, 25:425, :] // 2))
    there, back = match(one, other), match(other, one)
    assert len(there) > 400
    found, again = np.hstack([there.x, there.y]), np.hstack([back.y, back.x])
    assert np.array_equal(np.unique(found, axis=0), np.unique(again, axis=0))


def test_one_place_with_several_orientations_gives_one_match() -> None:
    random = np.random.default_rng(0)
    vectors = np.abs(random.normal(size=(60, 128)))
    points = np.repeat(random.uniform(0, 500, (30, 2)), 2, axis=0)
    a = described(vectors, points)
    matches = match(a, described(vectors, points + (5, 7)))
    assert len(matches) == 30
    assert len(np.unique(np.hstack([matches.x, matches.y]), axis=0)) == 30
    assert np.allclose(matches.y - matches.x, (5, 7))


@pytest.mark.parametrize("count", [0, 1])
def test_less_than_two_points_cannot_be_told_apart(count: int) -> None:
    few, many = described(np.ones((count, 128))) if count else described(np.empty((0, 128))), described(np.eye(128))
    assert len(match(few, many)) == len(match(many, few)) == 0


def test_a_shifted_picture_matches_itself() -> None:
    whole = texture(340, 440, 5)
    one, other = (detect(np.ascontiguousarray(part)) for part in (whole[:300, :400], whole[30:330, 25:425]))
    matches = match(one, other)
    error = np.linalg.norm(matches.y - matches.x + (25, 30), axis=1)
    assert len(matches) > 500 and np.mean(error < 0.5) > 0.97 and np.median(error) < 0.05


def test_pictures_of_other_things_hardly_match() -> None:
    a, b = detect(texture(300, 400, 1)), detect(texture(300, 400, 99))
    assert len(match(a, b)) < 0.05 * len(a.points)


def test_the_coarser_picture_sets_the_unit_of_the_noise() -> None:
    vectors, points = np.eye(128), np.arange(256.0).reshape(128, 2)
    fine, coarse = (Features(points, vectors.astype(np.float32), scale) for scale in (1.0, 2.5))
    assert match(fine, coarse).scale == match(coarse, fine).scale == 2.5
    assert match(fine, fine).scale == 1.0


def test_subsets_keep_pairs_and_scale() -> None:
    matches = Matches(np.arange(20.0).reshape(10, 2), 100 + np.arange(20.0).reshape(10, 2), 1.7)
    keep = np.arange(10) % 3 == 0
    for chosen in (keep, np.flatnonzero(keep)):
        part = matches.subset(chosen)
        assert len(part) == 4 and part.scale == 1.7
        assert np.array_equal(part.y - part.x, np.full((4, 2), 100)) and np.array_equal(part.x, matches.x[keep])


# --- the same bytes ------------------------------------------------------------------------------------------------


def test_the_number_of_threads_changes_no_byte() -> None:
    view = texture(300, 400, 6)
    before = cv2.getNumThreads()
    results = []
    try:
        for threads in (1, 2, 1):
            cv2.setNumThreads(threads)
            one, other = detect(view), detect(turned(view))
            matches = match(one, other)
            results.append([one.points.tobytes(), one.descriptors.tobytes(), matches.x.tobytes(), matches.y.tobytes()])
    finally:
        cv2.setNumThreads(before)
    assert results[0] == results[1] == results[2]


def test_matching_in_slabs_changes_no_match() -> None:
    """Features on both sides of a slab's border match as in one piece."""
    random = np.random.default_rng(3)
    vectors = np.abs(random.normal(size=(2100, 128)))
    order = random.permutation(2100)
    a, b = described(vectors), described(vectors[order])
    matches = match(a, b)
    assert len(matches) == 2100 and np.array_equal(matches.x, a.points)
    assert np.array_equal(matches.y, b.points[np.argsort(order)])


# --- what matches carry --------------------------------------------------------------------------------------------


def test_matches_carry_their_weights_and_whose_they_are() -> None:
    x = np.arange(20.0).reshape(10, 2)
    plain = Matches(x, x + 1, scale=2.0)
    assert plain.weight is None and not plain.given and np.array_equal(plain.weights, np.ones(10))
    ours = Matches(x, x + 1, 2.0, np.arange(10.0), given=True)
    for keep in (np.arange(10) % 3 == 0, np.array([9, 0, 3])):
        part = ours.subset(keep)
        assert np.array_equal(part.weights, np.arange(10.0)[keep]) and np.array_equal(part.y, x[keep] + 1)
        assert part.given and part.scale == 2.0 and plain.subset(keep).weight is None
    few = ours.thinned(4)
    assert few.weights.tolist() == [0, 3, 6, 9] and few.given and ours.thinned(10) is ours


@pytest.mark.parametrize("stronger", [0, 1])
def test_of_the_last_round_the_strongest_are_taken(stronger: int) -> None:
    """Two cells with twenty points each, of which seventeen are wanted: eight of each and one more of the stronger."""
    random = np.random.default_rng(2)
    cell = np.arange(40) % 2
    points = random.uniform((10, 10), (85, 85), (40, 2)) + np.column_stack([100 * cell, np.zeros(40)])
    strength = random.uniform(0, 1, 40) + 5 * (cell == stronger)
    chosen = spread_evenly(points, strength, (100, 200), 17)
    assert np.bincount(cell[chosen]).tolist() == [9 - stronger, 8 + stronger]
    for one in (0, 1):
        best = np.flatnonzero(cell == one)[np.argsort(-strength[cell == one])]
        assert set(chosen[cell[chosen] == one]) == set(best[: 8 + (one == stronger)])
