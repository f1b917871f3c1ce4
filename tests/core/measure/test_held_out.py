"""Held-out errors: every match is predicted once, by a field that never saw it; and fields can be fitted again."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.choices import FIELDS, LINE_FIELDS
from edf_stitch.core.field.field import Field
from edf_stitch.core.field.options import STRICT
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.measure.held_out import HeldOut, held_out
from edf_stitch.core.measure.metrics import CoverageSamples, look_up
from edf_stitch.core.panorama.warp import build_warp
from edf_stitch.core.rivals.options import HOMOGRAPHY
from edf_stitch.core.system.errors import DegenerateGeometry

SIZE = (400, 300)
Depths = Callable[[np.ndarray], np.ndarray]


def planar(points: np.ndarray) -> np.ndarray:
    return points @ np.array([6e-5, -1e-4]) + 0.12


def curved(points: np.ndarray) -> np.ndarray:
    return 0.12 + 0.04 * np.exp(-((points - (260, 150)) ** 2).sum(axis=-1) / (2 * 70**2))


@pytest.fixture(scope="module")
def camera(by_hand: SimpleNamespace) -> Camera:
    return by_hand.camera(SIZE, 380.0)


@pytest.fixture(scope="module")
def view(by_hand: SimpleNamespace, camera: Camera) -> TwoView:
    return by_hand.view(camera, camera, (2.0, -10, 3), (1, 0.1, 0.15))


def matches_of(view: TwoView, depths: Depths, count: int = 400, noise: float = 0.0, seed: int = 0) -> Matches:
    """Points of the overlap; noise in px of each target coordinate."""
    random = np.random.default_rng(seed)
    x = random.uniform(0, np.array(SIZE) - 1, (8 * count, 2))
    y = target_points(view, x, depths(x))
    seen = ((y > 0) & (y < np.array(SIZE) - 1)).all(axis=1)
    return Matches(x[seen][:count], y[seen][:count] + random.normal(0, noise, (count, 2)))


def fitted(name: str, view: TwoView, matches: Matches) -> Field:
    return fit_field(name, "plane", view, matches, SIZE, SIZE)


def missed(field: Field, matches: Matches) -> np.ndarray:
    return np.linalg.norm(field.predict(matches.x) - matches.y, axis=1)


def overhang(*direction: float) -> CoverageSamples:
    """An overlap around (200, 150), and as much again further in a direction."""
    middle = np.random.default_rng(1).uniform((150, 100), (250, 200), (100, 2))
    points = np.concatenate([middle, middle + 300 * np.array(direction)])
    return CoverageSamples(points, points, np.arange(200) < 100)


RIGHT = overhang(1, 0)
NOWHERE = CoverageSamples(RIGHT.points, RIGHT.target, np.full(200, True))


@dataclass
class Memory:
    """A field that knows by heart what it was fitted to, and is 5 px off everywhere else."""

    known: np.ndarray
    fit: SimpleNamespace
    fitted_to: list[np.ndarray] = field(default_factory=list)

    def refitted(self, matches: Matches) -> Memory:
        self.fitted_to.append(matches.x)
        return Memory(matches.x, self.fit)

    def predict(self, points: np.ndarray) -> np.ndarray:
        known = (points[:, None] == self.known[None]).all(axis=2).any(axis=1)
        return points + np.where(known[:, None], 0.0, (3.0, 4.0))


def remembered(count: int, shown: CoverageSamples, seed: int = 0) -> tuple[HeldOut, np.ndarray, list[set[int]]]:
    """Held-out errors of such a field, the points, and which of them each fit was without."""
    x = np.floor(np.random.default_rng(5).uniform((0, 0), SIZE, (count, 2)) * 8) / 8  # so that sums are exact
    memory = Memory(x, SimpleNamespace(inliers_used=np.full(count, True)))
    found = held_out(memory, Matches(x, x), shown, seed)
    place = {tuple(point): i for i, point in enumerate(x)}
    return found, x, [set(range(count)) - {place[tuple(point)] for point in points} for points in memory.fitted_to]


def test_every_match_is_held_out_once_from_a_fit_that_never_saw_it() -> None:
    found, _, without = remembered(102, RIGHT)
    assert found == HeldOut(5.0, 5.0, 5.0), "a single match seen before would pull the RMS down"
    folds = without[:5]
    assert sorted(len(fold) for fold in folds) == [20, 20, 20, 21, 21] and set.union(*folds) == set(range(102))


def test_folds_are_scattered_and_follow_the_seed() -> None:
    _, x, first = remembered(100, RIGHT)
    assert all(np.ptp(x[sorted(fold)], axis=0).min() > 200 for fold in first[:5]), "no strips, no corners"
    assert remembered(100, RIGHT)[2] == first
    assert remembered(100, RIGHT, seed=1)[2][:5] != first[:5]
    assert remembered(100, RIGHT, seed=1)[2][5] == first[5], "the strip is where it is"


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0.6, -0.8)])
def test_the_strip_is_the_fifth_nearest_to_what_only_the_target_shows(direction: tuple[float, float]) -> None:
    _, x, without = remembered(100, overhang(*direction))
    strip = np.isin(np.arange(100), sorted(without[5]))
    along = x @ np.array(direction)
    # the middle of the samples is that of their square to a few px, hence the direction to a degree
    assert strip.sum() == 20 and along[strip].min() > along[~strip].max() - 8


@pytest.mark.parametrize("shown", [
    NOWHERE, CoverageSamples(*(np.empty((0, 2)),) * 2, np.empty(0, bool)),
    replace(RIGHT, overlap=np.full(200, False)),
    CoverageSamples(np.tile(RIGHT.points, (6, 1)), np.tile(RIGHT.points, (6, 1)), np.arange(1200) < 1189),
], ids=["no overhang", "nothing shown", "no overlap", "a sliver"])  # fmt: skip
def test_without_anything_of_the_targets_own_there_is_no_strip(shown: CoverageSamples) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, _, without = remembered(100, shown)
    assert np.isnan(found.towards_rms_px) and found.rms_px == 5 and len(without) == 5


@pytest.mark.parametrize("name", ["strict", "slack"])
def test_a_clean_plane_is_foretold_exactly(name: str, view: TwoView) -> None:
    matches = matches_of(view, planar, 200)
    found = held_out(fitted(name, view, matches), matches, RIGHT)
    assert max(found.rms_px, found.median_px, found.towards_rms_px) < 1e-6


def test_of_noise_both_components_are_seen(view: TwoView) -> None:
    matches = matches_of(view, planar, 600, noise=0.5)
    found = held_out(fitted("strict", view, matches), matches, RIGHT)
    assert 0.97 < found.rms_px / (0.5 * np.sqrt(2)) < 1.06
    assert found.median_px == pytest.approx(0.5 * np.sqrt(2 * np.log(2)), rel=0.08), "of Rayleigh's distribution"
    assert found.towards_rms_px > found.rms_px / 1.2


def test_an_error_across_the_lines_counts_and_slack_foresees_it(view: TwoView) -> None:
    matches = matches_of(view, planar, 300)
    line = matches.x @ view.F[:2, :2].T + view.F[:2, 2]
    off = Matches(matches.x, matches.y + 2 * line / np.linalg.norm(line, axis=1, keepdims=True))
    assert held_out(fitted("strict", view, off), off, RIGHT).rms_px == pytest.approx(2, abs=0.02)
    assert held_out(fitted("slack", view, off), off, RIGHT).rms_px < 0.2


def test_what_bends_is_harder_to_foretell_beyond_the_matches(view: TwoView) -> None:
    matches = matches_of(view, curved, 300)
    found = held_out(fitted("strict", view, matches), matches, RIGHT)
    assert found.median_px < 0.1 and found.towards_rms_px > 5 * found.rms_px


def test_outliers_that_the_whole_fit_dropped_take_no_part(view: TwoView) -> None:
    clean = matches_of(view, planar, 300, noise=0.2)
    depths = planar(clean.x)
    depths[::20] += 0.1
    moved = np.where((np.arange(300) % 20 == 0)[:, None], target_points(view, clean.x, depths), clean.y)
    field = fitted("strict", view, Matches(clean.x, moved))
    assert not field.fit.inliers_used[::20].any()
    assert held_out(field, Matches(clean.x, moved), RIGHT).rms_px < 0.35


@pytest.mark.parametrize("name", FIELDS)
def test_too_few_or_badly_placed_matches_give_nan_without_a_word(name: str, view: TwoView) -> None:
    # APAP and the meshes of lines begin with the strict field, and so with more matches than they need: never short
    few = matches_of(view, planar, HOMOGRAPHY.min_matches if name == "homography" else STRICT.min_centres)
    # 38 on one line, 8 off it: without the strip only a line is left
    x = np.concatenate([np.column_stack([np.full(38, 100.0), np.linspace(20, 280, 38)]),
                        np.column_stack([np.full(8, 300.0), np.linspace(20, 280, 8)])])  # fmt: skip
    lined = Matches(x, target_points(view, x, planar(x)), given=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = held_out(fitted(name, view, few), few, RIGHT)
        assert name in ("apap", *LINE_FIELDS) or np.isnan([found.rms_px, found.median_px, found.towards_rms_px]).all()
        found = held_out(fitted(name, view, lined), lined, RIGHT)
        assert np.isfinite(found.rms_px) and np.isnan(found.towards_rms_px)


# --- what fields offer for it --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_sends_points_where_its_map_does(name: str, view: TwoView, camera: Camera) -> None:
    matches = matches_of(view, curved, 300, noise=0.3)
    field = fitted(name, view, matches)
    points = matches.x[(np.abs(matches.x - (250, 150)) < (100, 100)).all(axis=1)]
    shown = look_up(build_warp(field, views_of(field.two_view, (camera, camera))), points)
    assert len(points) > 50 and np.abs(field.predict(points) - shown).max() < 0.05


@pytest.mark.parametrize("name", FIELDS)
def test_fitted_again_to_the_same_a_field_is_the_same(name: str, view: TwoView) -> None:
    matches = replace(matches_of(view, curved, 200, noise=0.3), given=True, weight=np.linspace(0.5, 2, 200))
    field = fitted(name, view, matches)
    again = field.refitted(matches)
    assert field.fit.inliers_used.all() and again.fit.inliers_used.all()
    assert np.array_equal(again.fit.smoothing, field.fit.smoothing, equal_nan=True)
    assert again.name == name and np.abs(again.predict(matches.x) - field.predict(matches.x)).max() < 1e-6


@pytest.mark.parametrize("name", FIELDS)
def test_fitted_again_a_field_follows_the_new_matches(name: str, view: TwoView) -> None:
    field = fitted(name, view, matches_of(view, curved, 200))
    new = matches_of(view, lambda x: curved(x) + 0.05, 150, seed=1)
    assert missed(field, new).min() > 5
    again = field.refitted(new)
    # one homography, and a mesh that is held to one, leave what bends: as near as one that never saw the first matches
    within = 0.5 if name not in ("homography", *LINE_FIELDS) else 1.01 * np.median(missed(fitted(name, view, new), new))
    assert len(again.fit.inliers_used) == 150 and np.median(missed(again, new)) < within


def test_matches_on_a_line_refit_nothing(view: TwoView) -> None:
    matches = matches_of(view, planar, 60)
    field = fitted("strict", view, matches)
    lined = replace(matches, x=matches.x * (1, 0))
    with pytest.raises(DegenerateGeometry, match="on a line"):
        field.refitted(lined)
    with pytest.raises(DegenerateGeometry):
        field.refitted(matches.subset(np.arange(STRICT.min_centres - 1)))


@pytest.mark.parametrize("name", ["strict", "slack"])
def test_without_parallax_the_homography_foretells(name: str, view: TwoView) -> None:
    still = replace(view, e_prime=np.zeros(3), F=np.full((3, 3), np.nan), t=np.full(3, np.nan))
    x = matches_of(view, planar, 200).x
    noise = np.random.default_rng(3).normal(0, 0.5, (200, 2))
    matches = Matches(x, target_points(still, x, np.zeros(200)) + noise)
    found = held_out(fitted(name, still, matches), matches, RIGHT)
    assert found.rms_px == pytest.approx(np.sqrt((noise**2).sum(axis=1).mean()), rel=1e-9 if name == "strict" else 0.1)
