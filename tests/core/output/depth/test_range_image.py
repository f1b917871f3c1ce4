"""Ranges of a panorama, against those of the scene that it shows; and the file, as OpenEXR and Blender read it."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import OpenEXR
import pytest
from edf_stitch.core.cameras.scale import Scale
from edf_stitch.core.output.depth.range_image import range_bytes, range_image
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.system.errors import DegenerateGeometry
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at

from .finished import finished, plane, rays_of, sphere

NORMAL = np.array([0.1, 0.7, 0.3])


def test_a_pairs_ranges_are_those_of_its_scene(small_pair: Pair, small_result: StitchResult) -> None:
    """Along the rays, not along the axis; half a metre is one baseline."""
    image = range_image(small_result)
    camera, (x, y) = small_pair.reference_camera, small_result.canvas.offset
    width, height = camera.size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
    true = depth_at(camera, pixels) * np.linalg.norm(rays_through(camera, pixels), axis=-1)
    baseline = float(np.linalg.norm(small_pair.target_camera.place - camera.place))
    found = image.range[y : y + height, x : x + width] * baseline
    sure = small_result.confidence[y : y + height, x : x + width] > 0.5
    off = np.abs(np.log(found / true))[sure]
    assert sure.mean() > 0.3 and np.median(off) < 0.04
    assert image.confidence is not None and image.deviation is not None


def rays_through(camera: SimpleNamespace, pixels: np.ndarray) -> np.ndarray:
    K = camera.K
    return np.stack([*((pixels[..., k] - K[k, 2]) / K[k, k] for k in (0, 1)), np.ones(pixels.shape[:2])], axis=-1)


@pytest.mark.parametrize("canvas", [sphere(), plane()], ids=["sphere", "plane"])
def test_ranges_are_along_the_rays_in_metres_where_a_scale_is_known(canvas: SimpleNamespace) -> None:
    true = 1 / np.maximum(rays_of(canvas) @ NORMAL, 0.05)
    image = range_image(finished(canvas, true, scale=Scale(2.5, "told")))
    np.testing.assert_allclose(image.range, 2.5 * true, rtol=1e-5)


def test_infinity_is_told_from_what_has_no_depth() -> None:
    canvas = sphere()
    ranges = np.full((canvas.height, canvas.width), 4.0)
    ranges[0], ranges[1], ranges[2] = np.inf, -3.0, np.nan
    shows = np.ones(ranges.shape, bool)
    shows[3] = False
    deviation = np.full(ranges.shape, 0.01, np.float32)
    image = range_image(finished(canvas, ranges, shows, deviation=deviation))
    assert np.isposinf(image.range[:2]).all() and np.isnan(image.range[2:4]).all()
    assert image.deviation is not None
    assert np.isposinf(image.deviation[:2]).all() and np.isnan(image.deviation[2:4]).all()
    np.testing.assert_allclose(image.deviation[4:], 4.0**2 * 0.01, rtol=1e-5)


def test_the_part_of_a_sphere_that_is_mapped_lies_in_its_place() -> None:
    canvas = sphere()
    part = canvas.within((100, 40, 120, 60))
    inner = finished(part, np.full((60, 120), 2.0))
    whole = finished(canvas, np.full((canvas.height, canvas.width), 2.0))
    inner.spread = (-100, -40, canvas.width, canvas.height)
    inner.canvas, inner.panorama = canvas, whole.panorama
    image = range_image(inner)
    known = np.isfinite(image.range)
    assert image.range.shape == (canvas.height, canvas.width)
    assert known[40:100, 100:220].all() and known.sum() == 60 * 120


def test_without_depth_there_is_none() -> None:
    far = finished(plane(), np.full((100, 200), np.inf))
    with pytest.raises(DegenerateGeometry, match="leave out --depth and --mesh"):
        range_image(far)
    one_place = finished(plane(), np.full((100, 200), 3.0))
    one_place.views = (one_place.views[0], one_place.views[0])
    with pytest.raises(DegenerateGeometry, match="no depth"):
        range_image(one_place)


def test_openexr_reads_what_was_written() -> None:
    canvas = plane()
    ranges = 1 / np.maximum(rays_of(canvas) @ NORMAL, 0.2)
    ranges[0] = np.inf
    spread = np.full(ranges.shape, 0.02, np.float32)
    image = range_image(finished(canvas, ranges, scale=Scale(3.0, "told"), deviation=spread, lazy_confidence=spread))
    file = OpenEXR.File(io.BytesIO(range_bytes(image)), separate_channels=True)
    channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(channels) == {"Y", "Z", "deviation", "confidence"}
    np.testing.assert_array_equal(channels["Z"], image.range)
    np.testing.assert_array_equal(channels["Y"], image.range)
    np.testing.assert_array_equal(channels["deviation"], image.deviation)
    np.testing.assert_array_equal(channels["confidence"], spread)
    header = file.header()
    assert header["rangeUnit"] == "metres" and header["metresPerBaseline"] == "3"
    without = OpenEXR.File(io.BytesIO(range_bytes(range_image(finished(canvas, ranges)))), separate_channels=True)
    assert set(without.channels()) == {"Y", "Z"} and without.header()["rangeUnit"] == "baselines"
    assert "metresPerBaseline" not in without.header()


@pytest.mark.blender
def test_blender_reads_it_as_a_gray_picture(tmp_path: Path) -> None:
    bpy = pytest.importorskip("bpy")
    canvas = plane()
    ranges = 1 / np.maximum(rays_of(canvas) @ NORMAL, 0.2)
    ranges[0], ranges[1] = np.inf, np.nan
    spread = np.full(ranges.shape, 0.02, np.float32)
    image = range_image(finished(canvas, ranges, deviation=spread, lazy_confidence=spread))
    (tmp_path / "depth.exr").write_bytes(range_bytes(image))
    read = bpy.data.images.load(str(tmp_path / "depth.exr"))
    pixels = np.empty(read.size[0] * read.size[1] * 4, np.float32)
    read.pixels.foreach_get(pixels)
    pixels = pixels.reshape(*ranges.shape, 4)[::-1]
    for channel in range(3):
        np.testing.assert_array_equal(pixels[..., channel], image.range)
    assert (pixels[..., 3] == 1).all(), "no channel is taken for alpha"
