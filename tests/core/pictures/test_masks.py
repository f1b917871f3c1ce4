"""Ignore masks: what counts as white, whatever the file; and that nobody looks at what they hide."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.blend import averaged, feathered
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.masks import painted_over, read_mask, read_painted, without
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.pose import features
from edf_stitch.core.system.errors import BadRequest, UnreadableImage

SIZE = (36, 24)
MASK = np.zeros((24, 36), bool)
MASK[4:10, 5:30] = MASK[12, 12] = True


def read(source: str | Path | np.ndarray, size: tuple[int, int] = SIZE) -> np.ndarray:
    mask = read_mask(source, size, "the reference")
    assert mask.dtype == bool and mask.shape == (size[1], size[0])
    return mask


def written(tmp_path: Path, array: np.ndarray, suffix: str = ".png") -> Path:
    """array: as OpenCV stores it (B, G, R, A)."""
    path = tmp_path / f"mask{suffix}"
    path.write_bytes(cv2.imencode(suffix, array)[1].tobytes())
    return path


def levels(dark: float, bright: float, dtype: type = np.uint8) -> np.ndarray:
    return np.where(MASK, bright, dark).astype(dtype)


# --- what is white --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("suffix", "dark", "bright", "dtype"), [
    (".png", 0, 255, np.uint8), (".png", 127, 128, np.uint8), (".jpg", 0, 255, np.uint8), (".bmp", 0, 255, np.uint8),
    (".webp", 0, 255, np.uint8), (".tif", 0, 255, np.uint8), (".png", 0, 65535, np.uint16),
    (".tif", 32000, 33500, np.uint16), (".tif", 0, 1, np.float32), (".tif", 0.49, 0.51, np.float32),
])  # fmt: skip
@pytest.mark.parametrize("channels", [1, 3])
def test_white_is_ignored_in_every_kind_of_file(
    tmp_path: Path, suffix: str, dark: float, bright: float, dtype: type, channels: int
) -> None:
    array = np.repeat(levels(dark, bright, dtype)[..., None], channels, axis=2)
    found = read(written(tmp_path, array, suffix))
    # JPEG smears a single pixel
    assert np.array_equal(found[:11], MASK[:11]) if suffix == ".jpg" else np.array_equal(found, MASK)


@pytest.mark.parametrize(("dark", "bright"), [(0, 1), (0.4, 0.6), (0, 500)])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_float_mask_is_taken_by_its_values_not_by_how_it_is_shown(
    tmp_path: Path, dark: float, bright: float, channels: int
) -> None:
    light = np.repeat(levels(dark, bright, np.float32)[..., None], channels, axis=2)
    path = tmp_path / "mask.exr"
    path.write_bytes(encode_picture(light, None, 32, ".exr")[0])
    assert np.array_equal(read(path), MASK)
    assert not read(np.full((24, 36), 0.3, np.float32)).any()


def test_a_colour_counts_by_how_bright_it_is(tmp_path: Path) -> None:
    for bgr, ignored in (((0, 0, 255), False), ((255, 0, 0), False), ((0, 255, 255), True), ((200, 200, 200), True)):
        array = np.where(MASK[..., None], np.uint8(bgr), np.uint8(0))
        assert read(written(tmp_path, array)).any() == ignored


@pytest.mark.parametrize(("colour", "under"), [(0, 0), (0, 255), (255, 0), (255, 255), (90, 7)])
def test_where_the_shown_has_one_colour_alpha_decides(tmp_path: Path, colour: int, under: int) -> None:
    """Painted in black or white on a transparent layer: what lies under the transparent part means nothing."""
    alpha = levels(0, 255)
    alpha[0, :9], alpha[1, :9] = 100, 160  # a soft edge
    array = np.dstack([*[np.where(alpha > 0, colour, under).astype(np.uint8)] * 3, alpha])
    wanted = MASK.copy()
    wanted[1, :9] = True
    assert np.array_equal(read(written(tmp_path, array)), wanted)


def test_otherwise_colour_times_alpha_does(tmp_path: Path) -> None:
    alpha = np.full((24, 36), 255, np.uint8)
    alpha[:, :10], alpha[:, 10:14], alpha[:, 14:18] = 0, 120, 200
    array = np.dstack([*[levels(0, 255)] * 3, alpha])
    assert np.array_equal(read(written(tmp_path, array)), MASK & (alpha > 127))
    array[..., :3] = np.where(MASK[..., None], 150, array[..., :3])
    assert np.array_equal(read(written(tmp_path, array)), MASK & (alpha == 255)), "150 × 200 / 255 is below half"


def test_a_picture_without_anything_shown_ignores_nothing(tmp_path: Path) -> None:
    assert not read(written(tmp_path, np.zeros((24, 36, 4), np.uint8))).any()
    assert not read(written(tmp_path, np.zeros((24, 36), np.uint8))).any()


@pytest.mark.parametrize("array", [
    MASK, levels(0, 255), levels(0, 65535, np.uint16), levels(0, 1, np.float32), levels(0, 1, np.float64),
    np.dstack([levels(0, 255)] * 3), np.dstack([levels(0, 0), levels(0, 255)]),
])  # fmt: skip
def test_arrays(array: np.ndarray) -> None:
    before = array.copy()
    assert np.array_equal(read(array), MASK) and np.array_equal(array, before)


# --- sizes ----------------------------------------------------------------------------------------------------------


def test_exif_turns_a_mask_upright(tmp_path: Path) -> None:
    data = cv2.imencode(".jpg", np.ascontiguousarray(np.rot90(levels(0, 255))))[1].tobytes()
    block = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    path = tmp_path / "mask.jpg"
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", 8 + len(block)) + b"Exif\0\0" + block + data[2:])
    assert np.array_equal(read(path)[:11], MASK[:11])


@pytest.mark.parametrize("factor", [2, 3, 5])
def test_a_larger_or_smaller_copy_is_stretched(factor: int) -> None:
    large = np.kron(MASK, np.ones((factor, factor), bool))
    assert np.array_equal(read(large), MASK)
    assert np.array_equal(read(MASK, (36 * factor, 24 * factor)), large)


def test_of_a_larger_mask_the_pixels_in_the_middle_count() -> None:
    large = np.zeros((72, 108), bool)
    large[1::3, 1::3] = MASK
    assert np.array_equal(read(large), MASK)


@pytest.mark.parametrize(("own", "size"), [
    ((2000, 1500), (4001, 3000)), ((400, 300), (4007, 3000)), ((4007, 3000), (400, 300)), ((641, 480), (640, 480)),
    ((640, 479), (640, 480)), ((333, 250), (4000, 3000)),
    ((400, 301), (4000, 3000)), ((401, 300), (4000, 3000)),
])  # fmt: skip
def test_rounding_to_whole_pixels_is_no_other_shape(own: tuple[int, int], size: tuple[int, int]) -> None:
    mask = np.zeros((own[1], own[0]), bool)
    mask[:, own[0] // 2 :] = True
    found = read(mask, size)
    middle, off = size[0] // 2, size[0] // own[0] + 1
    assert not found[:, : middle - off].any() and found[:, middle + off :].all()


@pytest.mark.parametrize("own", [(480, 640), (640, 482), (643, 480), (320, 320), (1280, 968), (160, 122)])
def test_another_shape_is_refused_with_both_sizes(own: tuple[int, int]) -> None:
    with pytest.raises(BadRequest, match=f"mask of the reference has {own[0]}×{own[1]} pixels.* has 640×480:"):
        read(np.zeros((own[1], own[0]), bool), (640, 480))


def test_a_mask_of_a_few_pixels_does_not_fit_every_picture() -> None:
    with pytest.raises(BadRequest, match="has 4×3 pixels.* has 452×300:"):
        read(np.zeros((3, 4), bool), (452, 300))
    assert read(np.zeros((4, 6), bool), (452, 300)).shape == (300, 452)


# --- refusals -------------------------------------------------------------------------------------------------------


def test_a_mask_of_everything_is_refused() -> None:
    mask = np.ones((100, 100), bool)
    with pytest.raises(BadRequest, match=r"the reference leaves 0\.0% .* invert the mask"):
        read(mask, (100, 100))
    mask[0, :99] = False
    with pytest.raises(BadRequest, match="invert the mask"):
        read(mask, (100, 100))
    mask[0, 99] = False
    assert read(mask, (100, 100)).sum() == 9900


@pytest.mark.parametrize(("label", "dtype"), [(1, np.uint8), (1, np.uint16), (255, np.uint16)])
def test_labels_of_zero_and_one_are_not_taken_for_black(tmp_path: Path, label: int, dtype: type) -> None:
    with pytest.raises(BadRequest, match="almost black; save what is to be ignored as white"):
        read(written(tmp_path, levels(0, label, dtype)))


def test_files_and_arrays_that_are_no_pictures_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "mask.txt").write_text("white, please", "utf-8")
    for path in (tmp_path / "missing.png", tmp_path / "mask.txt"):
        with pytest.raises(UnreadableImage, match=path.name) as caught:
            read(str(path))
        assert caught.value.exit_code == 4
    with pytest.raises(BadRequest, match="the mask of the reference: int64 values"):
        read(np.zeros((24, 36), np.int64))


# --- without --------------------------------------------------------------------------------------------------------


def test_alpha_is_zero_in_the_mask_and_stays_elsewhere() -> None:
    opaque = picture_from_array(np.full((24, 36, 3), 99, np.uint8))
    hidden = without(opaque, MASK)
    assert hidden.alpha is not None and hidden.alpha.dtype == np.float32
    assert np.array_equal(hidden.alpha, np.where(MASK, 0, 1)) and opaque.alpha is None
    assert replace(hidden, alpha=None) is not opaque and hidden.light is opaque.light
    soft = replace(opaque, alpha=np.full((24, 36), 0.25, np.float32))
    assert np.array_equal(without(soft, MASK).alpha, np.where(MASK, 0, np.float32(0.25)))
    assert soft.alpha is not None and (soft.alpha == 0.25).all(), "the given picture stays as it is"
    assert without(opaque, np.zeros_like(MASK)) is opaque


def noisy(picture: Picture, mask: np.ndarray) -> Picture:
    """The picture with noise in the mask; black and white in a corner keep the range that overshoot is held to."""
    noise = np.random.default_rng(3).integers(0, 256, picture.view.shape, dtype=np.uint8)
    array = np.where(mask[..., None], noise, picture.view)
    array[0, 0], array[0, 1] = 0, 255
    return picture_from_array(array)


@pytest.fixture(scope="module")
def masks(small_result: StitchResult) -> tuple[np.ndarray, np.ndarray]:
    """A part of the overlap in the reference, another in the target."""
    height, width = small_result.pictures[0].view.shape[:2]
    first, second = np.zeros((2, height, width), bool)
    first[height // 3 : height // 2, width // 2 : 3 * width // 4] = True
    second[height // 2 : 3 * height // 4, width // 4 : width // 2] = True
    return first, second


def test_no_feature_comes_from_the_mask(small_result: StitchResult, masks: tuple[np.ndarray, np.ndarray]) -> None:
    mask = masks[0]
    picture = without(small_result.pictures[0], mask)
    points = features.detect(picture.view, picture.alpha).points
    column, row = np.rint(points).astype(int).T
    assert len(points) > 50 and not mask[row, column].any()
    column, row = np.rint(features.detect(picture.view).points).astype(int).T
    assert mask[row, column].any(), "there would be some"


def test_paint_is_black_white_or_none() -> None:
    array = np.full((20, 30, 4), 128, np.uint8)
    array[..., 3] = 255
    array[:5, :, :3], array[5:10, :, :3] = 0, 255
    array[10:15] = (255, 255, 255, 0)
    painted = read_painted(array)
    assert painted.dtype == np.int8 and painted.shape == (20, 30)
    assert (painted[:5] == -1).all() and (painted[5:10] == 1).all() and (painted[10:] == 0).all()
    assert np.array_equal(read_painted(array[..., :3])[:5], painted[:5]), "opaque pictures too"
    twice = painted_over(painted, (60, 40))
    assert twice.shape == (40, 60) and np.array_equal(twice[::2, ::2], painted)
    with pytest.raises(BadRequest, match="30×20 pixels, the whole panorama has 40×40"):
        painted_over(painted, (40, 40))


def test_paint_that_cannot_be_read_is_told_by_its_name(tmp_path: Path) -> None:
    with pytest.raises(UnreadableImage, match="none.png"):
        read_painted(tmp_path / "none.png")


def test_what_the_mask_hides_changes_no_layer_and_no_blend(
    small_result: StitchResult, masks: tuple[np.ndarray, np.ndarray]
) -> None:
    pictures, found = small_result.pictures, []
    for noise in (np.zeros_like(masks[0]), True):
        first, second = (without(noisy(p, m & noise), m) for p, m in zip(pictures, masks, strict=True))
        base, layer = (layer_of(p, one) for p, one in zip((first, second), small_result.warp.maps, strict=True))
        shown = base.alpha > 0
        found.append([layer, averaged(base, layer, shown), feathered(base, layer, np.zeros_like(shown))])
    for ours, theirs in zip(*found, strict=True):
        shown = ours.alpha > 0
        assert shown.any() and np.array_equal(ours.alpha, theirs.alpha)
        assert np.allclose(ours.pixels[shown], theirs.pixels[shown], atol=1e-6)
    assert (found[0][0].alpha[small_result.layers[1].alpha > 0] == 0).any(), "something was hidden"
