"""How far a pair's depth may be off: by so much that its points move by what matches may be off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, inverse_intrinsics
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.dense.sphere.options import SWEEP
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.depth.pair_deviation import pair_deviation
from edf_stitch.core.output.depth.range_image import range_image
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at


@pytest.fixture(scope="module")
def half(small_pair: Pair, known: StitchOptions) -> StitchResult:
    """The same from a viewpoint that slides half-way, on a cylinder."""
    return stitch((small_pair.reference, small_pair.target), replace(known, projection="cylindrical", slide=0.5))


def seen_at(result: StitchResult, d: np.ndarray) -> list[np.ndarray]:
    """Where both cameras see the points of all canvas pixels at inverse depth d (H, W): ideal px (H, W, 2)."""
    canvas, (reference, target) = result.warp.canvas, result.views
    rays = np.stack(
        canvas.project_rows(inverse_intrinsics(reference.K), canvas.xs, canvas.ys, reference.camera), axis=-1
    )
    slide = np.zeros(d.shape) if result.warp.slide is None else result.warp.slide[:, :]
    points = rays / d[..., None] + slide[..., None] * (-target.R.T @ target.t)
    seen = [(points @ view.R.T + view.t) @ view.K.T for view in result.views]
    return [one[..., :2] / one[..., 2:] for one in seen]


@pytest.mark.parametrize("which", ["small_result", "half"])
def test_a_change_by_its_deviation_moves_the_pictures_apart_by_what_matches_are_off(
    which: str, request: pytest.FixtureRequest
) -> None:
    result: StitchResult = request.getfixturevalue(which)
    deviation, d = pair_deviation(result).astype(np.float64), result.warp.inverse_depth.astype(np.float64)
    before, after = seen_at(result, d), seen_at(result, d + 1e-3 * deviation)
    moved = sum(np.linalg.norm(b - a, axis=-1) for a, b in zip(before, after, strict=True)) / 1e-3
    sure, field_px = result.confidence, result.pair_field.fit.held_out_px
    known = np.isfinite(deviation) & (d > 0.02)
    assert known.mean() > 0.2
    wanted = np.hypot(sure * SWEEP.noise_px, (1 - sure) * field_px)
    np.testing.assert_allclose(moved[known], wanted[known], rtol=0.02)


def test_what_one_picture_alone_sees_has_none(small_result: StitchResult) -> None:
    deviation = pair_deviation(small_result)
    both = np.logical_and.reduce([one.inside() for one in small_result.warp.maps])
    np.testing.assert_array_equal(np.isfinite(deviation), both & ~small_result.occluded[1])
    image = range_image(small_result)
    alone = ~both & np.isfinite(image.range)
    assert alone.any() and image.deviation is not None and np.isnan(image.deviation[alone]).all()


def test_without_dense_refinement_it_is_the_smooth_fields(small_pair: Pair, known: StitchOptions) -> None:
    smooth = stitch((small_pair.reference, small_pair.target), replace(known, dense=False))
    coarse, fine = pair_deviation(smooth), pair_deviation(replace(smooth, warp=replace(
        smooth.warp, lazy_confidence=np.ones(smooth.warp.inverse_depth.shape, np.float32)
    )))  # fmt: skip
    known_there = np.isfinite(coarse)
    share = smooth.pair_field.fit.held_out_px / SWEEP.noise_px
    np.testing.assert_allclose(coarse[known_there], share * fine[known_there], rtol=1e-4)


def test_between_cameras_that_are_known_depth_is_off_by_about_that(small_pair: Pair, known: StitchOptions) -> None:
    cameras = small_pair.reference_camera, small_pair.target_camera
    table = {
        name: {"K": one.K.tolist(), "R": one.R.tolist(), "t": one.t.tolist()}
        for name, one in zip(("reference", "target"), cameras, strict=True)
    }
    given = replace(known, camera=CameraRequest(cameras={"cameras": table, "unit": "metres"}))
    result = stitch((small_pair.reference, small_pair.target), given)
    image, (left, top), (width, height) = range_image(result), result.canvas.offset, cameras[0].size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
    along = np.linalg.norm(homogeneous(pixels) @ np.linalg.inv(cameras[0].K).T, axis=-1)
    part = slice(top, top + height), slice(left, left + width)
    assert image.deviation is not None
    off = np.abs(image.range[part] - depth_at(cameras[0], pixels) * along) / image.deviation[part]
    off = off[np.isfinite(off)]
    assert off.size > 5000 and 0.15 < np.median(off) < 1 and (off < 2).mean() > 0.85
