"""Figures of a rig: how well its cameras explain what its pictures show, and how they hang together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from ..cameras.camera import Camera
from ..cameras.edge import Edge
from ..cameras.lens import distort
from ..cameras.projective import project
from ..cameras.rig import Rig, RigEdge
from ..panorama.warp import Warp
from ..raster.arrays import Array
from ..raster.picture_map import BoxedMap, CanvasMap, PictureMap
from ..raster.resizing import resized_points
from ..system.threads import ask
from .metrics import shown_at
from .options import RIG


def residuals(rig: Rig) -> Array:
    """px (O,) between where the bundle's cameras see their points and where these are."""
    seen = rig.observations
    out = np.full(len(seen.point), np.nan)
    for number, view in enumerate(rig.views):
        own = np.flatnonzero(seen.picture == number)
        points = seen.point[own]
        q = rig.rays[points] @ view.R.T + rig.inverse_ranges[points, None] * view.t
        with np.errstate(divide="ignore", invalid="ignore"):
            found = distort(project(q @ view.K.T), view.camera)
        out[own] = np.linalg.norm(found - seen.pixels[own], axis=1)
    return out


def scale_kind(rig: Rig) -> str:
    """How the lengths of the baselines are known against each other: "one place" if there are none, "measured" if
    points that three pictures see tie all pictures together, "continuity" if some are only by continuity of depth, and
    "none" if some are not at all."""
    if not rig.t.any():
        return "one place"
    for kinds, word in ((("measured",), "measured"), (("measured", "continuity"), "continuity")):
        tied = [(edge.i, edge.j) for edge in rig.edges if edge.baseline in kinds] + _stations(rig)
        if _parts(tied, len(rig)) == 1:
            return word
    return "none"


def focal_spread(rig: Rig) -> float:
    """By which share the guesses of the focal length that explain the pictures almost alike differ at most."""
    focals = [guess.focal for guess in rig.guesses]
    return max(focals) / min(focals) - 1 if focals else 0.0


def weak_links(rig: Rig) -> list[RigEdge]:
    """Edges with few matches, without which the rig would fall apart or hang by still fewer."""
    if not rig.edges:
        return []
    # int32 is what SciPy's graphs take
    i, j = np.array([(edge.i, edge.j) for edge in rig.edges], np.int32).T
    lengths = [1 / max(edge.inliers, 1) for edge in rig.edges]
    # the tree of the strongest edges holds the weakest ones that cannot be done without
    tree = minimum_spanning_tree(coo_array((lengths, (i, j)), (len(rig), len(rig))).tocsr())
    kept = set(zip(*(part.tolist() for part in tree.nonzero()), strict=True))
    return [edge for edge in rig.edges if edge.inliers < RIG.weak_inliers and (edge.i, edge.j) in kept]


def map_errors(warp: Warp, edges: Sequence[Edge], cameras: Sequence[Camera]) -> Array:
    """px (M,) by which the maps miss matches: of each pair, a match's point of the first picture is looked up where
    the canvas shows it, and compared with its point of the second one; an even sample of each pair. cameras: of the
    pictures that the edges lie in, of which the maps may know smaller copies."""
    found = []
    for edge in edges:
        ask()
        inliers = edge.matches.subset(edge.two_view.inliers).thinned(RIG.matches_looked_up)
        if len(inliers):
            (first, corner), (second, other) = (_known_part(warp.maps[number]) for number in (edge.i, edge.j))
            x, y = (
                points if camera.size == one.size else resized_points(points, camera.size, one.size)
                for points, camera, one in zip((inliers.x, inliers.y), edge.pair(cameras), (first, second), strict=True)
            )
            at = shown_at(first, x) + corner - other
            found.append(np.linalg.norm(second.between(at) - y, axis=1))
    errors = np.concatenate([np.zeros(0), *found])
    finite: Array = errors[np.isfinite(errors)]
    return finite


def shares(labels: NDArray[np.int16] | None, maps: Sequence[CanvasMap], shown: int) -> list[float]:
    """The share of a panorama of `shown` px that comes from each picture; without labels, that shows it."""
    if labels is None:
        return [float(one.inside().sum() / max(1, shown)) for one in maps]
    counts = np.bincount(labels[labels >= 0].ravel(), minlength=len(maps))
    return [float(count / max(1, counts.sum())) for count in counts]


def _known_part(one: CanvasMap) -> tuple[PictureMap, Array]:
    """A map where it is known, and the canvas px (2,) of its first pixel."""
    if isinstance(one, BoxedMap):
        known = one.known()
        return known.inner, np.array(known.corner, np.float64)
    return one.arrays(), np.zeros(2)


def _stations(rig: Rig) -> list[tuple[int, int]]:
    return [(station[0], other) for station in rig.stations for other in station[1:]]


def _parts(tied: Sequence[tuple[int, int]], count: int) -> int:
    """In how many parts a graph falls."""
    i, j = np.array(tied, np.int32).reshape(-1, 2).T
    return int(connected_components(coo_array((np.ones(len(i)), (i, j)), (count, count)), directed=False)[0])
