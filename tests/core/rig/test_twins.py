"""Pictures that show the same from the same place: what is one, and that they cost and change nothing."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.rig import PictureMatches, Registration
from edf_stitch.core.measure.rig_figures import residuals
from edf_stitch.core.rig.averaging.options import TWINS
from edf_stitch.core.rig.registration import register
from edf_stitch.core.rig.twins import twins_of

from .rigs import SyntheticRig, make_rig

TWIN, OF = 11, 4


def with_twin(rig: SyntheticRig, moved: float = 0.05) -> SyntheticRig:
    """The rig with a noisy copy of a picture, which matches what that matches."""
    noise = np.random.default_rng(0).normal(0, moved, rig.points[OF].shape)
    count = np.arange(len(noise))
    matches = [*rig.matches, PictureMatches(OF, TWIN, np.stack([count, count], axis=1))]
    for pair in rig.matches:
        if OF == pair.i:
            matches.append(PictureMatches(pair.j, TWIN, pair.index[:, ::-1]))
        elif OF == pair.j:
            matches.append(PictureMatches(pair.i, TWIN, pair.index))
    return replace(
        rig, cameras=(*rig.cameras, rig.cameras[OF]), points=[*rig.points, rig.points[OF] + noise], matches=matches
    )


@pytest.fixture(scope="module")
def both() -> tuple[Registration, SyntheticRig, Registration]:
    """A ring, and the same with a twin of one of its pictures."""
    rig = make_rig("ring", 0)
    twin = with_twin(rig)
    return (
        register(rig.cameras, rig.points, rig.matches), twin,
        register(twin.cameras, twin.points, twin.matches),
    )  # fmt: skip


def test_the_others_are_as_without_it(both: tuple[Registration, SyntheticRig, Registration]) -> None:
    before, _, found = both
    assert found.numbers == (*range(11), TWIN) and not found.left_out
    np.testing.assert_allclose(found.rig.R[:11], before.rig.R, atol=1e-12)
    np.testing.assert_allclose(found.rig.t[:11], before.rig.t, atol=1e-12)
    np.testing.assert_allclose(found.rig.inverse_ranges, before.rig.inverse_ranges, atol=1e-12)
    edges = [astuple(edge) for edge in found.rig.edges if edge.j != TWIN]
    assert edges == [astuple(edge) for edge in before.rig.edges]


def test_a_twin_stands_where_its_picture_does_and_sees_the_same_points(
    both: tuple[Registration, SyntheticRig, Registration]
) -> None:
    _, twin, found = both
    rig, seen = found.rig, found.rig.observations
    assert np.array_equal(rig.R[OF], rig.R[TWIN]) and np.array_equal(rig.t[OF], rig.t[TWIN])
    assert rig.stations == ((OF, TWIN),) and rig.lenses[TWIN] == rig.lenses[OF]
    assert {len(part) for part in (rig.cameras, rig.focal_deviation, rig.position_deviation)} == {12}
    (edge,) = (edge for edge in rig.edges if edge.j == TWIN)
    assert (edge.i, edge.baseline) == (OF, "none") and edge.inliers == edge.matches == len(twin.points[OF])
    own = seen.picture == TWIN
    assert set(seen.point[own]) == set(seen.point[seen.picture == OF]) and own.sum() > 100
    error = residuals(rig)
    used = seen.used
    assert abs(np.median(error[own & used]) - np.median(error[(seen.picture == OF) & used])) < 0.05
    assert (np.diff(seen.point) >= 0).all(), "observations stay sorted by point"


def test_what_moves_more_or_has_few_matches_is_no_twin() -> None:
    rig = make_rig("ring", 0)
    for moved, found in ((0.05, {TWIN: OF}), (2.0, {})):
        one = with_twin(rig, moved)
        assert twins_of(one.cameras, one.points, one.matches, 1.0) == found
    one = with_twin(rig, 2.0)
    assert twins_of(one.cameras, one.points, one.matches, 8.0) == {TWIN: OF}, "as coarse as the pictures are"
    one = with_twin(rig)
    few = [replace(pair, index=pair.index[: TWINS.matches - 1]) for pair in one.matches]
    assert not twins_of(one.cameras, one.points, few, 1.0)
    assert not twins_of(rig.cameras, rig.points, rig.matches, 1.0)


@pytest.mark.parametrize(("how", "found"), [
    ("best known", {OF: TWIN}), ("another size", {}), ("another given focal length", {}), ("given pose", {}),
])  # fmt: skip
def test_what_is_known_of_their_cameras_counts(how: str, found: dict[int, int]) -> None:
    one = with_twin(make_rig("ring", 0))

    def held(camera: Camera, factor: float) -> Camera:
        return replace(camera, K=camera.scaled(factor), log_sigma=0.0)

    first, second = one.cameras[OF], one.cameras[TWIN]
    first, second = {
        "best known": (first, replace(second, log_sigma=0.01)),
        "another size": (first, replace(second, size=(801, 600))),
        "another given focal length": (held(first, 1.0), held(second, 1.2)),
        "given pose": (first, replace(second, pose=(np.eye(3), np.zeros(3)))),
    }[how]
    cameras = [*one.cameras[:OF], first, *one.cameras[OF + 1 : TWIN], second]
    assert twins_of(cameras, one.points, one.matches, 1.0) == found


def test_two_twins_alone_are_registered_as_they_are() -> None:
    """Of one picture there would be no rig."""
    rig = with_twin(make_rig("ring", 0))
    cameras, points = ([every[OF], every[TWIN]] for every in (rig.cameras, rig.points))
    (pair,) = (pair for pair in rig.matches if (pair.i, pair.j) == (OF, TWIN))
    found = register(cameras, points, [replace(pair, i=0, j=1)])
    assert found.numbers == (0, 1) and not found.rig.t.any()


def test_the_twin_of_a_picture_that_is_left_out_is_left_out_too() -> None:
    rig = with_twin(make_rig("ring", 0))
    matches = [pair for pair in rig.matches if not {OF, TWIN} & {pair.i, pair.j} or {pair.i, pair.j} == {OF, TWIN}]
    found = register(rig.cameras, rig.points, matches)
    assert set(found.left_out) == {OF, TWIN}
    assert found.left_out[TWIN].startswith("shows the same as picture 5, which is left out as well: connects to no")
