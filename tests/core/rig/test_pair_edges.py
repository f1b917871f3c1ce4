"""Pairs of a rig: their geometry is the rig's, and their inliers are its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from edf_stitch.core.cameras.projective import sampson_residuals
from edf_stitch.core.rig.matching import Matched
from edf_stitch.core.rig.pair_edges import edges_of, reordered_edges
from edf_stitch.core.rig.reframing import reordered

from .known_rigs import known_rig


def test_true_matches_lie_on_the_lines_of_every_pair() -> None:
    rig, matched = known_rig()
    edges = edges_of(rig, matched, range(4))
    assert [(edge.i, edge.j) for edge in edges] == [(edge.i, edge.j) for edge in rig.edges]
    for edge in edges:
        assert edge.two_view.inliers.all() and len(edge.matches) > 20
        assert edge.two_view.model == "general"
        np.testing.assert_allclose(sampson_residuals(edge.two_view.F, edge.ideal.x, edge.ideal.y), 0, atol=1e-6)


def test_numbers_are_the_rigs_own_whatever_the_pictures_were_matched_by() -> None:
    rig, matched = known_rig()
    order = [2, 0, 3, 1]
    edges = edges_of(reordered(rig, order), matched, order)
    assert edges
    for edge in edges:
        assert edge.two_view.inliers.all()
        np.testing.assert_allclose(sampson_residuals(edge.two_view.F, edge.ideal.x, edge.ideal.y), 0, atol=1e-6)


def test_in_another_order_they_are_what_they_were() -> None:
    rig, matched = known_rig()
    order = [2, 0, 3, 1]
    turned = reordered(rig, order)
    found, anew = reordered_edges(edges_of(rig, matched, range(4)), turned, order), edges_of(turned, matched, order)
    assert [(one.i, one.j) for one in found] == [(one.i, one.j) for one in anew] and len(found) > 3
    for one, other in zip(found, anew, strict=True):
        np.testing.assert_array_equal(one.matches.x, other.matches.x)
        np.testing.assert_allclose(one.ideal.y, other.ideal.y, atol=1e-9)
        np.testing.assert_allclose(one.two_view.F, other.two_view.F, rtol=1e-9)
        np.testing.assert_array_equal(one.two_view.inliers, other.two_view.inliers)


def test_what_the_bundle_left_out_is_no_inlier() -> None:
    rig, matched = known_rig()
    of_first_pair = np.intersect1d(*(rig.observations.point[rig.observations.picture == j] for j in (0, 1)))
    used = rig.observations.point != of_first_pair[-1]
    rig = replace(rig, observations=replace(rig.observations, used=used))
    swapped = [replace(one, index=one.index.copy()) for one in matched.matches]
    swapped[0].index[:2, 1] = swapped[0].index[1::-1, 1]  # two matches that are wrong
    edge = edges_of(rig, Matched(matched.points, tuple(swapped), 1.0), range(4))[0]
    assert not edge.two_view.inliers[:2].any()
    assert edge.two_view.inliers.sum() == len(edge.matches) - 3


def test_pictures_of_one_station_are_a_rotation() -> None:
    rig, matched = known_rig()
    edge = edges_of(replace(rig, stations=((0, 1),)), matched, range(4))[0]
    assert edge.two_view.model == "rotation"
    assert not edge.two_view.t.any() and not edge.two_view.e_prime.any() and np.isnan(edge.two_view.F).all()
