"""Dense refinement against the ground truth of a photographed pair, and what it promises everywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.dense.epipolar_lines import EpipolarLines, SparseMap
from edf_stitch.core.dense.matching import ComparedPicture
from edf_stitch.core.dense.refine import _guide, _in_both, _overlap, _plain
from edf_stitch.core.field.folding import folds, turning
from edf_stitch.core.pictures.picture import Picture, load_picture, picture_from_array
from edf_stitch.core.pipeline import StitchResult, stitch

from ...pairs import ON_REFERENCE
from ..line_scenes import Field

DATA = Path(pytest.importorskip("skimage").__file__).parent / "data"


@pytest.fixture(scope="module")
def motorcycle() -> tuple[StitchResult, StitchResult]:
    """Scikit-image's pair (Middlebury 2014), without and with dense refinement; nothing told of the cameras."""
    pictures = [load_picture(DATA / f"motorcycle_{side}.png").view for side in ("left", "right")]
    sparse, dense = (stitch(pictures, replace(ON_REFERENCE, dense=dense, measure=False)) for dense in (False, True))
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


# --- its parts, on a pair of parallel cameras ----------------------------------------------------------------------

SIZE, TARGET_SIZE = (200, 150), (220, 140)
FOCAL = 100.0
ALONG, ASIDE = (1.0, 0, 0), (0, 1.0, 0)


def sparse_map(by_hand: SimpleNamespace, right: float, t: tuple[float, float, float] = ALONG) -> SparseMap:
    """Everything is seen so many px further right (or lower, for a camera that stands higher) than where it is; the
    axes meet the pictures in the same pixel."""
    camera, other = by_hand.camera(SIZE, FOCAL), by_hand.camera(TARGET_SIZE, FOCAL)
    other = replace(other, K=camera.K)
    field = Field(lambda points: np.full(points.shape[:-1], right / FOCAL))
    return SparseMap.over_reference(field, by_hand.view(camera, other, (0, 0, 0), t), camera, other, 16)


def rgb(levels: np.ndarray) -> np.ndarray:
    return np.repeat(levels.astype(np.uint8)[..., None], 3, axis=-1)


@pytest.mark.parametrize("right, t, expected", [
    (-60.0, ALONG, (60, 0, 199, 139)),  # the target, 140 px high, shows its lines as they are
    (80.0, ALONG, (0, 0, 139, 139)),
    (-70.0, ASIDE, (0, 70, 199, 149)),
    (50.0, ASIDE, (0, 0, 199, 89)),
])  # fmt: skip
def test_the_overlap_is_what_both_show_and_a_little_around_it(
    by_hand: SimpleNamespace, right: float, t: tuple[float, float, float], expected: tuple[int, int, int, int]
) -> None:
    """left, top, right, bottom; found on a grid of cells of some three px, of which one more is taken."""
    box = _overlap(sparse_map(by_hand, right, t), TARGET_SIZE)
    assert box is not None
    found = np.array([box[0], box[1], box[0] + box[2] - 1, box[1] + box[3] - 1])
    outwards = (found - expected) * (-1, -1, 1, 1)
    assert found[0] >= 0 and found[1] >= 0 and found[2] <= SIZE[0] - 1 and found[3] <= SIZE[1] - 1
    at_edge = np.array([expected[0] == 0, expected[1] == 0, expected[2] == 199, expected[3] == 149])
    assert (outwards[at_edge] == 0).all()
    assert (outwards[~at_edge] >= 1).all() and (outwards <= 8).all()


def test_an_overlap_that_is_hardly_one_is_none(by_hand: SimpleNamespace) -> None:
    assert _overlap(sparse_map(by_hand, -180.0), TARGET_SIZE) is None, "20 px wide"
    assert _overlap(sparse_map(by_hand, -130.0, ASIDE), TARGET_SIZE) is None, "20 px high"
    assert _overlap(sparse_map(by_hand, -300.0), TARGET_SIZE) is None
    assert _overlap(sparse_map(by_hand, -160.0), TARGET_SIZE) is not None, "40 px wide"


@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("t", [ALONG, ASIDE])
def test_what_does_not_change_along_a_line_is_plain(
    by_hand: SimpleNamespace, slope: float, t: tuple[float, float, float]
) -> None:
    """A ramp of so many gray levels a px: plain across it, and along it by its squared slope beside that of half a
    texture, which is 1."""
    sparse = sparse_map(by_hand, 5.0, t)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    along, across = (x, y) if t is ALONG else (y, x)
    inner = np.s_[12:-12, 12:-12]
    for step, at_most in ((1.0, 0.02), (2.0, 0.05)):
        lines = EpipolarLines.over(sparse, (0, 0, *SIZE), step)
        for ramp, expected in ((along, 1 / (1 + (step * slope) ** 2)), (across, 1.0), (0 * x, 1.0)):
            plain = _plain(lines, sparse, ComparedPicture.of(rgb(slope * ramp % 250), None, step))
            assert plain.shape == lines.shape
            assert abs(np.median(plain[inner]) - expected) < at_most


def test_the_guide_is_the_reference_at_the_nodes(by_hand: SimpleNamespace) -> None:
    sparse = sparse_map(by_hand, 5.0)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    view = rgb((x + y) / 2)
    for step in (1.0, 2.0):
        lines = EpipolarLines.over(sparse, (20, 10, 120, 80), step)
        guide = _guide(view, lines)
        assert guide.shape == (*lines.shape, 3) and guide.dtype == np.float32
        expected = lines.ideal.sum(axis=-1) / 2
        assert np.abs(guide - expected[..., None])[3:-3, 3:-3].max() <= 1.0


def pictures(alpha: np.ndarray | None, alpha_too: np.ndarray | None) -> tuple[Picture, Picture]:
    return tuple(
        replace(picture_from_array(np.zeros((size[1], size[0], 3), np.uint8)), alpha=one)
        for size, one in ((SIZE, alpha), (TARGET_SIZE, alpha_too))
    )


@pytest.mark.parametrize("step", [1.0, 2.0])
def test_nodes_that_either_picture_does_not_show_are_not_there(by_hand: SimpleNamespace, step: float) -> None:
    """Everything is seen 10.3 px further left in a target that is ten px lower than the reference."""
    lines = EpipolarLines.over(sparse_map(by_hand, -10.3), (4, 2, 180, 148), step)
    zero = np.zeros(lines.shape, np.float32)
    x, y = lines.ideal[..., 0], lines.ideal[..., 1]
    clear = np.abs(y - 139) > 0.01  # on the last line rounding decides

    def there(move: float, alpha: np.ndarray | None = None, alpha_too: np.ndarray | None = None) -> np.ndarray:
        return _in_both(lines, zero + move, zero, pictures(alpha, alpha_too))[clear]

    assert lines.direction[0, 0, 0] > 0
    for move in (0.0, 5.0):
        assert np.array_equal(there(move), ((x + move >= 10.3) & (y < 139))[clear])
    first, second = np.ones(SIZE[::-1], np.float32), np.ones(TARGET_SIZE[::-1], np.float32)
    first[:, 100:] = first[:30] = 0
    second[:, :40] = second[100:] = 0
    whole = there(0.0)
    assert np.array_equal(there(0.0, first), whole & ((x < 99.6) & (y > 29.6))[clear])
    # of the target what lies between a px that is shown and one that is not is still seen
    assert np.array_equal(there(0.0, None, second), whole & ((x > 39 + 10.3) & (y < 100))[clear])
