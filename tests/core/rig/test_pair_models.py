"""Residuals of pairs, their derivatives, and the fit of all pairs with a shared lens."""

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.projective import fundamental_from_pose, sampson_residuals, skew
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.rig.averaging.averaged import Verified
from edf_stitch.core.rig.averaging.matched_rays import SharedLens, matched_rays
from edf_stitch.core.rig.averaging.pair_models import EpipolarModel, Poses, RotationModel
from edf_stitch.core.rig.averaging.pair_refinement import LensPrior, refine_each, refine_together
from edf_stitch.core.rig.averaging.pure_rotations import each_as_rotation
from edf_stitch.core.rig.averaging.turns import degrees_between, rotations
from hypothesis import given, settings
from hypothesis import strategies as st

from .rigs import camera_of


def two_pairs(seed: int, k1: float = 0.0, noise: float = 0.5, still: bool = False, free: bool = True):
    """Three pictures, the last one smaller, and the poses of pairs (0, 1) and (1, 2) as their rays are ordered."""
    rng = np.random.default_rng(seed)
    cameras = [camera_of(600.0), camera_of(600.0), camera_of(300.0, (400, 300))]
    R = rotations(rng.normal(0, 0.15, (3, 3)))
    t = np.zeros((3, 3)) if still else rng.normal(0, 0.5, (3, 3))
    X = rng.uniform([-2, -1.5, 4], [2, 1.5, 9], (120, 3))
    points = []
    for camera, R_k, t_k in zip(cameras, R, t, strict=True):
        seen = X @ R_k.T + t_k
        bent = Camera(camera.K, camera.size, "", 0.0, np.array([k1, 0, 0, 0, 0]))
        px = distort(seen[:, :2] / seen[:, 2:] * camera.focal + camera.K[:2, 2], bent)
        points.append(px + rng.normal(0, noise, px.shape) * camera.focal / 600)
    if not free:
        cameras = [camera_of(camera.focal, camera.size, 0.0) for camera in cameras]
    index = np.column_stack([np.arange(120)] * 2)
    verified = Verified(
        (PictureMatches(0, 1, index), PictureMatches(1, 2, index)), (120, 120), np.zeros(3, int), 1.0, 0
    )
    rays, ends = matched_rays(cameras, points, verified)
    first, second = ends.T
    between = R[second] @ np.swapaxes(R[first], 1, 2)
    along = t[second] - np.einsum("pij,pj->pi", between, t[first])
    if not still:
        along /= np.linalg.norm(along, axis=1, keepdims=True)
    return rays, ends, Poses(between, along), points, cameras


def test_distances_are_sampsons_in_px_of_each_picture():
    rays, ends, poses, points, cameras = two_pairs(0)
    found = EpipolarModel(rays, 1.5).residuals(poses, SharedLens())
    for k, (i, j) in enumerate(ends):
        F = fundamental_from_pose(cameras[i].K, cameras[j].K, poses.R[k], poses.t[k])
        expected = sampson_residuals(F, points[i], points[j])
        np.testing.assert_allclose(found[rays.starts[k] : rays.starts[k + 1]], expected, atol=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.floats(0.8, 1.25), st.floats(-0.15, 0.15))
def test_gradients_are_the_costs_derivatives(seed, factor, k1):
    rays, _, poses, _, _ = two_pairs(seed)
    poses = Poses(rotations(np.full((2, 3), 0.003)) @ poses.R, poses.t)
    lens, h = rays.within_limits(SharedLens(factor, k1)), 1e-6
    k1 = lens.k1
    for model in (EpipolarModel(rays, 1.5), RotationModel(rays, 20.0)):
        H, gradient = model.equations(poses, lens, shared=True)
        numbers = np.zeros_like(gradient)
        for k in range(model.freedom):
            step = np.zeros((2, model.freedom))
            step[:, k] = h
            ahead, behind = (model.costs(model.stepped(poses, sign * step), lens) for sign in (1, -1))
            numbers[:, k] = (ahead - behind) / (2 * h)
        for k, ends in enumerate(
            ((SharedLens(factor * np.exp(h), k1), SharedLens(factor * np.exp(-h), k1)),
             (SharedLens(factor, k1 + h), SharedLens(factor, k1 - h)))
        ):  # fmt: skip
            numbers[:, model.freedom + k] = (model.costs(poses, ends[0]) - model.costs(poses, ends[1])) / (2 * h)
        scale = np.sqrt(np.diagonal(H, axis1=1, axis2=2))
        np.testing.assert_allclose(gradient / scale, numbers / scale, atol=2e-3)


@given(st.floats(-0.2, 0.3), st.floats(0.5, 2.0))
def test_rays_through_a_lens_are_undistorted(k1, factor):
    rays, _, _, _, _ = two_pairs(1)
    lens = rays.within_limits(SharedLens(factor, k1))
    seen = rays.undistorted(lens).a[:, :2]
    bent = seen * (1 + lens.k1 * (seen**2).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(bent, rays.x / factor, atol=1e-4)


@given(st.floats(-0.3, 0.3), st.floats(0.3, 2.0))
def test_no_lens_folds_inside_a_picture(k1, factor):
    rays, _, _, _, _ = two_pairs(1)
    lens = rays.within_limits(SharedLens(factor, k1))
    seen = rays.undistorted(lens).a[:, :2]
    assert (1 + 3 * lens.k1 * (seen**2).sum(axis=1) > 0).all()


def test_a_pair_is_refined_to_its_pose():
    rays, _, poses, _, _ = two_pairs(2, noise=0.0)
    start = Poses(rotations(np.full((2, 3), 0.01)) @ poses.R, poses.t)
    found = refine_each(EpipolarModel(rays, 1.5), start, SharedLens(), 20)
    assert degrees_between(found.R, poses.R).max() < 1e-4


def test_wrong_matches_do_not_bend_a_pair():
    """Cauchy: a sixth of the matches is off by 20 px, all to one side."""
    rays, _, poses, _, _ = two_pairs(4, noise=0.1)
    rays.y[::6, 1] += 20 / 600
    start = Poses(rotations(np.full((2, 3), 0.01)) @ poses.R, poses.t)
    robust, squared = (refine_each(EpipolarModel(rays, width), start, SharedLens(), 30) for width in (1.5, 1e6))
    assert degrees_between(robust.R, poses.R).max() < 0.1
    assert degrees_between(squared.R, poses.R).min() > 0.3


def test_pairs_and_lens_are_refined_together():
    rays, _, poses, _, _ = two_pairs(3, k1=-0.1, noise=0.0)
    start = SharedLens(1.04, 0.0)
    wide = LensPrior(1e3)
    held = refine_together(EpipolarModel(rays, 1.5), poses, start, LensPrior(1e3, (False, False)), 0.01, 50)
    found = refine_together(EpipolarModel(rays, 1.5), poses, start, wide, 0.01, 50)
    assert held.lens == start
    assert found.lens.factor == pytest.approx(1, abs=2e-3) and found.lens.k1 == pytest.approx(-0.1, abs=2e-3)
    assert degrees_between(found.poses.R, poses.R).max() < 0.02 < degrees_between(held.poses.R, poses.R).max()


def test_pairs_follow_the_focal_length_as_told():
    """by_focal and k1_by_focal are how the optimum moves when the focal length is held elsewhere."""
    rays, _, poses, _, _ = two_pairs(4)
    model = EpipolarModel(rays, 1.5)
    best = refine_together(model, poses, SharedLens(), LensPrior(0.05), 0.5, 60)
    step = 0.002
    aside = SharedLens(best.lens.factor * np.exp(step), best.lens.k1)
    there = refine_together(model, best.poses, aside, LensPrior(0.05, (False, True)), 0.5, 60)
    assert there.lens.k1 - best.lens.k1 == pytest.approx(step * best.k1_by_focal, rel=0.1)
    predicted = rotations(best.by_focal[:, :3] * step) @ best.poses.R
    assert degrees_between(there.poses.R, predicted).max() < 0.1 * degrees_between(there.poses.R, best.poses.R).max()


def test_a_given_lens_is_not_touched():
    rays, _, poses, _, _ = two_pairs(5, free=False)
    assert rays.anything_free == (False, False)
    model = EpipolarModel(rays, 1.5)
    np.testing.assert_array_equal(
        model.residuals(poses, SharedLens(1.3, -0.1)), model.residuals(poses, SharedLens())
    )  # fmt: skip


@pytest.mark.parametrize("still", [True, False])
def test_a_rotation_is_told_from_a_pose(still):
    rays, _, poses, _, _ = two_pairs(6, still=still)
    t = poses.t if not still else np.tile([1.0, 0, 0], (2, 1))
    model = EpipolarModel(rays, 1.5)
    refined = refine_each(model, Poses(poses.R, t), SharedLens(), 20)
    squares = model.squares(refined, SharedLens())
    turning = each_as_rotation(rays, poses.R, SharedLens(), squares, 0.5)
    assert (turning.gain > 20).all() if still else (turning.gain < -20).all()
    assert (turning.parallax < 1.5).all() if still else (turning.parallax > 3).all()


def test_an_essential_matrix_is_a_turn_and_a_direction():
    """The parameters of a pose keep |t| = 1 and R a rotation."""
    rays, _, poses, _, _ = two_pairs(7)
    moved = EpipolarModel(rays, 1.5).stepped(poses, np.full((2, 5), 0.1))
    E = skew(moved.t) @ moved.R
    np.testing.assert_allclose(np.linalg.svd(E)[1], [[1, 1, 0]] * 2, atol=1e-12)


def test_no_pairs_of_some_are_none():
    rays, *_ = two_pairs(0)
    assert len(rays.of_pairs([])) == 0 and len(rays.of_pairs([1, 1])) == 2
