"""The geometry of pictures after these were resized: found on the full ones, it serves their previews."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..raster.arrays import Array
from ..raster.resizing import resized_points, size_change
from .camera import Camera
from .edge import Edge
from .matches import Matches
from .rig import Rig

Sizes = Sequence[tuple[int, int]]


def resized_rig(rig: Rig, sizes: Sizes) -> Rig:
    """A rig with its pictures resized to (W, H) px; its places, points and depths stay.

    Parameters
    ----------
    rig : Rig
    sizes : sequence of (int, int)
        In the order of its pictures.

    Returns
    -------
    Rig
    """
    before, seen = np.array([camera.size for camera in rig.cameras]), rig.observations
    share = _share(rig.cameras, sizes)
    pixels = resized_points(seen.pixels, before[seen.picture], np.array(sizes)[seen.picture])
    return replace(
        rig, cameras=tuple(camera.resized(size) for camera, size in zip(rig.cameras, sizes, strict=True)),
        observations=replace(seen, pixels=pixels), noise_px=share * rig.noise_px,
        edges=tuple(
            replace(edge, noise_px=share * edge.noise_px, parallax_px=share * edge.parallax_px) for edge in rig.edges
        ),
        guesses=tuple(replace(guess, focal=share * guess.focal) for guess in rig.guesses),
    )  # fmt: skip


def resized_edge(edge: Edge, cameras: Sequence[Camera], sizes: Sizes) -> Edge:
    """Two pictures that show the same, resized.

    Parameters
    ----------
    edge : Edge
    cameras : sequence of Camera
        Of all pictures, as they are.
    sizes : sequence of (int, int)
        (W, H) px that they become.

    Returns
    -------
    Edge
    """
    before = tuple(camera.size for camera in edge.pair(cameras))
    after, share = edge.pair(sizes), _share(edge.pair(cameras), edge.pair(sizes))
    first, second = (_matrix(*both) for both in zip(before, after, strict=True))
    back, view = np.linalg.inv(first), edge.two_view

    def resized(matches: Matches) -> Matches:
        x, y = (
            resized_points(points, *both)
            for points, both in zip((matches.x, matches.y), zip(before, after, strict=True), strict=True)
        )
        return replace(matches, x=x, y=y, scale=max(1.0, share * matches.scale))

    two_view = replace(
        view, K=first @ view.K, K_prime=second @ view.K_prime, F=np.linalg.inv(second).T @ view.F @ back,
        H_inf=second @ view.H_inf @ back, e_prime=second @ view.e_prime, sigma=share * view.sigma,
        h_inf_spread=share * view.h_inf_spread,
    )  # fmt: skip
    return replace(edge, matches=resized(edge.matches), ideal=resized(edge.ideal), two_view=two_view)


def _share(cameras: Sequence[Camera], sizes: Sizes) -> float:
    """By which lengths in px change, in the middle of all pictures."""
    return float(np.median([max(size) / max(camera.size) for camera, size in zip(cameras, sizes, strict=True)]))


def _matrix(size: tuple[int, int], new_size: tuple[int, int]) -> Array:
    """The matrix (3, 3) from px of a picture to px of the same at a new size."""
    factor, shift = size_change(size, new_size)
    matrix = np.diag([*factor, 1.0])
    matrix[:2, 2] = shift
    return matrix
