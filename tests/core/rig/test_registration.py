"""From features and matches to a rig: random rigs with truth, and what is said of what is not known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.cameras.rig import FocalGuess, PictureMatches, Registration
from edf_stitch.core.raster.arrays import Array
from edf_stitch.core.rig import registration
from edf_stitch.core.rig.averaging.turns import degrees_between
from edf_stitch.core.rig.registration import register
from edf_stitch.core.system.errors import Cancelled, DegenerateGeometry, NoOverlap
from edf_stitch.core.system.progress import Progress

from .rigs import FOCAL, SyntheticRig, camera_of, make_rig


def registered(rig: SyntheticRig) -> Registration:
    return register(rig.cameras, rig.points, rig.matches)


def turned_off(found: Registration, rig: SyntheticRig) -> Array:
    """Degrees between the rotations of all pairs and the true ones."""
    R, true = found.rig.R, rig.R[list(found.numbers)]
    i, j = np.triu_indices(len(R), 1)
    return degrees_between(R[j] @ np.swapaxes(R[i], 1, 2), true[j] @ np.swapaxes(true[i], 1, 2))


def placed_off(found: Registration, rig: SyntheticRig) -> Array:
    """How far places are off after the best similarity, in units of the cameras' extent."""
    mine, true = (c - c.mean(axis=0) for c in (found.rig.centres, rig.centres[list(found.numbers)]))
    U, stretch, Vt = np.linalg.svd(true.T @ mine)
    sign = np.array([1, 1, np.linalg.det(U @ Vt)])
    fitted = mine @ (U @ np.diag(sign) @ Vt).T * (stretch * sign).sum() / (mine**2).sum()
    return np.linalg.norm(fitted - true, axis=1) / np.linalg.norm(true, axis=1).max()


@pytest.fixture(scope="module")
def ring() -> tuple[SyntheticRig, Registration]:
    rig = make_rig("ring", 0)
    return rig, registered(rig)


def test_a_ring(ring: tuple[SyntheticRig, Registration]) -> None:
    rig, found = ring
    assert found.numbers == tuple(range(11)) and not found.left_out
    assert turned_off(found, rig).max() < 0.35
    assert placed_off(found, rig).max() < 0.03
    assert abs(found.rig.cameras[0].focal / FOCAL - 1) < 0.003
    # of one pair's points a third picture sees three only
    assert [edge.baseline for edge in found.rig.edges].count("measured") >= len(found.rig.edges) - 1


def test_the_first_picture_is_the_frame(ring: tuple[SyntheticRig, Registration]) -> None:
    _, found = ring
    np.testing.assert_allclose(found.rig.R[0], np.eye(3), atol=1e-12)
    assert not found.rig.t[0].any()
    np.testing.assert_allclose(np.linalg.norm(found.rig.t, axis=1).max(), 1, atol=1e-12)


def test_points_are_seen_where_they_were_found(ring: tuple[SyntheticRig, Registration]) -> None:
    _, found = ring
    rig, seen = found.rig, found.rig.observations
    used = seen.used
    picture, point = seen.picture[used], seen.point[used]
    q = np.einsum("oij,oj->oi", rig.R[picture], rig.rays[point])
    q += rig.inverse_ranges[point][:, None] * rig.t[picture]
    ideal = q[:, :2] / q[:, 2:]
    bent = ideal * (1 + rig.cameras[0].distortion[0] * (ideal**2).sum(axis=1, keepdims=True))
    off = np.linalg.norm(homogeneous(bent) @ rig.cameras[0].K[:2].T - seen.pixels[used], axis=1)
    assert np.sqrt(np.mean(off**2)) < 1
    assert (np.bincount(point) >= 2).all() and len(np.unique(point)) == len(rig.rays)


def test_deviations_are_those_of_the_errors() -> None:
    """Over rigs, errors in units of their deviations are about 1: not a tenth, not ten."""
    focal, places = [], []
    for seed in range(4):
        rig = make_rig("ring", seed, points=4000)
        found = registered(rig)
        focal.append(np.log(found.rig.cameras[0].focal / FOCAL) / found.rig.focal_deviation[0])
        unit = np.linalg.norm(rig.centres - rig.centres[0], axis=1).max()
        places.append(placed_off(found, rig).max() * rig.extent / unit / found.rig.position_deviation.max())
    assert 0.2 < np.sqrt(np.mean(np.square(focal))) < 4
    assert 0.2 < np.median(places) < 4


def test_what_the_observations_do_not_tell_has_a_large_deviation() -> None:
    """Half are from one place: in which direction they are apart is not told, and rounding may not make it negative."""
    rig = make_rig("half", 0, points=2000, noise_px=0.1, pictures=7)
    found = register([camera_of(FOCAL * 1.05, log_sigma=0.25)] * 7, rig.points, rig.matches)
    sure = found.rig.position_deviation
    assert np.isfinite(sure).all() and np.isfinite(found.rig.deviations).all()
    assert (sure[1:] > 0).all()


def test_the_order_of_the_pictures_does_not_matter(ring: tuple[SyntheticRig, Registration]) -> None:
    rig, found = ring
    order = np.random.default_rng(1).permutation(11)
    other = registered(rig.shuffled(order))
    assert other.numbers == tuple(range(11))
    R = other.rig.R[np.argsort(order)]
    i, j = np.triu_indices(11, 1)
    between, before = (turns[j] @ np.swapaxes(turns[i], 1, 2) for turns in (R, found.rig.R))
    assert degrees_between(between, before).max() < 0.01
    assert abs(other.rig.cameras[0].focal / found.rig.cameras[0].focal - 1) < 0.001
    as_truth = replace(rig, R=found.rig.R, t=found.rig.t)
    assert placed_off(replace(other, rig=other.rig, numbers=tuple(order)), as_truth).max() < 0.002


@pytest.mark.slow
def test_a_tripod_invents_no_depth() -> None:
    """Also where many pairs have too few matches to show that they rotate."""
    rig = make_rig("tripod", 0, points=5000)
    found = registered(rig)
    assert found.rig.stations == (tuple(range(11)),)
    assert not found.rig.t.any() and not found.rig.inverse_ranges.any()
    assert turned_off(found, rig).max() < 0.15
    assert {edge.baseline for edge in found.rig.edges} == {"none"}


@pytest.mark.slow
def test_half_tripod_half_hand_held() -> None:
    """The bundle's cost finds the station: without it, points behind are invented."""
    rig = make_rig("half", 1, points=4000)
    found = registered(rig)
    assert len(found.rig.stations) == 1 and set(found.rig.stations[0]) <= set(range(6))
    assert (found.rig.inverse_ranges < 0).mean() < 0.02
    assert turned_off(found, rig).max() < 0.7
    assert placed_off(found, rig).max() < 0.2


def test_one_tripod_whose_pictures_are_proposed_as_two_stations_is_one() -> None:
    """No pair between its halves has matches: what they share with the others tells that they stand at one place."""
    rig, halves = make_rig("half", 1, points=4000), (set(range(3)), set(range(3, 6)))
    kept = [pair for pair in rig.matches if not all({pair.i, pair.j} & half for half in halves)]
    found = register(rig.cameras, rig.points, kept)
    assert found.rig.stations == (tuple(range(6)),)
    assert (found.rig.inverse_ranges < 0).mean() < 0.02


def test_lengths_along_a_chain_are_not_measured() -> None:
    """And how far any other picture is from the first one is a guess, to about half of it."""
    found = registered(make_rig("chain", 1)).rig
    assert {edge.baseline for edge in found.edges} == {"continuity"}
    away = np.linalg.norm(found.centres, axis=1)
    assert (found.position_deviation[1:] >= 0.45 * away[1:]).all()


def test_a_wrong_pair_changes_little() -> None:
    rig = make_rig("wrong", 0)
    found = registered(rig)
    assert (0, 5) not in {(edge.i, edge.j) for edge in found.rig.edges}
    assert np.median(turned_off(found, rig)) < 0.3
    assert placed_off(found, rig).max() < 0.1


def test_a_fixed_focal_length_stays() -> None:
    rig = make_rig("ring", 1, points=4000)
    fixed = tuple(camera_of(FOCAL * 1.01, log_sigma=0.0) for _ in rig.cameras)
    found = register(fixed, rig.points, rig.matches)
    assert all((camera.K == fixed[0].K).all() for camera in found.rig.cameras)
    assert not found.rig.focal_deviation.any()


def test_it_is_said_that_the_matches_told_the_focal_length() -> None:
    rig = make_rig("ring", 1, points=3000)
    for knowledge, source in ((Knowledge.ASSUMED, "the matches, from a guess"), (Knowledge.EXIF, "a guess")):
        believed = [replace(camera, source="a guess", knowledge=knowledge) for camera in rig.cameras]
        found = register(believed, rig.points, rig.matches).rig
        assert {camera.source for camera in found.cameras} == {source}


def test_focal_lengths_that_cost_almost_the_same_make_it_unsure(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_rig("ring", 1, points=3000)
    before = register(rig.cameras, rig.points, rig.matches).rig
    others = tuple(FocalGuess(factor * FOCAL, 0.0, 1.0) for factor in (1.0, 1.3, 1.3))
    monkeypatch.setattr(registration, "_guesses", lambda found: others)
    assumed = [replace(camera, knowledge=Knowledge.ASSUMED) for camera in rig.cameras]
    found = register(assumed, rig.points, rig.matches).rig
    apart = np.sqrt(2 / 3) * np.log(1.3)
    np.testing.assert_allclose(found.focal_deviation, np.hypot(before.focal_deviation, apart), rtol=1e-6)
    assert found.cameras[0].source.startswith("not determined by the matches, ")


def test_given_poses_stay() -> None:
    rig = make_rig("ring", 2, points=4000)
    cameras = [
        replace(camera, pose=(rig.R[k], rig.t[k])) if k in (0, 4, 7) else camera
        for k, camera in enumerate(rig.cameras)
    ]
    found = register(cameras, rig.points, rig.matches)
    for k in (4, 7):
        np.testing.assert_allclose(found.rig.R[k], rig.R[k] @ rig.R[0].T, atol=1e-9)
    between, true = (c[7] - c[4] for c in (found.rig.centres, (rig.centres - rig.centres[0]) @ rig.R[0].T))
    np.testing.assert_allclose(between / np.linalg.norm(between), true / np.linalg.norm(true), atol=1e-9)
    assert placed_off(found, rig).max() < 0.05


def given(rig: SyntheticRig, order: Sequence[int]) -> list[Camera]:
    """True cameras with their poses; picture k is given that of picture order[k]."""
    return [replace(camera_of(FOCAL, log_sigma=0.0), pose=(rig.R[k], rig.t[k])) for k in order]


@pytest.mark.parametrize("kind", ["ring", "tripod"])
def test_given_cameras_of_swapped_pictures_are_refused(kind: str) -> None:
    rig = make_rig(kind, 2, points=4000)
    with pytest.raises(DegenerateGeometry, match="do not fit the matches.* hardly any of picture 2 and picture 5:"):
        register(given(rig, (0, 4, 2, 3, 1, 5, 6, 7, 8, 9, 10)), rig.points, rig.matches)


def test_given_cameras_of_one_place_are_taken() -> None:
    rig = make_rig("tripod", 2, points=4000)
    turned = [replace(camera, pose=(R, np.zeros(3))) for camera, R in zip(given(rig, range(11)), rig.R, strict=True)]
    found = register(turned, rig.points, rig.matches)
    assert not found.rig.t.any()
    np.testing.assert_allclose(found.rig.R, rig.R @ rig.R[0].T, atol=1e-9)


@pytest.mark.parametrize(("pictures", "seed"), [(7, 0), (7, 1), (13, 2)])
def test_sharp_matches_of_a_tripod_are_of_one_place(pictures: int, seed: int) -> None:
    """Most are right to a twentieth of a px, and some err by half a px: no depth is to explain these."""
    rig = make_rig("tripod", seed, points=5000, noise_px=0.05, outliers=0.01, pictures=pictures)
    rng = np.random.default_rng(seed)
    points = [p + rng.normal(0, 0.4, p.shape) * (rng.random((len(p), 1)) < 0.1) for p in rig.points]
    believed = [camera_of(FOCAL * 0.86, log_sigma=0.25) for _ in rig.cameras]
    found = register(believed, points, rig.matches)
    assert found.numbers == tuple(range(pictures))
    assert not found.rig.t.any() and found.rig.stations == (found.numbers,)
    assert abs(found.rig.cameras[0].focal / FOCAL - 1) < 0.003


def test_two_lenses() -> None:
    """Half the pictures are twice as large: their focal length is their own."""
    rig = make_rig("ring", 3)
    large = range(1, 11, 2)
    points = [2 * p + 0.5 if k in large else p for k, p in enumerate(rig.points)]
    cameras = [
        camera_of(2 * FOCAL * 1.03, (1600, 1200)) if k in large else camera_of(FOCAL * 0.98) for k in range(11)
    ]
    found = register(cameras, points, rig.matches)
    assert len(set(found.rig.lenses)) == 2
    assert abs(found.rig.cameras[0].focal / FOCAL - 1) < 0.005
    assert abs(found.rig.cameras[1].focal / (2 * FOCAL) - 1) < 0.005


def test_two_pictures() -> None:
    rig = make_rig("ring", 0)
    pair = [pair for pair in rig.matches if (pair.i, pair.j) == (0, 1)]
    found = register(rig.cameras[:2], rig.points[:2], pair)
    assert found.numbers == (0, 1) and found.rig.edges[0].baseline == "measured"
    assert turned_off(found, rig).max() < 1


def test_what_connects_to_nothing_is_named() -> None:
    rig = make_rig("ring", 0)
    matches = [pair for pair in rig.matches if 3 not in (pair.i, pair.j)]
    few = PictureMatches(3, 4, next(pair for pair in rig.matches if (pair.i, pair.j) == (3, 4)).index[:15])
    found = register(rig.cameras, rig.points, [*matches, few])
    assert found.numbers == (0, 1, 2, 4, 5, 6, 7, 8, 9, 10)
    assert set(found.left_out) == {3} and "connects to no other picture" in found.left_out[3]


def test_of_two_groups_the_larger_is_kept() -> None:
    rig = make_rig("ring", 0)
    apart = {8, 9, 10}
    matches = [pair for pair in rig.matches if (pair.i in apart) == (pair.j in apart)]
    found = register(rig.cameras, rig.points, matches)
    assert found.numbers == tuple(range(8))
    assert set(found.left_out) == apart and "connects only with picture 10 and picture 11" in found.left_out[8]


def test_nothing_connects() -> None:
    rig = make_rig("ring", 0, points=500)
    with pytest.raises(NoOverlap, match="overlap by a third"):
        register(rig.cameras, rig.points, [])
    noise = np.random.default_rng(0)
    stray = [PictureMatches(0, 1, np.column_stack([noise.permutation(40)] * 2)[:30])]
    points = [noise.uniform(0, 500, (40, 2)) for _ in rig.cameras]
    with pytest.raises(NoOverlap, match="no two pictures connect"):
        register(rig.cameras, points, stray)


def test_it_can_be_cancelled() -> None:
    rig = make_rig("ring", 0, points=2000)
    asked = iter(range(1000))
    with pytest.raises(Cancelled):
        register(rig.cameras, rig.points, rig.matches, progress=Progress(cancelled=lambda: next(asked) > 12))


def test_hypotheses_of_an_unknown_focal_length_are_compared() -> None:
    rig = make_rig("ring", 0, points=4000)
    unknown = tuple(camera_of(FOCAL * 1.5, log_sigma=0.4) for _ in rig.cameras)
    found = register(unknown, rig.points, rig.matches)
    assert abs(found.rig.cameras[0].focal / FOCAL - 1) < 0.005
    assert found.rig.guesses[0].cost == min(guess.cost for guess in found.rig.guesses)
    assert all(guess.cost <= 1.05 * found.rig.guesses[0].cost for guess in found.rig.guesses)
