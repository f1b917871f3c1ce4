"""Round panoramas hold the same field as flat ones, exactly on its epipolar lines, and all that both pictures show."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import fundamental_from_pose, skew
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.field.strict import StrictField, fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.measure.metrics import look_up
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.panorama.levelling import turned
from edf_stitch.core.panorama.projection import Projection, round_projection
from edf_stitch.core.panorama.warp import Warp, build_map, build_warp, trimmed
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.arrays import box_of
from edf_stitch.core.raster.lazy import whole
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.core.system.errors import BadRequest

from ...pairs import with_map

SIZE, TARGET = (320, 240), (300, 260)
ROUND = ("cylindrical", "equirectangular")
LEVEL = turned(12, -9, 4)
STANDS = {
    "sideways": ((0, -12, 0), (-1.0, 0.1, 0.05)),
    "forward": ((1, 16, 0), (0.05, 0.02, -1.0)),
    "up": ((7, 0, -10), (0.1, 1.0, 0.1)),
}


def depth(points: np.ndarray) -> np.ndarray:
    """Inverse depth of a hilly scene, 3 to 7 baselines away."""
    return 0.22 + 0.06 * np.sin(points[..., 0] / 60) * np.cos(points[..., 1] / 45) + 1e-4 * points[..., 0]


def scene(by_hand: SimpleNamespace, stand: str, lens: tuple[float, ...] = ()) -> tuple[TwoView, Camera, Camera]:
    camera, camera_prime = by_hand.camera(SIZE, 300.0, lens), by_hand.camera(TARGET, 310.0)
    return by_hand.view(camera, camera_prime, *STANDS[stand]), camera, camera_prime


def matches_of(view: TwoView, count: int = 200, bend: float = 0.0) -> Matches:
    x = np.random.default_rng(0).uniform((0, 0), np.array(SIZE) - 1, (count, 2))
    y = target_points(view, x, depth(x))
    inside = np.isfinite(y).all(axis=1) & (y > 0).all(axis=1) & (y < np.array(TARGET) - 1).all(axis=1)
    y = y + bend * np.sin(y[:, ::-1] / 80)
    return Matches(x[inside], y[inside])


def projection_of(view: TwoView, kind: str, level: np.ndarray = LEVEL) -> Projection:
    return round_projection(kind, view.K, level)


def rays_of(canvas: Canvas) -> np.ndarray:
    assert canvas.projection is not None
    return canvas.projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("stand", STANDS)
def test_every_pixel_lies_on_the_epipolar_line_of_its_ray(by_hand: SimpleNamespace, stand: str, kind: str) -> None:
    """x'ᵀ K'⁻ᵀ [t]ₓ R r = 0, and x' ~ K' (R r + d t), as somebody who reads the .npz computes them."""
    view, *cameras = scene(by_hand, stand)
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, kind))
    rays = rays_of(warp.canvas).reshape(-1, 3)
    seen = warp.maps[1].inside().ravel()
    assert seen.sum() > 30_000
    x = np.column_stack([warp.maps[1].x.ravel(), warp.maps[1].y.ravel(), np.ones(len(seen))])[seen]
    line = rays[seen] @ (np.linalg.inv(view.K_prime).T @ skew(view.t) @ view.R).T
    off = np.abs((x * line).sum(axis=1)) / np.hypot(line[:, 0], line[:, 1])
    assert off.max() < 1e-4, "float32 of 300 px"
    d = warp.inverse_depth.ravel()[seen, None].astype(float)
    at = (rays[seen] @ view.R.T + d * view.t) @ view.K_prime.T
    assert (at[:, 2] > 0).all() and np.abs(at[:, :2] / at[:, 2:] - x[:, :2]).max() < 1e-3


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("fade", ["plane", "infinity"])
@pytest.mark.parametrize("name", ["strict", "slack"])
def test_the_field_is_the_flat_panoramas(by_hand: SimpleNamespace, name: str, fade: str, kind: str) -> None:
    """Fading and slack included: what a pixel of the reference's plane shows is what its ray shows."""
    view, *cameras = scene(by_hand, "sideways")
    field = fit_field(name, fade, view, matches_of(view, bend=1.0), SIZE, TARGET)
    flat = build_warp(field, views_of(view, cameras))
    warp = build_warp(field, views_of(view, cameras), projection_of(view, kind))
    x, y = np.meshgrid(np.arange(2, flat.canvas.width - 2, 3), np.arange(2, flat.canvas.height - 2, 3))
    points = np.column_stack([x.ravel(), y.ravel()]) - np.array(flat.canvas.offset, float)
    theirs = look_up(flat, points)
    shown = (theirs > 0).all(axis=1) & (theirs < np.array(TARGET) - 1).all(axis=1)
    inside = shown & (points > 0).all(axis=1) & (points < np.array(SIZE) - 1).all(axis=1)
    assert inside.sum() > 3000 and (shown & ~inside).sum() > 1000
    off = np.linalg.norm(look_up(warp, points) - theirs, axis=1)
    assert np.isfinite(off[shown]).mean() > 0.99, "the rim: bilinear needs four pixels"
    assert np.nanmax(off[inside]) < 0.03 and np.nanmedian(off[inside]) < 0.002
    # a fade begins at a node of its grid, and every canvas has its own
    assert np.nanmax(off[shown & ~inside]) < 0.5


@pytest.mark.parametrize("kind", ROUND)
def test_a_plane_is_a_plane_all_round(by_hand: SimpleNamespace, kind: str) -> None:
    """d = n·r with n = Kᵀ m, also where the reference camera does not look."""
    view, *cameras = scene(by_hand, "sideways")
    m = np.array([4e-4, -2e-4, 0.1])
    x = matches_of(view).x
    y = target_points(view, x, x @ m[:2] + m[2])
    field = fit_strict(view, Matches(x, y), SIZE, TARGET)
    canvas = Canvas(1500, 400, (750, 200), projection=projection_of(view, kind))
    warp = build_map(field, views_of(view, cameras), canvas)
    expected = rays_of(canvas) @ (view.K.T @ m)
    assert (rays_of(canvas)[..., 2] < -0.2).sum() > 1000
    assert np.abs(warp.inverse_depth - expected).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("stand", STANDS)
def test_the_canvas_holds_both_pictures_whole_and_no_more(by_hand: SimpleNamespace, stand: str, kind: str) -> None:
    view, *cameras = scene(by_hand, stand)
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, kind))
    maps = [one.arrays() for one in warp.maps]
    assert [one.size for one in maps] == [SIZE, TARGET]
    own, theirs = (
        (one.x >= 0) & (one.x <= width - 1) & (one.y >= 0) & (one.y <= height - 1)
        for one, (width, height) in zip(maps, (SIZE, TARGET), strict=True)
    )
    for shown, one, size in ((own, maps[0], SIZE), (theirs, maps[1], TARGET)):
        found = np.zeros(size[::-1], np.uint8)
        found[np.rint(one.y[shown]).astype(int), np.rint(one.x[shown]).astype(int)] = 1
        assert cv2.dilate(found, np.ones((7, 7), np.uint8)).all()
    seen = own | theirs
    assert seen[0].any() and seen[-1].any() and seen[:, 0].any() and seen[:, -1].any() and not warp.canvas.cropped
    left, top, width, height = box_of(warp.maps[0].inside())
    assert own[top : top + height, left : left + width].sum() == own.sum()
    assert own[top].any() and own[:, left].any() and own[top + height - 1].any() and own[:, left + width - 1].any()


def wide(by_hand: SimpleNamespace) -> tuple[TwoView, Camera, Camera, StrictField]:
    """A target that looks 75° to the right of the reference, both with lenses of 94°."""
    camera = by_hand.camera(SIZE, 150.0)
    view = by_hand.view(camera, camera, (0, -75, 0), (-1.0, 0.0, 0.05))
    x = np.random.default_rng(1).uniform((200, 0), np.array(SIZE) - 1, (300, 2))
    d = 0.05 + 1e-4 * x[:, 0]
    y = target_points(view, x, d)
    inside = np.isfinite(y).all(axis=1) & (y > 0).all(axis=1) & (y < np.array(SIZE) - 1).all(axis=1)
    return view, camera, camera, fit_strict(view, Matches(x[inside], y[inside]), SIZE, SIZE)


def test_a_wide_pair_that_a_plane_must_crop_is_whole_on_a_cylinder(by_hand: SimpleNamespace) -> None:
    view, *cameras, field = wide(by_hand)
    views = views_of(view, cameras)
    assert build_warp(field, views).canvas.cropped
    for kind in ROUND:
        warp = build_warp(field, views, projection_of(view, kind, np.eye(3)))
        assert not warp.canvas.cropped
        assert (rays_of(warp.canvas)[..., 2] < 0)[warp.maps[1].inside()].mean() > 0.05, "some of it lies behind"
        shown = warp.maps[1].inside()
        found = np.zeros(SIZE[::-1], np.uint8)
        found[np.rint(warp.maps[1].y[shown]).astype(int), np.rint(warp.maps[1].x[shown]).astype(int)] = 1
        assert cv2.dilate(found, np.ones((9, 9), np.uint8)).all()


@pytest.mark.parametrize("level", [turned(0, 90, 0), turned(20, -85, 30), turned(180, 0, 0), turned(170, 60, 5)])
def test_pictures_over_a_pole_or_across_the_line_behind_are_whole_on_a_sphere(
    by_hand: SimpleNamespace, level: np.ndarray
) -> None:
    view, *cameras = scene(by_hand, "sideways")
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, "equirectangular", level))
    assert not warp.canvas.cropped
    for size, one in zip((SIZE, TARGET), warp.maps, strict=True):
        x, y = one.arrays().x, one.arrays().y
        with np.errstate(invalid="ignore"):
            shown = (x >= 0) & (x <= size[0] - 1) & (y >= 0) & (y <= size[1] - 1)
        found = np.zeros(size[::-1], np.uint8)
        found[np.rint(y[shown]).astype(int), np.rint(x[shown]).astype(int)] = 1
        assert cv2.dilate(found, np.ones((7, 7), np.uint8)).all()
    _, _, width, height = warp.canvas.whole
    assert width == 2 * height and warp.canvas.width <= width and warp.canvas.height <= height


def test_a_cylinder_ends_before_the_zenith_and_says_so(by_hand: SimpleNamespace) -> None:
    view, *cameras = scene(by_hand, "sideways")
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, "cylindrical", turned(0, 70, 0)))
    assert warp.canvas.cropped and warp.canvas.height < 3.1 * 300


@pytest.mark.parametrize("kind", ROUND)
def test_the_depth_order_counts_the_same(by_hand: SimpleNamespace, kind: str) -> None:
    """Inverse depth in front of the target, where canvas points are rays: the flat panorama's at the same places."""
    view, *cameras = scene(by_hand, "forward")
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, kind))
    frame = build_map(field, views_of(view, cameras), Canvas(*SIZE, (0, 0)))
    points = np.random.default_rng(3).uniform((20, 20), (300, 220), (200, 2))
    found, expected = (
        look_up(with_map(w, whole(w.nearness(views_of(view, cameras), 1))), points)[:, 0] for w in (warp, frame)
    )
    target = look_up(frame, points)
    seen = (target > 5).all(axis=1) & (target < np.array(TARGET) - 6).all(axis=1)  # where nothing fades
    assert seen.sum() > 100 and np.abs(found - expected)[seen].max() < 1e-3 * expected[seen].max()


@pytest.mark.parametrize("lens", [(), (-0.2, 0.05)], ids=["ideal", "bent"])
@pytest.mark.parametrize("kind", ROUND)
def test_the_reference_is_fetched_where_its_rays_are(
    by_hand: SimpleNamespace, kind: str, lens: tuple[float, ...]
) -> None:
    """A picture that holds its own coordinates says where each canvas pixel was fetched."""
    view, camera, target = scene(by_hand, "sideways", lens)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    picture = picture_from_array(np.stack([x, y, 0 * x], axis=-1).astype(np.float32))
    canvas = Canvas(420, 330, (210, 165), projection=projection_of(view, kind))
    field, views = fit_strict(view, matches_of(view), SIZE, TARGET), views_of(view, (camera, target))
    layer = layer_of(picture, build_map(field, views, canvas).maps[0])
    shown = layer.alpha == 1
    assert 40_000 < shown.sum() < canvas.width * canvas.height and not layer.pixels[layer.alpha == 0].any()
    places = canvas.of_reference(layer.pixels[shown][:, :2].astype(float), camera)
    assert np.abs(places - np.argwhere(shown)[:, ::-1]).max() < 0.2, "OpenCV's bicubic is off by 0.1"


def test_a_lens_bends_both_panoramas_alike(by_hand: SimpleNamespace) -> None:
    view, *cameras = scene(by_hand, "sideways", (-0.2, 0.05))
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    frame = build_map(field, views_of(view, cameras), Canvas(*SIZE, (0, 0)))
    warp = build_warp(field, views_of(view, cameras), projection_of(view, "cylindrical"))
    points = np.random.default_rng(3).uniform((5, 5), (314, 234), (400, 2))
    target = look_up(frame, points)
    seen = (target > 5).all(axis=1) & (target < np.array(TARGET) - 6).all(axis=1)  # where nothing fades
    assert seen.sum() > 100 and np.abs(look_up(warp, points, cameras[0]) - target)[seen].max() < 0.03


def test_a_field_of_the_plane_alone_is_refused(by_hand: SimpleNamespace) -> None:
    view, *cameras = scene(by_hand, "sideways")
    field = fit_field("paper", "plane", view, matches_of(view), SIZE, TARGET)
    with pytest.raises(BadRequest, match="'paper' knows the reference's plane only: use slack or strict"):
        build_warp(field, views_of(view, cameras), projection_of(view, "cylindrical"))


def test_a_window_that_shows_nothing_is_refused(by_hand: SimpleNamespace) -> None:
    projection = Projection("cylindrical", 100.0, (0.0, 0.0), np.eye(3), by_hand.camera(SIZE, 300.0).K)
    nothing = PictureMap(np.full((4, 5), np.nan, np.float32), np.full((4, 5), np.nan, np.float32), SIZE)
    canvas = Canvas(5, 4, (-200, 0), projection=replace(projection, window=(200, 0, 205, 4)))
    with pytest.raises(BadRequest, match="shows nothing .* centre"):
        trimmed(Warp(canvas, (nothing, nothing), np.zeros((4, 5), np.float32)))


def test_a_rotation_needs_no_depth(by_hand: SimpleNamespace) -> None:
    view, *cameras = scene(by_hand, "sideways")
    zero = np.zeros(3)
    view = replace(view, t=zero, e_prime=zero, F=np.full((3, 3), np.nan), model="rotation")
    x = matches_of(view).x
    field = fit_strict(view, Matches(x, target_points(view, x, np.zeros(len(x)))), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, "equirectangular"))
    assert not warp.inverse_depth.any()
    at = rays_of(warp.canvas) @ (view.K_prime @ view.R).T
    shown = warp.maps[1].inside()
    assert np.abs(at[shown][:, 0] / at[shown][:, 2] - warp.maps[1].x[shown]).max() < 1e-3


def test_beyond_its_edges_a_warp_is_nothing(by_hand: SimpleNamespace) -> None:
    view, *cameras = scene(by_hand, "sideways")
    field = fit_strict(view, matches_of(view), SIZE, TARGET)
    warp = build_warp(field, views_of(view, cameras), projection_of(view, "equirectangular"))
    whole: Warp = warp.within(warp.canvas.whole)
    assert whole.maps[1].x.shape == (whole.canvas.height, whole.canvas.width) and whole.canvas.whole[:2] == (0, 0)
    left, top, _, _ = warp.canvas.whole
    part = np.s_[-top : -top + warp.canvas.height, -left : -left + warp.canvas.width]
    assert np.array_equal(whole.maps[1].x[part], warp.maps[1].x, equal_nan=True)
    assert np.isfinite(whole.maps[1].x).sum() == np.isfinite(warp.maps[1].x).sum()
    assert np.abs(fundamental_from_pose(view.K, view.K_prime, view.R, view.t) - view.F).max() < 1e-9
