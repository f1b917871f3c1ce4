"""The file of matches beside a report: read as --matches, it makes the same panorama."""

from __future__ import annotations

import numpy as np

from ..pipeline import StitchResult
from ..pose.match_files import NOT_BY_FIELD, NOT_BY_GEOMETRY, USED, matches_csv


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
    sizes = tuple(camera.size for camera in edge.pair(result.cameras))
    worked = None if sizes == edge.pair(result.full_sizes) else edge.matches
    states = None if edge.matches.given else _states(result)
    return matches_csv(result.full_matches, states, worked)


def _states(result: StitchResult) -> list[str]:
    """What became of each match: used, left out by the geometry, or by the field."""
    of_inliers = np.where(result.used, USED, NOT_BY_FIELD)
    return [str(state) for state in np.where(result.edges[0].two_view.inliers, of_inliers, NOT_BY_GEOMETRY)]
