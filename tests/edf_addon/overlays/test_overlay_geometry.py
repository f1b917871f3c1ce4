"""What lies over a picture: coordinates that come back, lines that hold both ends of a match, colours that tell."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.projective import homogeneous, project, rotation_from_vector
from edf_stitch.core.pictures.decoding import turn
from hypothesis import assume, given, settings
from hypothesis import strategies as st

pytest.importorskip("bpy")

from edf_stitch.edf_addon.overlays import overlay_geometry as og  # noqa: E402

SIZE, SIZE_PRIME = (400, 300), (320, 480)
sides = st.sampled_from(("reference", "target"))


@pytest.fixture(scope="module")
def geometry(by_hand):
    """Two cameras of different sizes, turned and apart, as a result has them."""
    view = by_hand.view(by_hand.camera(SIZE, 350.0), by_hand.camera(SIZE_PRIME, 410.0), (3, -8, 2), (1, 0.1, 0.2))
    return {
        "full_sizes": [list(SIZE), list(SIZE_PRIME)], "F": view.F.tolist(), "K": view.K.tolist(),
        "K_prime": view.K_prime.tolist(), "R": view.R.tolist(), "t": view.t.tolist(),
        "S": [[0.5, 0, 70.25], [0, 0.5, 11.75], [0, 0, 1]], "K_canvas": np.eye(3).tolist(),
    }  # fmt: skip


def seen_by_both(geometry, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A world point's px in the reference and in the target."""
    random = np.random.default_rng(seed)
    ray = np.linalg.inv(np.array(geometry["K"])) @ [*random.uniform((60, 60), (340, 240)), 1]
    X = ray * random.uniform(3, 30)
    x = project(np.array(geometry["K"]) @ X)
    return x, project(np.array(geometry["K_prime"]) @ (np.array(geometry["R"]) @ X + np.array(geometry["t"])))


def distance(polyline: np.ndarray, point: np.ndarray) -> float:
    """Of a point from a polyline."""
    starts, ends = polyline[:-1], polyline[1:]
    along = ends - starts
    share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    return float(np.linalg.norm(starts + share[:, None] * along - point, axis=1).min())


def test_places_to_look_at_are_outlined_by_four_lines_each():
    verdict = {"places": [{"box": [10, 20, 30, 40]}, {"box": [0, 0, 1, 1]}]}
    ends = og.places({"verdict": verdict}).reshape(2, 4, 2, 2)
    first = {tuple(map(tuple, line)) for line in ends[0].tolist()}
    assert first == {((9.5, 19.5), (39.5, 19.5)), ((39.5, 19.5), (39.5, 59.5)), ((39.5, 59.5), (9.5, 59.5)),
                     ((9.5, 59.5), (9.5, 19.5))}  # fmt: skip
    assert ends[1].min() == -0.5 and ends[1].max() == 0.5, "all of a pixel"
    assert og.places({}).shape == og.places({"verdict": None}).shape == (0, 2), "of an earlier release"


def test_the_corners_of_a_picture_are_those_of_the_view():
    corners = np.array([[-0.5, -0.5], [SIZE[0] - 0.5, SIZE[1] - 0.5]])
    np.testing.assert_allclose(og.to_view(corners, SIZE), [[0, 1], [1, 0]])


@given(x=st.floats(-50, 500), y=st.floats(-50, 500))
def test_px_come_back_from_the_view(x, y):
    points = np.array([[x, y]])
    np.testing.assert_allclose(og.from_view(og.to_view(points, SIZE), SIZE), points, atol=1e-9)


def test_a_region_that_shows_the_upper_right_quarter_puts_its_middle_in_the_middle():
    seen = np.array([[0.5, 0.5], [1.0, 1.0]])
    at = og.to_region(np.array([[0.75 * SIZE[0] - 0.5, 0.25 * SIZE[1] - 0.5]]), SIZE, seen, (800, 600))
    np.testing.assert_allclose(at, [[400, 300]])


def test_points_go_to_the_panorama_and_back(geometry):
    points = np.array([[0.0, 0], [399, 299], [17.5, 200]])
    known = {"geometry": geometry, "report": {"canvas": {"projection": {"kind": "perspective"}}}}
    there = og.on_panorama(known, points)
    np.testing.assert_allclose(there[0], [70.25, 11.75])
    np.testing.assert_allclose(og.from_panorama(known, there), points, atol=1e-9)


@pytest.fixture(scope="module", params=["cylindrical", "equirectangular", "perspective", "pannini"])
def round_one(request, geometry):
    """A panorama of its own, turned by 20° so that the reference reaches over its left edge, through a lens that
    bends."""
    turn_ = rotation_from_vector(np.radians((5.0, -20.0, 3.0)))
    told = {"kind": request.param, "focal_px": 200.0, "centre": [100.0, 150.0], "rotation": turn_.tolist(),
            "distance": 0.4 if request.param == "pannini" else 0.0}  # fmt: skip
    bent = {**geometry, "distortion": [-0.1, 0.01, 0, 0, 0], "canvas": [1256, 628], "K_canvas": [[None] * 3] * 3}
    return {"geometry": bent, "report": {"canvas": {"projection": told}}}


def test_points_go_to_a_round_panorama_and_back(round_one):
    points = np.array([[0.0, 0], [399, 299], [17.5, 200]])
    there = og.on_panorama(round_one, points)
    assert (np.abs(there - points) > 5).any()
    np.testing.assert_allclose(og.from_panorama(round_one, there), points, atol=1e-6)


def test_what_lies_behind_the_reference_has_no_px_there(round_one):
    if round_one["report"]["canvas"]["projection"]["kind"] in ("cylindrical", "equirectangular"):
        assert np.isnan(og.from_panorama(round_one, np.array([[100 + 200 * np.pi, 150.0]]))).all()


def test_a_line_on_a_round_panorama_is_a_curve_of_short_pieces(round_one):
    pieces = og.line_on_panorama(round_one, np.array([[0.0, 10], [399, 290]])).reshape(-1, 2, 2)
    assert len(pieces) > 40
    assert np.abs(np.diff(pieces[..., 0], axis=1)).max() < 60, "none goes right across"
    back = og.from_panorama(round_one, pieces.reshape(-1, 2).astype(float))
    along = np.array([399.0, 280]) / np.hypot(399, 280)
    off = (back - [0, 10]) @ [-along[1], along[0]]
    assert np.abs(off).max() < 1e-2


@pytest.fixture(scope="module")
def slid(round_one):
    """The same seen from a viewpoint that slides three quarters of the way, of a scene that is one slanted plane."""
    geometry = round_one["geometry"]
    R, t = np.array(geometry["R"]), np.array(geometry["t"])
    viewpoint = {"s1": 0.75, "c": (-R.T @ t).tolist(), "rotation": np.eye(3).tolist(), "along": [1.0, 0.0],
                 "ends": [-0.3, 0.35]}  # fmt: skip
    found = {**round_one, "geometry": {**geometry, "canvas": [480, 300], "viewpoint": viewpoint}}
    columns, rows = 97, 61
    nodes = np.stack(np.meshgrid(np.linspace(0, 479, columns), np.linspace(0, 299, rows)), axis=-1).reshape(-1, 2)
    rays, normal = og.projection_of(found).rays(nodes), np.array([0.1, -0.05, 0.3])
    d = rays @ normal / (1 - og.viewpoint_of(found).place(rays) @ normal)
    return {**found, "depth": {"columns": columns, "rows": rows, "inverse_depth": d.tolist()}, "normal": normal}


def test_a_match_lies_where_the_sliding_viewpoint_sees_its_point(slid):
    """With the target's px exactly, without by the panorama's own depth nearby; and back."""
    geometry, normal = slid["geometry"], slid["normal"]
    q = np.array([[-0.25, 0.1, 1], [0.0, 0, 1], [0.2, -0.1, 1], [0.35, 0.15, 1]])
    X = q / (q @ normal)[:, None]
    cameras = og.cameras_of(geometry)
    x = distort(q[:, :2] @ np.diag([350.0, 350]) + np.array(geometry["K"])[:2, 2], cameras["reference"])
    y = project((X @ np.array(geometry["R"]).T + np.array(geometry["t"])) @ np.array(geometry["K_prime"]).T)
    there = og.on_panorama(slid, x, y)
    projection, viewpoint = og.projection_of(slid), og.viewpoint_of(slid)
    seen = X - viewpoint.place(projection.rays(there))
    np.testing.assert_allclose(projection.points(seen), there, atol=1e-3)
    assert np.linalg.norm(there - projection.of_reference(x), axis=1).max() > 5, "it is not where s = 0 has it"
    np.testing.assert_allclose(og.on_panorama(slid, x), there, atol=0.5)
    np.testing.assert_allclose(og.from_panorama(slid, there), x, atol=0.5)


def test_an_epipolar_line_is_the_same_curve_wherever_the_viewpoint_stands(slid):
    geometry = slid["geometry"]
    x = np.array([230.0, 140.0])
    line = og.line_on_panorama(slid, og.epipolar_lines(geometry, x, "reference")["reference"]).astype(float)
    ideal = undistort(x[None], og.cameras_of(geometry)["reference"])
    q = homogeneous(ideal) @ np.linalg.inv(np.array(geometry["K"])).T
    for d in (0.02, 0.2, 0.4):  # the same px of the reference, near and far
        seen = og.projection_of(slid).points(og.viewpoint_of(slid).seen_from(q, np.array([d]))[0])[0]
        assert distance(line[::2], seen) < 0.3, d


@given(seed=st.integers(0, 10_000), side=sides)
@settings(max_examples=60)
def test_both_ends_of_a_match_lie_on_the_lines_of_either(geometry, seed, side):
    x, y = seen_by_both(geometry, seed)
    assume((y > 1).all() and (y < np.array(SIZE_PRIME) - 2).all())
    lines = og.epipolar_lines(geometry, x if side == "reference" else y, side)
    assert distance(lines["reference"], x) < 1e-6
    assert distance(lines["target"], y) < 1e-6


@given(seed=st.integers(0, 10_000), side=sides)
@settings(max_examples=30)
def test_where_lenses_bend_the_lines_bend_along(geometry, seed, side):
    bend, bend_prime = [-0.12, 0.02, 0.001, 0, 0], [0.1, 0, 0, 0.002, 0]
    bent = {**geometry, "distortion": bend, "distortion_prime": bend_prime}
    x, y = seen_by_both(geometry, seed)
    raw = distort(x, Camera(np.array(geometry["K"]), SIZE, "", 0.0, np.array(bend)))
    raw_prime = distort(y, Camera(np.array(geometry["K_prime"]), SIZE_PRIME, "", 0.0, np.array(bend_prime)))
    assume((raw_prime > 12).all() and (raw_prime < np.array(SIZE_PRIME) - 13).all())
    lines = og.epipolar_lines(bent, raw if side == "reference" else raw_prime, side)
    # a polyline of 48 points cuts corners a little
    assert distance(lines["reference"], raw) < 0.05
    assert distance(lines["target"], raw_prime) < 0.05


@pytest.mark.parametrize("F", [None, 0.0], ids=["a plane without a pose", "a rotation"])
def test_a_model_without_epipolar_lines_draws_none(geometry, F):
    assert og.epipolar_lines({**geometry, "F": [[F] * 3] * 3}, np.array([100.0, 100]), "reference") == {}


@given(a=st.floats(-1, 1), b=st.floats(-1, 1), x=st.floats(0, 399), y=st.floats(0, 299))
def test_a_line_through_a_point_of_the_picture_is_clipped_to_its_border(a, b, x, y):
    assume(np.hypot(a, b) > 1e-3)
    line = np.array([a, b, -a * x - b * y])
    ends = og.clipped(line, SIZE)
    assert ends is not None
    assert np.abs(homogeneous(ends) @ line).max() < 1e-6
    low, high = np.array([-0.5, -0.5]), np.array(SIZE) - 0.5
    assert ((ends > low - 1e-6) & (ends < high + 1e-6)).all()
    on_border = np.isclose(ends, low, atol=1e-6) | np.isclose(ends, high, atol=1e-6)
    assert on_border.any(axis=1).all()


@pytest.mark.parametrize("line", [(0, 1, 40), (1, 0, -400), (1, 1, 30), (0, 0, 1), (np.nan, 1, 0)])
def test_a_line_that_misses_the_picture_is_not_drawn(line):
    assert og.clipped(np.array(line, float), SIZE) is None


def test_colours_tell_good_from_bad_and_from_unknown():
    colours = og.residual_colours(np.array([0.0, og.WORST, 50.0, np.nan]))
    np.testing.assert_allclose(colours[0], og.RAMP[0], atol=1e-6)
    np.testing.assert_allclose(colours[1], og.RAMP[-1], atol=1e-6)
    np.testing.assert_array_equal(colours[1], colours[2])
    np.testing.assert_allclose(colours[3], og.GRAY, atol=1e-6)


def test_discs_are_round_and_each_has_its_colour():
    centres, colours = np.array([[10.0, 20], [50, 60]]), np.array([[1, 0, 0, 1], [0, 1, 0, 1]], np.float32)
    corners, each = og.discs(centres, 4.0, colours)
    assert len(corners) == len(each)
    half = len(corners) // 2
    radius = np.linalg.norm(corners[half:] - centres[1], axis=1)
    np.testing.assert_allclose(np.unique(radius.round(4)), [0, 4])
    np.testing.assert_array_equal(np.unique(each[half:], axis=0), [colours[1]])


def test_rings_and_polylines_are_pairs_of_ends():
    assert np.allclose(np.linalg.norm(og.rings(np.zeros((1, 2)), 3.0), axis=1), 3.0)
    np.testing.assert_array_equal(og.segments(np.array([[0.0, 0], [1, 0], [1, 1]])), [[0, 0], [1, 0], [1, 0], [1, 1]])


def test_the_nearest_point_within_reach():
    points = np.array([[0.0, 0], [np.nan, 0], [10, 0]])
    assert og.nearest(points, np.array([8.0, 1]), 5) == 2
    assert og.nearest(points, np.array([5.0, 30]), 5) is None
    assert og.nearest(np.zeros((0, 2)), np.zeros(2), 5) is None


@pytest.mark.parametrize("orientation", range(1, 9))
def test_px_are_turned_as_the_engine_turns_the_picture(orientation):
    stored = np.arange(7 * 5).reshape(5, 7, 1)
    turned = turn(stored, orientation)
    y, x = np.mgrid[:5, :7]
    points = np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)
    there = og.upright(points, (7, 5), orientation)
    np.testing.assert_array_equal(turned[there[:, 1].astype(int), there[:, 0].astype(int), 0], np.arange(35))
    np.testing.assert_array_equal(og.as_stored(there, (7, 5), orientation), points)


def test_light_is_encoded_for_the_screen_and_alpha_left_alone():
    shown = og.display_encoded(np.array([[0.0, 0.214, 7.0, 0.5]], np.float32))
    np.testing.assert_allclose(shown, [[0, 0.5, 1, 0.5]], atol=1e-3)
