"""The file of matches beside a report: read as --matches, it makes the same panorama."""

from __future__ import annotations

import numpy as np

from ..cameras.matches import Matches
from ..pipeline import StitchResult
from ..pose.match_files import NOT_BY_FIELD, NOT_BY_GEOMETRY, USED, matches_csv
from ..raster.resizing import resized_points


def match_file(result: StitchResult) -> bytes:
    """The content of the matches' file: all matches of a stitch, in their order.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    bytes
        A CSV file (see `matches_csv`) in px of the full pictures. For matches that were found, not given, it also says
        what became of each.
    """
    edge = result.edges[0]
    matches, full_sizes = edge.matches, edge.pair(result.full_sizes)
    sizes = tuple(camera.size for camera in edge.pair(result.cameras))
    points = zip((matches.x, matches.y), sizes, full_sizes, strict=True)
    x, y = (resized_points(one, size, full) for one, size, full in points)
    worked = None if sizes == full_sizes else matches
    states = None if matches.given else _states(result)
    return matches_csv(Matches(x, y, matches.scale, matches.weight), states, worked)


def _states(result: StitchResult) -> list[str]:
    """What became of each match: used, left out by the geometry, or by the field."""
    edge = result.edges[0]
    inliers = np.flatnonzero(edge.two_view.inliers)
    used = result.field.fit.inliers_used
    states = np.full(len(edge.matches), NOT_BY_GEOMETRY, object)
    states[inliers] = np.where(used, USED, NOT_BY_FIELD)
    return [str(state) for state in states]
