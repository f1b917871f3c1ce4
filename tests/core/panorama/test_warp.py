"""The backward map lies on the epipolar lines, means what docs/formats.md says, and does not spoil pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.projective import distance_to_line
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.field.refined_depth import RefinedDepth
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.panorama.reference_map import ReferenceMap
from edf_stitch.core.panorama.warp import Warp, build_map, build_warp
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.raster import sampling
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.core.raster.sampling import fetch
from edf_stitch.core.system.errors import NoOverlap

SIZE = (320, 240)
# how the target camera stands: sideways, forward (the epipole lies in the picture), backward and turned, up
STANDS = {
    "sideways": ((0, -12, 0), (-1.0, 0.1, 0.05)),
    "parallel": ((0, 0, 0), (-1.0, 0.0, 0.0)),
    "forward": ((1, 16, 0), (0.05, 0.02, -1.0)),
    "backward": ((0, -8, 3), (0.2, 0.1, 1.0)),
    "up": ((7, 0, -10), (0.1, 1.0, 0.1)),
}


def wavy(by_hand: SimpleNamespace) -> object:
    """A field that bends: depths from 2.5 to 20 baselines."""
    return by_hand.Field(
        lambda p: 0.2 + 0.1 * np.sin(p[..., 0] / 60) * np.cos(p[..., 1] / 45) + 1e-4 * p[..., 0],
        np.array([1e-4, 0, 0.2]),
    )


def made(by_hand: SimpleNamespace, stand: str, field: object | None = None) -> tuple[Warp, SimpleNamespace]:
    camera, camera_prime = by_hand.camera(SIZE, 300.0), by_hand.camera((300, 260), 310.0)
    view = by_hand.view(camera, camera_prime, *STANDS[stand])
    warp = build_warp(field or wavy(by_hand), views_of(view, (camera, camera_prime)))
    return warp, SimpleNamespace(view=view, size=camera.size, target_size=camera_prime.size)


def canvas_points(warp: Warp) -> np.ndarray:
    x, y = np.meshgrid(np.arange(warp.canvas.width), np.arange(warp.canvas.height))
    return np.stack([x, y], axis=-1).astype(float) - warp.canvas.offset


def planes_of(warp: Warp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The target's x and y, and the inverse depth."""
    return warp.maps[1].x, warp.maps[1].y, warp.inverse_depth


@pytest.mark.parametrize("stand", STANDS)
def test_every_canvas_pixel_lies_on_its_epipolar_line(by_hand: SimpleNamespace, stand: str) -> None:
    warp, scene = made(by_hand, stand)
    shown = warp.maps[1].inside()
    mapped = np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1)
    finite = np.isfinite(mapped).all(axis=-1)
    points = canvas_points(warp)
    inside = np.zeros(shown.shape, bool)
    x, y = warp.canvas.offset
    inside[y : y + SIZE[1], x : x + SIZE[0]] = True
    assert (shown & inside).sum() > 1000 and (shown & ~inside).sum() > 1000, "overlap and beyond"
    off = distance_to_line(scene.view.F, points[finite], mapped[finite].astype(float))
    near = np.abs(mapped[finite]).max(axis=1) < 4000  # float32 resolves 2.4e-4 there
    assert near.mean() > 0.9 and off[near].max() < 1e-3
    assert (off[~near] < 2 * np.spacing(np.abs(mapped[finite][~near]).max(axis=1))).all(), "no more than rounding"


@pytest.mark.parametrize("stand", STANDS)
def test_the_map_is_h_inf_p_plus_inverse_depth_times_e(by_hand: SimpleNamespace, stand: str) -> None:
    """As somebody who reads the .npz computes it, by docs/formats.md."""
    warp, scene = made(by_hand, stand)
    p = canvas_points(warp).reshape(-1, 2)
    ray = np.column_stack([p, np.ones(len(p))]) @ scene.view.H_inf.T
    ray += warp.inverse_depth.reshape(-1, 1).astype(float) * scene.view.e_prime
    front = ray[:, 2] > 1e-3
    expected = ray[front, :2] / ray[front, 2:]
    mapped = np.column_stack([warp.maps[1].x.ravel(), warp.maps[1].y.ravel()])[front]
    # float32 of the result, and of d e' before the division
    rounding = 2**-23 * (np.abs(expected) + np.abs(scene.view.e_prime).max() / ray[front, 2:])
    assert (np.abs(mapped - expected) <= rounding).all()
    for plane in planes_of(warp):
        assert plane.dtype == np.float32 and plane.shape == (warp.canvas.height, warp.canvas.width)


def test_the_inverse_depth_is_the_fields_at_every_pixel(by_hand: SimpleNamespace) -> None:
    warp, _ = made(by_hand, "sideways")
    assert np.abs(warp.inverse_depth - wavy(by_hand).depth(canvas_points(warp))).max() < 0.1 * (4 / 45) ** 2 / 4


def test_strips_leave_no_trace(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((1203, 1001), 900.0)
    view = by_hand.view(camera, camera, *STANDS["sideways"])
    field = wavy(by_hand)
    canvas = Canvas(1203, 1001, (17, -5))  # 1.2 million pixels: two strips
    warp = build_map(field, views_of(view, (camera, camera)), canvas)
    grid = Grid.over(-17, 5, 1203, 1001)
    whole = grid.to_pixels(field.on_grid(grid).inverse_depth, -17, 5, 1203, 1001)
    # BLAS sums a strip of another height in another order on some processors: the last float32 digit is its own
    assert np.allclose(warp.inverse_depth, whole, rtol=2**-21, atol=0)
    rows = np.abs(np.diff(warp.maps[1].y, 2, axis=0))
    assert rows.max() < 3 * np.median(rows.max(axis=1)), "no line where two strips meet"


def test_the_canvas_is_no_larger_than_what_it_shows(by_hand: SimpleNamespace) -> None:
    for stand in STANDS:
        warp, scene = made(by_hand, stand)
        shown = warp.maps[1].inside()
        x, y = warp.canvas.offset
        assert x >= 0 and y >= 0 and x + SIZE[0] <= warp.canvas.width and y + SIZE[1] <= warp.canvas.height
        shown[y : y + SIZE[1], x : x + SIZE[0]] = True
        assert shown[0].any() and shown[-1].any() and shown[:, 0].any() and shown[:, -1].any()
        assert not warp.canvas.cropped


def test_the_whole_target_is_shown(by_hand: SimpleNamespace) -> None:
    """Its corners too: none of its pixels lies further than a canvas pixel's reach from one that was fetched."""
    warp, scene = made(by_hand, "sideways")
    shown = warp.maps[1].inside()
    found = np.zeros(scene.target_size[::-1], np.uint8)
    found[np.rint(warp.maps[1].y[shown]).astype(int), np.rint(warp.maps[1].x[shown]).astype(int)] = 1
    assert cv2.dilate(found, np.ones((7, 7), np.uint8)).all()


def test_no_turn_and_no_depth_is_the_target_itself(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((97, 61), 80.0)
    view = by_hand.view(camera, camera, (0, 0, 0), (-1, 0, 0))
    warp = build_warp(by_hand.plane_field(0, 0, 0), views_of(view, (camera, camera)))
    assert warp.canvas == Canvas(97, 61, (0, 0))
    x, y, inverse_depth = planes_of(warp)
    assert np.abs(x - np.arange(97)).max() < 1e-4 and np.abs(y - np.arange(61)[:, None]).max() < 1e-4
    assert (inverse_depth == 0).all()


def identity(width: int, height: int, dx: float = 0.0, dy: float = 0.0) -> PictureMap:
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return PictureMap(x + np.float32(dx), y + np.float32(dy), (width, height))


def noise(height: int, width: int, channels: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, channels)).astype(np.float32)


@pytest.mark.parametrize("channels", [1, 3])
def test_the_identity_map_returns_every_pixel_as_it_is(channels: int) -> None:
    picture = picture_from_array(noise(41, 53, channels) * 100 - 3)
    layer = layer_of(picture, identity(53, 41))
    assert np.array_equal(layer.pixels, picture.pixels) and (layer.alpha == 1).all()


@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize(("dx", "dy"), [(7, 0), (-3, 5), (0, -40), (52, 0)])
def test_a_map_of_whole_pixels_moves_pixels_and_nothing_else(channels: int, dx: int, dy: int) -> None:
    source = noise(41, 53, channels)
    moved = identity(53, 41, dx, dy)
    out = fetch(source, moved.x, moved.y)
    expected = np.zeros_like(source)
    to_y, to_x = slice(max(0, -dy), min(41, 41 - dy)), slice(max(0, -dx), min(53, 53 - dx))
    expected[to_y, to_x] = source[to_y.start + dy : to_y.stop + dy, to_x.start + dx : to_x.stop + dx]
    assert np.array_equal(out, expected)


def test_straight_lines_of_light_are_met_between_pixels() -> None:
    """A ramp fetched at fractions is that ramp: no shift by half a pixel, and the rim is as good as the middle."""
    y, x = np.mgrid[:30, :40].astype(np.float32)
    half = identity(39, 29, 0.5, 0.5)  # where bicubic is symmetrical, hence exact on a ramp
    out = fetch(np.stack([x, y], axis=-1), half.x, half.y)
    assert np.abs(out[1:-1, 1:-1, 0] - half.x[1:-1, 1:-1]).max() < 1e-4
    assert np.abs(out[1:-1, 1:-1, 1] - half.y[1:-1, 1:-1]).max() < 1e-4
    assert np.abs(out[..., 0] - half.x).max() < 0.2 and np.abs(out[..., 1] - half.y).max() < 0.2


def test_positions_count_to_a_fifteenth_of_a_pixel() -> None:
    """OpenCV's remap knows 1/32 px, and its bicubic (a = −0.75) bends a ramp by up to 0.048 px: 1/64 + 0.048."""
    _, x = np.mgrid[:20, :200].astype(np.float32)
    map_x = x[2:18, 10:190] + np.linspace(0, 1, 180, dtype=np.float32)
    out = fetch(np.sin(x / 15)[..., None], map_x, np.full_like(map_x, 9))[..., 0]
    assert np.abs(out - np.sin(map_x / 15)).max() < 0.065 / 15


def test_the_reference_is_an_exact_paste(by_hand: SimpleNamespace) -> None:
    array = noise(31, 47, 4)
    array[:9, :9, 3] = 0
    for picture in (picture_from_array(array), picture_from_array(array[..., :3]), picture_from_array(array[..., :1])):
        layer = layer_of(picture, ReferenceMap(Canvas(70, 50, (11, 8)), by_hand.camera((47, 31), 40.0)))
        box = (slice(8, 39), slice(11, 58))
        assert np.array_equal(layer.pixels[box], picture.pixels)
        assert np.array_equal(layer.alpha[box], np.ones((31, 47)) if picture.alpha is None else picture.alpha)
        outside = np.ones((50, 70), bool)
        outside[box] = False
        assert not layer.alpha[outside].any() and not layer.pixels[outside].any()
        assert layer.pixels.dtype == np.float32 and layer.alpha.dtype == (
            bool if picture.alpha is None else np.float32
        )


def half_transparent() -> Picture:
    array = np.empty((40, 60, 4), np.float32)
    array[..., :3] = (0.25, 0.5, 0.75)
    array[:, 30:, :3] = (900.0, 0.0, 900.0)  # what nobody was meant to see
    array[..., 3] = np.where(np.arange(60) < 30, 1.0, 0.0)
    return picture_from_array(array)


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25, 0.5, 0.8])
def test_transparent_colours_never_bleed(shift: float) -> None:
    layer = layer_of(half_transparent(), identity(60, 40, shift, 0.3))
    seen = layer.alpha > 0
    assert seen.any() and np.abs(layer.pixels[seen] - (0.25, 0.5, 0.75)).max() < 1e-3
    assert not layer.pixels[~seen].any()
    assert layer.alpha.min() == 0 and layer.alpha.max() == 1
    assert (layer.alpha[:, :28][:-1] > 0.99).all() and (layer.alpha[:, 32:] == 0).all()


def test_alpha_is_straight() -> None:
    array = noise(30, 40, 4)
    array[..., :3] = 0.6
    array[..., 3] = np.linspace(0.2, 1, 40)
    layer = layer_of(picture_from_array(array), identity(40, 30, 0.37, 0.21))
    shown = layer.alpha > 0
    assert np.abs(layer.pixels[shown] - 0.6).max() < 1e-5, "not multiplied by alpha"
    expected = np.interp(np.arange(39) + 0.37, np.arange(40), array[0, :, 3])
    assert np.abs(layer.alpha[:-1, 2:37] - expected[2:37]).max() < 0.002


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_values_stay_within_the_pictures_range(channels: int) -> None:
    """Bicubic overshoots at edges; light below black does not exist."""
    random = np.random.default_rng(5)
    array = np.where(random.random((50, 50, channels)) < 0.5, 0.0, 700.0).astype(np.float32)
    if channels == 4:
        array[..., 3] = random.random((50, 50)) < 0.7
    picture = picture_from_array(array)
    x, y = (random.uniform(-3, 52, (80, 80)).astype(np.float32) for _ in range(2))
    layer = layer_of(picture, PictureMap(x, y, (50, 50)))
    assert layer.pixels.min() >= 0 and layer.pixels.max() <= 700
    assert 0 <= layer.alpha.min() and layer.alpha.max() <= 1
    raw = fetch(picture.pixels, x, y)
    assert raw.min() < -10 and raw.max() > 710, "there was something to hold"


def test_no_value_is_darker_than_the_darkest_of_a_bright_picture() -> None:
    random = np.random.default_rng(5)
    picture = picture_from_array(np.where(random.random((50, 50, 3)) < 0.5, 20.0, 700.0).astype(np.float32))
    x, y = (random.uniform(0, 49, (80, 80)).astype(np.float32) for _ in range(2))
    layer = layer_of(picture, PictureMap(x, y, (50, 50)))
    assert layer.alpha.all() and layer.pixels.min() >= 20 and layer.pixels.max() <= 700


def test_behind_the_camera_there_is_nothing(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((200, 150), 100.0)
    view = by_hand.view(camera, camera, (0, -60, 0), (-1, 0, 0))
    canvas = Canvas(600, 150, (380, 0))  # reaches 70° to the left of the reference's axis: 130° from the target's
    warp = build_map(by_hand.plane_field(0, 0, 0.1), views_of(view, (camera, camera)), canvas)
    ray = canvas_points(warp) @ view.H_inf[2, :2] + view.H_inf[2, 2] + 0.1 * view.e_prime[2]
    behind = ray < -0.01
    assert behind.sum() > 1000 and np.isnan(warp.maps[1].x[behind]).all() and np.isnan(warp.maps[1].y[behind]).all()
    assert np.isfinite(warp.maps[1].x[ray > 0.01]).all() and np.isfinite(warp.inverse_depth).all()
    assert not warp.maps[1].inside()[behind].any()
    layer = layer_of(picture_from_array(noise(150, 200, 3)), warp.maps[1])
    assert np.isfinite(layer.pixels).all() and not layer.alpha[behind].any() and not layer.pixels[behind].any()


def test_a_target_that_reaches_to_infinity_is_cropped_and_says_so(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((200, 150), 100.0)  # 90° wide: turned by 60° it reaches 105° to the side
    view = by_hand.view(camera, camera, (0, -60, 0), (-1, 0, 0.2))
    warp = build_warp(by_hand.plane_field(0, 0, 0.1), views_of(view, (camera, camera)))
    assert warp.canvas.cropped
    assert warp.canvas.width <= 200 + 2 * 3 * 200 and warp.canvas.height <= 150 + 2 * 3 * 200
    assert warp.maps[1].inside().sum() > 2000
    # nothing is shown that is stretched much more than four times in length
    x, y = warp.maps[1].x, warp.maps[1].y
    area = np.diff(x[:-1], axis=1) * np.diff(y[:, :-1], axis=0) - np.diff(x[:, :-1], axis=0) * np.diff(y[:-1], axis=1)
    columns = np.where(warp.maps[1].inside()[:-1, :-1], area, np.nan)
    assert np.nanmedian(columns[:, -12:-2]) > 0.5 / 4**2


def test_a_target_that_lies_too_far_away_is_cropped_and_says_so(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((200, 150), 100.0)
    views = views_of(by_hand.view(camera, camera, (0, 0, 0), (1, 0, 0)), (camera, camera))
    warp = build_warp(by_hand.plane_field(0, 0, 7.0), views)  # 700 px to the left: three widths are 600
    assert warp.canvas.cropped and 600 <= warp.canvas.offset[0] < 690
    whole = build_warp(by_hand.plane_field(0, 0, 5.0), views)
    assert not whole.canvas.cropped and whole.canvas.offset == (500, 0) and whole.canvas.width == 700


def test_a_warp_that_leads_nowhere_near_is_refused(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((200, 150), 200.0)
    view = by_hand.view(camera, camera, (0, -170, 0), (-1, 0, 0))
    with pytest.raises(NoOverlap, match="nowhere near"):
        build_warp(by_hand.plane_field(0, 0, 0.0), views_of(view, (camera, camera)))


@pytest.mark.parametrize("turned", [False, True], ids=["wide", "tall"])
def test_sources_and_targets_beyond_opencvs_32767_pixels(turned: bool) -> None:
    source, moved = noise(6, 40_000, 1), identity(40_000, 6, -2.0, 1.0)
    map_x, map_y = moved.x, moved.y
    expected = np.zeros_like(source)
    expected[:-1, 2:] = source[1:, :-2]
    if turned:
        source, expected = (np.ascontiguousarray(a.swapaxes(0, 1)) for a in (source, expected))
        map_x, map_y = np.ascontiguousarray(map_y.T), np.ascontiguousarray(map_x.T)
    assert np.array_equal(fetch(source, map_x, map_y), expected)


def test_a_few_pixels_from_all_over_a_huge_picture() -> None:
    """A tile that shrinks more than OpenCV can hold is quartered until it can."""
    source = noise(6, 40_000, 3)
    columns = np.random.default_rng(2).permutation(np.linspace(0, 39_999, 64).astype(int)).reshape(8, 8)
    out = fetch(source, columns.astype(np.float32), np.full((8, 8), 3, np.float32))
    assert np.array_equal(out, source[3, columns])


def test_tiles_leave_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    source = noise(90, 110, 3)
    y, x = np.mgrid[:130, :150].astype(np.float32)
    map_x, map_y = 0.8 * x + 0.1 * y - 7, 0.7 * y + 5 * np.sin(x / 9)
    map_x[40:44, 50:60] = np.nan
    whole = fetch(source, map_x, map_y)
    for tile, limit in ((64, 32_000), (7, 32_000), (64, 20), (4096, 20)):
        monkeypatch.setattr(sampling, "PARTS", replace(sampling.PARTS, tile_side=tile, max_remap_side=limit))
        assert np.array_equal(fetch(source, map_x, map_y), whole)


def cv2_undistorted(points: np.ndarray, camera: object) -> np.ndarray:
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    flat = points.reshape(-1, 1, 2)
    out = cv2.undistortPointsIter(flat, camera.K, camera.distortion, np.eye(3), camera.K, criteria)
    return out.reshape(points.shape)


def cv2_distorted(points: np.ndarray, camera: object) -> np.ndarray:
    flat = points.reshape(-1, 2)
    rays = np.column_stack([flat, np.ones(len(flat))]) @ np.linalg.inv(camera.K).T
    out, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, camera.distortion)
    return out.reshape(points.shape)


@pytest.mark.parametrize("which", ["reference", "target", "both"])
def test_a_distorted_pair_and_the_same_pair_undistorted_meet(by_hand: SimpleNamespace, which: str) -> None:
    """OpenCV does the distorting here: the raw map is distort' ∘ ideal map ∘ undistort, over the whole reference."""
    bent, straight = (-0.12, 0.03, 0.001, -0.002, 0.0), ()
    camera = by_hand.camera(SIZE, 300.0, bent if which != "target" else straight)
    camera_prime = by_hand.camera(SIZE, 290.0, bent if which != "reference" else straight)
    view = by_hand.view(camera, camera_prime, (2, -5, 3), (-1.0, 0.1, 0.1))
    field = by_hand.plane_field(4e-4, -6e-4, 0.3)  # a slanted plane: d differs from pixel to pixel
    warp = build_warp(field, views_of(view, (camera, camera_prime)))
    x, y = warp.canvas.offset
    box = (slice(y, y + SIZE[1]), slice(x, x + SIZE[0]))
    ideal = cv2_undistorted(canvas_points(warp)[box], camera)
    rays = np.concatenate([ideal, np.ones((*ideal.shape[:2], 1))], axis=-1) @ view.H_inf.T
    rays += field.depth(ideal)[..., None] * view.e_prime
    expected = cv2_distorted(rays[..., :2] / rays[..., 2:], camera_prime)
    mapped = np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1)[box]
    shown = warp.maps[1].inside()[box]
    assert shown.sum() > 20_000
    assert np.abs(mapped - expected)[shown].max() < 0.02


# --- a field that leaves its lines ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shifted:
    """Another field, and the same shift everywhere on top of it."""

    base: object
    by: tuple[float, float]

    @property
    def plane(self) -> np.ndarray:
        return self.base.plane

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        return FieldValues(self.base.on_grid(grid, ideal).inverse_depth, np.full((*grid.points.shape[:2], 2), self.by))


def test_a_shift_comes_on_top_and_the_canvas_makes_room_for_it(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera(SIZE, 300.0)
    view, plane = by_hand.view(camera, camera, *STANDS["parallel"]), by_hand.plane_field(0, 0, 0.2)
    views = views_of(view, (camera, camera))
    theirs, ours = (build_warp(field, views) for field in (plane, Shifted(plane, (0, -12.0))))
    a, b = theirs.canvas, ours.canvas
    assert (b.width, b.height, b.offset) == (a.width, a.height + 12, a.offset)
    for with_shift, without, by in zip(planes_of(ours), planes_of(theirs), (0, -12, 0), strict=True):
        assert np.abs(with_shift[: a.height] - without - by).max() < 1e-4


# --- a part of the canvas ------------------------------------------------------------------------------------------


def test_a_part_of_a_warp_and_of_a_layer(by_hand: SimpleNamespace) -> None:
    """Cut alike; the offset may leave the part: reference pixel (0, 0) then lies outside it."""
    whole, _ = made(by_hand, "sideways")
    box, cut = (20, 15, 90, 40), (slice(15, 55), slice(20, 110))
    part = whole.within(box)
    assert (part.canvas.width, part.canvas.height, part.canvas.cropped) == (90, 40, False)
    assert np.array_equal(canvas_points(part), canvas_points(whole)[cut])
    for array, all_of_it in zip(planes_of(part), planes_of(whole), strict=True):
        assert np.array_equal(array, all_of_it[cut], equal_nan=True)
    assert np.shares_memory(part.maps[1].arrays().x, whole.maps[1].arrays().x), "as large as a canvas"
    layer = layer_of(picture_from_array(noise(260, 300, 3)), whole.maps[1])
    again = layer_of(picture_from_array(noise(260, 300, 3)), part.maps[1])
    assert np.array_equal(layer.within(box).pixels, again.pixels)
    assert np.array_equal(layer.within(box).alpha, again.alpha)
    flagged = replace(whole, canvas=replace(whole.canvas, cropped=True))
    assert flagged.within(box).canvas.cropped, "a part of what was cut off stays cut off"


def test_depth_and_confidence_are_the_same_whatever_part_is_asked_for(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((1203, 1001), 900.0)
    view = by_hand.view(camera, camera, *STANDS["sideways"])
    nodes = np.random.default_rng(2).normal(scale=0.01, size=(30, 40, 4)).astype(np.float32)
    refined = RefinedDepth((100.5, 200.5), (20.0, 20.0), nodes[..., 0], nodes[..., 1:3], np.abs(nodes[..., 3]))
    warp = build_map(wavy(by_hand), views_of(view, (camera, camera)), Canvas(1203, 1001, (17, -5)), refined)
    assert warp.lazy_confidence is not None and warp.confidence is not None
    for plane, all_of_it in ((warp.depth, warp.inverse_depth), (warp.lazy_confidence, warp.confidence)):
        assert all_of_it[300:500, 300:500].any()
        for part in (np.s_[700:900, 0:1203], np.s_[815:1001, 333:700], np.s_[3:4, 9:10]):
            assert np.array_equal(plane[part], all_of_it[part])
    x, y = warp.maps[1].x[300:500, 300:500], warp.maps[1].y[300:500, 300:500]
    flat = build_map(wavy(by_hand), views_of(view, (camera, camera)), Canvas(1203, 1001, (17, -5)))
    assert np.hypot(x - flat.maps[1].x[300:500, 300:500], y - flat.maps[1].y[300:500, 300:500]).mean() > 0.5


# --- three pictures -------------------------------------------------------------------------------------------------


def test_each_further_picture_has_the_map_it_has_alone(by_hand: SimpleNamespace) -> None:
    """Depth lies along the reference's rays: two more pictures of it do not touch each other."""
    camera, lens = by_hand.camera(SIZE, 300.0), by_hand.camera((300, 260), 310.0, (-0.1, 0.02))
    pairs = [
        views_of(by_hand.view(camera, other, *STANDS[stand]), (camera, other))
        for other, stand in ((camera, "sideways"), (lens, "up"))
    ]
    (reference, first), (_, second) = pairs
    field, canvas = by_hand.plane_field(4e-4, -6e-4, 0.3), Canvas(500, 400, (80, 90))
    warp = build_map(field, (reference, first, second), canvas)
    assert len(warp.maps) == 3 and [one.size for one in warp.maps] == [SIZE, SIZE, (300, 260)]
    for one, pair in zip(warp.maps[1:], pairs, strict=True):
        alone = build_map(field, pair, canvas)
        assert one.inside().sum() > 10_000
        assert np.array_equal(one.x, alone.maps[1].x, equal_nan=True)
        assert np.array_equal(one.y, alone.maps[1].y, equal_nan=True)
        assert np.array_equal(warp.inverse_depth, alone.inverse_depth)
    assert np.abs(warp.maps[1].x - warp.maps[2].x).max() > 10, "not one picture twice"
