"""`estimate` against five hundred random problems with known answers, and the same problem in other pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.pose.estimation import estimate
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from .two_view_problems import (
    ANY,
    COUNT,
    GIVEN,
    KINDS,
    STRATA,
    UNKNOWN,
    Array,
    Problem,
    Result,
    expected_errors,
    kind_of,
    problem,
    quick_indices,
    solve,
    stratum_of,
    summarise,
    transfer_difference,
)

RIGHT_SHARE, EXACT_SHARE = 0.99, 0.95


@pytest.fixture(scope="module", params=["quick", pytest.param("all", marks=pytest.mark.slow)])
def results(request: pytest.FixtureRequest) -> list[Result]:
    """What `estimate` made of 44 problems, one or two of every kind, or of all."""
    return [solve(index) for index in (quick_indices()[::2] if request.param == "quick" else range(COUNT))]


def test_nothing_but_a_reason_or_a_result_comes_out(results: list[Result]) -> None:
    crashed = [result for result in results if result.crashed]
    assert not crashed, summarise(crashed)


def test_the_model_is_the_right_one(results: list[Result]) -> None:
    assert np.mean([result.right for result in results]) >= RIGHT_SHARE, summarise(results)


def test_with_known_focal_lengths_the_rotation_is_as_good_as_the_noise_allows(results: list[Result]) -> None:
    """Against the Cramér-Rao bound. A few may be worse: an outlier that chance put beside its line is noise too."""
    general = [r for r in results if r.asked.family == "general" and r.asked.calibration == GIVEN]
    assert np.mean([result.exact for result in general]) >= EXACT_SHARE, summarise(general)


# --- what a problem promises -----------------------------------------------------------------------------------------


def test_a_problem_is_always_the_same_one() -> None:
    for index in (0, 17, 258, COUNT - 1):
        one, other = problem(index), problem(index)
        assert one.matches.x.tobytes() == other.matches.x.tobytes()
        assert one.matches.y.tobytes() == other.matches.y.tobytes()
        assert one.camera.K.tobytes() == other.camera.K.tobytes()


def test_quick_problems_cover_every_kind_and_calibration() -> None:
    asked = [kind_of(index) for index in quick_indices()]
    for kind, calibrations in KINDS.items():
        assert {calibration for name, calibration in asked if name == kind} == set(calibrations), kind
    assert {kind_of(index)[0] for index in quick_indices()[::2]} == set(KINDS)


@pytest.mark.parametrize("index", quick_indices())
def test_the_truth_explains_the_inliers(index: int) -> None:
    """Each lies where the true cameras see a point in front of both, up to noise."""
    p = problem(index)
    if p.R is None or p.t is None:
        assert p.expected == {"refused"} and not p.inliers.any()
        return
    assert p.inliers.sum() >= 60 and abs(1 - p.inliers.mean() - p.outliers) < 0.02
    x, y = (np.column_stack([points[p.inliers], np.ones(p.inliers.sum())]) for points in (p.matches.x, p.matches.y))
    turned, seen = x @ np.linalg.inv(p.K).T @ p.R.T, y @ np.linalg.inv(p.K_prime).T
    # seen ~ turned + d t: d by least squares, then back into the picture
    across, along = np.cross(seen, turned), np.cross(seen, p.t)
    inverse_depth = -(across * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    there = turned + inverse_depth[:, None] * p.t
    sent = there @ p.K_prime.T
    off = np.linalg.norm(sent[:, :2] / sent[:, 2:] - y[:, :2], axis=1)
    assert (there[:, 2] > 0).all()
    # noise of both pictures, enlarged by a zoom or where a reference pixel covers more than one in the target
    assert np.median(off) < 4 * p.noise * max(1.0, p.K_prime[0, 0] / p.K[0, 0]) + 1e-6


# --- the same problem in other pixels --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Change:
    """Other pixels for a picture: x → A x, and the size that comes with it; `unit`: how much larger a pixel's worth of
    noise becomes."""

    A: Array
    size: tuple[int, int]
    unit: float = 1.0

    def points(self, points: Array) -> Array:
        return points @ self.A[:2, :2].T + self.A[:2, 2]

    def camera(self, camera: Camera) -> Camera:
        # a quarter turn turns the camera: its K stays one with positive focal lengths
        middle = self.points(camera.K[None, :2, 2])[0]
        lengths = np.abs(self.A[:2, :2]) @ np.diag(camera.K)[:2]
        K = np.array([[lengths[0], 0, middle[0]], [0, lengths[1], middle[1]], [0, 0, 1]])
        return replace(camera, K=K, size=self.size)


def enlarged(size: tuple[int, int]) -> Change:
    """Twice as large: x → 2 (x + ½) − ½."""
    return Change(np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]]), (2 * size[0], 2 * size[1]), 2.0)


def framed(size: tuple[int, int], border: tuple[int, int, int, int]) -> Change:
    """With a border around: left, top, right, bottom."""
    left, top, right, bottom = border
    A = np.array([[1.0, 0, left], [0, 1, top], [0, 0, 1]])
    return Change(A, (size[0] + left + right, size[1] + top + bottom))


def quarter_turned(size: tuple[int, int]) -> Change:
    """By 90° clockwise."""
    return Change(np.array([[0.0, -1, size[1] - 1], [1, 0, 0], [0, 0, 1]]), size[::-1])


def some(*calibrations: str) -> st.SearchStrategy[int]:
    """Problems that have one answer, with few matches: of the same camera twice, refusing may be a matter of luck."""
    kinds = [kind for kind in KINDS if not kind.startswith("refused") and kind != "rotation/identity"]
    return st.sampled_from([
        i for i in range(COUNT)
        if kind_of(i)[0] in kinds and kind_of(i)[1] in calibrations and stratum_of(i) in STRATA[:2]
    ])  # fmt: skip


# Without shrinking: there is no simpler problem than another, and looking for one takes minutes.
FEW = settings(max_examples=5, phases=[Phase.generate])
BORDER = st.tuples(*[st.integers(0, 300)] * 4)


def check_same(asked: Problem, change: Change, change_prime: Change) -> None:
    """`estimate` finds the same in the other pixels: what differs is rounding, and with it the random draws, so that
    all may differ by a part of what the noise leaves open."""
    matches, size = asked.matches, asked.camera.size
    view = estimate(matches, asked.camera, asked.camera_prime)
    other = estimate(
        Matches(change.points(matches.x), change_prime.points(matches.y), scale=change.unit),
        change.camera(asked.camera), change_prime.camera(asked.camera_prime),
    )  # fmt: skip
    assert other.model == view.model
    assert np.mean(other.inliers != view.inliers) <= 0.03
    if asked.family == "plane":  # two poses see a plane alike: which one it is, noise decides
        return
    back = np.linalg.inv(change_prime.A) @ other.H_inf @ change.A
    assert transfer_difference(back, view.H_inf, size) < 0.3 * expected_errors(asked)[1]
    # where a model does not say how sure it is of the focal length, it is no surer than before
    unsure = view.focal_deviation if np.isfinite(view.focal_deviation) else asked.camera.log_sigma
    for K, K_other in ((view.K, other.K), (view.K_prime, other.K_prime)):
        assert abs(np.log(K_other[0, 0] / change.unit / K[0, 0])) <= 0.3 * unsure + 1e-9


@given(index=some(*ANY))
@FEW
def test_pictures_twice_as_large_have_the_same_geometry(index: int) -> None:
    asked = problem(index)
    check_same(asked, enlarged(asked.camera.size), enlarged(asked.camera_prime.size))


@given(index=some(GIVEN), border=BORDER, border_prime=BORDER)
@FEW
def test_borders_change_nothing(
    index: int, border: tuple[int, int, int, int], border_prime: tuple[int, int, int, int]
) -> None:
    asked = problem(index)
    check_same(asked, framed(asked.camera.size, border), framed(asked.camera_prime.size, border_prime))


@given(index=some(GIVEN, UNKNOWN))
@FEW
def test_pictures_turned_by_a_quarter_have_a_turned_geometry(index: int) -> None:
    asked = problem(index)
    check_same(asked, quarter_turned(asked.camera.size), quarter_turned(asked.camera_prime.size))
