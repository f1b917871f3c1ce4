"""Figures of a rig: what its cameras explain, and how its pictures hang together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.edge import Edge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.rig import FocalGuess, Rig, RigEdge
from edf_stitch.core.measure.rig_figures import focal_spread, map_errors, residuals, scale_kind, shares, weak_links
from edf_stitch.core.measure.rig_report import place_deviation, rig_warnings
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.picture_map import BoxedMap, MapPart, PictureMap

from ...conftest import view_of
from ..rig.known_rigs import known_rig


def with_edges(*edges: tuple[int, int, int, str], count: int = 4) -> Rig:
    rig, _ = known_rig(count)
    return replace(rig, edges=tuple(RigEdge(i, j, n, n, 1, 1, 0, kind) for i, j, n, kind in edges))


def test_residuals_are_px_of_the_raw_pictures() -> None:
    rig, _ = known_rig()
    np.testing.assert_allclose(residuals(rig), 0, atol=1e-6)
    seen = rig.observations
    moved = replace(rig, observations=replace(seen, pixels=seen.pixels + (3.0, 4.0)))
    np.testing.assert_allclose(residuals(moved), 5, atol=1e-6)
    bent = replace(rig, cameras=tuple(replace(one, distortion=np.array([0.1, 0, 0, 0, 0])) for one in rig.cameras))
    assert np.median(residuals(bent)) > 1, "the lens counts"


@pytest.mark.parametrize(("kinds", "scale"), [
    (("measured", "measured", "measured"), "measured"), (("measured", "continuity", "measured"), "continuity"),
    (("measured", "continuity", "none"), "none"),
])  # fmt: skip
def test_the_scale_is_as_sure_as_its_weakest_link(kinds: tuple[str, ...], scale: str) -> None:
    chain = [(i, i + 1, 99, kind) for i, kind in enumerate(kinds)]
    assert scale_kind(with_edges(*chain)) == scale
    assert scale_kind(with_edges(*chain, (0, 2, 99, "measured"), (1, 3, 99, "measured"), (0, 3, 99, "measured"))) == (
        "measured"
    ), "another way round will do"


@pytest.mark.parametrize(("kind", "why"), [
    ("continuity", "since no three of them show the same things"), ("none", "since near and far hardly move"),
])  # fmt: skip
def test_it_is_said_why_a_distance_is_not_known(kind: str, why: str) -> None:
    rig = with_edges((0, 1, 99, "measured"), (1, 2, 99, kind), (2, 3, 99, "measured"))
    (warning,) = rig_warnings(rig, "abcd")
    assert why in warning and "(b and c)" in warning
    assert not rig_warnings(replace(rig, t=np.zeros((4, 3))), "abcd"), "at one place there is nothing to know"


def test_pictures_of_one_station_need_no_scale_between_them() -> None:
    rig = with_edges((0, 1, 99, "none"), (1, 2, 99, "measured"), (2, 3, 99, "measured"))
    assert scale_kind(rig) == "none"
    assert scale_kind(replace(rig, stations=((0, 1),))) == "measured"
    assert scale_kind(replace(rig, t=np.zeros((4, 3)))) == "one place"


def test_a_weak_link_is_one_that_something_hangs_by() -> None:
    rig = with_edges((0, 1, 900, "measured"), (1, 2, 25, "measured"), (2, 3, 500, "measured"), (0, 2, 20, "measured"))
    assert [(edge.i, edge.j) for edge in weak_links(rig)] == [(1, 2)]
    assert not weak_links(with_edges((0, 1, 900, "measured"), (1, 2, 300, "measured"), (0, 2, 20, "measured"), count=3))
    assert not weak_links(replace(rig, edges=()))


def test_guesses_of_the_focal_length_are_compared() -> None:
    rig, _ = known_rig()
    assert focal_spread(rig) == 0
    guesses = tuple(FocalGuess(focal, 0.0, 1.0) for focal in (471.0, 480.0, 475.0))
    assert focal_spread(replace(rig, guesses=guesses)) == pytest.approx(480 / 471 - 1)
    tied = with_edges(*((i, i + 1, 99, "measured") for i in range(3)))
    (warning,) = rig_warnings(replace(tied, guesses=guesses), "abcd")
    assert "471 px, 480 px, 475 px explain the pictures almost alike" in warning and "--focal35" in warning
    assert not rig_warnings(replace(tied, guesses=(guesses[0], FocalGuess(474.0, 0.0, 1.0))), "abcd"), "nobody sees it"


def test_a_place_that_hardly_anything_ties_is_not_known() -> None:
    rig = replace(known_rig(4)[0], position_deviation=np.array([0.0, 0.03, 1.2e9, np.inf]))
    assert [place_deviation(rig, number) for number in range(4)] == [0.0, 0.03, None, None]
    assert place_deviation(replace(rig, position_deviation=np.zeros(0)), 1) is None


def test_shares_add_up() -> None:
    labels = np.array([[0, 0, 1], [2, -1, 2]], np.int16)
    ramp = np.arange(6, dtype=np.float32).reshape(2, 3)
    maps = [PictureMap(ramp - start, np.zeros_like(ramp), (3, 1)) for start in (0, 2, 4)]
    assert shares(labels, maps, 5) == [0.4, 0.2, 0.4]
    assert shares(None, maps, 6) == [0.5, 0.5, pytest.approx(1 / 3)]


def test_maps_are_asked_where_pictures_show_what_matches() -> None:
    """Two pictures of 40 × 30 px on a canvas, the second 10 px further right, its map known in its box only."""
    x, y = (values.astype(np.float32) for values in np.meshgrid(np.arange(60), np.arange(30)))
    whole = PictureMap(x, y, (40, 30))
    boxed = BoxedMap((MapPart(PictureMap(x[:, :50], y[:, :50], (40, 30)), (10, 0)),), (30, 60))
    warp = Warp(Canvas(60, 30, (0, 0)), (whole, boxed), np.zeros((30, 60), np.float32))
    points = np.random.default_rng(0).uniform((12, 2), (36, 28), (50, 2))
    camera = Camera(np.eye(3), (40, 30), "test", 0.0)
    view = view_of(camera, camera, (0, 0, 0), (1, 0, 0))
    for off in (0.0, 3.0):
        matches = Matches(points, points - (10, 0) + (off, 0))
        edge = Edge(0, 1, matches, matches, replace(view, inliers=np.ones(50, bool)))
        np.testing.assert_allclose(map_errors(warp, [edge], (camera, camera)), off, atol=1e-3)
