"""Nodes of a panorama's surface: where they lie, what is known there, and that a file keeps them."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.output.depth.nodes import DepthNodes, depth_nodes

from .finished import CAMERA, HEIGHT, WIDTH, K, finished, plane, rays_of, sphere


def test_they_reach_from_border_to_border_and_hold_what_the_pixels_have() -> None:
    canvas = plane()
    d = 0.1 + 0.001 * canvas.xs + 0.002 * canvas.ys[:, None]
    length = canvas.rays_at(K, canvas.xs, canvas.ys, CAMERA)[1]
    nodes = depth_nodes(finished(canvas, length / d), 1000)
    assert (nodes.x[0], nodes.x[-1], nodes.y[0], nodes.y[-1]) == (-0.5, 199.5, -0.5, 99.5)
    assert nodes.inverse_depth.shape == (len(nodes.y), len(nodes.x)) == nodes.shows.shape
    at = np.ix_(np.clip(np.rint(nodes.y), 0, 99).astype(int), np.clip(np.rint(nodes.x), 0, 199).astype(int))
    assert nodes.inverse_depth == pytest.approx(d[at], rel=1e-5)
    assert 900 < nodes.inverse_depth.size < 1100 and nodes.middles.shape == (len(nodes.y) - 1, len(nodes.x) - 1)


def test_a_whole_sphere_is_closed() -> None:
    ranges = 2.0 + rays_of(sphere()) @ [0.5, 0.2, 0.7]
    d = depth_nodes(finished(sphere(), ranges), 2000).inverse_depth
    assert (d[:, 0] == d[:, -1]).all() and np.ptp(d[0]) == np.ptp(d[-1]) == 0 < np.ptp(d)


def test_what_is_not_known_takes_the_middle_beside_it() -> None:
    ranges = np.full((HEIGHT, WIDTH), 4.0)
    ranges[:, 180:] = np.nan
    nodes = depth_nodes(finished(sphere(), ranges), 2000)
    known = np.isfinite(nodes.inverse_depth)
    assert 0 < known.sum() < known.size and (nodes.inverse_depth[known] == 0.25).all()
    assert (known[:-1, :-1] >= np.isfinite(nodes.middles)).all(), "a cell whose middle is known has all its corners"


def test_a_file_keeps_them() -> None:
    nodes = depth_nodes(finished(sphere(), np.full((HEIGHT, WIDTH), 4.0), np.eye(HEIGHT, WIDTH) > 0), 500)
    again = DepthNodes.from_bytes(nodes.to_bytes())
    for name in ("x", "y", "shows"):
        assert (getattr(again, name) == getattr(nodes, name)).all()
    for name in ("inverse_depth", "middles"):
        assert getattr(again, name) == pytest.approx(getattr(nodes, name), rel=1e-6)
