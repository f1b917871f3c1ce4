"""Dense refinement: every pixel of the overlap found along its epipolar line, where the pictures tell.

The sparse field is right at its matches and smooth between them. Here each pixel is sought along its line around the
field (`matching`), edges of the reference guide what is filled and smoothed (`edge_aware_smoothing`), and both
pictures' gray levels settle the last fraction of a pixel (`polish`). Where they say nothing the field stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..field.refined_depth import RefinedDepth
from ..field.slack import SlackField
from ..field.strict import StrictField
from ..pictures.picture import Picture
from ..raster.arrays import Box, Plane
from ..raster.sampling import REMAP_LIMIT, fetch
from ..system.threads import in_order
from .edge_aware_smoothing import Smoother, cut_edges, edge_weights, strengthen
from .epipolar_lines import EpipolarLines, SparseMap
from .matching import View, search, search_base
from .moved_depth import MOST_FADE, build_refinement
from .polish import likeness, polish
from .unfolding import unfolded

# Pixels of the overlap that are searched and polished at most: beyond, both pictures are shrunk.
SEARCHED, POLISHED = 1.5e6, 3e6
# Search range in px of what is searched: at least, at most.
LEAST_REACH, MOST_REACH = 24.0, 96.0
# Gray levels across an edge; strength of the first smoothing; what the field, or a guess, counts beside a found pixel.
EDGE, FIRST_SMOOTHNESS, FIELD_SHARE = 4.0, 5.0, 1e-2
# px between neighbours that are a depth edge
JUMP = 0.3
# Squared gradient along the line (gray levels per px) of half a texture; how much more neighbours without any hold
# together, and how little they count, unless both pictures look alike there: noise does not, a soft surface does.
TEXTURE, TIE, PLAIN_DOUBT = 1.0, 15.0, 0.99
# Nodes, a side, that say where the overlap is; overlaps with fewer pixels a side are left alone.
LOOK, LEAST_SIDE = 64, 32


@dataclass(frozen=True)
class Dense:
    """What became of dense refinement: the relief, or None and why not.

    reach_px: how far along the lines was sought; found: share of the overlap where both pictures agreed on a place;
    moved_px, across_px: RMS of the moves along the lines and across them.
    """

    relief: RefinedDepth | None
    why: str
    reach_px: float = 0.0
    found: float = 0.0
    moved_px: float = 0.0
    across_px: float = 0.0


def refine(
    field: StrictField | SlackField, two_view: TwoView, matches: Matches, pictures: tuple[Picture, Picture],
    cameras: tuple[Camera, Camera],
) -> Dense:  # fmt: skip
    """Refines a strict or slack field of a pair.

    matches: the inliers that the field was fitted to, ideal px. A strict field keeps to its lines; a slack one may
    leave them a little further than matches could tell.
    """
    if not two_view.e_prime.any() or not np.isfinite(two_view.F).all():
        return Dense(None, f"a {two_view.model} without a baseline has no epipolar lines to search along")
    slack = isinstance(field, SlackField)
    side = max(cameras[0].size)
    margin = int(MOST_FADE * side) + 16
    if max(side, *cameras[1].size) + 2 * margin > REMAP_LIMIT:
        return Dense(None, f"a picture with a side of {max(side, *cameras[1].size)} px is too long to be searched")
    every = max(1, int(np.sqrt(np.prod(cameras[0].size) / POLISHED)))
    sparse = SparseMap.over_reference(field, two_view, *cameras, margin, every)
    box = _overlap(sparse, cameras[1].size)
    if box is None:
        return Dense(None, "the overlap is too small")
    step, fine = (max(1.0, float(np.sqrt(box[2] * box[3] / most))) for most in (SEARCHED, POLISHED))
    base, reach = search_base(sparse, matches.subset(field.fit.inliers_used), field.plane, MOST_REACH * step)
    reach = float(np.clip(reach, LEAST_REACH * step, MOST_REACH * step))
    lines = EpipolarLines.over(base, box, fine)
    field_at = (lines.at(sparse) - lines.inverse_depth) / lines.depth_per_px
    coarse_views = _views(pictures, step)
    views = coarse_views if fine == step else _views(pictures, fine)
    along, found = search(lines, base, coarse_views[0], coarse_views[1], step, reach)
    along = np.where(found > 0, along, field_at)
    alike = found * np.square(np.maximum(likeness(lines, views[0], views[1], along), 0))
    plain = _plain(lines, sparse, views[0]) * (1 - alike)
    weights = edge_weights(_guide(pictures[0].view, lines), EDGE)
    weights = strengthen(cut_edges(weights, along, found > 0, JUMP), plain, TIE)
    share = np.maximum(found * (1 - np.float32(PLAIN_DOUBT) * plain), np.float32(FIELD_SHARE))
    along = Smoother.of(weights, FIRST_SMOOTHNESS).smoothed(along, share)
    polished = polish(lines, views[0], views[1], along, np.maximum(found, np.float32(FIELD_SHARE)), weights, slack)
    confidence = np.clip(polished.likeness, 0, 1) * cv2.blur(found, (9, 9))
    there = _there(lines, polished.along, polished.across, pictures)
    if not there.any():
        return Dense(None, "the overlap is too small")
    along = unfolded(lines, two_view, cameras, polished.along, polished.across) - field_at
    relief = build_refinement(lines, base, along, polished.across, confidence, there)
    moved, across = (float(np.sqrt(np.square(v[there]).mean())) for v in (along, polished.across))
    return Dense(relief, "", reach, float((found[there] > 0).mean()), moved, across)


def _overlap(sparse: SparseMap, target_size: tuple[int, int]) -> Box | None:
    """The part of the reference (left, top, width, height) that the field shows in the target, with a little around
    it."""
    width, height = sparse.camera.size
    lines = EpipolarLines.over(sparse, (0, 0, width, height), max(1.0, max(width, height) / LOOK))
    x, y = lines.target(np.zeros(lines.shape, np.float32))
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= target_size[0] - 1) & (y <= target_size[1] - 1)
    if not inside.any():
        return None
    cell = np.array([width / lines.shape[1], height / lines.shape[0]])
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    low = np.maximum(np.floor(np.array([columns[0] - 1, rows[0] - 1]) * cell), 0).astype(int)
    high = np.minimum(np.ceil(np.array([columns[-1] + 2, rows[-1] + 2]) * cell), [width, height]).astype(int)
    across, down = (high - low).tolist()
    return (int(low[0]), int(low[1]), across, down) if min(across, down) >= LEAST_SIDE else None


def _views(pictures: tuple[Picture, Picture], step: float) -> tuple[View, View]:
    """Both pictures with `step` px to each of their own."""
    reference, target = in_order(lambda picture: View.of(picture.view, picture.alpha, step), pictures)
    return reference, target


def _guide(view: NDArray[np.uint8], lines: EpipolarLines) -> NDArray[np.float32]:
    """The reference's colours at the nodes, a little smoothed: noise is no edge."""
    left, top, width, height = lines.box
    part = view[top : top + height, left : left + width]
    rows, columns = lines.shape
    if (rows, columns) != part.shape[:2]:
        part = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(part, (0, 0), 1.0).astype(np.float32)


def _plain(lines: EpipolarLines, sparse: SparseMap, reference: View) -> Plane:
    """How little (h, w) 0..1 the reference shows around the nodes that a move along their lines would change."""
    epipole = np.linalg.svd(sparse.two_view.F)[2][2]
    gray = cv2.GaussianBlur(reference.gray, (0, 0), 1.0)
    slope, length = np.zeros((2, *lines.shape), np.float32)
    for k in (0, 1):
        away = (lines.ideal[..., k] * epipole[2] - epipole[k]).astype(np.float32)
        gradient = cv2.Scharr(gray, cv2.CV_32F, 1 - k, k, scale=1 / 32)
        slope += reference.at_nodes(gradient, lines)[0] * away
        away *= away
        length += away
    slope *= slope
    slope /= np.maximum(length, np.float32(1e-24))
    return TEXTURE / (TEXTURE + cv2.blur(slope, (7, 7)))


def _there(lines: EpipolarLines, along: Plane, across: Plane, pictures: tuple[Picture, Picture]) -> NDArray[np.bool_]:
    """Where the nodes show both pictures."""
    height, width = pictures[1].view.shape[:2]
    x, y = lines.target(along, across)
    with np.errstate(invalid="ignore"):
        there = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    if pictures[1].alpha is not None:
        there &= fetch(pictures[1].alpha[..., None], x, y, cv2.INTER_LINEAR)[..., 0] > 0
    if pictures[0].alpha is not None:
        left, top, across_px, down = lines.box
        part = (pictures[0].alpha[top : top + down, left : left + across_px] > 0).astype(np.uint8)
        there &= cv2.resize(part, lines.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    return there
