"""How what continues beyond the overlap takes over from the field on every canvas."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.continuation.continuation import Continuation
from edf_stitch.core.continuation.target_grid import TargetGrid
from edf_stitch.core.field.field import Field, FieldValues
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.warp import build_map, build_warp
from edf_stitch.core.raster.grid import Grid

SIZE = (320, 240)
BAND = 30.0


class Sloping:
    """A field on a plane, with slack, which is defined on every ray."""

    name = "given"
    plane = np.array([2e-4, 1e-4, 0.1])
    fit = SimpleNamespace(fade_px=20.0)

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        points = grid.points if ideal is None else ideal
        shift = np.broadcast_to([3.0, -2.0], points.shape)
        return FieldValues(points @ self.plane[:2] + self.plane[2], shift, self.plane)


@pytest.fixture(scope="module")
def rig(by_hand: SimpleNamespace) -> tuple[Field, tuple[View, ...], Continuation]:
    camera = by_hand.camera(SIZE, 300.0)
    views = views_of(by_hand.view(camera, camera, (0, -15, 0), (-1, 0, 0.1)), (camera, camera))
    grid = TargetGrid.over(views[1], np.array([0.0, 1.0, 0.0]))
    surface = Continuation.of(camera.K, grid, np.full(grid.shape, 0.25), BAND)
    return Sloping(), views, surface


CANVASES = ("reference", "cylindrical", "equirectangular")


def canvas_of(kind: str, views: tuple[View, ...]) -> Canvas:
    if kind == "reference":
        return Canvas(520, 260, (10, 10))
    return Canvas(480, 260, (170, 130), projection=round_projection(kind, views[0].K, np.eye(3)))


@pytest.mark.parametrize("kind", CANVASES)
def test_nothing_changes_where_the_reference_lies(
    kind: str, rig: tuple[Field, tuple[View, ...], Continuation]
) -> None:
    field, views, surface = rig
    canvas = canvas_of(kind, views)
    before, after = build_map(field, views, canvas), build_map(field, views, canvas, continuation=surface)
    inside = before.maps[0].inside()
    assert 0.2 < inside.mean() < 0.9
    for one, other in ((before.inverse_depth, after.inverse_depth), (before.maps[1].x, after.maps[1].x)):
        assert np.array_equal(one[inside], other[inside], equal_nan=True)


@pytest.mark.parametrize("kind", CANVASES)
def test_beyond_the_band_only_the_surface_counts_without_slack(
    kind: str, rig: tuple[Field, tuple[View, ...], Continuation]
) -> None:
    field, views, surface = rig
    canvas = canvas_of(kind, views)
    warp = build_map(field, views, canvas, continuation=surface)
    reference, view = warp.maps[0].arrays(), views[1]
    beyond = warp.maps[1].inside() & ~(reference.x < SIZE[0] - 1 + BAND)
    assert beyond.sum() > 2000
    # the surface δ = 1/4 is a plane of the target: its map is a homography of the rays
    x, y = warp.maps[1].x[beyond], warp.maps[1].y[beyond]
    rays = surface.outline(np.stack([x, y], axis=-1).astype(float))
    seen = rays @ surface.K.T
    raw = seen[:, :2] / seen[:, 2:]
    assert np.abs(raw - np.stack([reference.x[beyond], reference.y[beyond]], axis=-1)).max() < 0.05
    assert view.e_prime.any()


@pytest.mark.parametrize("kind", CANVASES)
def test_depth_and_its_slope_are_continuous_across_the_border(
    kind: str, rig: tuple[Field, tuple[View, ...], Continuation]
) -> None:
    field, views, surface = rig
    canvas = canvas_of(kind, views)
    before, after = (
        build_map(field, views, canvas, continuation=one).inverse_depth.astype(float) for one in (None, surface)
    )
    added = (after - before)[120, canvas.width // 2 :]
    slope = np.diff(added)
    change = np.abs(np.diff(slope))
    # a jump in d would be as large as the surfaces are apart, one in its slope as large as that over the band
    apart = np.abs(added).max()
    assert apart > 0.02
    assert np.abs(slope).max() < 3 * apart / BAND
    assert change.max() < 12 * apart / BAND**2


@pytest.mark.parametrize("kind", CANVASES)
def test_the_canvas_holds_what_the_surface_shows(
    kind: str, rig: tuple[Field, tuple[View, ...], Continuation]
) -> None:
    field, views, surface = rig
    projection = None if kind == "reference" else round_projection(kind, views[0].K, np.eye(3))
    warp = build_warp(field, views, projection, continuation=surface)
    edge = np.linspace(20, SIZE[1] - 20, 9)
    rays = surface.outline(np.stack([np.full(9, SIZE[0] - 2.0), edge], axis=-1))
    shown = rays @ surface.K.T
    places = shown[:, :2] / shown[:, 2:]
    at = warp.canvas.of_reference(places)
    assert (at >= 0).all() and (at <= np.array([warp.canvas.width, warp.canvas.height]) - 1).all()
