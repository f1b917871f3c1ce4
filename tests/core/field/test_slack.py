"""Slack: nothing where matches lie on their lines, the smooth rest where they do not, nothing outside the overlap."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import distance_to_line
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.field.options import STRICT
from edf_stitch.core.field.slack import SlackField, _on_matches, fit_slack
from edf_stitch.core.field.strict import StrictField, fit_strict
from edf_stitch.core.field.transfer import inverse_depths, target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.warp import Warp, build_map
from edf_stitch.core.raster.grid import Grid

from .test_strict import SIDE, SIZE, VIEWS, curved, every_view, planar, some_matches

CAMERAS = (Camera(SIDE.K, SIZE, "test", 0.0), Camera(SIDE.K_prime, SIZE, "test", 0.0))


def bent(points: np.ndarray) -> np.ndarray:
    """What a lens of unknown distortion might do to target pixels (…, 2): up to two px, quadratic over the picture."""
    u = (points - (600, 450)) / (600, 450)
    return np.stack([0.3 * u[..., 0] * u[..., 1], 2.0 * u[..., 0] ** 2 - 1.2 * u[..., 1] ** 2], axis=-1)


def slack_of(two_view: TwoView, matches: Matches) -> tuple[StrictField, SlackField]:
    strict = fit_strict(two_view, matches, SIZE, SIZE)
    return strict, fit_slack(strict, matches)


@pytest.fixture(scope="module")
def distorted() -> tuple[StrictField, SlackField]:
    """A hill, exact matches, and a distortion that nobody knows of."""
    x, y, _ = some_matches(SIDE, curved, 400)
    return slack_of(SIDE, Matches(x, y + bent(x)))


@every_view
def test_where_matches_lie_on_their_lines_it_is_the_strict_field(two_view: TwoView) -> None:
    x, y, _ = some_matches(two_view, planar)
    strict, slack = slack_of(two_view, Matches(x, y))
    grid = Grid.over(-200, -100, 1600, 1100)
    ours, theirs = slack.on_grid(grid), strict.on_grid(grid)
    # the two may be summed up in another order, in float32; a unit of depth is a thousand px
    assert theirs.shift is None and 1000 * np.abs(ours.inverse_depth - theirs.inverse_depth).max() < 1e-3
    assert ours.shift is not None and ours.shift.shape == (grid.rows, grid.columns, 2)
    assert np.abs(ours.shift).max() < 1e-4
    assert np.abs(slack.predict(x) - y).max() < 1e-5 and slack.name == "slack"
    assert np.array_equal(slack.plane, strict.plane) and slack.fit is strict.fit


def test_errors_along_the_lines_never_lead_off_them() -> None:
    """Half a pixel of noise along the lines only; a tenth of it may be smooth enough to be taken for slack."""
    x, y, d = some_matches(SIDE, curved, 400)
    _, sensitivity = inverse_depths(SIDE, x, y)
    y = target_points(SIDE, x, d + 0.5 * np.random.default_rng(3).normal(size=len(x)) / sensitivity)
    strict, slack = slack_of(SIDE, Matches(x, y))
    probe, _, _ = some_matches(SIDE, curved, 400, seed=9)
    moved = np.linalg.norm(slack.predict(probe) - strict.predict(probe), axis=1)
    assert np.sqrt((moved**2).mean()) < 0.1
    assert distance_to_line(SIDE.F, probe, slack.predict(probe)).max() < 0.005


def test_it_takes_up_what_is_smooth_and_off_the_lines(distorted: tuple[StrictField, SlackField]) -> None:
    strict, slack = distorted
    probe, y, _ = some_matches(SIDE, curved, 400, seed=9)
    true = y + bent(probe)
    missed, caught = (np.linalg.norm(field.predict(probe) - true, axis=1) for field in (strict, slack))
    assert missed.max() > 1.5 and np.sqrt((missed**2).mean()) > 0.5, "the lines alone cannot follow"
    assert caught.max() < 0.2 and np.sqrt((caught**2).mean()) < 0.05


def test_the_whole_overlap_is_mended_not_its_matches_only(distorted: tuple[StrictField, SlackField]) -> None:
    """Also between and beside the matches, as far as the overlap goes, in the map that is fetched through."""
    strict, slack = distorted
    warp, points, both = overlap_of(slack)
    true = target_points(SIDE, points, curved(points)) + bent(points)
    error = np.linalg.norm(np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1) - true, axis=-1)[both]
    assert both.sum() > 300_000 and np.median(error) < 0.03
    assert np.percentile(error, 95) < 0.2


def test_it_is_at_least_ten_times_smoother_than_the_strict_spline() -> None:
    """A smoothing spline leaves 8πλ D w of what it was given: λ can be read off what each match keeps."""
    x, y, _ = some_matches(SIDE, curved, 400)
    weight = np.random.default_rng(0).uniform(0.3, 3, len(x))
    for matches in (Matches(x, y + bent(x)), Matches(x, y + bent(x), weight=weight)):
        strict, slack = slack_of(SIDE, matches)
        kept = matches.subset(strict.fit.inliers_used)
        left = across(slack.predict(kept.x), kept.y - slack.predict(kept.x))
        w = across(slack.predict(kept.x), slack.spline.weights) / kept.weights
        share = np.sum(left * w) / np.sum(w * w) / (8 * np.pi)
        assert share == pytest.approx(slack.smoothing, rel=0.01) and slack.smoothing >= 9.99 * strict.fit.smoothing


def across(sent: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """How far (N,) moves of target pixels lead off their lines."""
    lines = np.cross(np.column_stack([sent, np.ones(len(sent))]), SIDE.e_prime)[:, :2]
    return np.sum(moves * lines, axis=1) / np.linalg.norm(lines, axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_is_no_reason_to_leave_the_lines(seed: int) -> None:
    x, y, _ = some_matches(SIDE, curved, 400)
    _, slack = slack_of(SIDE, Matches(x, y + np.random.default_rng(seed).normal(0, 0.5, y.shape)))
    grid = Grid.over(0, 0, *SIZE)
    assert np.abs(slack.on_grid(grid).shift).max() < 0.1


def test_it_is_as_stiff_as_the_noise_asks_for() -> None:
    """The more noise the stiffer, and much nearer to the truth than any one λ would be."""
    x, y, _ = some_matches(SIDE, curved, 400)
    probe, true, _ = some_matches(SIDE, curved, 400, seed=9)
    stiffness = []
    for noise in (0.05, 1.0):
        matches = Matches(x, y + bent(x) + np.random.default_rng(1).normal(0, noise, y.shape))
        strict, slack = slack_of(SIDE, matches)
        stiffness.append(slack.smoothing)
        fields = slack, _on_matches(strict, matches, 1e-6), _on_matches(strict, matches, 10.0)
        off, soft, stiff = (
            np.abs(across(f.predict(probe), true + bent(probe) - f.predict(probe))).mean() for f in fields
        )
        assert off < soft / 2 and off < stiff / 2
    assert stiffness[0] < stiffness[1] < np.inf


def test_away_from_matches_the_lines_are_left_no_further_than_twice_what_matches_ask_for() -> None:
    x, y, _ = some_matches(SIDE, curved, 400)
    _, slack = slack_of(SIDE, Matches(x, y + bent(x)))
    asked = np.linalg.norm(slack.spline.at(x), axis=1)
    assert slack.slack_px == pytest.approx(2 * np.percentile(asked, 98), rel=0.01)
    points = np.stack(np.meshgrid(np.linspace(-2500, 3700, 9), np.linspace(-2500, 3700, 9)), axis=-1).reshape(-1, 2)
    moved = np.linalg.norm(slack.predict(points) - slack.strict.predict(points), axis=1)
    unbounded, seen = np.linalg.norm(slack.spline.at(points), axis=1), np.isfinite(moved)
    assert seen.any() and (unbounded[seen] > 1.3 * slack.slack_px).any()
    assert moved[seen] == pytest.approx(np.minimum(unbounded, slack.slack_px)[seen])


def test_heavy_matches_count_for_more() -> None:
    x, y, _ = some_matches(SIDE, planar, 200)
    there = np.argmin(np.linalg.norm(x - (750, 450), axis=1))
    wrong = y + bent(x)
    wrong[there, 1] += 1.5
    pulls = []
    for heavy in (0.1, 1.0, 10.0):
        weight = np.ones(len(x))
        weight[there] = heavy
        strict, slack = slack_of(SIDE, Matches(x, wrong, weight=weight))
        assert strict.fit.inliers_used[there]
        pulls.append(np.linalg.norm((slack.predict(x) - y - bent(x))[there]))
    assert pulls[0] < pulls[1] < pulls[2] and pulls[2] > 2 * pulls[0]


# --- how it ends ----------------------------------------------------------------------------------------------------


def overlap_of(field: StrictField | SlackField) -> tuple[Warp, np.ndarray, np.ndarray]:
    """The map around the reference, its points (…, 2), and where both pictures show something."""
    warp = build_map(field, views_of(SIDE, CAMERAS), Canvas(1240, 940, (20, 20)))
    points = np.stack(np.meshgrid(np.arange(-20.0, 1220), np.arange(-20.0, 920)), axis=-1)
    within = (points >= 0).all(axis=-1) & (points <= np.array(SIZE) - 1).all(axis=-1)
    return warp, points, within & warp.maps[1].inside()


def test_far_outside_the_overlap_nothing_of_it_is_left(distorted: tuple[StrictField, SlackField]) -> None:
    strict, slack = distorted
    grid = Grid((-1600, -1200), 16, 275, 206)
    values, plain = slack.on_grid(grid), strict.on_grid(grid)
    assert values.shift is not None
    assert 1000 * np.abs(values.inverse_depth - plain.inverse_depth).max() < 1e-3
    target = target_points(SIDE, grid.points, plain.inverse_depth)
    inside = (grid.points >= 0).all(axis=-1) & (grid.points <= np.array(SIZE) - 1).all(axis=-1)
    inside &= (target >= 0).all(axis=-1) & (target <= np.array(SIZE) - 1).all(axis=-1)
    distance = grid.step * cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    far = distance > slack.fade_px + 3 * grid.step
    assert far.mean() > 0.1 and inside.mean() > 0.03
    assert not values.shift[far].any(), "exactly nothing"
    whole = slack.spline.on_axes(grid.xs, grid.ys)
    assert np.abs(values.shift - whole)[inside].max() < 1e-4 and np.abs(whole[inside]).max() > 1.5
    # between the two it only ever gets less
    assert (np.abs(values.shift) <= np.abs(whole) + 1e-4).all()


def test_the_fade_of_slack_has_no_seam(distorted: tuple[StrictField, SlackField]) -> None:
    _, slack = distorted
    grid = Grid((-1600, -1200), 8, 550, 412)
    shift, whole = slack.on_grid(grid).shift, slack.spline.on_axes(grid.xs, grid.ys)
    assert shift is not None
    for axis in (0, 1):
        near = np.maximum(*(np.abs(np.take(whole, range(k, whole.shape[axis] - 1 + k), axis=axis)) for k in (0, 1)))
        # the slope of the fade is 3/2 over its width; the distance may step by √2 cells where the fade moves by one
        allowed = np.abs(np.diff(whole, axis=axis)) + 1.5 * np.sqrt(2) * grid.step / slack.fade_px * near
        assert (np.abs(np.diff(shift, axis=axis)) <= allowed + 1e-4).all()


# --- in the map -----------------------------------------------------------------------------------------------------


def test_the_map_is_the_strict_one_and_slack_on_top(distorted: tuple[StrictField, SlackField]) -> None:
    """x' = π(H_inf p + d e') + s(p) with the inverse depth that the warp exports."""
    strict, slack = distorted
    warp, points, both = overlap_of(slack)
    mapped = np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1).astype(float)
    base = target_points(SIDE, points, warp.inverse_depth.astype(float))
    inner = cv2.erode(both.astype(np.uint8), np.ones((41, 41), np.uint8))
    probe = tuple(part[::7] for part in np.nonzero(inner))
    s = slack.spline.at(points[probe])
    assert np.abs(s).max() > 1.5
    # between nodes 7 px apart s is interpolated; it bends by 2 px over 600
    assert np.abs(mapped[probe] - base[probe] - s).max() < 0.005
    assert distance_to_line(SIDE.F, points[probe], mapped[probe]).max() > 1.5
    assert distance_to_line(SIDE.F, points[probe], mapped[probe] - s).max() < 0.005
    other = overlap_of(strict)[0]
    assert 1000 * np.abs(other.inverse_depth - warp.inverse_depth).max() < 1e-3
    mapped = np.stack([other.maps[1].x, other.maps[1].y], axis=-1)
    seen = np.isfinite(mapped[..., 0])
    assert distance_to_line(SIDE.F, points[seen], mapped[seen]).max() < 1e-3


def test_outside_the_map_returns_to_the_lines(distorted: tuple[StrictField, SlackField]) -> None:
    _, slack = distorted
    warp = build_map(slack, views_of(SIDE, CAMERAS), Canvas(900, 900, (-1200 - int(slack.fit.fade_px) - 60, 0)))
    points = np.stack(np.meshgrid(np.arange(900.0), np.arange(900.0)), axis=-1) - warp.canvas.offset
    seen = np.isfinite(warp.maps[1].x)
    assert seen.mean() > 0.5
    mapped = np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1)[seen].astype(float)
    rounding = np.spacing(np.abs(mapped).max().astype(np.float32))
    assert distance_to_line(SIDE.F, points[seen], mapped).max() < 1e-3 + rounding


def test_slack_is_in_ideal_pixels_of_a_lens_that_bends() -> None:
    """s comes before the target's own distortion, and is looked up at the undistorted reference point."""
    x, y, _ = some_matches(SIDE, curved, 200)
    _, slack = slack_of(SIDE, Matches(x, y + bent(x)))
    camera = replace(CAMERAS[0], distortion=np.array([-0.1, 0.02, 0, 0, 0]))
    camera_prime = replace(CAMERAS[1], distortion=np.array([0.05, 0, 0.001, 0, 0]))
    left, top = -600, -230
    warp = build_map(slack, views_of(SIDE, (camera, camera_prime)), Canvas(420, 500, (left, top)))
    raw = np.stack(np.meshgrid(np.arange(620.0, 1000, 9), np.arange(250.0, 700, 9)), axis=-1).reshape(-1, 2)
    column, row = (raw + (left, top)).astype(int).T
    expected = distort(slack.predict(undistort(raw, camera)), camera_prime)
    inside = ((expected > 0) & (expected < np.array(SIZE) - 1)).all(axis=1)
    assert inside.mean() > 0.5
    mapped = np.column_stack([warp.maps[1].x[row, column], warp.maps[1].y[row, column]])
    assert np.abs(mapped - expected)[inside].max() < 0.02


# --- odd cases ------------------------------------------------------------------------------------------------------


def without_parallax() -> TwoView:
    none = np.zeros(3)
    return replace(VIEWS["to the side, turned"], t=none, e_prime=none, F=np.full((3, 3), np.nan), model="rotation")


def test_without_parallax_it_is_a_homography_and_slack() -> None:
    view = without_parallax()
    x, y, _ = some_matches(view, planar, 300)
    strict, slack = slack_of(view, Matches(x, y + bent(x)))
    assert np.abs(strict.predict(x) - y).max() < 1e-6 and not slack.plane.any()
    probe, true, _ = some_matches(view, planar, 300, seed=4)
    assert np.linalg.norm(slack.predict(probe) - true - bent(probe), axis=1).max() < 0.2


def test_without_parallax_too_there_are_at_most_a_thousand_centres() -> None:
    """Thousands of matches are common, and a dense solve costs their cube."""
    view = without_parallax()
    x, y, _ = some_matches(view, planar, 2000)
    field = fit_field("slack", "plane", view, Matches(x, y), SIZE, SIZE)
    assert isinstance(field, SlackField) and len(field.spline.centres) <= STRICT.max_centres


@pytest.fixture(scope="module")
def pruned() -> tuple[StrictField, SlackField]:
    """Outliers along their lines that the strict field dropped, and 30 px off them as well."""
    x, y, d = some_matches(SIDE, curved, 400)
    y += bent(x)
    wrong = np.flatnonzero(x[:, 0] > 800)[::10]  # on one side, so that the middle of all is not that of those kept
    y[wrong] = target_points(SIDE, x[wrong], d[wrong] + 0.05) + bent(x[wrong])
    y[wrong, 1] += 30
    strict, slack = slack_of(SIDE, Matches(x, y))
    assert not strict.fit.inliers_used[wrong].any() and len(slack.spline.centres) == strict.fit.inliers_used.sum()
    return strict, slack


def test_matches_that_the_strict_field_dropped_do_not_bend_it(pruned: tuple[StrictField, SlackField]) -> None:
    probe, true, _ = some_matches(SIDE, curved, 400, seed=9)
    assert np.abs(pruned[1].predict(probe) - true - bent(probe)).max() < 0.4


def test_the_grid_says_what_the_points_say_where_matches_were_dropped(pruned: tuple[StrictField, SlackField]) -> None:
    """The strict spline's coordinates are normalised by all matches, slack's by those that were kept."""
    strict, slack = pruned
    grid = Grid.over(500, 150, 500, 500)
    ours, theirs = slack.on_grid(grid), strict.on_grid(grid)
    assert 1000 * np.abs(ours.inverse_depth - theirs.inverse_depth).max() < 1e-3
    sent = target_points(SIDE, grid.points, ours.inverse_depth) + ours.shift
    assert np.abs(sent.reshape(-1, 2) - slack.predict(grid.points.reshape(-1, 2))).max() < 1e-3
