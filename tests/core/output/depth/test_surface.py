"""A grid of rays as a surface: whole, and cut where near and far meet. The scene: a ball before a wall and a floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.output.depth import surface as surface_module
from edf_stitch.core.output.depth.options import MESH
from edf_stitch.core.output.depth.surface import DepthGrid, Surface, cut_surface, whole_surface
from scipy.ndimage import gaussian_filter

BALL, RADIUS = np.array([0.2, -0.1, 2.0]), 0.5
WALL, FLOOR = 6.0, 1.3
ROWS, COLUMNS = 121, 161


def rays_at(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    rays = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), np.ones((len(y), len(x)))], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


Y, X = np.linspace(-0.45, 0.45, ROWS), np.linspace(-0.6, 0.6, COLUMNS)
RAYS = rays_at(Y, X)
MIDDLES = rays_at((Y[1:] + Y[:-1]) / 2, (X[1:] + X[:-1]) / 2)


def behind(rays: np.ndarray) -> np.ndarray:
    """Range of wall and floor."""
    with np.errstate(divide="ignore"):
        floor = np.where(rays[..., 1] > 0, FLOOR / rays[..., 1], np.inf)
    return np.minimum(WALL / rays[..., 2], floor)


def ranges(rays: np.ndarray) -> np.ndarray:
    along = rays @ BALL
    left = along**2 - BALL @ BALL + RADIUS**2
    return np.where(left > 0, along - np.sqrt(np.maximum(left, 0)), behind(rays))


def grid(d: np.ndarray, middles: np.ndarray | None = None, shows: np.ndarray | None = None) -> DepthGrid:
    uvs = np.stack(np.meshgrid(np.linspace(0, 1, COLUMNS), np.linspace(0, 1, ROWS)), axis=-1)
    shows = np.ones((ROWS, COLUMNS), bool) if shows is None else shows
    return DepthGrid(RAYS, d, shows, uvs, None, middles)


def scene(blur: float = 0.0) -> DepthGrid:
    """What is seen; blur: px by which its inverse range is smoothed."""
    d = 1 / ranges(RAYS)
    return grid(gaussian_filter(d, blur) if blur else d, 1 / ranges(MIDDLES))


def off_surfaces(surface: Surface) -> np.ndarray:
    """How far (N,) vertices lie from ball, wall and floor, in ranges of their own."""
    points = surface.vertices
    away = np.linalg.norm(points, axis=1)
    from_ball = np.abs(np.linalg.norm(points - BALL, axis=1) - RADIUS)
    return np.minimum(from_ball, np.abs(away - behind(points / away[:, None]))) / away


def skins(surface: Surface) -> int:
    """Faces that stretch from the ball to what lies behind."""
    near = np.linalg.norm(surface.vertices, axis=1) < 3
    return int((near[surface.faces].any(axis=1) & ~near[surface.faces].all(axis=1)).sum())


def test_what_is_whole_has_skins_and_what_is_cut_has_none() -> None:
    assert skins(whole_surface(scene())) > 100
    assert skins(cut_surface(scene())) == 0


def test_seen_from_the_viewpoint_nothing_is_missing() -> None:
    """One face for each cell, over all of it: its corners lie on the cell's own rays."""
    surface = cut_surface(scene())
    assert len(surface.faces) == (ROWS - 1) * (COLUMNS - 1)
    unit = surface.vertices / np.linalg.norm(surface.vertices, axis=1)[:, None]
    np.testing.assert_allclose(
        unit[:, :2] / unit[:, 2:], (surface.uvs * [1.2, 0.9]) - [0.6, 0.45], atol=1e-9
    )
    corners = np.sort(surface.uvs[surface.faces].mean(axis=1) @ [1, 1000])
    assert len(np.unique(corners.round(9))) == len(surface.faces)
    a, b, c, _ = (unit[surface.faces[:, corner]] for corner in range(4))
    turned = np.cross(b - a, c - a)
    # y runs down here, so that counter-clockwise as seen is towards the viewpoint
    assert (np.sum(turned * a, axis=1) * np.sign(np.sum(turned * a, axis=1)[0]) > 0).all()


def test_a_cell_across_an_edge_goes_to_the_side_that_its_middle_lies_on() -> None:
    surface = cut_surface(scene())
    middles = surface.uvs[surface.faces].mean(axis=1) * [1.2, 0.9] - [0.6, 0.45]
    rays = np.column_stack([middles, np.ones(len(middles))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    away = np.linalg.norm(surface.vertices[surface.faces].mean(axis=1), axis=1)
    assert ((away < 3) == (ranges(rays) < 3)).mean() > 0.9999
    assert np.percentile(off_surfaces(surface), 99.9) < 0.02


@pytest.mark.parametrize("blur", [0.7, 1.2])
def test_a_blurred_edge_becomes_a_step(blur: float) -> None:
    def steep(surface: Surface) -> int:
        away = np.linalg.norm(surface.vertices, axis=1)[surface.faces]
        return int((away.max(axis=1) > 1.2 * away.min(axis=1)).sum())

    assert steep(whole_surface(scene(blur))) > 500 and (off_surfaces(whole_surface(scene(blur))) > 0.1).sum() > 250
    surface = cut_surface(scene(blur))
    assert len(surface.faces) == (ROWS - 1) * (COLUMNS - 1)
    assert steep(surface) == 0 and not (off_surfaces(surface) > 0.1).any()


def test_ground_and_walls_seen_along_stay_whole() -> None:
    """A floor up to its horizon, and a wall beside the viewpoint: slopes, but no edges."""
    with np.errstate(divide="ignore"):
        floor = np.where(RAYS[..., 1] > 0, RAYS[..., 1] / FLOOR, 0)
    side = np.maximum(RAYS[..., 0], 0) / 0.8
    for d in (floor, np.maximum(floor, side)):
        surface = cut_surface(grid(np.maximum(d, 1e-3), np.full((ROWS - 1, COLUMNS - 1), 0.1)))
        assert len(surface.vertices) == ROWS * COLUMNS


def test_a_spike_is_taken_away() -> None:
    d = np.full((ROWS, COLUMNS), 0.2)
    d[40, 50] = 3.0
    surface = cut_surface(grid(d, np.full((ROWS - 1, COLUMNS - 1), 0.2)))
    np.testing.assert_allclose(np.linalg.norm(surface.vertices, axis=1), 5.0)


def test_a_wide_slope_is_a_real_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is seen under a small angle, as the ground is by a telephoto: neither cut nor made a step."""
    monkeypatch.setattr(surface_module, "MESH", replace(MESH, ramp_nodes=4))
    d = np.full((ROWS, COLUMNS), 0.1)
    d[40:51], d[51:] = np.linspace(0.1, 1.0, 11)[:, None], 1.0
    surface = cut_surface(grid(d, np.full((ROWS - 1, COLUMNS - 1), 1.0)))
    assert len(surface.vertices) == ROWS * COLUMNS
    assert len(np.unique((1 / np.linalg.norm(surface.vertices, axis=1)).round(6))) == 11
    narrow = np.full((ROWS, COLUMNS), 0.1)
    narrow[40:46], narrow[46:] = np.linspace(0.1, 1.0, 6)[:, None], 1.0
    surface = cut_surface(grid(narrow, np.full((ROWS - 1, COLUMNS - 1), 1.0)))
    assert len(np.unique((1 / np.linalg.norm(surface.vertices, axis=1)).round(6))) == 2


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("middle", [0.47, 0.53])
def test_a_cell_is_continued_from_all_corners_of_its_side(turn: int, middle: float) -> None:
    """Two corners are near, and the others take their mean, whichever way round they lie."""
    ring = np.roll([0.5, 0.52, 0.2, 0.2], turn)  # from the lower left counter-clockwise
    d = np.array([[ring[3], ring[2]], [ring[0], ring[1]]])
    corners = np.ix_([0, 1], [0, 1])
    one = DepthGrid(RAYS[corners], d, np.ones((2, 2), bool), np.zeros((2, 2, 2)), None, np.array([[middle]]))
    found = 1 / np.linalg.norm(cut_surface(one).vertices, axis=1)
    np.testing.assert_allclose(np.sort(found), [0.5, 0.51, 0.51, 0.52], rtol=1e-6)


def test_without_middles_a_cell_across_an_edge_is_far() -> None:
    known = scene()
    surface = cut_surface(grid(known.inverse_depth))
    near = (np.linalg.norm(surface.vertices, axis=1) < 3)[surface.faces].all(axis=1).sum()
    with_middles = cut_surface(known)
    assert near < (np.linalg.norm(with_middles.vertices, axis=1) < 3)[with_middles.faces].all(axis=1).sum()


def test_what_is_not_shown_or_not_known_has_no_face() -> None:
    shows = np.ones((ROWS, COLUMNS), bool)
    shows[:, :10] = False
    d = np.full((ROWS, COLUMNS), 0.2)
    d[0, -1] = np.nan
    surface = cut_surface(grid(d, np.full((ROWS - 1, COLUMNS - 1), 0.2), shows))
    assert len(surface.faces) == (ROWS - 1) * (COLUMNS - 10) - 1
    assert np.isfinite(surface.vertices).all()


def test_everything_beyond_the_farthest_ends_there() -> None:
    d = np.full((ROWS, COLUMNS), 0.5)
    d[:20] = 0.0
    surface = cut_surface(grid(d, np.full((ROWS - 1, COLUMNS - 1), 0.5)), farthest=10)
    away = np.linalg.norm(surface.vertices, axis=1)
    np.testing.assert_allclose(np.unique(away.round(6)), [2, 20])
