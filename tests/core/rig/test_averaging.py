"""From matches of N pictures to their rotations and the lens they share, on random rigs with known truth."""

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.rig.averaging.averaged import Averaged
from edf_stitch.core.rig.averaging.averaging import averaged, hypotheses
from edf_stitch.core.rig.averaging.focal_starts import starts
from edf_stitch.core.rig.averaging.matched_rays import SharedLens
from edf_stitch.core.rig.averaging.pairs import verified
from edf_stitch.core.rig.averaging.turns import degrees_between

from .rigs import SyntheticRig, camera_of, make_rig


def run(rig: SyntheticRig, cameras: tuple[Camera, ...] | None = None, start: SharedLens | None = None, hold=False):
    """Averaged rotations from the rig's matches."""
    cameras = cameras or rig.cameras
    agreed = verified(rig.points, rig.matches, 1.0, 0)
    return averaged(cameras, rig.points, agreed, start or starts(cameras, rig.points, agreed)[0], hold)


def errors(found: Averaged, rig: SyntheticRig):
    """Of the relative rotations between members, degrees."""
    i, j = np.array([(a, b) for a in found.members for b in found.members if a < b]).T
    return degrees_between(
        found.R[j] @ np.swapaxes(found.R[i], 1, 2), rig.R[j] @ np.swapaxes(rig.R[i], 1, 2)
    )  # fmt: skip


def cameras_of(rig: SyntheticRig, factor: float, log_sigma: float = 0.05) -> tuple[Camera, ...]:
    """As believed: every focal length off by this factor."""
    return tuple(camera_of(rig.focal * factor, camera.size, log_sigma) for camera in rig.cameras)


@pytest.fixture(scope="module")
def ring() -> SyntheticRig:
    return make_rig("ring", 2)


@pytest.fixture(scope="module")
def of_ring(ring):
    return run(ring, cameras_of(ring, 1.03))


def test_a_ring_is_turned_as_it_was(ring, of_ring):
    assert of_ring.members == tuple(range(11))
    assert errors(of_ring, ring).max() < 0.3
    assert of_ring.noise_px == pytest.approx(0.5, rel=0.25)
    assert 0 < of_ring.loop_degrees < 3 and not of_ring.one_place


def test_a_focal_length_that_was_three_per_cent_off_is_found(ring, of_ring):
    for camera in of_ring.cameras:
        assert camera.focal == pytest.approx(ring.focal, rel=0.01)
        assert abs(camera.distortion[0]) < 0.01


def test_pairs_say_what_they_are(ring, of_ring):
    found = {(pair.i, pair.j): len(pair) for pair in ring.matches}
    for pair in of_ring.pairs:
        true = ring.R[pair.j] @ ring.R[pair.i].T
        along = ring.t[pair.j] - true @ ring.t[pair.i]
        assert degrees_between(pair.R, true) < 0.5 + 4 * pair.degrees
        assert pair.found == found[pair.i, pair.j] >= pair.verified >= len(pair.index) >= 20
        assert pair.off_degrees == pytest.approx(
            float(degrees_between(pair.R, of_ring.R[pair.j] @ of_ring.R[pair.i].T)), abs=1e-9
        )
        if pair.degrees < 0.2:
            assert pair.t @ along / np.linalg.norm(along) > 0.8
            assert not pair.rotates and pair.parallax_px > 1
    sure = [pair for pair in of_ring.pairs if pair.degrees < 0.3]
    off = [degrees_between(pair.R, ring.R[pair.j] @ ring.R[pair.i].T) / pair.degrees for pair in sure]
    assert len(sure) >= 8 and np.median(off) < 4


@pytest.mark.parametrize("kind", ["wrong", "tripod"])
def test_the_order_of_the_pictures_does_not_matter(kind):
    rig = make_rig(kind, 2)
    order = np.random.default_rng(0).permutation(len(rig.R))
    first, second = run(rig), run(rig.shuffled(order))
    place = np.argsort(order)
    assert sorted(order[list(second.members)]) == list(first.members)
    i, j = np.triu_indices(len(rig.R), 1)
    between = [R[j] @ np.swapaxes(R[i], 1, 2) for R in (first.R, second.R[place])]
    np.testing.assert_allclose(*between, atol=1e-6)
    assert first.cameras[0].focal == pytest.approx(second.cameras[0].focal, rel=1e-9)
    assert first.cost == pytest.approx(second.cost, rel=1e-9)


def test_a_wrong_pair_is_dropped():
    rig = make_rig("wrong", 0)
    found = run(rig)
    assert (0, 5) in {(pair.i, pair.j) for pair in verified(rig.points, rig.matches, 1.0, 0).pairs}
    assert (0, 5) not in {(pair.i, pair.j) for pair in found.pairs}
    assert len(found.members) == 11 and errors(found, rig).max() < 1.5


def test_what_was_taken_from_a_tripod_is_told():
    rig = make_rig("tripod", 1)
    found = run(rig, cameras_of(rig, 1.03))
    assert found.one_place and errors(found, rig).max() < 0.3
    assert found.cameras[0].focal == pytest.approx(rig.focal, rel=0.005)
    assert all(pair.rotation_gain > 0 for pair in found.pairs if pair.rotates)


def test_a_set_that_is_half_from_a_tripod_is_not_one_place():
    rig = make_rig("half", 1)
    found = run(rig)
    rotating = {(pair.i, pair.j) for pair in found.pairs if pair.rotates}
    assert not found.one_place and rotating
    assert all(j < 6 for _, j in rotating), "the others were held by hand"


def test_the_lens_is_found(ring):
    k1 = -0.09
    bent = [Camera(c.K, c.size, "", 0.0, np.array([k1, 0, 0, 0, 0])) for c in ring.true_cameras]
    points = [distort(p, camera) for p, camera in zip(ring.points, bent, strict=True)]
    found = run(replace(ring, points=points), cameras_of(ring, 1.02))
    assert found.cameras[0].distortion[0] == pytest.approx(k1, abs=0.02)
    assert found.cameras[0].focal == pytest.approx(ring.focal, rel=0.015)
    assert errors(found, ring).max() < 0.5


def test_a_given_lens_is_taken_off_first(ring, of_ring):
    lens = np.array([-0.2, 0.05, 0.002, -0.001, 0.0])
    bent = [Camera(c.K, c.size, "", 0.05, lens, knowledge=Knowledge.EXIF) for c in cameras_of(ring, 1.03)]
    points = [distort(p, camera) for p, camera in zip(ring.points, bent, strict=True)]
    found = run(replace(ring, points=points), tuple(bent))
    assert errors(found, ring).max() < 0.4
    # the lens still moves the same pixels, though its focal length was found to be another
    grid = np.stack(np.meshgrid(np.linspace(0, 799, 5), np.linspace(0, 599, 5)), axis=-1)
    np.testing.assert_allclose(distort(grid, found.cameras[0]), distort(grid, bent[0]), atol=0.1)


def test_given_cameras_stay(ring):
    given = cameras_of(ring, 1.0, log_sigma=0.0)
    found = run(ring, given)
    assert all(a is b for a, b in zip(found.cameras, given, strict=True))
    assert errors(found, ring).max() < 0.3


def test_given_cameras_stay_among_others(ring):
    given, guessed = cameras_of(ring, 1.0, log_sigma=0.0), cameras_of(ring, 1.04)
    found = run(ring, (*given[:4], *guessed[4:]))
    assert all(a is b for a, b in zip(found.cameras[:4], given[:4], strict=True))
    assert found.cameras[4].focal == pytest.approx(ring.focal, rel=0.01)


def test_a_lens_that_is_held_stays(ring):
    found = run(ring, cameras_of(ring, 1.0), SharedLens(1.01, -0.01), hold=True)
    assert found.cameras[0].focal == pytest.approx(1.01 * ring.focal, rel=1e-6)
    assert found.cameras[0].distortion[0] == pytest.approx(-0.01, abs=1e-6)


def test_pictures_of_several_sizes(ring):
    cameras, points = list(cameras_of(ring, 1.03)), list(ring.points)
    for k in (1, 4, 5, 8):
        small = cameras[k].resized((400, 300))
        points[k] = (points[k] - cameras[k].K[:2, 2]) / 2 + small.K[:2, 2]
        cameras[k] = small
    found = run(replace(ring, points=points), tuple(cameras))
    assert errors(found, ring).max() < 0.6
    assert found.cameras[1].focal == pytest.approx(found.cameras[0].focal / 2, rel=1e-12)


def test_what_connects_to_nothing_is_left_out_with_its_count(ring):
    rng = np.random.default_rng(0)
    stray = rng.uniform(0, 600, (200, 2))
    index = np.column_stack([rng.permutation(200), rng.permutation(200)])
    rig = replace(
        ring, cameras=(*ring.cameras, ring.cameras[0]), points=[*ring.points, stray],
        matches=[*ring.matches, PictureMatches(0, 11, index)],
    )  # fmt: skip
    found = run(rig)
    assert found.members == tuple(range(11)) and np.isnan(found.R[11]).all() and np.isfinite(found.R[:11]).all()
    assert 7 <= verified(rig.points, rig.matches, 1.0, 0).best[11] < 38


def test_of_two_groups_the_larger_is_taken(ring):
    """Pictures 0 to 2 meet none of the others."""
    matches = [pair for pair in ring.matches if (pair.i < 3) == (pair.j < 3)]
    found = run(replace(ring, matches=matches))
    assert found.members == tuple(range(3, 11))
    assert {pair.i for pair in found.pairs} <= set(range(3, 11))


def test_nothing_that_agrees_is_nothing(ring):
    assert averaged(ring.cameras, ring.points, verified(ring.points, [], 1.0, 0), SharedLens()) is None


def test_a_known_focal_length_is_the_only_start(ring):
    agreed = verified(ring.points, ring.matches, 1.0, 0)
    assert starts(cameras_of(ring, 1.05), ring.points, agreed) == [SharedLens()]
    assert starts(cameras_of(ring, 1.0, 0.0), ring.points, agreed) == [SharedLens()]


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_an_unknown_focal_length_is_found(factor):
    rig = make_rig("street", 1, points=3000, pictures=5)
    cameras = cameras_of(rig, factor, 0.4)
    agreed = verified(rig.points, rig.matches, 1.0, 0)
    hypotheses = starts(cameras, rig.points, agreed)
    assert hypotheses[0].factor == pytest.approx(1 / factor, rel=0.12)
    assert hypotheses[1].k1 < 0 and hypotheses[1].factor < hypotheses[0].factor
    found = [averaged(cameras, rig.points, agreed, start) for start in hypotheses[:2]]
    best = min(found, key=lambda each: each.cost)
    assert best.cameras[0].focal == pytest.approx(rig.focal, rel=0.01)
    assert errors(best, rig).max() < 0.3


def test_starts_that_end_alike_are_one_hypothesis():
    rig = make_rig("street", 1, points=3000, pictures=5)
    cameras = cameras_of(rig, 0.8, 0.4)
    agreed = verified(rig.points, rig.matches, 1.0, 0)
    found = hypotheses(cameras, rig.points, agreed)
    assert 1 <= len(found) < len(starts(cameras, rig.points, agreed))
    assert found[0].cost == min(each.cost for each in found)
    assert found[0].cameras[0].focal == pytest.approx(rig.focal, rel=0.01)


def test_cost_tells_a_right_start_from_a_wrong_one(ring, of_ring):
    wrong = run(ring, cameras_of(ring, 1.0), SharedLens(1.4, 0.0), hold=True)
    assert wrong.cost > 1.2 * of_ring.cost
