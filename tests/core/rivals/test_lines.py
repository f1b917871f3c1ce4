"""Lines of two pictures, and the meshes of SPW and LPC that keep them: each term does what it is there for."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.fields import fit_field
from edf_stitch.core.rivals.line_fields import _terms, _with_lines
from edf_stitch.core.rivals.line_mesh import Mesh, Terms
from edf_stitch.core.rivals.lines import MatchedLines, PairLines, joined, matched_lines
from edf_stitch.core.rivals.options import LINE_MESH, LineMethod
from edf_stitch.core.system.errors import DegenerateGeometry

from ..field.test_strict import SIDE, SIZE, curved, some_matches

G = np.array([[1.02, 0.05, 30.0], [-0.03, 0.98, 12.0], [1e-4, 4e-5, 1.0]])


def through(points: np.ndarray, H: np.ndarray = G) -> np.ndarray:
    return project(homogeneous(points.reshape(-1, 2)) @ H.T).reshape(points.shape)


def segments(count: int, seed: int = 0, side: float = 500.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    starts, turns = random.uniform(60, side - 60, (count, 2)), random.uniform(0, np.pi, count)
    return np.stack([starts, starts + 80 * np.column_stack([np.cos(turns), np.sin(turns)])], axis=1)


def matches_on(H: np.ndarray, seed: int = 1) -> Matches:
    y = np.random.default_rng(seed).uniform(0, 560, (200, 2))
    return Matches(through(y, H), y)


def test_the_same_lines_find_each_other_whatever_their_ends() -> None:
    target = segments(30)
    reference = through(target)
    cut = reference[:, :1] + (reference - reference[:, :1]) * np.array([0.2, 1.1])[None, :, None]
    order = np.random.default_rng(2).permutation(30)
    found = matched_lines(PairLines(cut[order], target), matches_on(G), G)
    assert len(found.ends) > 25
    assert np.abs(np.einsum("nek,nk->ne", through(found.ends), found.lines[:, :2]) + found.lines[:, 2:]).max() < 1e-6
    turned = through(target) + np.array([[0, 0], [0, 40]])
    assert len(matched_lines(PairLines(turned, target), matches_on(G), G).ends) < 8
    assert not len(matched_lines(PairLines.none(), matches_on(G), G).ends)
    further = reference + 1.5 * np.diff(reference, axis=1)  # on the same lines, but with nothing in common
    assert len(matched_lines(PairLines(further, target), matches_on(G), G).ends) < 5
    twice = np.concatenate([target, target + 1.0])
    assert len(matched_lines(PairLines(reference, twice), matches_on(G), G).ends) <= len(target)


def test_pieces_of_one_line_are_joined() -> None:
    whole = np.array([[10.0, 20], [410, 120]])
    parts = (0, 0.3), (0.4, 0.6), (0.75, 1)
    pieces = np.array([whole[0] + np.outer(shares, whole[1] - whole[0]) for shares in parts])
    beside = whole + np.array([0, 15.0])
    (long,) = joined(np.concatenate([pieces, beside[None]]), 1.0)
    assert np.abs(long - whole).max() < 1e-6
    assert not len(joined(beside[None], 1.0))


def test_a_homography_needs_nothing_from_a_mesh() -> None:
    """Where one homography is right, all terms but the even division beyond the overlap agree with it."""
    mesh = Mesh.over((600, 600), G, 40.0)
    terms = Terms(mesh)
    matches, lines = matches_on(G), segments(20)
    terms.points(matches.y, matches.x, matches.weights)
    terms.straight(np.concatenate([*mesh.cross_lines(), lines]), 50.0)
    terms.evenly_divided(mesh.cross_lines()[0], 5.0)
    assert np.abs(terms.solved() - mesh.start).max() < 0.1, "but for what u is not quite evenly divided by rounding"


def test_cross_lines_along_u_stay_parallel_and_those_along_v_do_not() -> None:
    u, v = Mesh.over((600, 400), G, 40.0).cross_lines()

    def turns(ends: np.ndarray) -> np.ndarray:
        along = np.diff(through(ends), axis=1)[:, 0]
        return np.unwrap(2 * np.arctan2(along[:, 1], along[:, 0])) / 2

    assert len(u) > 5 and len(v) > 5
    assert np.ptp(turns(u)) < 1e-9 and np.ptp(turns(v)) > 0.01


def test_beyond_the_overlap_it_is_evenly_divided_where_a_homography_stretches() -> None:
    mesh = Mesh.over((600, 400), G, 40.0)
    terms, (u, v) = Terms(mesh), mesh.cross_lines()
    terms.points(mesh.nodes, mesh.start, np.full(len(mesh.nodes), 1e-3))
    terms.evenly_divided(v, 100.0, beyond=(10, 10))
    points = mesh.along(v[len(v) // 2 : len(v) // 2 + 1])[0]
    shown, ways = mesh.shown(points), mesh.weights(points) @ (terms.solved() - mesh.start)
    uneven = [np.abs(np.diff(places, 2, axis=0)).mean() for places in (shown, shown + ways)]
    assert uneven[1] < 0.3 * uneven[0] and len(u)


def test_cross_lines_and_points_along_them_are_half_a_cell_apart() -> None:
    mesh = Mesh.over((600, 400), np.array([[1.0, 0, 0], [0, 1, 0], [1e-4, 0, 1]]), 50.0)
    assert mesh.cell == pytest.approx((50.0, 50.0), rel=0.01)
    u, _ = mesh.cross_lines()  # upright: the homography shortens from left to right
    assert np.abs(np.diff(u[:, 0, 0])) == pytest.approx(25.0, rel=0.01)
    assert np.abs(np.diff(mesh.along(u[:1])[0], axis=0)).max() == pytest.approx(25.0, rel=0.05)


def test_only_the_ends_of_matched_lines_are_pulled_onto_their_lines() -> None:
    mesh = Mesh.over((601, 401), np.eye(3), 50.0)
    terms = Terms(mesh)
    terms.points(mesh.nodes, mesh.start, np.full(len(mesh.nodes), 1e-3))
    ends = np.array([[[100.0, 200.0], [500.0, 200.0]]])
    terms.on_lines(ends, np.array([[0.0, 1.0, -210.0]]), 5.0)
    ways = mesh.weights(mesh.along(ends)[0]) @ (terms.solved() - mesh.start)
    assert ways[[0, -1], 1] == pytest.approx(10.0, abs=0.1) and np.abs(ways[len(ways) // 2]).max() < 0.1


@pytest.mark.parametrize(("method", "expected"), [
    (LINE_MESH.spw, {80.0: 5.0, 250.0: 5.0}), (LINE_MESH.lpc, {40.0: 50.0, 80.0: 50.0, 250.0: 100.0}),
])  # fmt: skip
def test_a_line_counts_by_its_length(
    method: LineMethod, expected: dict[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """20, 40, 80 and 250 px: 0.4, 0.7, 1.4 and 4.4 diagonals of SPW's cells, 0.3, 0.6, 1.1 and 3.5 of LPC's."""
    mesh, asked = Mesh.over((601, 401), G, method.cell_px), {}
    monkeypatch.setattr(Terms, "straight", lambda _, ends, weight: asked.update(
        {round(float(np.linalg.norm(end - start)), 3): weight for start, end in ends}))  # fmt: skip
    lines = np.array([[[50, 60 + 80 * k], [50 + length, 60 + 80 * k]] for k, length in enumerate((20, 40, 80, 250))])
    none = MatchedLines(np.zeros((0, 2, 2)), np.zeros((0, 3)))
    given = PairLines(np.zeros((0, 2, 2)), lines.astype(float))
    _terms(method, mesh, matches_on(G), none, given, (600, 400))
    assert {length: asked[length] for length in (20.0, 40.0, 80.0, 250.0) if length in asked} == expected


def test_lines_pull_the_homography_where_points_say_little() -> None:
    random = np.random.default_rng(5)
    true, off = G, G @ np.array([[1, 0, 0], [0, 1, 0], [0, 2e-5, 1.0]])
    y = np.column_stack([random.uniform(0, 560, 40), random.uniform(0, 60, 40)])
    matches = Matches(through(y, true) + random.normal(0, 0.3, y.shape), y)
    ends = segments(40, 6)
    shown = through(ends, true)
    along = np.diff(shown, axis=1)[:, 0]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    lines = np.column_stack([normals, -np.einsum("nk,nk->n", normals, shown[:, 0])])
    found = _with_lines(matches, MatchedLines(ends, lines), off)
    assert np.abs(through(ends, found) - shown).max() < 0.3 < np.abs(through(ends, off) - shown).max()


@pytest.mark.parametrize(("name", "most"), [("spw", 1.0), ("lpc", 0.6)])
def test_lines_that_matches_bend_are_kept_straighter(name: str, most: float) -> None:
    x, y, _ = some_matches(SIDE, curved, 200, 0.3)
    lines = segments(60, 3)
    fields = [fit_field(name, "plane", SIDE, Matches(x, y), SIZE, SIZE, 0, given) for given in
              (None, (np.zeros((0, 2, 2)), lines))]  # fmt: skip
    bends = []
    for field in fields:
        mesh = Mesh(field.target_size, *_shape(field), np.eye(3))  # type: ignore[attr-defined]
        points, number = mesh.along(lines)
        places = mesh.weights(points) @ field.places  # type: ignore[attr-defined]
        off = [np.linalg.svd(part - part.mean(axis=0))[1][1] / np.sqrt(len(part))
               for part in np.split(places, np.flatnonzero(np.diff(number)) + 1)]  # fmt: skip
        bends.append(np.mean(off))
    assert bends[1] < most * bends[0]


def _shape(field) -> tuple[int, int]:
    columns = len(np.unique(field.nodes[:, 0]))
    return columns, len(field.nodes) // columns


def test_a_homography_that_sends_the_target_to_infinity_is_refused() -> None:
    with pytest.raises(DegenerateGeometry, match="choose another field"):
        Mesh.over((600, 400), np.array([[1.0, 0, 0], [0, 1, 0], [-2e-3, 0, 1]]), 40.0)
