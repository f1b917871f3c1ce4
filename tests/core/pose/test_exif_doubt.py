"""A focal length by EXIF is believed unless the matches clearly prefer another one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import project
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.pose.estimation import estimate
from edf_stitch.core.pose.exif_doubt import by_exif_or_without, exif_warning
from edf_stitch.core.rig.exif_doubt import exif_warnings, without_wrong_exif, wrong_exif
from edf_stitch.core.rig.matching import Matched

from ..point_scenes import FOCAL, SIZE, spoiled, turned_by, unit

MIDDLE = ((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2)


def intrinsics(focal: float) -> np.ndarray:
    return np.array([[focal, 0, MIDDLE[0]], [0, focal, MIDDLE[1]], [0, 0, 1.0]])


def by_exif(focal: float, knowledge: Knowledge = Knowledge.EXIF) -> Camera:
    sigma = {Knowledge.EXIF: INTRINSICS.exif_sigma, Knowledge.ASSUMED: INTRINSICS.assumed_sigma}.get(knowledge, 0.0)
    return Camera(intrinsics(focal), SIZE, "EXIF 35 mm equivalent", sigma, knowledge=knowledge,
                  principal_sigma=INTRINSICS.principal_sigma)  # fmt: skip


def views(count: int, seed: int = 1, baseline: float = 0.4, number: int = 150) -> list[np.ndarray]:
    """Points (N, 2) as cameras that turn towards each other see them, without noise; those all see come first."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-4, -3, 3), (4, 3, 9), (4 * number, 3))
    seen = []
    for k in range(count):
        R, t = turned_by(3 * k, -8 * k, 2 * k), baseline * k * unit(1, -0.4, 0.3)
        seen.append(project((points @ R.T + t) @ intrinsics(FOCAL).T))
    inside = np.all([((one > 0) & (one < SIZE)).all(axis=1) for one in seen], axis=0)
    return [one[inside][:number] for one in seen]


def pair(seed: int = 1, noise: float = 0.1, baseline: float = 0.4) -> Matches:
    x, y = views(2, seed, baseline)
    x, y, _ = spoiled(x, y, noise, 0.05, np.random.default_rng(seed))
    return Matches(x, y)


def found(matches: Matches, cameras: Sequence[Camera]) -> tuple[TwoView, tuple[Camera, ...], int]:
    calls = 0

    def counted(these: Matches, known: Sequence[Camera]) -> TwoView:
        nonlocal calls
        calls += 1
        return estimate(these, known[0], known[1])

    return *by_exif_or_without(matches, cameras, 0, counted), calls


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wrong_one_is_overruled(factor: float, seed: int) -> None:
    view, used, _ = found(pair(seed), (by_exif(factor * FOCAL),) * 2)
    assert all(camera.assumed for camera in used)
    assert abs(np.log(view.K[0, 0] / FOCAL)) < 0.03


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("factor", [0.95, 1.0, 1.06])
def test_a_right_one_is_kept_and_costs_nothing(seed: int, factor: float) -> None:
    view, used, calls = found(pair(seed), (by_exif(factor * FOCAL),) * 2)
    assert [camera.knowledge for camera in used] == [Knowledge.EXIF] * 2 and calls == 1
    assert abs(np.log(view.K[0, 0] / FOCAL)) < 0.05


def test_what_matches_cannot_tell_is_kept() -> None:
    """Hardly any parallax and much noise: no focal length fits better than another."""
    _, used, _ = found(pair(noise=1.5, baseline=0.15), (by_exif(1.3 * FOCAL),) * 2)
    assert not used[0].assumed


def test_what_was_given_is_never_doubted() -> None:
    cameras = (by_exif(0.5 * FOCAL, Knowledge.GIVEN),) * 2
    _, used, calls = found(pair(), cameras)
    assert used == cameras and calls == 1


def test_of_one_place_a_wrong_one_is_overruled_too() -> None:
    matches = pair(baseline=0.0)
    view, used, _ = found(matches, (by_exif(0.5 * FOCAL),) * 2)
    assert view.model == "rotation" and abs(np.log(view.K[0, 0] / FOCAL)) < 0.03


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_the_strongest_pairs_of_a_set_are_asked(factor: float) -> None:
    rng = np.random.default_rng(5)
    points = [one + rng.normal(0, 0.1, one.shape) for one in views(3)]
    index = np.repeat(np.arange(len(points[0]))[:, None], 2, axis=1)
    matched = Matched(tuple(points), tuple(PictureMatches(i, j, index) for i, j in ((0, 1), (0, 2), (1, 2))), 1.0)
    cameras = [by_exif(factor * FOCAL)] * 3
    doubted = wrong_exif(cameras, matched, 0)
    used = without_wrong_exif(cameras, doubted, ["a", "b", "c"])
    warnings = exif_warnings(cameras, doubted, ["a", "b", "c"], {1: FOCAL})
    if factor == 1.0:
        assert not doubted and used == tuple(cameras) and not warnings
        return
    assert doubted[0].pictures == (0, 1, 2) and all(camera.assumed for camera in used)
    assert f"give {FOCAL:.0f} px" in warnings[0] and not exif_warnings(cameras, doubted, ["a", "b", "c"], {})
    assert f"EXIF of 3 pictures ({factor * FOCAL:.0f} px" in warnings[0] and "contradicts the matches" in warnings[0]


def test_another_body_of_a_set_keeps_its_own() -> None:
    """Two pictures say half of what is true, a third one, of another focal length, is not asked."""
    rng = np.random.default_rng(5)
    points = [one + rng.normal(0, 0.1, one.shape) for one in views(3)]
    index = np.repeat(np.arange(len(points[0]))[:, None], 2, axis=1)
    matched = Matched(tuple(points), tuple(PictureMatches(i, j, index) for i, j in ((0, 1), (0, 2), (1, 2))), 1.0)
    cameras = [by_exif(0.5 * FOCAL), by_exif(0.5 * FOCAL), by_exif(FOCAL)]
    doubted = wrong_exif(cameras, matched, 0)
    assert [one.pictures for one in doubted] == [(0, 1)]
    used = without_wrong_exif(cameras, doubted, ["a.jpg", "b.jpg", "c.jpg"])
    assert [camera.assumed for camera in used] == [True, True, False]


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.6])
def test_one_picture_beside_others_is_asked(factor: float) -> None:
    """Nothing has the focal length that it says: it is given that of the others, where they say the same."""
    rng = np.random.default_rng(5)
    points = [one + rng.normal(0, 0.1, one.shape) for one in views(4)]
    index = np.repeat(np.arange(len(points[0]))[:, None], 2, axis=1)
    pairs = tuple(PictureMatches(i, j, index) for i in range(4) for j in range(i + 1, 4))
    matched = Matched(tuple(points), pairs, 1.0)
    cameras = [by_exif(FOCAL), by_exif(factor * FOCAL), by_exif(FOCAL), by_exif(FOCAL)]
    doubted, names = wrong_exif(cameras, matched, 0), ["a.jpg", "b.jpg", "c.jpg", "d.jpg"]
    used = without_wrong_exif(cameras, doubted, names)
    assert [camera.focal for camera in used] == pytest.approx([FOCAL] * 4)
    assert [one.pictures for one in doubted] == ([] if factor == 1.0 else [(1,)])
    assert used[1].lens_of == ("" if factor == 1.0 else "a.jpg")


def test_pairs_with_few_matches_do_not_outvote_one_with_many() -> None:
    """A picture at the end of a row: what it shares with those further on tells nothing."""
    rng = np.random.default_rng(5)
    points = [one + rng.normal(0, 0.1, one.shape) for one in views(4)]
    index = np.repeat(np.arange(len(points[0]))[:, None], 2, axis=1)
    pairs = tuple(
        PictureMatches(i, j, index if j == i + 1 else rng.permuted(index, axis=0)[:30])
        for i in range(4) for j in range(i + 1, 4)
    )  # fmt: skip
    cameras = [by_exif(1.6 * FOCAL), by_exif(FOCAL), by_exif(FOCAL), by_exif(FOCAL)]
    assert [one.pictures for one in wrong_exif(cameras, Matched(tuple(points), pairs, 1.0), 0)] == [(0,)]


def test_a_picture_that_was_zoomed_keeps_its_own() -> None:
    """Its EXIF says so, and the matches agree."""
    rng = np.random.default_rng(5)
    points = [one + rng.normal(0, 0.1, one.shape) for one in views(4)]
    points[1] = 1.6 * (points[1] - by_exif(FOCAL).K[:2, 2]) + by_exif(FOCAL).K[:2, 2]
    index = np.repeat(np.arange(len(points[0]))[:, None], 2, axis=1)
    pairs = tuple(PictureMatches(i, j, index) for i in range(4) for j in range(i + 1, 4))
    cameras = [by_exif(FOCAL), by_exif(1.6 * FOCAL), by_exif(FOCAL), by_exif(FOCAL)]
    assert wrong_exif(cameras, Matched(tuple(points), pairs, 1.0), 0) == ()


def test_the_warning_names_both_values_and_what_to_do() -> None:
    told = exif_warning("a.jpg and b.jpg", by_exif(500.0), 1012.4)
    assert "500 px" in told and "1012 px" in told and "--focal35" in told
