"""The canvas holds both pictures, and a grid's values reach pixels without a shift."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.panorama.canvas import _area_ratio, border, bounding_canvas, expected_reach
from edf_stitch.core.panorama.options import CANVAS
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.system.errors import OutputTooLarge


def grid_with_step(step: int, left: int, top: int, width: int, height: int) -> Grid:
    """What Grid.over makes, with a step of one's choice."""
    return Grid((left - 2 * step, top - 2 * step), step, -(-width // step) + 4, -(-height // step) + 4)


def pixels_of(left: int, top: int, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    return np.meshgrid(np.arange(left, left + width, dtype=float), np.arange(top, top + height, dtype=float))


def test_a_grid_of_few_nodes_covers_the_rectangle_with_two_cells_to_spare() -> None:
    assert Grid.over(-29, 41, 101, 77, nodes=101 * 77 // 49) == grid_with_step(7, -29, 41, 101, 77)
    for left, top, width, height in ((0, 0, 1, 1), (-37, 11, 641, 479), (5, -900, 4001, 3003)):
        grid = Grid.over(left, top, width, height)
        half = (grid.step - 1) / 2
        assert grid.step >= 4 and grid.columns * grid.rows < 25_000 + 10 * (grid.columns + grid.rows)
        for nodes, first, count in ((grid.xs, left, width), (grid.ys, top, height)):
            assert np.allclose(np.diff(nodes), grid.step)
            assert nodes[0] == first - 2 * grid.step + half, "nodes are the centres of cells of whole pixels"
            assert nodes[1] + half < first and nodes[-2] - half > first + count - 1, "bicubic needs them"
        assert grid.points.shape == (grid.rows, grid.columns, 2)
        assert np.array_equal(grid.points[3, 2 % grid.columns], (grid.xs[2 % grid.columns], grid.ys[3]))


@pytest.mark.parametrize("step", [4, 5, 7, 10, 16, 23, 50])
@pytest.mark.parametrize(("width", "height"), [(101, 77), (64, 128), (1, 53), (13, 3)])
def test_affine_functions_reach_every_pixel_as_they_are(step: int, width: int, height: int) -> None:
    """A plane is affine in inverse depth: what is added here bends every wall. Half a cell would be 2 to 25."""
    left, top = -29, 41
    grid = grid_with_step(step, left, top, width, height)
    x, y = pixels_of(left, top, width, height)
    for a, b, c in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-0.4, 0.7, 12.0), (0.0, 0.0, 3.5)):
        values = grid.points @ (a, b) + c
        pixels = grid.to_pixels(values, left, top, width, height)
        assert pixels.shape == (height, width) and pixels.dtype == np.float32
        # rounding of a few float32 operations on values of this size
        assert np.abs(pixels - (a * x + b * y + c)).max() <= 16 * np.spacing(np.float32(np.abs(values).max()))


def test_a_smooth_function_reaches_pixels_with_a_small_error() -> None:
    left, top, width, height, step = -11, 3, 331, 207, 9
    grid = grid_with_step(step, left, top, width, height)
    omega = 2 * np.pi / (40 * step)

    def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.sin(omega * x + 0.3) * np.cos(0.7 * omega * y)

    pixels = grid.to_pixels(wave(grid.points[..., 0], grid.points[..., 1]), left, top, width, height)
    # what even linear interpolation achieves: h² (|f_xx| + |f_yy|) / 8
    assert np.abs(pixels - wave(*pixels_of(left, top, width, height))).max() < (omega * step) ** 2 * 1.49 / 8


@pytest.mark.parametrize("step", [4, 7, 50])
def test_strips_and_parts_equal_the_whole(step: int) -> None:
    left, top, width, height = -20, 9, 203, 151
    grid = grid_with_step(step, left, top, width, height)
    values = np.random.default_rng(3).normal(size=(grid.rows, grid.columns))
    whole = grid.to_pixels(values, left, top, width, height)
    for x, y, w, h in ((0, 0, width, 1), (0, height - 1, width, 1), (0, 37, width, 50), (width - 1, 0, 1, height),
                       (101, 77, 5, 3)):  # fmt: skip
        part = grid.to_pixels(values, left + x, top + y, w, h)
        assert part.shape == (h, w)
        assert np.abs(part - whole[y : y + h, x : x + w]).max() <= 1e-5


def shifted(dx: float, dy: float, scale: float = 1.0):  # noqa: ANN201
    """One further picture's map: its pixel = scale · (reference pixel − shift)."""
    return lambda grid: [scale * (grid.points - (dx, dy))]


def corners(dx: float, dy: float, width: float, height: float) -> np.ndarray:
    return np.array([[dx, dy], [dx + width, dy], [dx, dy + height], [dx + width, dy + height]], float)


@pytest.mark.parametrize(("dx", "dy"), [(0, 0), (140, 0), (-140, 33), (25.5, -60.25), (300, 200), (-7, -4)])
@pytest.mark.parametrize("target_size", [(200, 150), (311, 97)])
def test_the_canvas_holds_both_pictures_and_not_much_more(
    dx: float, dy: float, target_size: tuple[int, int]
) -> None:
    size = (200, 150)
    reach, cut = expected_reach([corners(dx, dy, *(s - 1 for s in target_size))], size, [target_size])
    assert not cut
    canvas = bounding_canvas(shifted(dx, dy), (0, 0, *size), [target_size], reach)
    left, top = -canvas.offset[0], -canvas.offset[1]
    right, bottom = max(size[0], dx + target_size[0]) - 1, max(size[1], dy + target_size[1]) - 1
    need = (min(0, dx), min(0, dy), right, bottom)
    have = (left, top, left + canvas.width - 1, top + canvas.height - 1)
    assert have[0] <= need[0] and have[1] <= need[1] and have[2] >= need[2] and have[3] >= need[3]
    cell = max(4, int(np.sqrt((need[2] - need[0]) * (need[3] - need[1]) * 2 / 5000))) + 4
    assert all(abs(a - b) <= 2.5 * cell for a, b in zip(have, need, strict=True))
    assert not canvas.cropped
    assert all(isinstance(value, int) for value in (canvas.width, canvas.height, *canvas.offset))


def test_a_target_that_shows_nothing_useful_leaves_the_reference() -> None:
    canvas = bounding_canvas(shifted(1e6, 0), (0, 0, 60, 40), [(60, 40)], np.array([0.0, 0, 60, 40]))
    assert canvas.offset == (0, 0) and 60 <= canvas.width <= 62 and 40 <= canvas.height <= 42


def test_what_is_stretched_beyond_four_times_in_length_is_cropped_and_said() -> None:
    def bend(grid: Grid) -> list[np.ndarray]:
        """Fine up to x = 300, then the target creeps: 0.1 target pixels for each canvas pixel, 0.1 in y too."""
        x, y = grid.points[..., 0], grid.points[..., 1]
        slow = np.maximum(x - 300, 0)
        there = np.minimum(x, 300) - 100 + 0.05 * slow, np.where(slow > 0, 75 + 0.05 * (y - 75), y)
        return [np.stack(there, axis=-1)]

    canvas = bounding_canvas(bend, (0, 0, 200, 150), [(400, 150)], np.array([0.0, 0, 900, 150]))
    assert canvas.cropped and 295 <= canvas.width + canvas.offset[0] <= 300 + 2 * 20


def test_an_outline_that_runs_to_infinity_is_looked_for_within_reach_only() -> None:
    points = corners(50, 0, 100, 100)
    points[1] = np.nan
    reach, cut = expected_reach([points], (200, 150), [(100, 100)])
    far = CANVAS.max_reach * 200
    assert cut and np.array_equal(reach, (-far, -far, 200 + far, 150 + far))


def test_an_outline_too_far_away_is_cut() -> None:
    reach, cut = expected_reach([corners(50, 0, 1e5, 100)], (200, 150), [(100, 100)])
    assert cut and reach[2] == 200 + CANVAS.max_reach * 200 and reach[0] <= 0
    reach, cut = expected_reach([corners(50, 20, 100, 100)], (200, 150), [(100, 100)])
    assert not cut and (reach[:2] <= (0, 0)).all() and (reach[2:] >= (200, 150)).all()


def test_a_panorama_of_too_many_pixels_is_refused_with_its_size() -> None:
    size = (40_000, 26_000)
    with pytest.raises(OutputTooLarge, match=r"4\d{4}×2\d{4} pixels, 1000 million at most: use smaller pictures"):
        bounding_canvas(shifted(0, 0), (0, 0, *size), [size], np.array([0.0, 0, *size]))


# --- the outline of a picture, and areas ---------------------------------------------------------------------------


def test_the_border_goes_once_round_the_picture_from_its_first_pixel() -> None:
    """Clockwise as seen, side by side, each point as far along its side as it is along the outline."""
    points = border((101, 51))
    assert points[0].tolist() == [0, 0] and len(np.unique(points, axis=0)) == len(points)
    count = len(points) // 4
    for k, (corner, along) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        assert points[k * count].tolist() == [100 * corner, 50 * along], "a corner"
    steps = np.diff(np.vstack([points, points[:1]]), axis=0)
    for part, (dx, dy) in zip(np.split(steps, 4), ((100, 0), (0, 50), (-100, 0), (0, -50)), strict=True):
        assert np.allclose(part, np.array([dx, dy]) / count)


@pytest.mark.parametrize("matrix", [(1, 0, 0, 1), (0.5, 0.2, -0.1, 2), (-1, 0, 0.5, 0.25), (0, 3, 2, 0)])
def test_an_area_is_in_target_pixels_for_each_of_the_canvas(matrix: tuple[float, float, float, float]) -> None:
    a, b, c, d = matrix
    grid = grid_with_step(5, 0, 0, 60, 40)
    x, y = np.moveaxis(grid.points, -1, 0)
    target = np.stack([a * x + b * y, c * x + d * y], axis=-1)
    assert np.allclose(_area_ratio(target, 5), abs(a * d - b * c))
    target[3, 4] = np.nan
    assert np.isinf(_area_ratio(target, 5)[3, 5]) and np.isinf(_area_ratio(target, 5)[2, 4])


def test_an_outline_within_reach_gets_a_margin_of_a_tenth_of_the_longer_side() -> None:
    reach, cut = expected_reach([corners(150, -40, 300, 100)], (200, 150), [(300, 100)])
    assert not cut and np.allclose(reach, (0, -40 - 20, 450 + 20, 150))
