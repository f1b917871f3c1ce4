"""What the panorama shows and on what: levelled, centred, as flat as its width allows, with the pictures' own pixels.

The scenes are pictures of what is infinitely far, turned from each other: what is shown is known exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.panorama import framing
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.framing import FrameRequest, frame_for
from edf_stitch.core.panorama.framing_options import FRAMING
from edf_stitch.core.panorama.levelling import angles_of, turned
from edf_stitch.core.panorama.projection import Projection, focal_of
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.core.system.errors import BadRequest

Angles = tuple[float, float, float]


def view_of(angles: Angles, first: Angles, size: tuple[int, int], focal: float) -> View:
    """A camera at yaw, pitch, roll, beside a reference at others."""
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    R = turned(*angles) @ turned(*first).T
    camera = Camera(K, size, "given", 0.0)
    return View(camera, K, R, np.zeros(3), K @ R @ np.linalg.inv(K), np.zeros(3))


def rig(*all_angles: Angles, size: tuple[int, int] = (800, 600), focals: tuple[float, ...] = ()) -> list[View]:
    focals = focals or (700.0,) * len(all_angles)
    return [view_of(angles, all_angles[0], size, focal) for angles, focal in zip(all_angles, focals, strict=True)]


def warps(views: list[View]) -> Callable[[Projection], Warp]:
    """Their maps on all of a projection."""

    def warp_on(projection: Projection) -> Warp:
        left, top, right, bottom = projection.limits.astype(int)
        canvas = Canvas(right - left, bottom - top, (-left, -top), projection=projection)
        rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
        maps = []
        for view in views:
            p = rays @ (view.K @ view.R).T
            with np.errstate(divide="ignore", invalid="ignore"):
                x, y = (np.where(p[..., 2] > 1e-6, p[..., k] / p[..., 2], np.nan) for k in (0, 1))
            maps.append(PictureMap(x.astype(np.float32), y.astype(np.float32), view.size))
        return Warp(canvas, tuple(maps), np.zeros((canvas.height, canvas.width), np.float32))

    return warp_on


def framed(
    views: list[View], down: np.ndarray | None = None, edges: tuple | None = None, **asked: object
) -> Projection:
    return frame_for(FrameRequest(**asked), views, edges, down, warps(views))


def shown(projection: Projection, views: list[View]) -> np.ndarray:
    """Points (N, 2) of the plane along the pictures' borders."""
    out = []
    for view in views:
        width, height = view.size
        u = np.linspace(0, 1, 60)
        around = np.concatenate([np.stack(p, axis=-1) for p in (
            (u, 0 * u), (u, 0 * u + 1), (0 * u, u), (0 * u + 1, u))]) * (width - 1, height - 1)  # fmt: skip
        rays = np.column_stack([around, np.ones(len(around))]) @ np.linalg.inv(view.K).T @ view.R
        out.append(projection.points(rays))
    return np.concatenate(out)


def test_two_level_pictures_lie_level_and_halfway_between_their_ends() -> None:
    views = rig((0, 0, 0), (40, 0, 0))
    projection = framed(views)
    yaw, pitch, roll = angles_of(projection.rotation)
    assert abs(yaw + 20) < 0.7 and abs(pitch) < 0.2 and abs(roll) < 0.2
    points = shown(projection, views)
    assert abs(points[:, 0].min() + points[:, 0].max()) < 0.03 * np.ptp(points[:, 0])


@pytest.mark.parametrize(("yaw", "kind", "distance"), [
    (0.5, "perspective", 0.0), (30, "pannini", 0.49), (60, "pannini", 0.7), (80, "cylindrical", 0.0),
])  # fmt: skip
def test_the_wider_it_is_the_rounder_it_gets(yaw: float, kind: str, distance: float) -> None:
    """One picture shows 59.5 degrees from left to right."""
    projection = framed(rig((0, 0, 0), (yaw, 0, 0)))
    assert projection.kind == kind and abs(projection.distance - distance) < 0.03


def test_what_reaches_far_up_is_drawn_on_a_sphere() -> None:
    assert framed(rig((0, 0, 0), (0, 45, 0), (0, -45, 0))).kind == "equirectangular"


def kept_tilt(pitch: float, yaw: float) -> tuple[float, float]:
    """Degrees above the horizon that the panorama of two pictures with this pitch looks, and its rectangle's share."""
    views = rig((-yaw, pitch, 0), (yaw, pitch, 0))
    projection = framed(views, turned(-yaw, pitch, 0)[:, 1])
    ahead = turned(-yaw, pitch, 0).T @ projection.rotation[:, 2]
    covered = framing.coverage(warps(views)(framing.coarse_sphere(views)))
    return float(np.degrees(np.arcsin(-ahead[1]))), framing._room(projection, covered)[1]


@pytest.mark.parametrize(("pitch", "kept"), [(8.0, 0.0), (-11.0, 0.0), (20.0, 9.0), (-20.0, -9.0)])
def test_a_tilt_is_levelled_up_to_a_point(pitch: float, kept: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is beyond stays in the middle of the picture, so that the far end is not stretched; and a little more where
    the rectangle would become small."""
    tilt, room = kept_tilt(pitch, 15)
    assert -0.2 < (tilt - kept) * np.sign(pitch) < 4.7
    monkeypatch.setattr(framing, "FRAMING", replace(FRAMING, more_kept_deg=(0.0,)))
    levelled, less_room = kept_tilt(pitch, 15)
    assert abs(levelled - kept) < 0.2 and room >= less_room
    assert (abs(tilt - levelled) > 1) == (room > less_room), "only for a larger one"


def test_a_tilt_that_costs_nothing_is_not_kept() -> None:
    assert abs(kept_tilt(3.0, 15)[0]) < 0.2


def test_edges_that_would_leave_no_room_are_not_believed() -> None:
    """A wrong direction down leans the frame, and the rectangle collapses."""
    views = rig((-25, 0, 0), (25, 0, 0))
    held = framed(views).rotation
    askew = turned(0, 0, 9) @ np.array([0.0, 1.0, 0.0])
    wrong = turned(-25, 0, 0) @ askew
    assert np.allclose(framed(views, wrong).rotation, held)
    nearly = turned(-25, 0, 0) @ turned(0, 0, 2) @ np.array([0.0, 1.0, 0.0])
    assert np.allclose(framed(views, nearly).rotation[:, 1], nearly, atol=1e-6), "a little less room is the price"


@pytest.mark.parametrize("angles", [(0, 0, 12), (0, 0, -12), (0, 38, 0)])
def test_nobody_tilts_a_camera_so_far_by_mistake(angles: Angles) -> None:
    views = rig((0, 0, 0), (3, 0, 0))
    down = turned(*angles) @ np.array([0.0, 1.0, 0.0])
    assert np.allclose(framed(views, down).rotation, framed(views).rotation)


def test_the_sharper_picture_keeps_its_pixels_and_nothing_is_enlarged_by_much() -> None:
    """The second picture has half the pixels a radian, so it is shown enlarged, and says nothing."""
    for focals in ((175.0, 175.0), (90.0, 175.0), (175.0, 90.0)):
        views = rig((0, 0, 0), (25, 0, 0), size=(200, 150), focals=focals)
        projection = framed(views, kind="pannini", distance=0.5)
        warp = warps(views)(projection)
        areas = []
        for one in warp.maps:
            (xy, xx), (yy, yx) = (np.gradient(v.astype(float)) for v in (one.x, one.y))
            areas.append(np.where(one.inside(), np.abs(xx * yy - xy * yx), 0))
        sharpest = np.max(areas, axis=0)
        enlarged = 1 / np.sqrt(sharpest[sharpest > 0])
        assert np.percentile(enlarged, 99) < 1.37
        if focals[0] == focals[1]:
            assert abs(np.median(enlarged) - 1) < 0.02


def test_a_frontal_scene_stays_nearly_flat() -> None:
    """Level lines high above the horizon, square to the view: a façade. On the horizon nothing bends them."""
    views = rig((0, 0, 0), (30, 0, 0))
    assert framed(views).distance > 0.4
    for heights, flat in (((0.25, 0.3, 0.35, 0.4), True), ((0.01, 0.02, 0.03, 0.05), False)):
        heights = np.repeat(heights, 5)
        heading = np.radians(15)
        along = np.array([np.cos(heading), 0, -np.sin(heading)])  # square to where the panorama looks
        ahead = np.array([np.sin(heading), 0, np.cos(heading)])
        normals = np.cross(along, ahead - heights[:, None] * np.array([0, 1.0, 0]))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        found = framed(views, edges=(normals, np.full(len(heights), 0.5)))
        assert (found.distance == 0.15) == flat
    assert framed(views, edges=(normals, np.full(len(heights), 0.5)), kind="pannini", distance=0.6).distance == 0.6


@pytest.mark.parametrize("kind", ["perspective", "pannini", "cylindrical", "equirectangular"])
def test_what_is_asked_for_is_framed_alike(kind: str) -> None:
    views = rig((0, 0, 0), (20, 0, 0))
    projection, auto = framed(views, kind=kind), framed(views)
    assert projection.kind == kind and (projection.distance == 0) == (kind != "pannini")
    assert np.allclose(projection.rotation, auto.rotation)
    assert framed(views, kind="pannini", distance=0.0).kind == "pannini"


def test_an_angle_by_hand_turns_the_panorama_and_none_turns_nothing() -> None:
    views = rig((0, 3, 1), (30, 0, 0))
    assert np.allclose(framed(views, level=(-12.0, 4.0, 2.0)).rotation, turned(-12, 4, 2))
    assert np.array_equal(framed(views, level="none").rotation, np.eye(3))


def test_a_frame_is_moved_and_sized_without_turning_anything() -> None:
    views = rig((0, 0, 0), (30, 0, 0))
    plain = framed(views)
    assert plain.window is None
    for asked, ends in (({"fov": 40.0}, (-20, 20)), ({"fov": 40.0, "centre": (10.0, 0.0)}, (-10, 30))):
        found = framed(views, **asked)
        assert np.array_equal(found.rotation, plain.rotation) and found.focal == plain.focal
        assert found.distance == plain.distance and found.window is not None
        left, _, right, _ = found.window
        rays = found.rays(np.array([[left, 0.0], [right - 1, 0.0]])) @ found.rotation
        assert np.abs(np.degrees(np.arctan2(rays[:, 0], rays[:, 2])) - ends).max() < 0.3
    moved = framed(views, centre=(0.0, 5.0)).window
    assert moved is not None
    points = shown(plain, views)
    low, high = points.min(axis=0), points.max(axis=0)
    assert np.abs(np.array(moved[2:]) - moved[:2] - (high - low)).max() < 0.03 * np.ptp(points[:, 0]), "as large as all"
    assert abs((moved[1] + moved[3]) / 2 - (low + high)[1] / 2 + np.tan(np.radians(5)) * plain.focal) < 12, "up"


@pytest.mark.parametrize("asked", [{"centre": (-170.0, 0.0)}, {"centre": (70.0, 0.0), "fov": 20.0}], ids=str)
def test_a_frame_beside_all_pictures_is_refused(asked: dict) -> None:
    with pytest.raises(BadRequest, match="beside all pictures"):
        framed(rig((0, 0, 0), (30, 0, 0)), **asked)


@pytest.mark.parametrize("fov", [200.0, 360.0])
@pytest.mark.parametrize("kind", ["perspective", "pannini", "cylindrical"])
@pytest.mark.parametrize("heading", [0.0, 5.0])
def test_a_frame_that_reaches_straight_behind_shows_all(kind: str, fov: float, heading: float) -> None:
    views = rig((0, 0, 0), (30, 0, 0))
    found = framed(views, kind=kind, fov=fov, centre=(heading, 0.0))
    points, (left, _, right, _) = shown(found, views), found.limits
    assert left <= points[:, 0].min() and points[:, 0].max() < right


@pytest.mark.parametrize("kind", ["perspective", "pannini"])
def test_a_panorama_that_looks_away_from_all_pictures_is_refused(kind: str) -> None:
    with pytest.raises(BadRequest, match="lie behind a"):
        framed(rig((0, 0, 0), (30, 0, 0)), kind=kind, distance=0.3, level=(180.0, 0.0, 0.0))


def test_without_a_pose_it_is_framed_by_what_is_shown() -> None:
    first, second = rig((0, 0, 0), (30, 0, 0))
    unknown = View(second.camera, second.K, np.full((3, 3), np.nan), np.full(3, np.nan), second.H_inf, second.e_prime)
    projection = frame_for(FrameRequest(), [first, unknown], None, None, warps([first, second]))
    assert np.allclose(projection.rotation, framed([first, second]).rotation) and projection.focal > 0


def test_it_needs_edges_where_they_have_a_say() -> None:
    assert FrameRequest().needs_edges and FrameRequest("cylindrical").needs_edges
    assert FrameRequest("pannini", level="none").needs_edges
    assert not FrameRequest("pannini", 0.4, level="none").needs_edges
    assert not FrameRequest("perspective", level=(0.0, 0.0, 0.0)).needs_edges


def test_px_per_radian_are_those_of_the_middle() -> None:
    views = rig((0, 0, 0), (1, 0, 0))
    assert abs(framed(views).focal / focal_of(views[0].K) - 1) < 0.1


@pytest.mark.parametrize("kind", ["perspective", "pannini"])
def test_a_plane_that_is_turned_away_from_all_pictures_is_refused(kind: str) -> None:
    with pytest.raises(BadRequest, match="another level"):
        framed(rig((0, 0, 0), (35, 0, 0)), kind=kind, level=(180.0, 0.0, 0.0))


def test_what_lies_beyond_the_limits_of_a_plane_does_not_shrink_it() -> None:
    views = rig((0, 0, 0), (35, 0, 0))
    assert framed(views, kind="perspective", level=(80.0, 0.0, 0.0)).focal > 100


@pytest.mark.parametrize(("kind", "fov"), [("cylindrical", 360.0), ("cylindrical", 340.0), ("perspective", 360.0)])
def test_a_field_of_view_beyond_the_surface_ends_where_that_does(kind: str, fov: float) -> None:
    frame = framed(rig((0, 0, 0), (35, 0, 0)), kind=kind, centre=(20.0, 0.0), fov=fov)
    whole = replace(frame, window=None).limits
    assert frame.limits[2] == whole[2] and (kind == "cylindrical" or frame.limits[0] == whole[0])


def test_a_ring_is_drawn_on_a_sphere_level_and_without_a_tilt_to_any_side() -> None:
    """All looked up by the same angle: what goes round has no middle that a tilt would be kept for."""
    views = rig(*[(yaw, 18.0, 0.0) for yaw in range(0, 360, 30)])
    projection = framed(views)
    assert projection.kind == "equirectangular"
    assert np.degrees(np.arccos(projection.rotation[:, 1] @ turned(0, 18, 0)[:, 1])) < 0.5
    almost = framed(rig(*[(yaw, 18.0, 0.0) for yaw in range(0, 240, 30)]))
    assert almost.kind == "cylindrical"


@pytest.mark.parametrize("first", [-170, 10, 100, 160])
def test_a_ring_with_a_gap_has_its_ends_there(first: int) -> None:
    """The middle of what is seen is no mean of directions: three pictures more look one way than the other."""
    yaws = [first + yaw for yaw in (0, 5, 10, 15, 40, 80, 120, 160, 200, 240, 279)]
    views = rig(*[(float(yaw), 0.0, 0.0) for yaw in yaws])
    projection = framed(views)
    # pictures are 2 · 29.7 degrees wide: the gap is what is left of the circle between the outermost
    middle = np.radians(first + 279 / 2)
    ahead = projection.rotation @ np.array([0.0, 0, 1])
    expected = turned(*(float(first), 0, 0)) @ np.array([np.sin(middle), 0, np.cos(middle)])
    assert np.degrees(np.arccos(ahead @ expected)) < 1.5


def test_many_pictures_are_levelled_however_the_first_was_held() -> None:
    """Edges say what all cameras together do, within a degree; the first was turned by 20 degrees."""
    views = rig((0, 0, 20), (30, 0, 0), (-30, 0, 0), (60, 0, 0), (-60, 0, 0))
    down = turned(0, 0, 20) @ np.array([0.0, 1, 0])
    assert framed(views, down).rotation[:, 1] == pytest.approx(down, abs=1e-6)
