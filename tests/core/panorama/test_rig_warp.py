"""Maps of N pictures: on their epipolar lines, whole on a sphere, the pair's own for two, and each in its box."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import inverse_intrinsics, skew
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.field.sphere_field import SphereField, fit_sphere_field
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.panorama.levelling import turned
from edf_stitch.core.panorama.projection import Projection, round_projection
from edf_stitch.core.panorama.rig_options import RIG_WARP
from edf_stitch.core.panorama.rig_warp import RigSurface, build_rig_map, build_rig_warp, outline_of
from edf_stitch.core.panorama.warp import build_map
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.raster.lazy import whole
from edf_stitch.core.raster.picture_map import BoxedMap
from hypothesis import given, settings
from hypothesis import strategies as st

from ..field.sphere_scenes import SIZE, rig_of, room

AROUND = tuple(range(0, 360, 30))
KINDS = ("equirectangular", "cylindrical", "pannini", "perspective")


def strict(rig: Rig) -> SphereField:
    return fit_sphere_field(rig, with_slack=False)


def projection_of(rig: Rig, kind: str, rotation: np.ndarray, focal: float = 140.0) -> Projection:
    if kind in ("equirectangular", "cylindrical"):
        return round_projection(kind, rig.views[0].K, rotation, focal)
    return Projection(kind, focal, (0.0, 0.0), rotation, rig.views[0].K, 0.5 if kind == "pannini" else 0.0)


@pytest.fixture(scope="module")
def ring() -> Rig:
    """With a picture that is bent by up to two px."""
    rig = rig_of(AROUND, noise_px=0.2)
    seen = rig.observations
    bend = 2 * np.sin(seen.pixels / 60) * (seen.picture == 3)[:, None]
    return replace(rig, observations=replace(seen, pixels=seen.pixels + bend))


@pytest.fixture(scope="module")
def field(ring: Rig) -> SphereField:
    return fit_sphere_field(ring)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 1000), st.sampled_from(KINDS), st.floats(-180, 180), st.floats(-30, 30))
def test_every_pixel_lies_on_its_epipolar_line_in_every_picture(
    seed: int, kind: str, yaw: float, pitch: float
) -> None:
    """For any two pictures, x_jᵀ K_j⁻ᵀ [t_ij]ₓ R_ij K_i⁻¹ x_i = 0, in px of picture j."""
    rig = rig_of((0, 15, -20, 32), seed, points=1500, noise_px=1.0)
    if kind in ("pannini", "perspective"):
        yaw /= 12
    warp = build_rig_warp(RigSurface.of(strict(rig), rig.views), projection_of(rig, kind, turned(yaw, pitch, 3), 90.0))
    maps = [one.arrays() for one in warp.maps]
    shared = 0
    for i in range(4):
        for j in range(i + 1, 4):
            both = maps[i].inside() & maps[j].inside()
            shared += int(both.sum())
            x, y = (np.column_stack([m.x[both], m.y[both], np.ones(both.sum())]) for m in (maps[i], maps[j]))
            R = rig.R[j] @ rig.R[i].T
            to_ray = inverse_intrinsics(rig.views[i].K), inverse_intrinsics(rig.views[j].K)
            F = to_ray[1].T @ skew(rig.t[j] - R @ rig.t[i]) @ R @ to_ray[0]
            line = x @ F.T
            off = np.abs((y * line).sum(axis=1)) / np.maximum(np.hypot(line[:, 0], line[:, 1]), 1e-12)
            # maps are float32: a 2¹⁵th of a px; close to the epipole the line turns with it
            steady = np.hypot(line[:, 0], line[:, 1]) > 0.02 * np.hypot(F[:2, :2], 0).max() * 320
            assert off[steady].max(initial=0) < 2e-3
    assert shared > 1000


def test_what_is_mapped_is_the_equation(ring: Rig, field: SphereField) -> None:
    """x_j ~ K_j (R_j r + d t_j), with the depth that the warp tells, and slack on top."""
    projection = projection_of(ring, "equirectangular", turned(20, 5, 0))
    warp = build_rig_warp(RigSurface.of(strict(ring), ring.views), projection)
    canvas = warp.canvas
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    for view, one in zip(ring.views, warp.maps, strict=True):
        q = (rays @ view.R.T + whole(warp.depth)[..., None] * view.t) @ view.K.T
        ahead = q[..., 2] > 0
        there = one.arrays()
        shown = there.inside()
        assert shown.sum() > 5000
        assert ahead[shown].all()
        assert there.x[shown] == pytest.approx((q[..., 0] / q[..., 2])[shown], abs=2e-3)
        assert there.y[shown] == pytest.approx((q[..., 1] / q[..., 2])[shown], abs=2e-3)
    bent = build_rig_map(RigSurface.of(field, ring.views), canvas)
    places = bent.maps[3].arrays()
    slack = field.slack(3, rays)
    assert slack is not None
    without = RigSurface.of(replace(field, slacks=(None,) * len(ring)), ring.views)
    straight = build_rig_map(without, canvas).maps[3].arrays()
    inner = places.inside() & straight.inside()
    assert (places.x - straight.x)[inner] == pytest.approx(slack[..., 0][inner], abs=0.1)


def test_a_ring_covers_the_whole_sphere_around_and_goes_on_across_its_ends(ring: Rig, field: SphereField) -> None:
    projection = projection_of(ring, "equirectangular", np.eye(3))
    warp = build_rig_warp(RigSurface.of(field, ring.views), projection)
    canvas, sphere = warp.canvas, projection.sphere
    assert sphere is not None
    assert canvas.width == sphere[2]
    assert canvas.height < 0.6 * sphere[3]
    shown = np.zeros((canvas.height, canvas.width), bool)
    for one in warp.maps:
        shown |= one.inside()
    assert shown[canvas.height // 2].all()
    depth = whole(warp.depth)
    assert np.abs(depth[:, 0] - depth[:, -1]).max() < 0.005
    assert depth == pytest.approx(
        field.at(projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))), abs=2e-3
    )
    # the picture that looks back lies on both ends
    behind = warp.maps[6].inside()
    assert behind[:, :5].any()
    assert behind[:, -5:].any()
    x = warp.maps[6].arrays().x[canvas.height // 2]
    assert 0 < x[0] - x[-1] < 6


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_pictures_around_a_pole_cover_it(pitch: float) -> None:
    """Seen from straight below or above, they take the whole width and reach to the last row."""
    rig = rig_of((0, 20, -20), 2)
    projection = projection_of(rig, "equirectangular", turned(0, pitch, 0))
    warp = build_rig_warp(RigSurface.of(strict(rig), rig.views), projection)
    sphere = projection.sphere
    assert sphere is not None
    assert warp.canvas.width == sphere[2]
    shown = np.logical_or.reduce([one.inside() for one in warp.maps])
    last = shown[0] if pitch > 0 else shown[-1]
    assert last.all()


@dataclass(frozen=True)
class OnPlane:
    """The same field for a pair, at the nodes of the reference's plane."""

    sphere: SphereField
    K: np.ndarray

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        points = grid.points if ideal is None else ideal
        rays = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=-1) @ inverse_intrinsics(self.K).T
        length = np.linalg.norm(rays, axis=-1)
        return FieldValues(self.sphere.at(rays / length[..., None]) * length)


@pytest.mark.parametrize("lens", [(), (-0.08,)])
def test_two_pictures_have_the_maps_of_a_pair(lens: tuple[float, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    rig = rig_of((0, 18), 3, noise_px=0.3, lens=lens)
    field = strict(rig)
    canvas = Canvas(460, 300, (40, 30))
    # both on the same nodes
    monkeypatch.setattr("edf_stitch.core.panorama.rig_warp.RIG_WARP", replace(RIG_WARP, nodes=20_000))
    found = build_rig_map(RigSurface.of(field, rig.views), canvas)
    pair = build_map(OnPlane(field, rig.views[0].K), rig.views, canvas)  # type: ignore[arg-type]
    for one, other in zip(found.maps, pair.maps, strict=True):
        there, expected = one.arrays(), other.arrays()
        inside = expected.inside()
        assert np.array_equal(there.inside(), inside)
        assert np.abs(there.x - expected.x)[inside].max() < 1e-3
        assert np.abs(there.y - expected.y)[inside].max() < 1e-3
    assert whole(found.depth) == pytest.approx(whole(pair.depth), abs=1e-6)


def test_the_first_pictures_own_plane_keeps_its_pixels(ring: Rig, field: SphereField) -> None:
    rig = rig_of((0, 20, -20), noise_px=0.5)
    warp = build_rig_warp(RigSurface.of(fit_sphere_field(rig), rig.views))
    left, top = warp.canvas.offset
    own = warp.maps[0].arrays()
    assert own.inside().sum() == SIZE[0] * SIZE[1]
    assert own.x[top, left : left + SIZE[0]] == pytest.approx(np.arange(SIZE[0]))
    assert warp.canvas.width > 1.5 * SIZE[0]


def test_a_map_is_known_where_its_picture_is_shown_and_takes_no_more(ring: Rig, field: SphereField) -> None:
    projection = projection_of(ring, "equirectangular", np.eye(3))
    warp = build_rig_warp(RigSurface.of(field, ring.views), projection)
    whole_maps = build_rig_map(RigSurface.of(field, ring.views), warp.canvas)
    area = warp.canvas.width * warp.canvas.height
    across = 0
    for number, one in enumerate(warp.maps):
        assert isinstance(one, BoxedMap)
        inside, beyond = one.inside(), one.inside()
        across += inside[:, 0].any() and inside[:, -1].any()
        assert len(one.parts) == 1 + (inside[:, 0].any() and inside[:, -1].any())
        assert sum(part.inner.x.size for part in one.parts) < 0.35 * area
        for part in one.parts:
            left, top, width, height = part.box
            beyond[top : top + height, left : left + width] = False
            # nothing is cut off: the rim of a box shows nothing, where it is not the canvas's own
            shown = part.inner.inside()
            if left > 0:
                assert not shown[:, 0].any()
            if top > 0:
                assert not shown[0].any()
            if left + width < warp.canvas.width:
                assert not shown[:, -1].any()
            if top + height < warp.canvas.height:
                assert not shown[-1].any()
        assert not beyond.any()
        assert np.array_equal(inside, one.arrays().inside())
        assert np.array_equal(inside, whole_maps.maps[number].inside())
    assert 0 < across <= 3


def test_a_picture_at_both_ends_of_a_sphere_has_the_map_that_it_has_in_its_middle(
    ring: Rig, field: SphereField
) -> None:
    """The sphere turned by half a turn: the same pixels, half a canvas further on."""
    ahead, behind = (
        build_rig_warp(RigSurface.of(field, ring.views), projection_of(ring, "equirectangular", turned(yaw, 0, 0)))
        for yaw in (0.0, 180.0)
    )
    width = ahead.canvas.width
    for one, other in zip(ahead.maps, behind.maps, strict=True):
        rows = slice(*np.flatnonzero(one.inside().any(axis=1))[[0, -1]])
        shift = rows.start - int(np.flatnonzero(other.inside().any(axis=1))[0])
        turned_back = np.roll(other.arrays().x, width // 2, axis=1)
        there = slice(rows.start - shift, rows.stop - shift)
        both = one.inside()[rows] & np.roll(other.inside(), width // 2, axis=1)[there]
        assert both.sum() > 0.97 * one.inside()[rows].sum()
        assert np.abs(one.arrays().x[rows] - turned_back[there])[both].max() < 0.1


@pytest.mark.parametrize("box", [(0, 0, 30, 20), (100, 10, 200, 60), (-5, -6, 70, 90), (600, 100, 50, 40)])
def test_a_part_of_a_boxed_map_is_that_of_the_whole(
    ring: Rig, field: SphereField, box: tuple[int, int, int, int]
) -> None:
    warp = build_rig_warp(RigSurface.of(field, ring.views), projection_of(ring, "equirectangular", np.eye(3)))
    part = warp.within(box)
    for one, other in zip(part.maps, warp.maps, strict=True):
        expected = other.arrays().within(box)
        found = one.arrays()
        assert found.shape == (box[3], box[2])
        assert np.array_equal(found.x, expected.x, equal_nan=True)
        assert np.array_equal(one.inside(), expected.inside())
        again = one.within((1, 2, box[2] - 3, box[3] - 3)).arrays()
        assert np.array_equal(again.y, expected.within((1, 2, box[2] - 3, box[3] - 3)).y, equal_nan=True)


def test_a_layer_of_a_boxed_map_is_that_of_the_whole_map(ring: Rig, field: SphereField) -> None:
    warp = build_rig_warp(RigSurface.of(field, ring.views), projection_of(ring, "equirectangular", np.eye(3)))
    picture = picture_from_array(np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8))
    for one in (warp.maps[2], warp.maps[6]):  # the latter lies on both ends
        boxed, full = layer_of(picture, one), layer_of(picture, one.arrays())
        assert np.array_equal(boxed.alpha, full.alpha)
        assert np.array_equal(boxed.pixels, full.pixels)


def test_outlines_are_seen_on_the_border(ring: Rig, field: SphereField) -> None:
    for view in ring.views:
        rays = outline_of(field, view)
        q = (rays @ view.R.T + field.at(rays)[:, None] * view.t) @ view.K.T
        places = q[:, :2] / q[:, 2:]
        off = np.minimum(np.abs(places), np.abs(places - np.array(SIZE) + 1)).min(axis=1)
        assert np.median(off) < 1
    assert room(rays).min() > 0
