"""What is measured is what the words say: PSNR and SSIM as others compute them, folds, the map between pixels."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.field.folding import folds, turning
from edf_stitch.core.measure.metrics import (
    CoverageSamples,
    appearance,
    coverage_samples,
    look_up,
    off_line_mean,
    overlap_quality,
    psnr,
    ssim,
)
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.warp import Warp, build_warp
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.colour import decode, encode

from ...pairs import warp_of, with_map


def two_pictures(channels: int = 3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(8)
    smooth = cv2.GaussianBlur(random.random((90, 120, channels)), (0, 0), 2).reshape(90, 120, channels)
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    noisy = np.clip(smooth * 0.9 + 0.06 * random.normal(size=smooth.shape), 0, 1)
    return np.rint(255 * smooth).astype(np.uint8), np.rint(255 * noisy).astype(np.uint8)


def blob() -> np.ndarray:
    """A mask with a hole, a bay and a part at the picture's rim."""
    y, x = np.mgrid[:90, :120]
    mask = (np.hypot(x - 50, y - 40) < 38) | (x > 90)
    mask[30:36, 40:47] = False
    return mask


def map_of(x: np.ndarray, y: np.ndarray, offset: tuple[int, int] = (0, 0)) -> Warp:
    height, width = x.shape
    return warp_of(Canvas(width, height, offset), x, y)


def identity(width: int, height: int, offset: tuple[int, int] = (0, 0)) -> Warp:
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return map_of(x - offset[0], y - offset[1], offset)


@pytest.mark.parametrize("channels", [1, 3])
def test_psnr_is_scikit_images(channels: int) -> None:
    metrics = pytest.importorskip("skimage.metrics")
    a, b = two_pictures(channels)
    mask = blob()
    for where in (mask, np.ones_like(mask)):
        expected = metrics.peak_signal_noise_ratio(a[where], b[where], data_range=255)
        assert psnr(a, b, where) == pytest.approx(expected, abs=1e-4)
    assert psnr(a, a, mask) == float("inf")


@pytest.mark.parametrize("channels", [1, 3])
def test_ssim_is_scikit_images(channels: int) -> None:
    metrics = pytest.importorskip("skimage.metrics")
    a, b = two_pictures(channels)
    gray = [cv2.cvtColor(p, cv2.COLOR_RGB2GRAY) if channels == 3 else p[..., 0] for p in (a, b)]
    _, index = metrics.structural_similarity(
        *gray, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=255, full=True)
    mask = blob()
    inner = np.zeros_like(mask)  # the whole 11 × 11 window lies in the mask, and in the picture
    for y in range(5, 85):
        for x in range(5, 115):
            inner[y, x] = mask[y - 5 : y + 6, x - 5 : x + 6].all()
    assert inner.any() and ssim(a, b, mask) == pytest.approx(index[inner].mean(), abs=1e-5)
    assert ssim(a, b, np.ones_like(mask)) == pytest.approx(index[5:-5, 5:-5].mean(), abs=1e-5)
    assert ssim(a, a, mask) == pytest.approx(1, abs=1e-6)


def test_ssim_of_flat_bright_pictures_is_not_lost_in_rounding() -> None:
    a = np.full((40, 40, 1), 250, np.uint8)
    b = a.copy()
    b[::2] += 1
    # by hand: means 250, 250.5; variance 0 and 1/4; (0.01 · 255)², (0.03 · 255)²
    expected = (2 * 250 * 250.5 + 6.5025) / (250**2 + 250.5**2 + 6.5025) * 58.5225 / (0.25 + 58.5225)
    assert ssim(a, b, np.ones((40, 40), bool)) == pytest.approx(expected, abs=3e-4)


def test_a_mask_without_room_for_a_window() -> None:
    a, b = two_pictures()
    mask = np.zeros((90, 120), bool)
    mask[20:30, 20:60] = True  # ten rows
    assert np.isnan(ssim(a, b, mask))
    mask[30, 20:60] = True
    assert np.isfinite(ssim(a, b, mask))


def test_a_fold_is_found_and_a_bend_is_not() -> None:
    y, x = np.mgrid[:80, :200].astype(float)
    bend = map_of(x + 9 * np.sin(x / 10) * np.cos(y / 30), y + 0.2 * x)
    assert folds(turning(bend.maps[1].arrays())) == 0, "slope 0.1 at least"
    assert folds(turning(map_of(199 - x, y).maps[1].arrays())) == 0, "a mirror turns everything over: not a fold"
    there_and_back = np.where(x < 120, x, 240 - x)  # the last 80 of 200 columns run backwards
    assert folds(turning(map_of(there_and_back, y).maps[1].arrays())) == pytest.approx(80 / 199, abs=2 / 199)
    within = warp_of(Canvas(200, 80, (0, 0)), np.where(x < 120, x, 2 * x), y, size=(120, 80))
    assert folds(turning(within.maps[1].arrays())) == 0
    beyond = np.where(x < 120, x, -1 - x)
    assert folds(turning(map_of(beyond, y).maps[1].arrays())) < 0.02, "what falls outside the target does not count"
    assert folds(turning(map_of(np.full_like(x, np.nan), y).maps[1].arrays())) == 0
    hidden = np.zeros((80, 200), bool)
    hidden[:, 123:] = True
    assert folds(turning(map_of(there_and_back, y).maps[1].arrays()), hidden) == 0, "nor what is hidden, nor its rim"


def curved_map() -> tuple[Warp, object]:
    def at(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 3 + 0.9 * x - 0.2 * y + 1e-3 * x * y, 900 + 0.1 * x + 1.1 * y

    y, x = np.mgrid[:50, :70].astype(float)
    warp = map_of(*at(x - 12, y - 7), offset=(12, 7))
    return warp, at


def test_between_pixels_the_map_is_bilinear() -> None:
    """The map of curved_map is bilinear, so what is looked up is right to float32, not to OpenCV's 1/32 px."""
    warp, at = curved_map()
    points = np.random.default_rng(6).uniform((-12, -7), (57, 42), (500, 2))
    found = look_up(warp, points)
    assert found.dtype == np.float64 and np.isfinite(found).all()
    assert np.abs(found - np.column_stack(at(*points.T))).max() < 1e-3


def test_at_pixels_the_map_is_itself_up_to_the_last_one() -> None:
    warp, _ = curved_map()
    y, x = np.mgrid[:50, :70]
    points = np.column_stack([x.ravel() - 12, y.ravel() - 7]).astype(float)
    found = look_up(warp, points)
    assert np.array_equal(found, np.column_stack([warp.maps[1].x.ravel(), warp.maps[1].y.ravel()]).astype(float))


def test_outside_the_canvas_and_behind_the_camera_nothing_is_looked_up() -> None:
    warp, _ = curved_map()
    assert np.isnan(look_up(warp, np.array([[-14.0, 0], [0, 44], [60, 0], [1e7, 0]]))).all()
    warp.maps[1].x[20:24, 30:34] = np.nan
    assert np.isnan(look_up(warp, np.array([[18.5 + 1, 14.5]]))[0, 0])
    assert look_up(warp, np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("turned", [False, True], ids=["wide", "tall"])
def test_a_canvas_beyond_opencvs_32767_pixels(turned: bool) -> None:
    warp = identity(40_000, 6) if not turned else identity(6, 40_000)
    points = np.array([[1.0, 2], [35_000.5, 3.5]])[:, :: -1 if turned else 1]
    assert np.abs(look_up(warp, points) - points).max() < 0.01
    picture = picture_from_array(np.zeros((*warp.maps[1].x.shape, 3), np.uint8))
    assert overlap_quality((picture, picture), warp)["overlap_px"] == 240_000


def test_the_quality_of_an_overlap() -> None:
    a, b = two_pictures()
    first, second = picture_from_array(a), picture_from_array(b)
    canvas = identity(150, 100, offset=(10, 4))
    assert overlap_quality((first, first), canvas) == {
        "overlap_px": 90 * 120, "overlap_psnr_db": float("inf"), "overlap_ssim": pytest.approx(1)}
    whole = np.ones((90, 120), bool)
    found = overlap_quality((first, second), canvas)
    assert found == {"overlap_px": 90 * 120, "overlap_psnr_db": pytest.approx(psnr(a, b, whole)),
                     "overlap_ssim": pytest.approx(ssim(a, b, whole))}  # fmt: skip
    moved = with_map(canvas, canvas.maps[1].x + 30)  # the target lies 30 px further left
    found = overlap_quality((first, picture_from_array(np.roll(b, 30, axis=1))), moved)
    mask = whole.copy()
    mask[:, 90:] = False
    assert found["overlap_px"] == mask.sum() and found["overlap_psnr_db"] == pytest.approx(psnr(a, b, mask))
    gray = two_pictures(1)
    found = overlap_quality([picture_from_array(one) for one in gray], canvas)
    assert found["overlap_psnr_db"] == pytest.approx(psnr(*gray, whole))


@pytest.mark.parametrize("which", ["reference", "target"])
def test_what_is_transparent_is_not_compared(which: str) -> None:
    a, b = two_pictures()
    hidden = np.dstack([a if which == "reference" else b, np.full((90, 120), 255, np.uint8)])
    hidden[20:60, 30:70] = (0, 255, 0, 0)
    pictures = [picture_from_array(hidden if role == which else one) for role, one in (("reference", a), ("target", b))]
    found = overlap_quality(pictures, identity(120, 90))
    mask = np.ones((90, 120), bool)
    mask[20:60, 30:70] = False
    assert found["overlap_px"] == mask.sum()
    assert found["overlap_psnr_db"] == pytest.approx(psnr(a, b, mask))


def test_without_an_overlap_there_is_no_quality() -> None:
    picture = picture_from_array(two_pictures()[0])
    far = identity(120, 90)
    far = with_map(far, far.maps[1].x + 1000)
    found = overlap_quality((picture, picture), far)
    assert found["overlap_px"] == 0 and np.isnan(found["overlap_psnr_db"]) and np.isnan(found["overlap_ssim"])


def test_canvas_points_that_show_the_target(by_hand: SimpleNamespace) -> None:
    cameras = (by_hand.camera((120, 90), 100.0), by_hand.camera((100, 80), 100.0))
    warp = identity(200, 150, offset=(30, 20))
    warp = with_map(warp, warp.maps[1].x - 50, warp.maps[1].y + 5)  # reference columns 50-149, rows −5 to 74
    warp.maps[1].x[70:, :] = np.nan  # reference rows from 50 on
    every = coverage_samples(warp, cameras, samples=10**6)
    x, y = np.meshgrid(np.arange(50, 150), np.arange(-5, 50))
    assert np.array_equal(every.points, np.column_stack([x.ravel(), y.ravel()]))
    assert np.array_equal(every.target, every.points - (50, -5)) and every.points.dtype == every.target.dtype == float
    assert np.array_equal(every.overlap, (every.points[:, 0] <= 119) & (every.points[:, 1] >= 0))
    some = coverage_samples(warp, cameras, samples=200 * 150 // 16)
    assert len(some.points) == pytest.approx(100 * 55 / 16, rel=0.06), "every fourth in both directions"
    assert np.array_equal(some.target, some.points - (50, -5))
    spread = (some.points[:, 0].min() - 50, 149 - some.points[:, 0].max())
    assert max(spread) < 4 and set(np.diff(np.unique(some.points[:, 0]))) == {4}


def test_canvas_points_are_told_in_ideal_pixels(by_hand: SimpleNamespace) -> None:
    cameras = (by_hand.camera((120, 90), 100.0, (-0.1,)), by_hand.camera((120, 90), 100.0, (0.08,)))
    shown = coverage_samples(identity(120, 90), cameras, samples=500)
    assert np.abs(distort(shown.points, cameras[0]) - distort(shown.target, cameras[1])).max() < 1e-6
    assert np.abs(shown.points - shown.target).max() > 3 and shown.overlap.all()


def test_the_distance_off_the_lines_is_the_maps(by_hand: SimpleNamespace) -> None:
    camera = by_hand.camera((100, 80), 90.0)
    F = by_hand.view(camera, camera, (0, 0, 0), (1, 0, 0)).F  # level lines
    points = np.array([[10.0, 20], [30, 40], [120, 60]])
    shown = CoverageSamples(points, points + [[5, 3], [-7, -0.25], [0, 99]], np.array([True, True, False]))
    assert off_line_mean(F, shown) == pytest.approx((3 + 0.25) / 2), "outside the overlap the target is not compared"
    assert np.isnan(off_line_mean(np.full((3, 3), np.nan), shown))
    assert np.isnan(off_line_mean(F, replace(shown, overlap=np.full(3, False))))


@pytest.mark.parametrize("distortion", [(), (-0.15, 0.03)], ids=["ideal lens", "barrel"])
def test_a_map_on_its_lines_is_off_by_nothing_also_through_a_lens(
    by_hand: SimpleNamespace, distortion: tuple[float, ...]
) -> None:
    camera = by_hand.camera((400, 300), 380.0, distortion)
    view = by_hand.view(camera, camera, (2.0, -14, 3), (1, 0.1, 0.15))
    warp = build_warp(by_hand.plane_field(6e-5, -1e-4, 0.12), views_of(view, (camera, camera)))
    assert off_line_mean(view.F, coverage_samples(warp, (camera, camera))) < 1e-3
    aside = with_map(warp, y=warp.maps[1].y + np.float32(0.5))
    assert off_line_mean(view.F, coverage_samples(aside, (camera, camera))) == pytest.approx(0.5, rel=0.25)


# --- what the panorama looks like -----------------------------------------------------------------------------------


def two_layers(shift: int = 0) -> tuple[Layer, Layer]:
    """Two pictures of one texture, the second moved by some px."""
    random = np.random.default_rng(3)
    light = cv2.GaussianBlur(random.random((120, 200, 3)), (0, 0), 1.5).astype(np.float32)
    alpha, alpha_too = np.zeros((120, 200), np.float32), np.zeros((120, 200), np.float32)
    alpha[:, :150], alpha_too[:, 50:] = 1, 1
    return Layer(light, alpha), Layer(np.roll(light, shift, axis=1), alpha_too)


def cut_at(first: Layer, second: Layer, column: int) -> tuple[Layer, np.ndarray]:
    side = np.zeros(first.alpha.shape, np.int16)
    side[:, column:] = 1
    return Layer(np.where(side[..., None] == 1, second.pixels, first.pixels), np.ones_like(first.alpha)), side


def test_a_panorama_cut_from_its_pictures_is_faithful_to_them() -> None:
    first, second = two_layers(shift=6)
    whole, side = cut_at(first, second, 100)
    seen = appearance(whole, (first, second), side, False)
    assert seen["source_fidelity_mean"] > 0.95 and seen["source_fidelity_p5"] > 0.4
    same = appearance(first, (first, first), side, False)
    assert same["source_fidelity_p5"] == pytest.approx(1, abs=1e-6) and same["seam_visibility"] == 0


def test_a_ghost_is_faithful_to_neither() -> None:
    first, second = two_layers(shift=6)
    ghost = Layer((first.pixels + second.pixels) / 2, np.ones_like(first.alpha))
    assert appearance(ghost, (first, second), None, False)["source_fidelity_mean"] < 0.9
    assert math.isnan(appearance(ghost, (first, second), None, False)["seam_visibility"])


def test_a_seam_shows_by_as_many_levels_as_the_pictures_differ() -> None:
    flat = np.full((120, 200, 3), 0.2, np.float32)
    first, _ = two_layers()
    brighter = np.full_like(flat, float(decode(encode(flat, 8)[:1, :1] + np.uint8(5))[0, 0, 0]))
    whole, side = cut_at(Layer(flat, first.alpha), Layer(brighter, first.alpha), 100)
    seen = appearance(whole, (Layer(flat, first.alpha), Layer(brighter, first.alpha)), side, False)
    assert seen["seam_visibility"] == pytest.approx(5)


def test_light_beyond_white_counts_and_pictures_that_do_not_meet_have_no_figures() -> None:
    first, second = two_layers(shift=6)
    bright = [Layer(1 + 50 * part.pixels, part.alpha) for part in (first, second)]
    whole, side = cut_at(*bright, 100)
    ghost = Layer((bright[0].pixels + bright[1].pixels) / 2, whole.alpha)
    assert appearance(whole, bright, side, True)["source_fidelity_mean"] > 0.9
    assert appearance(ghost, bright, side, True)["source_fidelity_mean"] < 0.9
    apart = Layer(second.pixels, np.zeros_like(second.alpha))
    assert all(math.isnan(value) for value in appearance(whole, (first, apart), None, False).values())
