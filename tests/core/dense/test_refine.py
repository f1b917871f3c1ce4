"""Dense refinement against the ground truth of a photographed pair, and what it promises everywhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.field.folding import folds, turning
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchResult, stitch

DATA = Path(pytest.importorskip("skimage").__file__).parent / "data"


@pytest.fixture(scope="module")
def motorcycle() -> tuple[StitchResult, StitchResult]:
    """Scikit-image's pair (Middlebury 2014), without and with dense refinement; nothing told of the cameras."""
    pictures = [load_picture(DATA / f"motorcycle_{side}.png").view for side in ("left", "right")]
    sparse, dense = (stitch(pictures, StitchOptions(dense=dense, measure=False)) for dense in (False, True))
    return sparse, dense


def errors(result: StitchResult) -> np.ndarray:
    """Distance (px) of the map from the true one over the mutually visible pixels."""
    disparity = np.load(DATA / "motorcycle_disp.npz")["arr_0"].astype(np.float64)
    height, width = disparity.shape
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    known = np.isfinite(disparity)
    there = x - np.where(known, disparity, 0)
    # visible: no other pixel of the row lands there with more disparity
    nearest = np.full((height, width + 1), -np.inf)
    column = np.clip(np.rint(there), 0, width).astype(int)
    np.maximum.at(nearest, (y.astype(int)[known], column[known]), disparity[known])
    visible = known & (there >= 0) & (disparity >= nearest[y.astype(int), column] - 1)
    left, top = result.warp.canvas.offset
    box = np.s_[top : top + height, left : left + width]
    return np.hypot(result.warp.maps[1].x[box] - there, result.warp.maps[1].y[box] - y)[visible]


def test_motorcycle_within_half_a_pixel(motorcycle: tuple[StitchResult, StitchResult]) -> None:
    sparse, dense = ((errors(result) <= 0.5).mean() for result in motorcycle)
    assert dense > sparse + 0.25


def test_the_field_stays_exact_on_its_lines_and_does_not_fold(motorcycle: tuple[StitchResult, StitchResult]) -> None:
    _, dense = motorcycle
    view, warp = dense.views[1], dense.warp
    assert warp.confidence is not None and 0 <= warp.confidence.min() and warp.confidence.max() <= 1
    assert folds(turning(warp.maps[1])) < 0.1
    x = np.stack(np.meshgrid(np.arange(741.0), np.arange(500.0), [1.0]), axis=-1)[:, :, 0]
    left, top = warp.canvas.offset
    box = np.s_[top : top + 500, left : left + 741]
    ray = x @ view.H_inf.T + warp.inverse_depth[box][..., None] * view.e_prime
    off = np.hypot(ray[..., 0] / ray[..., 2] - warp.maps[1].x[box], ray[..., 1] / ray[..., 2] - warp.maps[1].y[box])
    assert np.nanmax(off) < 3.0, "what leaves the lines is slack, and small"
