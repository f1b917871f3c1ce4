"""Figures of a rig: what its cameras explain, and how its pictures hang together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import FocalGuess, Rig, RigEdge
from edf_stitch.core.measure.rig_figures import focal_spread, residuals, scale_kind, shares, weak_links

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


def test_shares_add_up() -> None:
    labels = np.array([[0, 0, 1], [2, -1, 2]], np.int16)
    assert shares(labels, [np.ones((2, 3), bool)] * 4) == [0.4, 0.2, 0.4, 0.0]
    some = np.array([[True, False], [False, False]])
    assert shares(None, [some, ~some]) == [0.25, 0.75]
