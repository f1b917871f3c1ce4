"""Doubts what was found near the border of the overlap, and where there is no texture.

Near the border a window sees only half of what it needs, what one picture shows may lie beyond the other's border, and
whatever is wrong is carried on beyond the overlap. What has no texture gets its depth from what borders it, a sky that
of the leaves in front of it. So patches that neither the pictures' likeness nor the smooth field bears out get what
surer nodes say of the same surface, or the field where there are none, unless the pictures differ more then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..field.folding import jacobian
from ..raster.arrays import Plane, without_specks
from ..raster.distance import distance_to_border
from .edge_aware_smoothing import Smoother, edge_weights
from .epipolar_lines import EpipolarLines
from .matching import ComparedPicture
from .options import REFINE
from .rim_options import RIM


@dataclass(frozen=True)
class Found:
    """What was found along the lines.

    along, across (h, w): moves along the lines and across them, px; field (h, w): moves along them that the smooth
    field asks for; confidence (h, w), 0 to 1; plain (h, w): lack of texture, 0 to 1.
    """

    along: Plane
    across: Plane
    field: Plane
    confidence: Plane
    plain: Plane


def borne_out(
    lines: EpipolarLines, found: Found, overlap: NDArray[np.bool_], guide: NDArray[np.float32],
    views: tuple[ComparedPicture, ComparedPicture],
) -> Plane:  # fmt: skip
    """The moves along the lines (h, w) px, without those that nothing bears out near the overlap's border or without
    texture.

    overlap (h, w): mask of what both pictures show, by these moves and by the field's; guide (h, w, C): colours of the
    reference; views: reference and target.
    """
    moves = found.along - found.field
    # confidence is an average over a window, and reaches over the rim of what it is about
    confidence = cv2.erode(found.confidence, np.ones((RIM.confidence_erosion,) * 2, np.uint8))
    rows, columns = (np.ptp(np.flatnonzero(overlap.any(axis=axis))) + 1 if overlap.any() else 1 for axis in (1, 0))
    width = RIM.width * float(min(rows, columns))
    rim = _near_rim(moves, confidence, overlap, width)
    patches = _numbered(rim)
    untextured = _numbered(_untextured(moves, found.plain, overlap & (patches == 0)))
    inside = 1 + int(patches.max())
    patches += np.where(untextured > 0, untextured + np.int32(inside - 1), np.int32(0))
    if not patches.any():
        return found.along
    sure = np.clip((confidence - RIM.ignored_confidence) / (RIM.trusted_confidence - RIM.ignored_confidence), 0, 1)
    safer = found.field + _from_surface(moves, overlap * (patches == 0) * sure, guide)
    better = _better(patches, inside, *(_looks(lines, views, along, found.across) for along in (found.along, safer)))
    share = cv2.blur(better[patches].astype(np.float32), (RIM.softness,) * 2)
    result: Plane = found.along + share * (safer - found.along)
    return result


def _better(patches: NDArray[np.int32], inside: int, before: _Looks, after: _Looks) -> NDArray[np.bool_]:
    """Which patches (n,) look no worse after: the map folds less there, or no more, and the pictures differ no more, or
    hardly where it folded. Patches that are hardly shown after only seemed to be part of the overlap. From number
    `inside` on they have to differ much less: a bare wall looks the same at any depth."""
    both = before.shown & after.shown
    levels, folds = (
        [np.bincount(patches[at], values[at], patches.max() + 1) for values in pair]
        for at, pair in ((both, (before.difference, after.difference)), (patches > 0, (before.folded, after.folded)))
    )
    size = np.maximum(np.bincount(patches.ravel()), 1)
    alike = levels[1] <= (1 + RIM.fold_tolerance * folds[0] / size) * levels[0]
    hardly_shown = np.bincount(patches[both], minlength=len(size)) < RIM.shown_share * size
    better: NDArray[np.bool_] = (folds[1] <= folds[0]) & (alike | hardly_shown & (folds[1] < folds[0]))
    better[inside:] &= levels[1][inside:] < RIM.plain_difference * levels[0][inside:]
    better[0] = False
    return better


def _near_rim(
    moves: Plane, confidence: Plane, overlap: NDArray[np.bool_], width: float
) -> list[NDArray[np.bool_]]:
    """Masks (h, w), each of one kind of moves: alike and far from the field's where confidence (h, w) is low, as far as
    they begin near the border of the overlap (h, w). moves (h, w): px; width: how many nodes from it are doubted."""
    distance = distance_to_border(overlap) / np.float32(width)
    doubtful = (confidence < RIM.trusted_confidence) & (np.abs(moves) > RIM.agreeing_px) & (distance < 1)
    begins = _touching(doubtful, distance < RIM.beginning)
    kinds = (moves > 0) + 2 * (np.abs(moves) > RIM.large_px)
    return [begins & (kinds == kind) for kind in range(4)]


def _untextured(moves: Plane, plain: Plane, where: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """Masks (h, w) of the nodes, where asked, that lack texture (h, w) and are nearer than the field by far, and of
    those that are farther; moves (h, w): px from it."""
    far = where & (plain > RIM.plain) & (np.abs(moves) > RIM.plain_px)
    return [without_specks(far & (side * moves > 0)) for side in (1, -1)]


def _numbered(masks: Sequence[NDArray[np.bool_]]) -> NDArray[np.int32]:
    """Numbers (h, w), from 1, of the connected parts of masks (h, w) that do not overlap; 0 elsewhere."""
    patches, count = np.zeros(masks[0].shape, np.int32), 0
    for mask in masks:
        more, numbers = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
        patches += numbers + np.where(numbers > 0, np.int32(count), np.int32(0))
        count += more - 1
    return patches


def _touching(mask: NDArray[np.bool_], places: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The connected parts of a mask (h, w) that any of the places (h, w) belongs to."""
    count, numbers = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    touching = np.zeros(count, bool)
    touching[numbers[places]] = True
    touching[0] = False
    parts: NDArray[np.bool_] = touching[numbers]
    return parts


def _from_surface(moves: Plane, known: Plane, guide: NDArray[np.float32]) -> Plane:
    """Moves (h, w), as far as known (h, w), carried along surfaces of the guide; 0 where there is nothing to carry."""
    shape = moves.shape[::-1]
    small = tuple(-(-side // RIM.coarse_step) for side in shape)
    sums, weight, colours = (
        cv2.resize(np.asarray(v, np.float32), small, interpolation=cv2.INTER_AREA)
        for v in (moves * known, known, guide)
    )
    means = sums / np.maximum(weight, np.float32(1e-6))
    smoother = Smoother.of(edge_weights(colours, REFINE.edge_levels), RIM.smoothness)
    result: Plane = cv2.resize(smoother.smoothed(means, weight, floor=RIM.field_confidence), shape)
    return result


@dataclass(frozen=True)
class _Looks:
    """What moves lead to, at each node (h, w): the squared difference of both pictures, gray levels squared; whether
    both show something; whether the map folds."""

    difference: Plane
    shown: NDArray[np.bool_]
    folded: NDArray[np.bool_]


def _looks(lines: EpipolarLines, views: tuple[ComparedPicture, ComparedPicture], along: Plane, across: Plane) -> _Looks:
    """The pictures after moves (h, w) px along the lines and across them."""
    first, shown = views[0].at_nodes(views[0].gray, lines)
    x, y = lines.target(along, across)
    second, also_shown = views[1].sample(views[1].gray, x, y)
    turning = jacobian(x, y)
    with np.errstate(invalid="ignore"):
        folded = turning * np.float32(np.sign(np.nanmedian(turning[:: RIM.usual_every, :: RIM.usual_every]))) <= 0
    return _Looks(np.square(first - second), shown & also_shown, folded)
