"""The last fraction of a pixel: from moves that are nearly right to those that are, on rendered pairs."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.dense import polish as polish_module
from edf_stitch.core.dense.edge_aware_smoothing import edge_weights
from edf_stitch.core.dense.epipolar_lines import EpipolarLines
from edf_stitch.core.dense.matching import ComparedPicture
from edf_stitch.core.dense.polish import Polished, likeness, polish

from ..line_scenes import MOTIONS, SIZE, Scene, scene


def nearly(lines: EpipolarLines, pair: Scene, much: float = 0.4, seed: int = 0) -> np.ndarray:
    """Moves that are off by so many px on average, much the same for neighbours."""
    rng = np.random.default_rng(seed)
    off = cv2.GaussianBlur(rng.normal(size=lines.shape).astype(np.float32), (0, 0), 12)
    return (pair.truth(lines) + off * (much / np.abs(off).mean())).astype(np.float32)


def vivid(picture: np.ndarray) -> np.ndarray:
    """With so much contrast that what it shows outweighs what the search is believed for."""
    return np.clip((picture - picture.mean()) * 2.5 + 128, 0, 255).astype(np.uint8)


def polished(
    pair: Scene, lines: EpipolarLines, along: np.ndarray, slack: bool = False,
    views: tuple[ComparedPicture, ComparedPicture] | None = None,
) -> Polished:
    guide = cv2.resize(pair.reference, lines.shape[::-1], interpolation=cv2.INTER_AREA)
    weights = edge_weights(cv2.GaussianBlur(guide, (0, 0), 1.0).astype(np.float32), 4.0)
    known = np.ones(lines.shape, np.float32)
    return polish(lines, *(views or pair.views(lines.step)), along, known, weights, slack)


def inner(pair: Scene, lines: EpipolarLines) -> np.ndarray:
    """Visible nodes that are no neighbours of the edge between wall and floor, nor of what is not visible."""
    truth = pair.truth(lines)
    second = np.abs(np.gradient(np.gradient(truth, axis=0), axis=0))
    bad = (second > 0.05) | ~pair.visible(lines)
    return cv2.dilate(bad.astype(np.uint8), np.ones((13, 13), np.uint8)) == 0


def off(pair: Scene, lines: EpipolarLines, along: np.ndarray) -> np.ndarray:
    return np.abs(along - pair.truth(lines))[inner(pair, lines)]


@pytest.mark.parametrize("motion", MOTIONS)
def test_most_of_what_is_wrong_goes(motion: str) -> None:
    pair = scene(motion)
    lines = pair.lines(pair.field())
    start = nearly(lines, pair)
    before = np.median(off(pair, lines, start))
    assert inner(pair, lines).mean() > 0.3 and before > 0.3
    found = polished(pair, lines, start)
    assert np.median(off(pair, lines, found.along)) < 0.8 * before
    views = tuple(ComparedPicture.of(vivid(picture), None, 1.0) for picture in (pair.reference, pair.target))
    told = polished(pair, lines, start, views=views)
    assert np.median(off(pair, lines, told.along)) < 0.55 * before
    assert not found.across.any(), "a field that keeps to its lines"


def test_what_is_right_stays_right() -> None:
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    found = polished(pair, lines, pair.truth(lines).astype(np.float32))
    assert np.median(off(pair, lines, found.along)) < 0.06


def test_half_as_many_nodes_do_it_too() -> None:
    pair = scene("sideways")
    lines = pair.lines(pair.field(), 2.0)
    start = nearly(lines, pair)
    views = tuple(ComparedPicture.of(vivid(picture), None, 2.0) for picture in (pair.reference, pair.target))
    found = polished(pair, lines, start, views=views)
    assert views[0].gray.shape == lines.shape == (SIZE[1] // 2, SIZE[0] // 2)
    assert np.median(off(pair, lines, found.along)) < 0.75 * np.median(off(pair, lines, start))


def test_light_that_changes_over_the_picture_does_not_lead_it_away() -> None:
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    start = nearly(lines, pair)
    ramp = np.linspace(0.75, 1.0, SIZE[0])[None, :, None]
    darker = ComparedPicture.of(np.rint(pair.target * ramp * 0.85 + 8).astype(np.uint8), None, 1.0)
    plain = polished(pair, lines, start)
    lit = polished(pair, lines, start, views=(pair.views()[0], darker))
    assert np.median(off(pair, lines, lit.along)) < np.median(off(pair, lines, plain.along)) + 0.05


def test_half_the_contrast_does_not_lead_it_away() -> None:
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    start = nearly(lines, pair)
    flat = ComparedPicture.of((vivid(pair.target) * 0.55 + 60).astype(np.uint8), None, 1.0)
    found = polished(pair, lines, start, views=(ComparedPicture.of(vivid(pair.reference), None, 1.0), flat))
    assert np.median(off(pair, lines, found.along)) < 0.55 * np.median(off(pair, lines, start))


def test_with_slack_an_offset_across_the_lines_is_found_and_else_it_is_left() -> None:
    """As lens distortion and an F that is a little wrong make it."""
    pair = scene("sideways")
    true_lines, missed = pair.lines(pair.field(truth=True)), 0.6
    # the field is told that everything lies 0.6 px to the side of its line
    across = np.median(true_lines.direction.reshape(-1, 2), axis=0)
    shift = (missed * across[1], -missed * across[0])
    lines = pair.lines(pair.field(truth=True, shift=shift))
    start = np.zeros(lines.shape, np.float32)
    here = inner(pair, lines)
    loose = polished(pair, lines, start, slack=True)
    assert np.abs(np.median(loose.across[here]) - missed) < 0.15
    assert loose.across[here].std() < 0.15, "very smooth"
    assert max(np.abs(np.diff(loose.across, axis=k)).max() for k in (0, 1)) < 0.05
    assert np.median(np.abs(loose.along[here])) < 0.12
    strict = polished(pair, lines, start)
    assert not strict.across.any()
    alike, apart = (likeness(lines, *pair.views(), one.along, one.across) for one in (loose, strict))
    assert np.median(alike[here]) > np.median(apart[here])


def test_likeness_says_where_the_pictures_agree() -> None:
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    start, here = pair.truth(lines).astype(np.float32), inner(pair, lines)
    target = pair.target.copy()
    target[:, 100:140] = np.random.default_rng(1).integers(0, 256, (SIZE[1], 40, 3))  # something else stands there
    alpha = np.ones(SIZE[::-1], np.float32)
    alpha[:, :60] = 0
    views = pair.views()[0], ComparedPicture.of(target, alpha, 1.0)
    found = likeness(lines, *views, polished(pair, lines, start, views=views).along)
    x, _ = lines.target(start)
    assert found.max() <= 1.01
    assert np.median(found[here & (x > 150)]) > 0.9
    assert np.median(np.abs(found[(x > 108) & (x < 132)])) < 0.4
    assert not found[(x < 55)].any(), "the target shows nothing"


def test_where_there_is_nothing_to_see_the_search_is_believed() -> None:
    """A gray patch in both pictures."""
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    start = pair.truth(lines).astype(np.float32) + 0.8
    x, y = lines.target(start)
    patch = np.zeros(lines.shape, bool)
    patch[40:110, 70:140] = True
    first, second = pair.reference.copy(), pair.target.copy()
    first[patch] = 128
    there = (y > 2) & (y < SIZE[1] - 3) & (x > 2) & (x < SIZE[0] - 3) & patch
    low, high = (np.array([f(y[there]), f(x[there])]).astype(int) for f in (np.min, np.max))
    second[max(0, low[0] - 4) : high[0] + 5, max(0, low[1] - 4) : high[1] + 5] = 128
    compared = tuple(ComparedPicture.of(one, None, 1.0) for one in (first, second))
    found = polished(pair, lines, start, views=compared)
    middle = np.s_[65:85, 95:115]
    assert np.abs(found.along - start)[middle].max() < 0.3
    assert found.evidence[middle].max() < np.percentile(found.evidence[~patch & pair.visible(lines)], 20)


def test_guesses_do_not_pull_at_what_was_found() -> None:
    """A wrong guess beside a right place, in gray that says nothing of its own and holds together."""
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    blank = ComparedPicture.of(np.full_like(pair.reference, 128), None, 1.0)
    start = np.zeros(lines.shape, np.float32)
    start[:, 100:] = 4.0
    known = np.where(start > 0, np.float32(0.01), np.float32(1))
    weights = np.full((SIZE[1], SIZE[0] - 1), 30, np.float32), np.full((SIZE[1] - 1, SIZE[0]), 30, np.float32)
    even, told = (polish(lines, blank, blank, start, k, weights, False).along for k in (np.ones_like(known), known))
    near = np.s_[20:130, 92:98]
    assert even[near].mean() > 0.3 and told[near].mean() < 0.2 * even[near].mean()


def test_strip_by_strip_it_comes_to_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows reach over the strips' borders; also where the target shows not all."""
    pair = scene("sideways")
    lines = pair.lines(pair.field())
    start = nearly(lines, pair)
    alpha = np.ones(SIZE[::-1], np.float32)
    alpha[50:70, 80:90] = 0
    views = pair.views()[0], ComparedPicture.of(pair.target, alpha, 1.0)
    found = []
    for rows in (1000, 31):
        monkeypatch.setattr(polish_module, "POLISH", replace(polish_module.POLISH, strip_rows=rows))
        one = polished(pair, lines, start, slack=True, views=views)
        found.append((one.along, one.across, one.evidence, likeness(lines, *views, one.along, one.across)))
    for first, second in zip(*found, strict=True):
        np.testing.assert_allclose(first, second, atol=2e-3)


def test_contrast_is_evened_out_by_no_more_than_a_factor_of_two() -> None:
    """What is all but plain in one picture is its noise: that is not blown up to what the other one shows."""
    pair = scene("sideways")
    lines = pair.lines(pair.field(truth=True))
    here, still = inner(pair, lines), np.zeros(lines.shape, np.float32)

    def steepness(faded: float, faded_too: float) -> float:
        """Gray levels per px along the lines that the target is taken to show."""
        first, target = (
            ComparedPicture.of(np.rint(128 + (picture - 128.0) * share).astype(np.uint8), None, 1.0)
            for picture, share in ((pair.reference, faded), (pair.target, faded_too))
        )
        slopes = [cv2.Scharr(target.gray, cv2.CV_32F, 1 - k, k, scale=1 / 32) for k in (0, 1)]
        second = cv2.merge([target.gray, *slopes])
        at_nodes = first.at_nodes(first.gray, lines)
        found = polish_module._compared(lines, *at_nodes, target, second, still, still)
        return float(np.median(np.abs(found.slope[here])))

    usual = steepness(1.0, 1.0)
    assert steepness(1.0, 0.7) == pytest.approx(usual, rel=0.15)
    assert steepness(1.0, 0.1) == pytest.approx(0.2 * usual, rel=0.15)
    assert steepness(0.1, 1.0) == pytest.approx(0.5 * usual, rel=0.15)
