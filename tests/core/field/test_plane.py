"""The plane a field fades to: the one that goes on beyond the reference."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.field.plane import beyond_reference, continued_plane

SIZE = (1200, 900)
SIDE = float(np.sqrt(1200 * 900))
LEFT, RIGHT = np.array([-4e-4, 0, 0.3]), np.array([4e-4, 0, -0.18])  # two walls that meet at x = 600
SENSITIVITY = 1000.0


def corner(count: int, seed: int = 0, noise: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """Matches on two walls that meet in a corner: the right one as dense as the left."""
    random = np.random.default_rng(seed)
    x = random.uniform((0, 0), SIZE, (count, 2))
    d = np.where(x[:, 0] < 600, homogeneous(x) @ LEFT, homogeneous(x) @ RIGHT)
    return x, d + noise / SENSITIVITY * random.standard_normal(count)


def side_of(border: float) -> np.ndarray:
    return np.column_stack([np.full(20, border), np.linspace(0, 899, 20)])


def found(x: np.ndarray, d: np.ndarray, beyond: np.ndarray, weight: np.ndarray | None = None) -> np.ndarray:
    s = np.full(len(x), SENSITIVITY)
    return continued_plane(x, d, s, np.ones(len(x)) if weight is None else weight, beyond, SIDE, 1.0, 0.3)


def off_px(plane: np.ndarray, true: np.ndarray, x: np.ndarray) -> float:
    return float(np.abs(SENSITIVITY * homogeneous(x) @ (plane - true)).max())


@pytest.mark.parametrize(("border", "wall"), [(0.0, LEFT), (1199.0, RIGHT)], ids=["left", "right"])
@pytest.mark.parametrize("seed", range(3))
def test_of_a_corner_the_wall_that_goes_on_is_taken(border: float, wall: np.ndarray, seed: int) -> None:
    x, d = corner(400, seed)
    beyond = np.array([[border - 400, 0], [border + 400, 899]])
    assert off_px(found(x, d, side_of(border)), wall, beyond) < 0.6


def test_many_matches_on_a_small_thing_count_as_little_as_it_is_large() -> None:
    x, d = corner(300)
    random = np.random.default_rng(5)
    poster = random.uniform((1020, 300), (1120, 400), (900, 2))
    x, d = np.vstack([x, poster]), np.concatenate([d, np.full(900, 0.45)])
    assert off_px(found(x, d, side_of(1199.0)), RIGHT, np.array([[1199.0, 450], [1600, 450]])) < 0.6


def test_a_quarter_of_outliers_changes_nothing() -> None:
    x, d = corner(400)
    d[::4] += np.random.default_rng(2).uniform(-0.2, 0.2, 100)
    assert off_px(found(x, d, side_of(1199.0)), RIGHT, np.array([[1199.0, 450], [1600, 450]])) < 1.0


def test_weights_decide_between_two_layers() -> None:
    x, _ = corner(300)
    d = np.where(np.arange(300) % 2, 0.1, 0.14)
    for heavy, depth in ((1, 0.1), (0, 0.14)):
        weight = np.where(np.arange(300) % 2 == heavy, 50.0, 0.1)
        plane = found(x, d, side_of(1199.0), weight)
        assert np.abs(homogeneous(x) @ plane - depth).max() < 1e-3


def test_matches_on_a_line_still_give_a_plane() -> None:
    x = np.column_stack([np.linspace(0, 1199, 50), np.linspace(0, 899, 50)])
    assert np.isfinite(found(x, np.full(50, 0.1), side_of(1199.0))).all()


def test_where_the_target_goes_on_beyond_the_reference() -> None:
    moved = np.array([[1, 0, -500], [0, 1, 0], [0, 0, 1.0]])  # the target begins at the reference's x = 500
    points = beyond_reference(moved, SIZE, SIZE)
    assert len(points) and (points[:, 0] == 1199).all() and (np.ptp(points[:, 1]) > 800)
    assert len(beyond_reference(np.eye(3), SIZE, SIZE)) == 0
    assert len(beyond_reference(moved, SIZE, (300, 200))) == 0, "a target that lies within"
    turned = np.array([[0, 0, 1000.0], [0, 1, 0], [-1, 0, 500]])  # half of it lies behind the reference
    assert np.isfinite(beyond_reference(turned, SIZE, SIZE)).all()
