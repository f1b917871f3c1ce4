"""Matches between several pictures that the user gives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.rig import PictureMatches
from ..pictures.picture import Picture
from ..pose.match_files import read_matches_of_pairs
from .matching import Matched

Size = tuple[int, int]


def given_matches(
    source: str | Path | NDArray[Any], pictures: Sequence[Picture], sizes: Sequence[Size], worked: Sequence[Size]
) -> Matched:
    """Matches from a file that names the pictures (see `read_matches_of_pairs`).

    Parameters
    ----------
    source : str or path
    pictures : sequence of Picture
        As they are worked on: what is transparent in them has no matches.
    sizes, worked : sequence of (int, int)
        (W, H) px of the pictures as they came, and as they are worked on.

    Returns
    -------
    Matched
        Matches that end at one place of a picture share that feature.

    Raises
    ------
    BadRequest, UnreadableImage
        About the file.
    """
    by_pair = read_matches_of_pairs(source, [picture.name for picture in pictures], sizes, worked)
    features: list[dict[tuple[float, float], int]] = [{} for _ in pictures]
    found = []
    for (i, j), matches in by_pair.items():
        shown = pictures[i].shows(matches.x) & pictures[j].shows(matches.y)
        index = [
            [features[side].setdefault(tuple(point), len(features[side])) for point in points[shown].tolist()]
            for side, points in ((i, matches.x), (j, matches.y))
        ]
        found.append(PictureMatches(i, j, np.array(index, np.intp).T))
    points = tuple(np.array(list(one), np.float64).reshape(-1, 2) for one in features)
    scale = max(matches.scale for matches in by_pair.values())
    given = all(matches.given for matches in by_pair.values())
    return Matched(points, tuple(one for one in found if len(one)), scale, given)
