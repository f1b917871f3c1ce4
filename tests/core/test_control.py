"""What the user decides, through stitch(): matches, masks, crop and scale, alone and together."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.choices import FIELDS, Crop
from edf_stitch.core.compose.crop import largest_rectangle
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.match_table import match_file
from edf_stitch.core.output.warp_file import warp_bytes
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.pose.match_files import matches_csv
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at

from ..pairs import ON_REFERENCE

WIDTH, HEIGHT = 240, 180
Mask = np.ndarray


@pytest.fixture(scope="module")
def quick(known: StitchOptions) -> StitchOptions:
    return replace(known, measure=False)


@pytest.fixture(scope="module")
def smooth(quick: StitchOptions) -> StitchOptions:
    """Without dense refinement: what matches do to the field is seen, and pixels do not make good for bad ones."""
    return replace(quick, dense=False)


def in_reference(result: StitchResult, size: tuple[int, int] = (WIDTH, HEIGHT)) -> tuple[np.ndarray, np.ndarray]:
    """The map (H, W, 2) where the reference lies, and where it falls inside the target."""
    x, y = result.warp.canvas.offset
    box = (slice(y, y + size[1]), slice(x, x + size[0]))
    mapped = np.stack([result.warp.maps[1].x, result.warp.maps[1].y], axis=-1)[box].astype(float)
    return mapped, result.warp.maps[1].inside()[box]


def apart(one: StitchResult, other: StitchResult) -> np.ndarray:
    """Distances (N,) in px between two maps, over the overlap."""
    (ours, both), (theirs, too) = in_reference(one), in_reference(other)
    assert (both & too).sum() > 0.95 * both.sum() > 0
    return np.linalg.norm(ours - theirs, axis=-1)[both & too]


def rows_of(result: StitchResult) -> np.ndarray:
    used = result.used_matches
    return np.column_stack([used.x, used.y, used.weights])


# --- matches --------------------------------------------------------------------------------------------------------


def reported(result: StitchResult, folder: Path) -> Path:
    """The file of matches beside its report."""
    path = folder / "report.matches.csv"
    path.write_bytes(match_file(result))
    return path


def same_bytes(one: StitchResult, other: StitchResult) -> bool:
    return one.pixels.tobytes() == other.pixels.tobytes() and warp_bytes(one) == warp_bytes(other)


# A third of the size has a factor that rounds: points there and back differ in their last digits.
@pytest.mark.parametrize(
    ("field", "scale", "focal"),
    [*((name, 1.0, "given") for name in FIELDS), ("slack", 0.6, "estimated"), ("strict", 1 / 3 + 0.4, "given")],
)
def test_reported_matches_given_back_make_the_same_panorama(
    small_pair: Pair, quick: StitchOptions, tmp_path: Path, field: str, scale: float, focal: str
) -> None:
    camera = quick.camera if focal == "given" else CameraRequest()
    options = replace(quick, field=field, scale=scale, camera=camera)
    first = stitch((small_pair.reference, small_pair.target), options)
    back = replace(options, matches=reported(first, tmp_path))
    again = stitch((small_pair.reference, small_pair.target), back)
    assert same_bytes(first, again) and not again.edges[0].matches.given
    assert match_file(again) == match_file(first)


@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_the_users_own_matches_are_reported_as_given(
    small_pair: Pair, small_result: StitchResult, smooth: StitchOptions, tmp_path: Path, scale: float
) -> None:
    """With their weights, and read back they are given and make the same panorama."""
    rows = rows_of(small_result) + 0.1  # no float of theirs is what a change of size leads to
    rows[::2, 4] = 0.5
    options = replace(smooth, matches=rows, scale=scale)
    first = stitch((small_pair.reference, small_pair.target), options)
    back = replace(options, matches=reported(first, tmp_path))
    again = stitch((small_pair.reference, small_pair.target), back)
    assert again.edges[0].matches.given and np.allclose(again.edges[0].matches.weights[:2], [0.5, 1.1])
    assert same_bytes(first, again) and match_file(again) == match_file(first)


def test_a_file_of_matches_is_as_good_as_an_array(
    small_pair: Pair, small_result: StitchResult, quick: StitchOptions, tmp_path: Path
) -> None:
    (tmp_path / "m.csv").write_bytes(matches_csv(small_result.used_matches))
    by_file, by_array = (
        stitch((small_pair.reference, small_pair.target), replace(quick, matches=source))
        for source in (tmp_path / "m.csv", rows_of(small_result))
    )
    assert np.array_equal(by_file.warp.maps[1].x, by_array.warp.maps[1].x)


def test_used_matches_are_those_the_field_stands_on(small_result: StitchResult) -> None:
    used, fit = small_result.used_matches, small_result.field.fit
    edge = small_result.edges[0]
    assert len(used) == fit.inliers_used.sum() <= edge.two_view.inliers.sum() < len(edge.matches)
    sent = small_result.field.predict(used.x)
    assert np.sqrt(np.mean(np.sum((sent - used.y) ** 2, axis=1))) < 0.5
    every = {tuple(row) for row in np.column_stack([small_result.edges[0].matches.x, small_result.edges[0].matches.y])}
    assert {tuple(row) for row in np.column_stack([used.x, used.y])} <= every


def test_used_matches_are_px_of_the_full_pictures(small_pair: Pair, quick: StitchOptions) -> None:
    half = stitch((small_pair.reference, small_pair.target), replace(quick, scale=0.5))
    used = half.used_matches
    kept = half.edges[0].matches.subset(np.flatnonzero(half.edges[0].two_view.inliers)[half.field.fit.inliers_used])
    assert np.allclose((used.x + 0.5) / 2 - 0.5, kept.x) and np.allclose((used.y + 0.5) / 2 - 0.5, kept.y)
    assert half.full_sizes == ((WIDTH, HEIGHT), (WIDTH, HEIGHT)) and used.x.max() > WIDTH / 2


def test_a_match_outside_its_picture_is_refused(
    small_pair: Pair, small_result: StitchResult, quick: StitchOptions
) -> None:
    rows = rows_of(small_result)
    rows[3, 2] = WIDTH
    with pytest.raises(BadRequest, match="row 3 .* outside the target, which has 240×180"):
        stitch((small_pair.reference, small_pair.target), replace(quick, matches=rows, scale=0.5))


# --- masks ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def passer_by(small_pair: Pair) -> tuple[Pair, Mask, Mask]:
    """A large textured thing, of a colour of its own, that moved between the two pictures; and where it is."""
    rough = np.random.default_rng(0).integers(0, 256, (22, 22), dtype=np.uint8)
    texture = cv2.resize(rough, (90, 90), interpolation=cv2.INTER_CUBIC)
    thing = np.stack([texture, np.zeros_like(texture), 255 - texture // 2], axis=-1)
    middle = np.array([[175.0, 105.0]])
    truth = TrueGeometry.of(small_pair.reference_camera, small_pair.target_camera)
    stays = truth.target_pixels(middle, depth_at(small_pair.reference_camera, middle))
    pictures, masks = [], []
    for picture, (x, y) in (
        (small_pair.reference, middle[0] - 45), (small_pair.target, np.rint(stays[0] + (15, 0)) - 45),
    ):  # fmt: skip
        box = (slice(int(y), int(y) + 90), slice(int(x), int(x) + 90))
        picture, mask = picture.copy(), np.zeros((HEIGHT, WIDTH), bool)
        picture[box], mask[box] = thing, True
        pictures.append(picture)
        masks.append(mask)
    return replace(small_pair, reference=pictures[0], target=pictures[1]), masks[0], masks[1]


def errors_beside(pair: Pair, result: StitchResult, mask: Mask) -> np.ndarray:
    """Distances (N,) in px of the map from the truth of the scene, in the overlap, beside what is masked."""
    mapped, inside = in_reference(result)
    points = np.stack(np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT))), axis=-1)
    truth = TrueGeometry.of(pair.reference_camera, pair.target_camera)
    true = truth.target_pixels(points.reshape(-1, 2), depth_at(pair.reference_camera, points.reshape(-1, 2)))
    return np.linalg.norm(mapped - true.reshape(points.shape), axis=-1)[inside & ~mask]


def of_the_thing(pixels: np.ndarray) -> np.ndarray:
    """Where something shows blue light and hardly any green (the scene never does; bicubic's lobes leave red alone)."""
    return (pixels[..., 2] > 0.05) & (pixels[..., 1] < 0.02 * (pixels[..., 0] + pixels[..., 2]))


def test_a_thing_that_moved_disturbs_unless_it_is_masked(
    passer_by: tuple[Pair, Mask, Mask], small_result: StitchResult, smooth: StitchOptions
) -> None:
    pair, first, second = passer_by
    masked = replace(smooth, ignore=(first, second))
    open_eyed, blind = (stitch((pair.reference, pair.target), options) for options in (smooth, masked))
    spoilt, clean, best = (errors_beside(pair, one, first) for one in (open_eyed, blind, small_result))
    assert np.median(best) < 0.2 and np.median(spoilt) > 5 * np.median(best), "it is large enough to lead astray"
    assert np.median(clean) < 0.3 and np.percentile(clean, 75) < 0.75
    for x, mask in ((blind.edges[0].matches.x, first), (blind.edges[0].matches.y, second)):
        column, row = np.rint(x).astype(int).T
        assert len(x) > 60 and not mask[row, column].any()


@pytest.mark.parametrize("blend", ["multiband", "feather", "linear"])
def test_what_is_masked_is_not_seen_in_the_panorama(
    passer_by: tuple[Pair, Mask, Mask], small_result: StitchResult, quick: StitchOptions, blend: str
) -> None:
    pair, first, second = passer_by
    assert not of_the_thing(small_result.pixels).any()
    options = replace(quick, blend=blend, exposure="none", ignore=(first, second))
    result = stitch((pair.reference, pair.target), options)
    assert of_the_thing(result.pictures[0].pixels).sum() > 3000, "the pictures hold it, alpha hides it"
    # where next to nothing is shown, bicubic's negative lobes alone decide about its colour
    assert not of_the_thing(result.pixels)[result.alpha > 0.05].any()
    # where one hides the thing the other shows what is behind, and where both do there is nothing
    x, y = result.warp.canvas.offset
    hidden = np.zeros(result.alpha.shape, bool)
    hidden[y : y + HEIGHT, x : x + WIDTH] = first
    behind = hidden & (result.layers[1].alpha > 0)
    away = 0.02 if blend == "multiband" else 1e-6  # light is evened out around what was filled in
    assert behind.sum() > 500 and np.allclose(result.pixels[behind], result.layers[1].pixels[behind], atol=away)
    assert not result.alpha[hidden & (result.layers[1].alpha == 0)].any()


def test_a_mask_of_one_picture_leaves_the_other_alone(small_pair: Pair, quick: StitchOptions) -> None:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:30] = 255
    result = stitch((small_pair.reference, small_pair.target), replace(quick, ignore=(None, mask)))
    found = result.edges[0].matches
    assert result.pictures[0].alpha is None and found.y[:, 1].min() > 30 and found.x[:, 1].min() < 30


# --- crop -----------------------------------------------------------------------------------------------------------


def box_of(kind: Crop, full: StitchResult) -> tuple[int, int, int, int]:
    """left, top, width, height of a crop of a panorama."""
    if not isinstance(kind, str):
        return kind
    width, height = full.cameras[0].size
    return (*full.warp.canvas.offset, width, height) if kind == "reference" else largest_rectangle(full.alpha > 0)


def arrays_of(result: StitchResult) -> list[np.ndarray]:
    """The target's map and the inverse depth."""
    target = result.warp.maps[1].arrays()
    return [target.x, target.y, result.warp.inverse_depth]


def assert_cropped(full: StitchResult, part: StitchResult, box: tuple[int, int, int, int]) -> None:
    """The part is what the box cuts out of the whole, in all of its arrays, and says so."""
    left, top, width, height = box
    cut = (slice(top, top + height), slice(left, left + width))
    canvas, x, y = part.warp.canvas, *full.warp.canvas.offset
    assert (canvas.width, canvas.height) == (width, height) and canvas.offset == (x - left, y - top)
    entry = part.report["canvas"]
    assert (entry["width"], entry["height"], entry["offset"]) == (width, height, [x - left, y - top])
    for ours, theirs in zip(arrays_of(part), arrays_of(full), strict=True):
        assert np.array_equal(ours, theirs[cut], equal_nan=True)
    for ours, theirs in ((part, full), (part.layers[0], full.layers[0]),
                         (part.layers[1], full.layers[1])):  # fmt: skip
        assert np.array_equal(ours.pixels, theirs.pixels[cut]) and np.array_equal(ours.alpha, theirs.alpha[cut])


@pytest.mark.parametrize("kind", ["inscribed", "reference", (30, 20, 200, 111), (300, 100, 40, 30), (0, 0, 1, 1)])
def test_a_crop_is_a_part_of_the_whole(
    small_pair: Pair, small_result: StitchResult, quick: StitchOptions, kind: Crop
) -> None:
    part = stitch((small_pair.reference, small_pair.target), replace(quick, crop=kind))
    assert_cropped(small_result, part, box_of(kind, small_result))
    if kind == "reference":
        assert part.alpha.shape == (HEIGHT, WIDTH) and part.warp.canvas.offset == (0, 0)
    if kind == "inscribed":
        assert (part.alpha == 1).all() and part.alpha.size > HEIGHT * WIDTH, "larger than the reference alone"
    assert part.report["measured"].items() <= small_result.report["measured"].items(), "of the whole, whatever is kept"


def test_a_crop_beyond_the_panorama_is_refused_with_its_size(
    small_pair: Pair, small_result: StitchResult, quick: StitchOptions
) -> None:
    height, width = small_result.alpha.shape
    with pytest.raises(BadRequest, match=f"{width}×{height}"):
        stitch((small_pair.reference, small_pair.target), replace(quick, crop=(0, 0, width + 1, 10)))


def test_the_warp_file_of_a_crop_keeps_its_promise(small_pair: Pair, quick: StitchOptions) -> None:
    """x' ~ H_inf p + inverse_depth e' with p = pixel − offset, for what is left of the canvas."""
    options = replace(quick, field="strict", crop=(90, 40, 240, 120))
    part = stitch((small_pair.reference, small_pair.target), options)
    with np.load(io.BytesIO(warp_bytes(part))) as file:
        warp = dict(file)
    assert warp["map_x_01"].shape == part.alpha.shape == (120, 240) and (warp["offset"] < 0).any()
    p = homogeneous(np.stack(np.meshgrid(np.arange(240.0), np.arange(120.0)), axis=-1) - warp["offset"])
    ray = p @ warp["H_inf"][1].T + warp["inverse_depth"][..., None].astype(float) * warp["e_prime"][1]
    mapped = np.stack([warp["map_x_01"], warp["map_y_01"]], axis=-1)
    assert np.isfinite(mapped).all() and np.abs(mapped - ray[..., :2] / ray[..., 2:]).max() < 1e-3


# --- scale ----------------------------------------------------------------------------------------------------------


def halved_K(K: np.ndarray) -> np.ndarray:
    """K of a picture of half the size: pixel centres are integers, so the corner stays at −½."""
    return np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]]) @ K


def from_full(full: StitchResult, half: StitchResult) -> np.ndarray:
    """How far (px of the half size) the half-size map is from the full one's, where the target shows; NaN elsewhere."""
    height, width = half.alpha.shape
    points = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) - half.warp.canvas.offset
    at = ((points + 0.5) * 2 - 0.5 + full.warp.canvas.offset).astype(np.float32)
    looked_up = np.stack([cv2.remap(m, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=np.nan)
                          for m in (full.warp.maps[1].x, full.warp.maps[1].y)], axis=-1)  # fmt: skip
    ours = np.stack([half.warp.maps[1].x, half.warp.maps[1].y], axis=-1)
    off = np.linalg.norm((looked_up + 0.5) / 2 - 0.5 - ours, axis=-1)
    return np.where(half.warp.maps[1].inside(), off, np.nan)


@pytest.mark.parametrize("field", ["slack", "strict"])
def test_half_the_scale_is_the_same_panorama_at_half_the_size(pair: Pair, field: str) -> None:
    K = pair.reference_camera.K
    camera = CameraRequest(focal_px=(K[0, 0],), principal=(K[0, 2], K[1, 2]))
    options = replace(ON_REFERENCE, field=field, camera=camera, measure=False)
    full = stitch((pair.reference, pair.target), options)
    half = stitch((pair.reference, pair.target), replace(options, scale=0.5))
    for ours, theirs in zip((*half.alpha.shape, *half.warp.canvas.offset),
                            (*full.alpha.shape, *full.warp.canvas.offset), strict=True):  # fmt: skip
        assert abs(ours - theirs / 2) <= 2
    assert half.report["options"]["scale"] == 0.5
    assert all(np.allclose(h.K, halved_K(f.K)) for h, f in zip(half.views, full.views, strict=True))
    off = from_full(full, half)
    # matches are fewer and half as sharp: a third of a px of the small picture
    assert np.nanmedian(off) < 0.33 and np.nanpercentile(off, 90) < 1
    # the light is that of the whole, made smaller: the reference's exactly, pixel for pixel
    x, y = half.warp.canvas.offset
    small = half.layers[0].pixels[y : y + 150, x : x + 200]
    light = full.pictures[0].pixels.reshape(150, 2, 200, 2, 3).mean(axis=(1, 3))
    assert np.abs(small - light).max() < 1e-5


def test_given_matches_and_a_crop_go_with_a_scale(small_pair: Pair, smooth: StitchOptions) -> None:
    """Matches are px of the full pictures, a crop px of the panorama that comes out."""
    strict = replace(smooth, field="strict")
    full = stitch((small_pair.reference, small_pair.target), strict)
    both = replace(strict, matches=rows_of(full), scale=0.5)
    half = stitch((small_pair.reference, small_pair.target), both)
    off = from_full(full, half)
    assert np.nanmedian(off) < 0.03 and np.nanpercentile(off, 95) < 0.3
    assert all(abs(a - b / 2) <= 1.5 for a, b in zip(half.alpha.shape, full.alpha.shape, strict=True))
    assert np.allclose(rows_of(half), rows_of(full), atol=1e-9)
    for kind in ("reference", "inscribed", (20, 10, 100, 60)):
        part = stitch((small_pair.reference, small_pair.target), replace(both, crop=kind))
        assert_cropped(half, part, box_of(kind, half))


def test_deep_and_transparent_pictures_at_half_the_scale(
    small_pair: Pair, small_result: StitchResult, quick: StitchOptions
) -> None:
    """16 bits stay 16, alpha stays alpha, and what is transparent lends its colour to nobody."""
    alpha = np.full((HEIGHT, WIDTH), 65535, np.uint16)
    alpha[:41, :61] = 0
    deep = [one.astype(np.uint16) * 257 for one in (small_pair.reference, small_pair.target)]
    deep[0][:41, :61] = (65535, 0, 65535)
    reference = np.dstack([deep[0], alpha])
    options = replace(quick, scale=0.5, matches=rows_of(small_result))
    plain = stitch((small_pair.reference, small_pair.target), options)
    result = stitch((reference, deep[1]), options)
    assert result.bits == 16 and plain.bits == 8 and result.pictures[0].alpha is not None
    seen = rows_of(small_result)[:, :2]
    hidden = (np.rint((seen + 0.5) / 2 - 0.5) < (30, 20)).all(axis=1)
    assert len(result.edges[0].matches) == len(seen) - hidden.sum()
    x, y = result.warp.canvas.offset
    a = result.layers[0].alpha[y : y + 90, x : x + 120]
    assert not a[:20, :30].any() and (a[21:] == 1).all() and (a[:, 31:] == 1).all()
    assert np.allclose(a[20, :30], 0.5) and np.allclose(a[:20, 30], 0.5) and np.allclose(a[20, 30], 0.75)
    ours = result.layers[0].pixels[y : y + 90, x : x + 120]
    ox, oy = plain.warp.canvas.offset
    theirs = plain.layers[0].pixels[oy : oy + 90, ox : ox + 120]
    assert np.abs(ours - theirs)[a == 1].max() < 1e-5
    assert not of_the_thing(result.pixels)[result.alpha > 0].any()


def test_a_mask_of_the_full_size_goes_with_a_scale(pair: Pair) -> None:
    mask = np.zeros((300, 400), bool)
    mask[:, 300:360] = True
    camera = CameraRequest(focal_px=(pair.reference_camera.K[0, 0],))
    options = replace(ON_REFERENCE, camera=camera, scale=0.5, ignore=(mask,), measure=False)
    result = stitch((pair.reference, pair.target), options)
    x, y = result.warp.canvas.offset
    alpha = result.layers[0].alpha[y : y + 150, x : x + 200]
    assert not alpha[:, 150:180].any() and (alpha[:, :150] == 1).all() and (alpha[:, 180:] == 1).all()
    within = (result.edges[0].matches.x[:, 0] > 149.5) & (result.edges[0].matches.x[:, 0] < 179.5)
    assert len(within) > 40 and not within.any()


def test_a_seam_may_be_painted_over_the_panorama_as_it_is_cropped(small_pair: Pair, quick: StitchOptions) -> None:
    """Halves of the cropped panorama, painted over it alone or over the whole, decide the same."""
    pictures, cropped = [small_pair.reference, small_pair.target], replace(quick, crop="inscribed")
    whole, part = stitch(pictures, quick), stitch(pictures, cropped)
    height, width = part.alpha.shape
    assert part.alpha.shape != whole.alpha.shape
    over_part = np.zeros((height, width), np.uint8)
    over_part[:, width // 2 :] = 255
    (x, y), (left, top) = part.canvas.offset, whole.canvas.offset
    over_whole = np.full(whole.alpha.shape, 128, np.uint8)
    over_whole[top - y : top - y + height, left - x : left - x + width] = over_part
    painted, padded = (stitch(pictures, replace(cropped, mask=mask)) for mask in (over_part, over_whole))
    assert painted.labels is not None and padded.labels is not None
    both = (painted.layers[0].alpha > 0) & (painted.layers[1].alpha > 0)
    assert (painted.labels[both] == (over_part[both] > 0)).mean() > 0.9
    np.testing.assert_array_equal(painted.labels, padded.labels)
