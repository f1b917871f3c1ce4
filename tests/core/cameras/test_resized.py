"""Geometry of resized pictures: what was seen in a px is seen in that px of the smaller picture."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.cameras.projective import distance_to_line, homogeneous, project
from edf_stitch.core.cameras.resized import resized_edge, resized_rig
from edf_stitch.core.measure.rig_figures import residuals
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.raster.resizing import resized_points

from ..rig.known_rigs import known_rig


def test_a_rig_explains_the_smaller_pictures_as_it_does_the_full_ones() -> None:
    rig, _ = known_rig()
    sizes = [(200, 150), (100, 75), (400, 300), (133, 100)]
    small = resized_rig(rig, sizes)
    assert [camera.size for camera in small.cameras] == sizes
    assert np.array_equal(small.rays, rig.rays) and np.array_equal(small.t, rig.t)
    shares = np.array([size[0] / 400 for size in sizes])[rig.observations.picture]
    np.testing.assert_allclose(residuals(small), shares * residuals(rig), rtol=0.02, atol=1e-6)


def test_so_does_the_geometry_of_a_pair(small_result: StitchResult) -> None:
    (edge,), cameras = small_result.edges, small_result.cameras
    sizes = [(120, 90), (80, 60)]
    small = resized_edge(edge, cameras, sizes)
    assert len(small.matches) == len(edge.matches) and np.array_equal(small.two_view.inliers, edge.two_view.inliers)
    np.testing.assert_allclose(
        small.matches.x, resized_points(edge.matches.x, cameras[0].size, sizes[0]), rtol=1e-12
    )
    x, y = small.inliers.x, small.inliers.y
    before = np.median(distance_to_line(edge.two_view.F, edge.inliers.x, edge.inliers.y))
    assert np.median(distance_to_line(small.two_view.F, x, y)) < 0.5 * before
    for d in (0.0, 0.2):
        full = project(homogeneous(edge.inliers.x) @ edge.two_view.H_inf.T + d * edge.two_view.e_prime)
        here = project(homogeneous(x) @ small.two_view.H_inf.T + d * small.two_view.e_prime)
        np.testing.assert_allclose(here, resized_points(full, cameras[1].size, sizes[1]), atol=1e-9)
