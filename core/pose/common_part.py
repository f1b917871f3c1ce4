"""What two pictures have in common, roughly: features are sought there only, for elsewhere none can match.

A few features of small copies and one homography say where the frame of each picture lies in the other. It leaves out
how near things are, so wide margins are kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous
from ..pictures.picture import Picture
from ..raster.arrays import Array, Box, common
from . import features
from .options import COMMON_PART


def common_parts(pictures: Sequence[Picture]) -> tuple[Box, Box] | None:
    """The part of each of two pictures that may show what the other shows.

    Parameters
    ----------
    pictures : sequence of two Pictures

    Returns
    -------
    pair of (left, top, width, height), or None
        px; None where it is not sure, or nearly all of both pictures.
    """
    sizes = [picture.view.shape[1::-1] for picture in pictures]
    if min(width * height for width, height in sizes) < COMMON_PART.least_pixels:
        return None
    few = [
        features.detect(picture.view, picture.alpha, COMMON_PART.budget, COMMON_PART.pixels) for picture in pictures
    ]
    matches = features.match(few[0], few[1])
    if len(matches) < COMMON_PART.least_agree:
        return None
    found = [_part(matches, sizes), _part(Matches(matches.y, matches.x, matches.scale), sizes[::-1])]
    first, second = found
    if first is None or second is None:
        return None
    share = sum(part[2] * part[3] for part in (first, second)) / sum(width * height for width, height in sizes)
    return (first, second) if share < COMMON_PART.most_share else None


def _part(matches: Matches, sizes: Sequence[tuple[int, ...]]) -> Box | None:
    """Where a picture may show what the other does; sizes: (W, H) of both. None where that is not sure."""
    (width, height), other = sizes
    within = COMMON_PART.agree_share * max(width, height)
    H, agree = cv2.findHomography(matches.y, matches.x, cv2.RANSAC, within, maxIters=COMMON_PART.rounds)
    agrees: NDArray[np.bool_] = np.zeros(len(matches), bool) if agree is None else agree.ravel() > 0
    if H is None or agrees.sum() < max(COMMON_PART.least_agree, COMMON_PART.least_share * len(matches)):
        return None
    there = homogeneous(_frame(other)) @ H.T
    of_matches = homogeneous(matches.y[agrees]) @ H.T
    if (there[:, 2] * np.sign(of_matches[0, 2]) < COMMON_PART.least_depth * np.abs(of_matches[:, 2]).mean()).any():
        return None  # part of the other picture's frame lies at infinity, or behind it
    shown = np.vstack([there[:, :2] / there[:, 2:], matches.x[agrees]])
    margin = COMMON_PART.margin * max(width, height)
    left, top = np.floor(shown.min(axis=0) - margin).astype(int).tolist()
    right, bottom = np.ceil(shown.max(axis=0) + margin).astype(int).tolist()
    return common((left, top, right - left, bottom - top), (0, 0, width, height))


def _frame(size: tuple[int, ...]) -> Array:
    """The corners (4, 2) of a picture of (W, H) px."""
    width, height = size
    return np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
