"""The outline of the frame that is chosen, over a panorama that was made for another, and over its pictures."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import project, rotation_from_vector
from edf_stitch.core.panorama.levelling import angles_of

pytest.importorskip("bpy")

from edf_stitch.edf_addon.overlays import frame_geometry as fg  # noqa: E402
from edf_stitch.edf_addon.scene import scene_geometry as sg  # noqa: E402

SIZE, SIZE_PRIME = (400, 300), (400, 300)
THEN = {"projection": "auto", "level": "auto", "crop": "full", "slide": "auto", "centre": None, "fov": None}


@pytest.fixture(scope="module")
def known(by_hand):
    """A panorama by Pannini's projection, levelled by itself, of two pictures side by side of a far plane."""
    view = by_hand.view(by_hand.camera(SIZE, 350.0), by_hand.camera(SIZE_PRIME, 350.0), (0, -25, 0), (-1, 0, 0))
    rotation = rotation_from_vector(np.radians((-4.0, 14.0, 2.0)))
    told = {"kind": "pannini", "focal_px": 300.0, "centre": [310.0, 170.0], "rotation": rotation.tolist(),
            "distance": 0.3, "level": list(angles_of(rotation))}  # fmt: skip
    geometry = {
        "full_sizes": [list(SIZE), list(SIZE_PRIME)], "K": view.K.tolist(), "K_prime": view.K_prime.tolist(),
        "R": view.R.tolist(), "t": view.t.tolist(), "canvas": [620, 340], "K_canvas": [[None] * 3] * 3,
    }  # fmt: skip
    depth = {"columns": 2, "rows": 2, "inverse_depth": [0.02] * 4, "shows": [1] * 4}
    return {"geometry": geometry, "report": {"canvas": {"projection": told}}, "depth": depth}


def box(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def test_the_same_frame_holds_both_pictures_and_is_a_rectangle_of_the_panorama(known):
    points = fg.on_panorama(known, fg.frame_border(known, THEN, THEN))
    left, top, right, bottom = box(points)
    edges = np.array([points[:, 0] - left, points[:, 0] - right, points[:, 1] - top, points[:, 1] - bottom])
    assert np.abs(edges).min(axis=0).max() < 1e-6, "every point lies on an edge"
    views = [fg._view(*one) for one in fg.posed_cameras(known["geometry"])]
    for outline in fg._outlines(known, views):
        shown = fg.on_panorama(known, outline)
        assert (shown > [left - 4, top - 4]).all() and (shown < [right + 4, bottom + 4]).all()


def test_a_set_has_the_same_outline_whether_its_viewpoint_slides_or_not(known):
    geometry = known["geometry"]
    first = {"name": "1", "K": geometry["K"], "R": np.eye(3).tolist(), "t": [0.0] * 3}
    other = {"name": "2", "K": geometry["K_prime"], "R": geometry["R"], "t": geometry["t"]}
    of_many = {**geometry, "cameras": [first, other]}
    asked = {**THEN, "fov": 50.0, "centre": [5.0, 0.0]}
    expected = fg.frame_border(known, asked, THEN)
    np.testing.assert_allclose(fg.frame_border({**known, "geometry": of_many}, asked, THEN), expected, atol=1e-9)
    places = [[0.0] * 3, (-np.array(geometry["R"]).T @ geometry["t"]).tolist()]
    slid = {**of_many, "viewpoint": {"s1": 1.0, "rotation": np.eye(3).tolist(), "places": places}}
    whole = [fg.on_panorama(known, fg.frame_border({**known, "geometry": one}, THEN, THEN)) for one in (of_many, slid)]
    assert np.abs(box(whole[0]) - box(whole[1])).max() < 40 and not np.allclose(*whole)


@pytest.mark.parametrize(("frame", "moved"), [
    ({"centre": [10.0, 0.0]}, (1, 0)), ({"centre": [0.0, 5.0]}, (0, -1)),
])  # fmt: skip
def test_a_moved_frame_moves_over_the_panorama(known, frame, moved):
    before, after = (box(fg.on_panorama(known, fg.frame_border(known, {**THEN, **one}, THEN))) for one in ({}, frame))
    shift = (after - before)[:2]
    assert shift[0] * moved[0] >= 0 and shift[1] * moved[1] >= 0 and np.abs(shift).max() > 20


def test_a_narrow_frame_is_as_wide_as_asked(known):
    rays = fg.frame_border(known, {**THEN, "fov": 40.0}, THEN)
    own = rays @ np.array(known["report"]["canvas"]["projection"]["rotation"])
    headings = np.degrees(np.arctan2(own[:, 0], own[:, 2]))
    assert np.ptp(headings) == pytest.approx(40, abs=0.7)


def test_the_inscribed_frame_lies_inside_the_full_one(known):
    full, inner = (
        box(fg.on_panorama(known, fg.frame_border(known, {**THEN, "crop": crop}, THEN)))
        for crop in ("full", "inscribed")
    )  # fmt: skip
    assert (inner[:2] >= full[:2] - 1e-6).all() and (inner[2:] <= full[2:] + 1e-6).all()
    assert np.prod(inner[2:] - inner[:2]) < 0.97 * np.prod(full[2:] - full[:2])


def test_the_reference_frame_holds_the_references_corners(known):
    rays = fg.frame_border(known, {**THEN, "projection": "reference"}, THEN)
    left, top, right, bottom = box(fg.on_picture(known, rays, "reference"))
    assert left <= 2 and top <= 2 and right > 500 and bottom >= 297


def test_over_a_picture_the_outline_lies_where_the_picture_shows_the_same(known):
    """Through a point in space, also where the viewpoint slides."""
    R, t = (np.array(known["geometry"][name]) for name in "Rt")
    rays = sg.projection_of(known).rays(np.array([[200.0, 150], [330, 200], [420, 120]]))
    viewpoint = {"s1": 0.75, "c": (-R.T @ t).tolist(), "rotation": np.eye(3).tolist(), "along": [1.0, 0.0],
                 "ends": [0.0, 0.35]}  # fmt: skip
    slid = {**known, "geometry": {**known["geometry"], "viewpoint": viewpoint}}
    for one in (known, slid):
        seen_from = sg.viewpoint_of(one)
        X = rays / 0.02 + (0 if seen_from is None else seen_from.place(rays))
        K = np.array(known["geometry"]["K"])
        np.testing.assert_allclose(fg.on_picture(one, rays, "reference"), project(X @ K.T), atol=1e-9)
        np.testing.assert_allclose(fg.on_picture(one, rays, "target"), project((X @ R.T + t) @ K.T), atol=1e-9)


def test_what_lies_behind_or_goes_right_across_is_not_drawn():
    points = np.array([[0.0, 0], [10, 0], [np.nan, 0], [10, 5], [900, 5], [905, 9]])
    np.testing.assert_array_equal(fg.closed_pieces(points, 400), [[0, 0], [10, 0], [900, 5], [905, 9]])


def test_without_the_targets_place_there_is_no_outline(known):
    nothing = {**known, "geometry": {**known["geometry"], "R": [[None] * 3] * 3, "t": [None] * 3}}
    assert fg.frame_border(nothing, THEN, THEN) is None
