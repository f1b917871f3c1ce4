"""Beyond the overlap: how far canvas points land from the epipolar lines of the target pixels they show."""

from __future__ import annotations

import warnings
from itertools import permutations
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import distance_to_line
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.measure.metrics import CoverageSamples, coverage_samples
from edf_stitch.core.measure.options import INDEPENDENT
from edf_stitch.core.measure.projectivity import eight_point, independent_fundamental, projectivity
from edf_stitch.core.panorama.warp import build_warp

SIZE = (400, 300)
TURNED = ((2.0, -14, 3), (1, 0.1, 0.15))
NO_F = np.full((3, 3), np.nan)


def wall(by_hand: SimpleNamespace, distortion: tuple[float, ...] = ()) -> tuple[TwoView, CoverageSamples]:
    """A slanted wall, seen by two turned cameras."""
    camera = by_hand.camera(SIZE, 380.0, distortion)
    view = by_hand.view(camera, camera, *TURNED)
    warp = build_warp(by_hand.plane_field(6e-5, -1e-4, 0.12), views_of(view, (camera, camera)))
    return view, coverage_samples(warp, (camera, camera))


def level(by_hand: SimpleNamespace) -> tuple[TwoView, CoverageSamples]:
    """Level lines; the target is the same picture moved: it shows 100 columns right of the reference."""
    camera = by_hand.camera(SIZE, 400.0)
    view = by_hand.view(camera, camera, (0, 0, 0), (-1, 0, 0))
    pair = camera, camera
    return view, coverage_samples(build_warp(by_hand.plane_field(0, 0, 0.25), views_of(view, pair)), pair)


def matches_of(view: TwoView, count: int, noise: float = 0.0, wrong: float = 0.0, seed: int = 0) -> Matches:
    """Points at all depths, noise in px of each target coordinate, a share of them chance look-alikes."""
    random = np.random.default_rng(seed)
    x = random.uniform(0, np.array(SIZE) - 1, (8 * count, 2))
    y = target_points(view, x, random.uniform(0.02, 0.3, len(x)))
    seen = ((y > 0) & (y < np.array(SIZE) - 1)).all(axis=1)
    x, y = x[seen][:count], y[seen][:count] + random.normal(0, noise, (count, 2))
    lost = np.arange(count) < wrong * count
    y[lost] = random.uniform(0, np.array(SIZE) - 1, (lost.sum(), 2))
    return Matches(x, y)


@pytest.mark.parametrize("distortion", [(), (-0.15, 0.03)], ids=["ideal lens", "barrel"])
def test_a_plane_through_the_field_stays_on_its_lines(by_hand: SimpleNamespace, distortion: tuple[float, ...]) -> None:
    view, shown = wall(by_hand, distortion)
    assert (~shown.overlap).sum() > 1000
    assert projectivity(view.F, shown) < 1e-3, "what is left is float32"


def test_lines_moved_by_so_much_are_missed_by_so_much(by_hand: SimpleNamespace) -> None:
    view, shown = level(by_hand)
    for px in (0.5, 3.0):
        moved = np.array([[1, 0, 0], [0, 1, px], [0, 0, 1]])  # of the reference: x'ᵀ F (moved p) = 0
        assert projectivity(view.F @ moved, shown) == pytest.approx(px, abs=1e-3)


def test_lines_turned_by_so_much_are_missed_by_so_much(by_hand: SimpleNamespace) -> None:
    view, shown = level(by_hand)
    angle = np.radians(0.5)
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])  # about the reference's pixel (0, 0)
    # columns 400 to 499 are the target's alone; rows 0 to 299: |s x + (c − 1) y| in the mean
    expected = s * 449.5 - (1 - c) * 149.5
    assert projectivity(view.F @ turned, shown) == pytest.approx(expected, rel=0.005)


def test_the_distance_is_the_references_not_the_targets(by_hand: SimpleNamespace) -> None:
    """A target of half the focal length: a pixel of it is two of the reference's."""
    camera, half = by_hand.camera(SIZE, 400.0), by_hand.camera(SIZE, 200.0)
    view = by_hand.view(camera, half, (0, 0, 0), (-1, 0, 0))
    warp = build_warp(by_hand.plane_field(0, 0, 0.25), views_of(view, (camera, half)))
    moved = np.array([[1, 0, 0], [0, 1, 1.0], [0, 0, 1]])
    assert projectivity(moved.T @ view.F, coverage_samples(warp, (camera, half))) == pytest.approx(2, abs=1e-3)


def test_only_what_lies_beyond_the_reference_counts(by_hand: SimpleNamespace) -> None:
    view, shown = wall(by_hand)
    broken = np.where(shown.overlap[:, None], shown.target + (0, 50), shown.target)
    assert projectivity(view.F, CoverageSamples(shown.points, broken, shown.overlap)) < 1e-3


def test_where_it_means_nothing_it_is_nan_without_a_word(by_hand: SimpleNamespace) -> None:
    view, shown = wall(by_hand)
    empty = CoverageSamples(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, bool))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(projectivity(NO_F, shown))
        assert np.isnan(projectivity(view.F, empty))
        covered = CoverageSamples(shown.points, shown.target, np.full(len(shown.points), True))
        assert np.isnan(projectivity(view.F, covered))


# --- the independent F ---------------------------------------------------------------------------------------------


def test_eight_points_give_f_exactly(by_hand: SimpleNamespace) -> None:
    view, _ = wall(by_hand)
    matches = matches_of(view, 60)
    weight = np.ones(60)
    matches.y[7] += 30
    weight[7] = 0.0  # what has no weight has no say
    F = eight_point(matches.x, matches.y, weight)
    assert np.linalg.norm(F) == pytest.approx(1)
    assert np.abs(F - np.sign((F * view.F).sum()) * view.F).max() < 1e-9
    weight[7] = 1.0
    far = distance_to_line(eight_point(matches.x, matches.y, weight), matches.x, matches.y)
    assert np.median(far) > 0.1


def test_of_noisy_points_too_the_lines_meet_in_one_point(by_hand: SimpleNamespace) -> None:
    view, _ = wall(by_hand)
    matches = matches_of(view, 60, noise=2.0)
    values = np.linalg.svd(view.K_prime.T @ eight_point(matches.x, matches.y, np.ones(60)) @ view.K, compute_uv=False)
    assert values[2] < 1e-9 * values[0] < values[1]


def test_the_independent_f_sees_through_noise_and_chance(by_hand: SimpleNamespace) -> None:
    view, shown = wall(by_hand)
    clean = matches_of(view, 500, wrong=0.4)
    assert projectivity(independent_fundamental(clean), shown) < 0.02
    noisy = matches_of(view, 500, noise=0.3, wrong=0.4)
    assert projectivity(independent_fundamental(noisy), shown) < 0.3


def test_the_independent_f_hangs_on_no_draw(by_hand: SimpleNamespace) -> None:
    view, shown = wall(by_hand)
    matches = matches_of(view, 300, noise=0.3, wrong=0.3)
    found = [projectivity(independent_fundamental(matches, seed), shown) for seed in range(6)]
    assert np.ptp(found) < 0.05
    cv2.setRNGSeed(12345)  # somebody else's business
    assert projectivity(independent_fundamental(matches, 3), shown) == found[3]


def test_of_several_draws_the_one_that_explains_most_counts(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two motions in one pair, of which a draw may find either, or nothing."""
    view, shown = wall(by_hand)
    camera = by_hand.camera(SIZE, 380.0)
    other = by_hand.view(camera, camera, (-3.0, -10, -2), (0.3, 1, 0))
    most, few = matches_of(view, 120), matches_of(other, 80, seed=1)
    both = Matches(np.concatenate([few.x, most.x]), np.concatenate([few.y, most.y]))
    for draws in permutations((view.F, other.F, None, np.vstack([other.F] * 3), other.F)):
        draw = iter(draws)
        monkeypatch.setattr(cv2, "findFundamentalMat", lambda *_, draw=draw: (next(draw), None))
        assert projectivity(independent_fundamental(both), shown) < 0.02


def test_an_f_that_is_off_is_found_out(by_hand: SimpleNamespace) -> None:
    """The point of the second opinion: a warp on its own lines is perfect by its own F, whatever that is."""
    view, _ = wall(by_hand)
    camera = by_hand.camera(SIZE, 380.0)
    (omega, t) = TURNED
    wrong = by_hand.view(camera, camera, (omega[0] + 1.0, *omega[1:]), t)
    warp = build_warp(by_hand.plane_field(6e-5, -1e-4, 0.12), views_of(wrong, (camera, camera)))
    shown = coverage_samples(warp, (camera, camera))
    independent = independent_fundamental(matches_of(view, 400, noise=0.2))
    assert projectivity(wrong.F, shown) < 1e-3 and projectivity(independent, shown) > 2


def test_matches_that_determine_no_f(by_hand: SimpleNamespace) -> None:
    view, _ = wall(by_hand)
    enough = matches_of(view, INDEPENDENT.min_matches)
    for count in (INDEPENDENT.min_matches - 1, 5, 0):
        assert np.isnan(independent_fundamental(enough.subset(np.arange(count)))).all()
    assert np.isfinite(independent_fundamental(enough)).all()
    random = np.random.default_rng(2)
    chance = Matches(random.uniform(0, 300, (20, 2)), random.uniform(0, 300, (20, 2)))
    assert np.isnan(independent_fundamental(chance)).all()
    same = Matches(np.full((30, 2), 5.0), np.full((30, 2), 7.0))
    assert independent_fundamental(same).shape == (3, 3), "no crash, whatever it says"
