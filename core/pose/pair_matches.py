"""Matches of two pictures: found in them, or given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.matches import Matches
from ..cameras.sources import role
from ..pictures.picture import Picture
from ..system.errors import NoOverlap, TooFewMatches
from ..system.progress import ReportProgress
from ..system.threads import at_most, in_order
from . import features
from .match_files import read_matches
from .options import ESTIMATION, FEATURES


def found_in(frames: Sequence[Sequence[Picture]], progress: ReportProgress, quick: bool) -> Matches:
    """Features matched in the two pictures of each frame and pooled, in px of the pictures; quick: few of them.

    Raises TooFewMatches where a single frame has hardly any.
    """
    found = []
    most = (FEATURES.preview_budget, FEATURES.preview_pixels) if quick else (FEATURES.budget, FEATURES.pixels)
    for i, pictures in enumerate(frames):
        seen = []
        with at_most(features.at_once(most[1], [picture.view[..., 0].size for picture in pictures])):
            for keypoints in in_order(lambda p: features.detect(p.view, p.alpha, *most), pictures):
                seen.append(keypoints)
                progress("features", (i + 0.9 * len(seen) / len(pictures)) / len(frames))
        found.append(features.match(seen[0], seen[1]))
        if len(frames) == 1 and len(found[0]) < ESTIMATION.min_matches:
            _refuse_scarce(len(found[0]), pictures, [len(one.points) for one in seen])
    x, y = np.concatenate([m.x for m in found]), np.concatenate([m.y for m in found])
    return Matches(x, y, max(m.scale for m in found))


def _refuse_scarce(matches: int, pictures: Sequence[Picture], details: Sequence[int]) -> None:
    """Raises TooFewMatches where there are few because one picture has hardly any points of detail; else it is the
    pair's fault, which `estimate` says."""
    for number, (picture, count) in enumerate(zip(pictures, details, strict=True)):
        if count < FEATURES.scarce_points:
            height, width = picture.view.shape[:2]
            raise TooFewMatches(
                f"only {matches} matching points found, at least {ESTIMATION.min_matches} needed: the "
                f"{role(number)} ({width}×{height} pixels) shows only {count} points of detail; choose a larger or "
                "sharper picture of something with texture, or give matches by hand (--matches)"
            )


def given_of(
    source: Path | NDArray[Any], pictures: Sequence[Picture], names: Sequence[str],
    full_sizes: Sequence[tuple[int, int]], cameras: Sequence[Camera],
) -> Matches:  # fmt: skip
    """Matches of two pictures from a file or array, at the scale of the work, without those in masked parts;
    full_sizes: px of the pictures as they came."""
    worked = cameras[0].size, cameras[1].size
    matches = read_matches(source, full_sizes[0], full_sizes[1], worked, (names[0], names[1]))
    seen = pictures[0].shows(matches.x) & pictures[1].shows(matches.y)
    if not seen.any():
        raise NoOverlap("all the given matches lie in parts of the pictures that are masked or transparent")
    return matches.subset(seen)
