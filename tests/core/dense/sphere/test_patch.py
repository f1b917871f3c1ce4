"""Where pictures see the nodes of a patch."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.dense.sphere.patch import Patch, SeenPatch, SweptPicture, sampled
from edf_stitch.core.field.sphere_chart import SphereChart
from edf_stitch.core.field.sphere_field import SphereField, fit_sphere_field
from edf_stitch.core.field.sphere_points import seen_at

from .card_scenes import card_rig, inverse_range, pictures_of

LENS = (-0.12, 0.03)


@pytest.fixture(scope="module", params=[(), LENS], ids=["plain", "bent lens"])
def seen(request: pytest.FixtureRequest) -> tuple[list[SeenPatch], SphereField]:
    rig = card_rig(lens=request.param)
    field = fit_sphere_field(rig, with_slack=False)
    patch = Patch(SphereChart.whole(np.eye(3), 880), 380, 800, (110, 130))
    pictures = pictures_of(rig)
    swept = [SweptPicture.of(k, view, picture, 280.0)
             for k, (view, picture) in enumerate(zip(rig.views, pictures, strict=True))]  # fmt: skip
    return [SeenPatch.of(patch, one, None) for one in swept], field


def rays_of(patch: Patch) -> np.ndarray:
    rows, columns = (np.arange(first, first + side, dtype=float)
                     for first, side in zip((patch.top, patch.left), patch.shape, strict=True))  # fmt: skip
    return patch.chart.rays(rows, columns)


def test_nodes_are_seen_where_the_camera_sees_them(seen: tuple[list[SeenPatch], SphereField]) -> None:
    for one in seen[0]:
        rays = rays_of(one.patch)
        d = inverse_range(rays).astype(np.float32)
        x, y = one.places(d)
        # of a picture without its lens: the picture shows the same colour there as the raw one where the lens puts it
        raw = seen_at(one.picture.view, rays.reshape(-1, 3), d.ravel()).reshape(*d.shape, 2)
        inside = ((raw > 2) & (raw < np.array(one.picture.view.size) - 3)).all(axis=-1)
        if not one.picture.view.camera.distortion.any():
            assert np.abs(np.stack([x, y], -1) - raw)[inside].max() < 0.02
        same = sampled(one.picture.levels, x, y)[..., 3] == 255
        assert same[inside].mean() > 0.999


def test_pictures_agree_where_the_range_is_right(seen: tuple[list[SeenPatch], SphereField]) -> None:
    d = inverse_range(rays_of(seen[0][0].patch)).astype(np.float32)
    first, second = (sampled(one.picture.levels, *one.places(d)).astype(float) for one in seen[0][:2])
    both = (first[..., 3] == 255) & (second[..., 3] == 255)
    assert both.mean() > 0.8
    assert np.median(np.abs(first - second)[both]) < 6
    wrong = sampled(seen[0][1].picture.levels, *seen[0][1].places(d * 1.3)).astype(float)
    assert np.median(np.abs(first - wrong)[both]) > 20


def test_slopes_are_what_a_little_more_inverse_range_moves(seen: tuple[list[SeenPatch], SphereField]) -> None:
    one = seen[0][2]
    d = np.full(one.patch.shape, 0.09, np.float32)
    before, after = np.array(one.places(d - np.float32(0.01))), np.array(one.places(d + np.float32(0.01)))
    assert np.allclose((after - before) / 0.02, one.slopes(d), rtol=0.02, atol=0.5)


def test_smooth_ranges_give_what_all_nodes_give(seen: tuple[list[SeenPatch], SphereField]) -> None:
    one = seen[0][1]
    d = 0.07 + 0.01 * one.patch.coarse_rays[..., 0]
    smooth = one.sampled_at(d, one.picture.levels).astype(int)
    each = sampled(one.picture.levels, *one.places(one.patch.between(d[..., None])[0])).astype(int)
    assert np.abs(smooth - each).mean() < 0.5


def test_a_patch_runs_over_the_ends_of_its_chart() -> None:
    chart = SphereChart.whole(np.eye(3), 40)
    values = np.arange(40 * 80, dtype=np.float32).reshape(40, 80)
    patch = Patch(chart, 0, -3, (5, 9))
    assert np.array_equal(patch.of_chart(values), np.roll(values, 3, axis=1)[:5, :9])
    # beyond a pole there is the pole's row
    assert np.array_equal(patch.of_chart(values, 2)[0, 2:-2], patch.of_chart(values)[0])
