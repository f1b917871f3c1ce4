"""The file of matches beside a report: read as --matches, it makes the same panorama."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..cameras.edge import Edge
from ..cameras.matches import Matches
from ..pose.match_files import NOT_BY_FIELD, NOT_BY_GEOMETRY, USED, matches_csv

if TYPE_CHECKING:
    from ..pipeline import StitchResult


def match_file(result: StitchResult) -> bytes:
    """The content of the matches' file: all matches of a stitch, in their order, pair by pair.

    Parameters
    ----------
    result : StitchResult

    Returns
    -------
    bytes
        A CSV file (see `matches_csv`) in px of the full pictures. For matches that were found, not given, it also says
        what became of each, and of more than two pictures, which two each belongs to.
    """
    edges = result.edges
    resized = [edge for edge in edges if _sizes(edge, result) != edge.pair(result.full_sizes)]
    worked = _joined([edge.matches for edge in edges]) if resized else None
    states = None if edges[0].matches.given else [state for edge in edges for state in _states(edge, result)]
    pictures = None
    if result.rig is not None:
        names = [picture.name for picture in result.pictures]
        pictures = [edge.pair(names) for edge in edges for _ in range(len(edge.matches))]
    return matches_csv(_joined([result.matches_of(edge) for edge in edges]), states, worked, pictures)


def _joined(parts: list[Matches]) -> Matches:
    """Matches of all edges in one list."""
    if len(parts) == 1:
        return parts[0]
    x, y, weight = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "y", "weights")
    )
    return Matches(x, y, parts[0].scale, weight, parts[0].given)


def _sizes(edge: Edge, result: StitchResult) -> tuple[tuple[int, int], ...]:
    """(W, H) px of its two pictures as they were worked on."""
    return tuple(camera.size for camera in edge.pair(result.cameras))


def _states(edge: Edge, result: StitchResult) -> list[str]:
    """What became of each match: used, left out by the geometry, or by the field."""
    of_inliers = np.where(result.used_of(edge), USED, NOT_BY_FIELD)
    return [str(state) for state in np.where(edge.two_view.inliers, of_inliers, NOT_BY_GEOMETRY)]
