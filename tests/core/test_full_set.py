"""Large sets: decided on small pictures, made of the full ones. The same panorama, the same bits however it is read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.compose.enlarging import draft
from edf_stitch.core.compose.enlarging.draft import draft_times
from edf_stitch.core.measure.metrics import psnr
from edf_stitch.core.measure.placed.of_result import placed
from edf_stitch.core.measure.placed.overlaps import gained_figures
from edf_stitch.core.measure.placed.straightness import line_figures
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.depth.mesh import mesh_bytes
from edf_stitch.core.output.depth.range_image import range_image
from edf_stitch.core.output.outputs import OutputRequest, check, write
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.raster.colour import encode
from edf_stitch.core.raster.lazy import whole
from edf_stitch.core.system.output_files import OutputFiles

from ..sets import FOCAL, PictureSet, make_set

KNOWN = StitchOptions(camera=CameraRequest(focal_px=(2 * FOCAL,)), dense=False)


@pytest.fixture(scope="module")
def large() -> PictureSet:
    """Four pictures of 640 × 480 px."""
    small = make_set()
    views = [cv2.resize(one.view, (640, 480), interpolation=cv2.INTER_CUBIC) for one in small.pictures]
    grain = np.random.default_rng(0).integers(-9, 10, (480, 640, 1))
    pictures = [
        picture_from_array(np.clip(view + grain, 0, 255).astype(np.uint8), one.name)
        for view, one in zip(views, small.pictures, strict=True)
    ]
    return replace(small, pictures=tuple(pictures))


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> StitchOptions:
    """KNOWN where features and geometry, which are those of the full pictures, are found once."""
    return replace(KNOWN, cache=tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def at_once(large: PictureSet, options: StitchOptions) -> StitchResult:
    return stitch(large.pictures, options)


@pytest.fixture(scope="module")
def drafted(large: PictureSet, options: StitchOptions) -> Iterator[StitchResult]:
    """The same as if these were more pixels than are decided about at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draft, "DRAFT", replace(draft.DRAFT, most_pixels=400_000))
        yield stitch(large.pictures, options)


def shown(result: StitchResult) -> np.ndarray:
    return encode(result.pixels, 8)


def test_how_much_a_set_is_shrunk_depends_on_its_pixels_alone() -> None:
    phone = [(4000, 3000)]
    options = StitchOptions()
    assert [draft_times(count * phone, options) for count in (2, 3, 4, 5, 16, 30, 60)] == [1, 1, 1, 2, 2, 4, 4]
    assert draft_times([(640, 480)] * 60, options) == 1
    for other in ({"blend": "linear"}, {"blend": "feather"}, {"projection": "reference"}):
        assert draft_times(30 * phone, replace(options, **other)) == 1


@pytest.mark.slow
def test_its_pictures_are_placed_as_those_of_what_is_made_at_once(
    at_once: StitchResult, drafted: StitchResult
) -> None:
    """A draft is coarser than all are compared at, so the full pictures are measured."""
    first, second = placed(at_once), placed(drafted)
    assert second.px_per_radian == pytest.approx(first.px_per_radian, rel=0.03)
    assert second.px_per_radian == pytest.approx(drafted.canvas.projection.focal, rel=1e-6)
    one, other = gained_figures(first), gained_figures(second)
    assert other["used"] == one["used"] and abs(other["gained_ssim"] - one["gained_ssim"]) < 0.05
    lines = [line_figures(*one)["lines"] for one in ((first, at_once.pictures), (second, drafted.pictures))]
    assert lines[1] == pytest.approx(lines[0], rel=0.05)
    shown = [np.logical_and(one.alpha, one.views_at > 0).sum() / (one.views_at > 0).sum() for one in (first, second)]
    assert min(shown) > 0.98


@pytest.mark.slow
def test_it_is_the_panorama_that_is_made_at_once(at_once: StitchResult, drafted: StitchResult) -> None:
    assert (at_once.times, drafted.times) == (1, 2)
    assert drafted.warp.canvas.width < 0.6 * drafted.canvas.width
    # frames and focal lengths differ a little: what is in the middle of the first is looked for in the second
    ratio = at_once.canvas.projection.focal / drafted.canvas.projection.focal
    assert ratio == pytest.approx(1, abs=0.03)
    first, second = shown(at_once), cv2.resize(shown(drafted), None, fx=ratio, fy=ratio, interpolation=cv2.INTER_CUBIC)
    assert np.abs(np.subtract(first.shape, second.shape)).max() <= 30
    middle = first[100:-100, 100:-100]
    found = cv2.matchTemplate(second, middle, cv2.TM_SQDIFF)
    y, x = np.unravel_index(found.argmin(), found.shape)
    part = second[y : y + middle.shape[0], x : x + middle.shape[1]]
    smooth = [cv2.GaussianBlur(one, None, 2) for one in (middle, part)]
    assert psnr(*smooth, np.ones(part.shape[:2], bool)) > 29
    sharpness = [cv2.Laplacian(one[100:-100, 100:-100], cv2.CV_32F).std() for one in (first, shown(drafted))]
    assert sharpness[1] > 0.9 * sharpness[0], "full pictures, not enlarged ones"


def test_cuts_and_threads_change_no_bit(drafted: StitchResult) -> None:
    light, random = drafted.panorama.light, np.random.default_rng(0)
    before = cv2.getNumThreads()
    try:
        found = []
        for threads in (1, 2, 4):
            cv2.setNumThreads(threads)
            found.append(whole(light))
    finally:
        cv2.setNumThreads(before)
    assert all(one.tobytes() == found[0].tobytes() for one in found)
    for _ in range(12):
        rows, columns = (slice(*np.sort(random.choice(side, 2, replace=False))) for side in light.shape[:2])
        np.testing.assert_array_equal(light[rows, columns], found[0][rows, columns])


def test_each_pixel_away_from_seams_is_its_pictures_own(drafted: StitchResult) -> None:
    """Seams are some px wide; in the middle of a picture's part nothing is mixed, and light is the layer's."""
    left, top, width, height = drafted.spread
    labels = np.repeat(np.repeat(drafted.labels, 2, axis=0), 2, axis=1)
    x, y = (2 * b - a for a, b in zip(drafted.canvas.offset, drafted.warp.canvas.offset, strict=True))
    labels = labels[top : top + height, left : left + width]
    assert (left, top) == (x, y)
    pixels = drafted.pixels
    for number in np.unique(labels[labels >= 0]).tolist():
        layer = drafted.full_layer(number).within(drafted.spread)
        inner = cv2.erode((labels == number).astype(np.uint8), np.ones((121, 121), np.uint8)) > 0
        assert inner.any() and layer.alpha[inner].all()
        ratio = pixels[inner] / layer.pixels[inner]
        assert np.ptp(ratio / drafted.decided[number].exposure.gain) < 0.1


def test_nothing_in_the_panorama_is_open(drafted: StitchResult) -> None:
    assert drafted.panorama.alpha.all() and drafted.panorama.alpha.dtype == bool
    assert drafted.pixels.min(axis=2).mean() > 0.01
    black = (drafted.pixels == 0).all(axis=2)
    assert not black.any()


def test_the_outline_is_that_of_the_pictures(
    large: PictureSet, options: StitchOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draft, "DRAFT", replace(draft.DRAFT, most_pixels=400_000))
    whole_frame = {"crop": "full", "projection": "cylindrical", "slide": 0, "holes": "transparent"}
    result = stitch(large.pictures, replace(options, **whole_frame))
    layers = [result.full_layer(number).within(result.spread).alpha for number in range(4)]
    anything, alpha = np.logical_or.reduce(layers), result.panorama.alpha > 0
    assert (alpha & ~anything).mean() < 0.0005, "gaps between two pictures that are narrower than a small pixel"
    assert (anything & ~alpha).mean() < 0.001, "corners, where the small pictures end a pixel earlier"


def test_the_report_counts_in_px_of_the_panorama(at_once: StitchResult, drafted: StitchResult) -> None:
    first, second = at_once.report, drafted.report
    assert second["canvas"]["width"] == drafted.canvas.width == drafted.panorama.alpha.shape[1]
    for name in ("width", "height"):
        assert [one[name] for one in second["pictures"]] == [one[name] for one in first["pictures"]]
    focals = [one["camera"]["focal_px"] for one in second["pictures"]]
    assert focals == pytest.approx([one["camera"]["focal_px"] for one in first["pictures"]])
    assert second["canvas"]["projection"]["focal_px"] == pytest.approx(
        first["canvas"]["projection"]["focal_px"], rel=0.03
    )
    for name in ("alignment_median_px", "alignment_p95_px"):
        assert second["measured"][name] == pytest.approx(first["measured"][name], rel=0.5, abs=0.1)
    assert second["field"]["leave_one_out_px"] == pytest.approx(first["field"]["leave_one_out_px"], rel=0.3)


def test_a_preview_is_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draft, "DRAFT", replace(draft.DRAFT, most_pixels=1))
    options = replace(KNOWN, camera=CameraRequest(focal_px=(FOCAL,)), slide=0, preview=True, measure=False)
    assert stitch(make_set(3, size=(240, 180)).pictures, options).enlarged is None


def test_depth_has_the_panoramas_size_and_lies_where_the_drafts_does(drafted: StitchResult) -> None:
    image = range_image(drafted)
    assert image.range.shape == drafted.panorama.alpha.shape and image.deviation.shape == image.range.shape
    left, top = drafted.spread[:2]
    height, width = (side // 2 * 2 - 2 for side in image.range.shape)
    inverse = 1 / image.range[top % 2 :, left % 2 :][:height, :width]
    blocks = inverse.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    row, column = (top + top % 2) // 2, (left + left % 2) // 2
    depth = drafted.warp.inverse_depth

    def off(down: int, right: int) -> float:
        part = depth[row + down :, column + right :][: height // 2 - 1, : width // 2 - 1]
        return float(np.nanmedian(np.abs(part - blocks[: part.shape[0], : part.shape[1]])))

    assert off(0, 0) < 0.3 * min(off(0, 1), off(1, 0)), "in px of the panorama, none beside its place"
    glb, _ = mesh_bytes(drafted, image)
    assert glb[:4] == b"glTF"


def test_layers_and_warp_have_the_panoramas_size(drafted: StitchResult, tmp_path: Path) -> None:
    request = OutputRequest(tmp_path / "o.png", layers=tmp_path / "layers", warp=tmp_path / "w.npz")
    with OutputFiles() as files:
        check(request, files, [picture.name for picture in drafted.pictures])
        write(drafted, request, files)
    size = drafted.canvas.height, drafted.canvas.width
    for path in (tmp_path / "layers").glob("*.png"):
        assert cv2.imread(str(path), cv2.IMREAD_UNCHANGED).shape[:2] == size, path.name
    panorama = cv2.imread(str(tmp_path / "o.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(panorama[..., ::-1], shown(drafted))
    labels = cv2.imread(str(tmp_path / "layers" / "labels.png"), cv2.IMREAD_UNCHANGED)
    assert set(np.unique(labels)) == {1, 2, 3, 4}
    with np.load(tmp_path / "w.npz") as warp:
        assert warp["canvas"].tolist() == list(size[::-1]) and warp["inverse_depth"].shape == size
        assert warp["sizes"].tolist() == [[640, 480]] * 4
        # the equation of docs/formats.md holds in px of the full pictures
        x, y = (values.astype(float) for values in np.meshgrid(*(np.arange(side) for side in size[::-1])))
        assert str(warp["projection"]) in ("perspective", "pannini", "cylindrical", "equirectangular")
        for number in range(4):
            left, top, width, height = warp[f"box_{number:02d}"]
            map_x = warp[f"map_x_{number:02d}"]
            assert map_x.shape == (height, width)
            inside = (map_x >= 0) & (map_x <= 639)
            assert 0.2 < inside.mean() and np.nanmax(map_x) > 600
