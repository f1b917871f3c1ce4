"""Where along their lines things are sought and found: rendered pairs whose depth is known, around a field that is
wrong by some px."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.dense import matching
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.matching import ComparedPicture, in_tones_of, search, search_base
from edf_stitch.core.dense.options import MATCHING
from edf_stitch.core.field.transfer import target_points

from ..line_scenes import MARGIN, MOTIONS, SIZE, Field, Scene, scene

REACH = 40.0


# --- views ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1.0, 2.0, 2.6])
def test_a_view_is_asked_at_px_of_the_full_picture(step: float) -> None:
    x, y = np.meshgrid(np.arange(120.0), np.arange(90.0))
    view = ComparedPicture.of((40 + x + 0.5 * y).astype(np.uint8)[..., None], None, step)
    assert view.size == (120, 90) and view.gray.shape == (round(90 / step), round(120 / step))
    at = np.float32(np.linspace(12, 100, 40))[None], np.float32(np.linspace(10, 75, 40))[None]
    found, shown = view.sample(view.gray, *at)
    assert shown.all() and np.abs(found - (40 + at[0] + 0.5 * at[1] - 0.25)).max() < 0.5


@pytest.mark.parametrize("covered", [False, True])
def test_at_the_nodes_it_shows_what_it_shows_there(covered: bool) -> None:
    """Pixel by pixel, and between pixels."""
    pair = scene("sideways")
    alpha = (np.arange(SIZE[1])[:, None] + np.zeros(SIZE[0]) < 90).astype(np.float32) if covered else None
    for box, step in (((12, 20, 100, 80), 1.0), ((12, 20, 100, 80), 2.0)):
        lines = EpipolarLines.over(pair.field(), box, step)
        for view in (ComparedPicture.of(pair.reference, alpha, 1.0), ComparedPicture.of(pair.reference, alpha, 2.0)):
            found, shown = view.at_nodes(view.gray, lines)
            expected, seen = view.sample(view.gray, *lines.nodes)
            assert np.array_equal(shown, seen) and np.abs(found - expected).max() < 1e-3 and found.shape == lines.shape


def test_colours_become_gray_as_the_eye_weighs_them() -> None:
    view = ComparedPicture.of(np.full((8, 9, 3), (200, 100, 50), np.uint8), None, 1.0)
    assert np.abs(view.gray - (0.299 * 200 + 0.587 * 100 + 0.114 * 50)).max() <= 1 and view.shown is None


@pytest.mark.parametrize("step", [1.0, 2.0])
def test_nothing_is_shown_outside_nor_where_there_is_no_picture(step: float) -> None:
    alpha = np.ones((40, 60), np.float32)
    alpha[:, 40:] = 0
    view = ComparedPicture.of(np.full((40, 60, 3), 99, np.uint8), alpha, step)
    x = np.array([[-3, 10, 38.0 - step, 39.2 + step, 50, 63, 10, 10, np.nan]], np.float32)
    y = np.array([[10, 10, 10, 10, 10, 10, -3, 43, 10]], np.float32)
    found, shown = view.sample(view.gray, x, y)
    assert shown.tolist() == [[False, True, True, False, False, False, False, False, False]]
    assert np.isfinite(found).all()


def test_tones_follow_the_curve_between_the_pictures() -> None:
    """Whatever monotone curve it is, and what only one of them shows has no say."""
    first = cv2.GaussianBlur(np.random.default_rng(2).random((120, 160)).astype(np.float32) * 255, (0, 0), 2)
    first = (first - first.min()) / (first.max() - first.min()) * 200 + 20
    second = (255 * (first / 255) ** 0.5 * 0.8 + 10).astype(np.float32)
    both = np.ones(first.shape, bool)
    both[:, :40] = False
    second[:, :30] = 255
    first, second = np.rint(first).astype(np.uint8), np.rint(second * MATCHING.sublevels).astype(np.uint16)
    found = in_tones_of(first, second, both)
    wrong = np.abs(found.astype(int) - first)[both]
    assert wrong.max() <= 4 and wrong.mean() < 0.1, "between the levels of 8 bits, too"
    unknown = in_tones_of(first, second, np.zeros(first.shape, bool))
    assert np.array_equal(unknown, np.rint(second / MATCHING.sublevels)), "nothing is known of the curve"
    coloured = in_tones_of(
        np.stack([first, 255 - first], -1), np.stack([second, 255 * MATCHING.sublevels - second], -1), both
    )  # fmt: skip
    assert np.array_equal(coloured[..., 0], found) and np.abs(coloured[..., 1] - 255.0 + first)[both].max() <= 4


# --- the search -----------------------------------------------------------------------------------------------------


def searched(
    pair: Scene, step: float = 1.0, target: ComparedPicture | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far off the moves are (h, w) px, where something was found, and where something is to be found."""
    field = pair.field()
    lines = pair.lines(field)
    views = pair.views(step)
    along, counts = search(lines, field, views[0], target or views[1], step, REACH)
    assert along.shape == counts.shape == lines.shape and not along[counts == 0].any()
    return along - pair.truth(lines), counts == 1, pair.visible(lines)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("step", [1.0, 1.5])
def test_it_finds_what_is_to_be_found(motion: str, step: float) -> None:
    pair = scene(motion)
    off, found, visible = searched(pair, step)
    wrong = np.abs(pair.truth(pair.lines(pair.field())))[visible]
    assert np.median(wrong) > 0.7 and wrong.max() > 4, "else there is nothing to seek"
    assert found[visible].mean() > 0.5
    assert (np.abs(off[found & visible]) < step).mean() > 0.9
    assert np.median(np.abs(off[found & visible])) < 0.35 * step


def test_another_exposure_changes_little() -> None:
    pair = scene("sideways")
    off, found, visible = searched(pair)
    dark = ComparedPicture.of(np.rint(255 * (pair.target / 255.0) ** 1.6 * 0.7).astype(np.uint8), None, 1.0)
    off_dark, found_dark, _ = searched(pair, target=dark)
    assert found_dark[visible].mean() > 0.85 * found[visible].mean()
    assert np.median(np.abs(off_dark[found_dark & visible])) < np.median(np.abs(off[found & visible])) + 0.1


def test_colours_tell_what_gray_does_not() -> None:
    """A picture whose gray is the same everywhere: red against green."""
    pair = scene("sideways")
    field = pair.field()
    lines = pair.lines(field)

    def isoluminant(picture: np.ndarray) -> np.ndarray:
        red = picture[..., 0].astype(np.float32)
        return np.rint(np.stack([red, (140 - 0.299 * red) / 0.587, np.full_like(red, 40)], axis=-1)).astype(np.uint8)

    views = tuple(ComparedPicture.of(isoluminant(picture), None, 1.0) for picture in (pair.reference, pair.target))
    assert views[0].gray.std() < 1.0
    along, counts = search(lines, field, *views, 1.0, REACH)
    good = (counts == 1) & pair.visible(lines)
    assert good.mean() > 0.4 and (np.abs(along - pair.truth(lines))[good] < 1).mean() > 0.9


def test_a_gray_picture_is_sought_in_a_coloured_one() -> None:
    pair = scene("sideways")
    gray = cv2.cvtColor(pair.target, cv2.COLOR_RGB2GRAY)[..., None]
    off, found, visible = searched(pair, target=ComparedPicture.of(gray, None, 1.0))
    assert found[visible].mean() > 0.5 and (np.abs(off[found & visible]) < 1).mean() > 0.9


def test_what_noise_hides_at_full_size_is_found_at_half_and_counts_less() -> None:
    pair = scene("sideways")
    field = pair.field()
    lines = pair.lines(field)
    rng = np.random.default_rng(3)
    noisy = (np.clip(p + rng.normal(0, 25, p.shape), 0, 255).astype(np.uint8) for p in (pair.reference, pair.target))
    along, counts = search(lines, field, *(ComparedPicture.of(p, None, 1.0) for p in noisy), 1.0, REACH)
    guessed = (counts > 0) & (counts < 1) & pair.visible(lines)
    assert guessed.mean() > 0.05 and np.isclose(counts[guessed], MATCHING.coarse_confidence).mean() > 0.6
    assert (np.abs(along - pair.truth(lines))[guessed] < 3).mean() > 0.6


def test_what_a_picture_does_not_show_is_not_found() -> None:
    """Transparent: the target's left half, and a corner of the reference."""
    pair = scene("sideways")
    field = pair.field()
    lines = pair.lines(field)
    first, second = (np.ones(SIZE[::-1], np.float32) for _ in range(2))
    first[:60, -60:] = 0
    second[:, :100] = 0
    views = ComparedPicture.of(pair.reference, first, 1.0), ComparedPicture.of(pair.target, second, 1.0)
    along, counts = search(lines, field, *views, 1.0, REACH)
    found = counts > 0
    x, _ = lines.target(along)
    assert found.mean() > 0.1 and not found[:60, -60:].any()
    assert x[found].min() > 98.5


def test_no_further_than_it_is_told() -> None:
    pair = scene("sideways")
    field = SparseMap.over_reference(
        Field(lambda points: pair.depth(points) + 0.25), pair.view, *pair.cameras, MARGIN
    )  # some fifty px off everywhere
    lines = pair.lines(field)
    right = np.abs(pair.truth(lines))
    along, counts = search(lines, field, *pair.views(), 1.0, 8.0)
    found = counts > 0
    assert np.median(right) > 25 and np.abs(along).max() < 24, "half the size looks twice as far"
    far, counts_far = search(lines, field, *pair.views(), 1.0, 64.0)
    found_far = counts_far > 0
    good = np.abs(far - pair.truth(lines)) < 1
    assert (good & found_far).mean() > 0.2 and (found & (np.abs(along - pair.truth(lines)) < 1)).mean() < 0.02


# --- around which field ---------------------------------------------------------------------------------------------


def test_it_searches_around_the_smoothest_field_that_will_do() -> None:
    """A thing 60 px wide that is some 30 px off the plane: seen over, where so much can be searched, else followed."""
    pair = scene("sideways")
    m = pair.plane

    def depth(points: np.ndarray) -> np.ndarray:
        return points @ m[:2] + m[2] + 0.12 * np.exp(-((points - (100, 75)) ** 2).sum(axis=-1) / (2 * 25.0**2))

    field = SparseMap.over_reference(Field(depth), pair.view, *pair.cameras, MARGIN)
    x = np.random.default_rng(5).uniform((4, 4), (SIZE[0] - 5, SIZE[1] - 5), (400, 2))
    matches = Matches(x, target_points(pair.view, x, depth(x)))

    def bend(base: SparseMap) -> float:
        plane = SparseMap.over_reference(Field(lambda p: p @ m[:2] + m[2]), pair.view, *pair.cameras, MARGIN)
        return float(np.abs(base.inverse_depth - plane.inverse_depth).max())

    bases = [search_base(field, matches, m, most) for most in (200.0, 18.0, 0.0)]
    assert bend(bases[0][0]) < bend(bases[1][0]) < bend(bases[2][0]) + 1e-9
    assert bases[2][0] is field, "nothing will do: the field as it is"
    for (base, reach), most in zip(bases[:2], (200.0, 18.0), strict=True):
        lines = pair.lines(base)
        move = np.abs((depth(lines.ideal) - lines.inverse_depth) / lines.depth_per_px)
        assert reach <= most and np.percentile(move, 99) <= reach, "what it leaves lies within the search"


def test_a_few_matches_that_are_wrong_do_not_widen_the_search() -> None:
    pair = scene("sideways")
    field = pair.field(truth=True)
    x = np.random.default_rng(6).uniform((4, 4), (SIZE[0] - 5, SIZE[1] - 5), (600, 2))
    y = target_points(pair.view, x, pair.depth(x))
    _, reach = search_base(field, Matches(x, y), pair.plane, 1e9)
    spoiled = y.copy()
    spoiled[:2] += 300
    _, reach_too = search_base(field, replace(Matches(x, y), y=spoiled), pair.plane, 1e9)
    assert reach_too == pytest.approx(reach, rel=0.3)


def test_matching_band_by_band_finds_what_matching_at_once_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """The costs of all rows at once may be gigabytes."""
    random = np.random.default_rng(8)
    wide = cv2.GaussianBlur(random.normal(size=(400, 300)), (0, 0), 1.5)
    wide = np.clip(128 + 90 * wide / wide.std(), 0, 255)
    rows = np.arange(400)[:, None]
    moved = np.rint(4 + 3 * np.sin(rows / 40) + 2 * (rows > 215)).astype(int)
    first = wide[:, 20:260].astype(np.uint8)
    second = np.take_along_axis(wide, np.arange(20, 260) + moved, axis=1).astype(np.uint8)
    at_once, sure = matching._matched(first, second, -16, 32)
    assert sure.mean() > 0.8
    heights: list[int] = []
    create = cv2.StereoSGBM_create

    def watched(**options: int) -> SimpleNamespace:
        matcher = create(**options)
        return SimpleNamespace(compute=lambda a, b: heights.append(len(a)) or matcher.compute(a, b))

    monkeypatch.setattr(matching, "MATCHING", replace(matching.MATCHING, costs_at_once=50 * 240 * 32))
    monkeypatch.setattr(cv2, "StereoSGBM_create", watched)
    banded, sure_too = matching._matched(first, second, -16, 32)
    assert len(heights) == 8 and max(heights) == 50 + 2 * MATCHING.band_margin_rows
    assert (sure != sure_too).mean() < 0.01 and (np.abs(at_once - banded)[sure & sure_too] > 0.5).mean() < 0.002


def test_the_costs_of_half_the_size_go_before_those_of_the_full_size_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """glibc's heap keeps what is freed, and larger costs do not fit there: both would be resident."""
    events: list[str] = []
    compute, given_back = matching._matched, matching.give_back
    monkeypatch.setattr(matching, "_matched", lambda *asked: events.append("costs") or compute(*asked))
    monkeypatch.setattr(matching, "give_back", lambda: events.append("given back") or given_back())
    searched(scene("sideways"))
    assert events == ["costs", "given back", "costs"]


def test_it_looks_as_far_as_it_is_told() -> None:
    """OpenCV looks at 16 places more, or not: what is just within reach must not be what it leaves out."""
    pair = scene("sideways")
    field = SparseMap.over_reference(
        Field(lambda points: pair.depth(points) + 0.05), pair.view, *pair.cameras, MARGIN
    )  # some ten px off everywhere
    lines = pair.lines(field)
    along, counts = search(lines, field, *pair.views(), 1.0, 12.0)
    right = pair.truth(lines)
    within = (np.abs(right) > 8.5) & (np.abs(right) < 12) & pair.visible(lines)
    assert within.sum() > 2000, "else there is nothing to seek"
    assert ((counts > 0) & (np.abs(along - right) < 1))[within].mean() > 0.4


@pytest.mark.parametrize(("far_rows", "reach"), [(2, True), (20, False), (0, False)])
def test_it_searches_further_where_a_few_points_are_found_further_away(far_rows: int, reach: bool) -> None:
    """Not where many are: then something else is wrong. What is found in a plain part does not count."""
    textured = np.random.default_rng(3).integers(0, 256, (100, 100)).astype(np.uint8)
    disparity = np.full((100, 100), 3, np.float32)
    disparity[:far_rows] = 27
    found = np.ones(disparity.shape, bool)
    least, count = matching._range(textured, disparity, found, 32)
    assert (least, least + count) == ((-16, 32) if reach else (-16, 16))
    assert matching._range(np.full_like(textured, 90), disparity, found, 32) == (-16, 32)
    assert count % 16 == 0


def test_at_the_rim_nothing_is_found_far_away(monkeypatch: pytest.MonkeyPatch) -> None:
    both = np.ones((120, 300), bool)
    inside = matching._inside(both)
    assert not inside[:, :6].any() and not inside[:6].any() and inside[7:-7, 7:-7].all()
    pair = scene("sideways")
    field = pair.field()
    lines = pair.lines(field)

    def everywhere(a: np.ndarray, *_: int) -> tuple[np.ndarray, np.ndarray]:
        return np.full(a.shape[:2], 1.5 * REACH, np.float32), np.ones(a.shape[:2], bool)

    def far() -> np.ndarray:
        return search(lines, field, *pair.views(), 1.0, REACH)[1] > 0

    monkeypatch.setattr(matching, "_matched_at_half", everywhere)
    monkeypatch.setattr(matching, "_matched", everywhere)
    found = far()
    monkeypatch.setattr(matching, "_inside", np.ones_like)
    all_found = far()
    assert 0.3 < found.sum() / all_found.sum() < 0.8 and not (found & ~all_found).any()
    first, last = np.flatnonzero(all_found.any(axis=0))[[0, -1]]
    assert not found[:, : first + 3].any() and not found[:, last - 3 :].any()


def _painted(picture: np.ndarray, x: np.ndarray, y: np.ndarray, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Some of a picture (h, w, 1) where its pixels are seen, px x and y (h, w), and the mask of where that is."""
    out, weight = np.zeros(picture.shape, np.float32), np.zeros(picture.shape, np.float32)
    for down in np.linspace(-0.5, 0.5, 3):
        for across in np.linspace(-0.5, 0.5, 3):
            column, row = np.rint(x[some] + across).astype(int), np.rint(y[some] + down).astype(int)
            inside = (column >= 0) & (row >= 0) & (column < out.shape[1]) & (row < out.shape[0])
            np.add.at(out, (row[inside], column[inside]), picture[some][inside].astype(np.float32))
            np.add.at(weight, (row[inside], column[inside]), np.float32(1))
    return np.rint(out / np.maximum(weight, 1)).astype(np.uint8), weight > 0
