"""REW: the global transformation, the spline over it, what is pruned, and how it fades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import homogeneous, infinite_homography, project
from edf_stitch.core.field.options import STRICT
from edf_stitch.core.field.spline import ThinPlateSpline
from edf_stitch.core.field.strict import fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.rivals.homography import direct_linear
from edf_stitch.core.rivals.rew import RewField, fit_rew, global_transformation
from scipy.optimize import minimize_scalar

from ..field.test_strict import SIDE, SIZE, curved, overlap, planar, some_matches

STILL = replace(SIDE, t=np.zeros(3), e_prime=np.zeros(3), F=np.full((3, 3), np.nan), model="rotation")


def rew_of(noise: float = 0.3, two_view=SIDE, depths=curved, count: int = 200) -> tuple[RewField, Matches]:
    matches = Matches(*some_matches(two_view, depths, count, noise)[:2])
    return fit_rew(fit_strict(two_view, matches, SIZE, SIZE), matches), matches


def test_it_reproduces_its_matches() -> None:
    """Without noise the least smoothing is the best, and nothing is left."""
    field, matches = rew_of(noise=0.0)
    assert field.fit.smoothing == STRICT.smoothing_ladder[0] and field.fit.residual_px < 0.05
    kept = matches.subset(field.fit.inliers_used)
    assert len(kept) > 190 and np.abs(field.predict(kept.x) - kept.y).max() < 0.3


def test_both_components_of_the_spline_are_thin_plates() -> None:
    """(Φ + 8πλ) w + M a = g and Mᵀ w = 0 for each (docs/method.md, 4)."""
    field, matches = rew_of()
    spline, kept = field.spline, matches.subset(field.fit.inliers_used)
    assert isinstance(spline, ThinPlateSpline) and spline.weights.shape == (len(kept), 2)
    moments = np.column_stack([spline.centres, np.ones(len(kept))]).T @ spline.weights
    assert np.abs(moments).max() < 1e-8 * np.abs(spline.weights).sum()
    left = kept.y - field.predict(kept.x)
    assert np.abs(left - 8 * np.pi * field.fit.smoothing * spline.weights).max() < 1e-6


@pytest.mark.parametrize("zoom", [1.0, 0.85])
def test_where_the_camera_only_turned_the_global_transformation_is_a_rotation(zoom: float) -> None:
    x, y, _ = some_matches(STILL, planar, 200, 0.2)
    wrong = replace(STILL, K=_zoomed(STILL.K, zoom), K_prime=_zoomed(STILL.K_prime, zoom))
    H = global_transformation(wrong, Matches(x, y))
    assert np.abs(project(homogeneous(x) @ H.T) - target_points(STILL, x, np.zeros(len(x)))).max() < 1.0
    # K' R K⁻¹ of some zoom: what is left after taking the cameras off is a rotation, which no free homography is
    def stretched(zoom: float, H: np.ndarray = H) -> float:
        M = np.linalg.inv(_zoomed(STILL.K_prime, zoom)) @ H @ _zoomed(STILL.K, zoom)
        M = M / np.cbrt(np.linalg.det(M))
        return float(np.abs(M @ M.T - np.eye(3)).max())

    best = minimize_scalar(stretched, bounds=(0.6, 1.6), method="bounded", options={"xatol": 1e-10})
    assert best.fun < 1e-6
    flat = direct_linear(x, y, np.ones(len(x)))
    assert min(stretched(zoom, flat) for zoom in np.linspace(0.6, 1.6, 1001)) > 1e-5


def test_where_the_camera_moved_and_no_rotation_serves_it_is_the_homography() -> None:
    x, y, _ = some_matches(SIDE, planar, 200, 0.2)
    H = global_transformation(SIDE, Matches(x, y))
    flat = direct_linear(x, y, np.ones(200))
    assert np.abs(project(homogeneous(x) @ H.T) - project(homogeneous(x) @ flat.T)).max() < 0.1
    turned = infinite_homography(SIDE.K, SIDE.K_prime, SIDE.R)
    assert np.median(np.linalg.norm(project(homogeneous(x) @ turned.T) - y, axis=1)) > 20


def test_what_lies_beyond_three_sigma_goes_until_none_is_left() -> None:
    matches = Matches(*some_matches(SIDE, curved, 300, 0.3)[:2])
    strict = fit_strict(SIDE, matches, SIZE, SIZE)
    matches.y[::50] += (0.0, 6.0)  # after the strict field has looked at them
    field = fit_rew(strict, matches)
    assert not field.fit.inliers_used[::50].any() and field.fit.inliers_used.sum() > 280
    kept = matches.subset(field.fit.inliers_used)
    left = kept.y - field.predict(kept.x)
    assert (np.abs(left) <= np.maximum(3 * np.sqrt((left**2).mean(axis=0)), 1.0)).all()


def test_it_fades_to_the_global_transformation() -> None:
    field, _ = rew_of()
    grid = Grid((-2600, -2000), 20, 340, 250)
    shift = field.on_grid(grid).shift
    c = target_points(field.two_view, grid.points, np.zeros(grid.points.shape[:2]))
    assert shift is not None and np.isfinite(shift).all()
    inside = overlap(field, grid.points)
    sent = field.predict(grid.points.reshape(-1, 2)).reshape(grid.points.shape)
    assert inside.mean() > 0.01 and np.abs((c + shift) - sent)[inside].max() < 1e-9
    assert np.abs(shift[0]).max() == 0 and np.abs(shift[:, 0]).max() == 0


def _zoomed(K: np.ndarray, factor: float) -> np.ndarray:
    return K * np.array([[factor, factor, 1], [factor, factor, 1], [1, 1, 1]])

