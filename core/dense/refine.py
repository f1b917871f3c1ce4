"""Dense refinement: every pixel of the overlap is searched for along its epipolar line.

The sparse field is right at its matches and smooth between them. Here each pixel is matched along its line close to
the field (`matching`), gaps are filled and errors smoothed along the edges of the reference (`edge_aware_smoothing`),
and both pictures' gray levels settle the last fraction of a pixel (`polish`). Where there is no texture the field
stays.
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
from ..raster.options import PARTS
from ..raster.sampling import fetch
from ..system.threads import in_order
from .epipolar_lines import EpipolarLines, SparseMap
from .filling import filled
from .matching import ComparedPicture, search, search_base
from .moved_depth import build_refinement
from .options import REFINE
from .outlines import at_outlines
from .polish import likeness, polish
from .rim import Found, borne_out
from .rim_options import BEYOND
from .unfolding import unfolded


@dataclass(frozen=True)
class Dense:
    """The result of dense refinement.

    Attributes
    ----------
    refined : RefinedDepth or None
        None where nothing was refined.
    why : str
        Why not, in plain words; empty where it was.
    reach_px : float
        Largest move along the epipolar lines that was searched, px of the pictures as searched.
    found : float
        Share of the overlap that was matched, 0 to 1.
    moved_px, across_px : float
        RMS of the moves along the lines and across them, px.
    """

    refined: RefinedDepth | None
    why: str
    reach_px: float = 0.0
    found: float = 0.0
    moved_px: float = 0.0
    across_px: float = 0.0


def refine(
    field: StrictField | SlackField, two_view: TwoView, matches: Matches, pictures: tuple[Picture, Picture],
    cameras: tuple[Camera, Camera],
) -> Dense:  # fmt: skip
    """Refines a strict or slack field of a pair of pictures.

    Parameters
    ----------
    field : StrictField or SlackField
        A strict field stays on its epipolar lines; a slack one may leave them, as it did before.
    two_view : TwoView
    matches : Matches
        The matches that the field was given, ideal px.
    pictures : (Picture, Picture)
        Reference and target.
    cameras : (Camera, Camera)
        Of the same, with their lenses.

    Returns
    -------
    Dense
        Without refinement where there is no baseline, no overlap to speak of, or a picture is too large.
    """
    if not two_view.e_prime.any() or not np.isfinite(two_view.F).all():
        return Dense(None, f"a {two_view.model} without a baseline has no epipolar lines to search along")
    slack = isinstance(field, SlackField)
    side = max(cameras[0].size)
    margin = int(BEYOND.max_fade * side) + 16
    if max(side, *cameras[1].size) + 2 * margin > PARTS.max_remap_side:
        return Dense(None, f"a picture with a side of {max(side, *cameras[1].size)} px is too long to be searched")
    every = max(1, int(np.sqrt(np.prod(cameras[0].size) / REFINE.max_refined_px)))
    sparse = SparseMap.over_reference(field, two_view, *cameras, margin, every)
    box = _overlap(sparse, cameras[1].size)
    if box is None:
        return Dense(None, "the overlap is too small")
    limits = REFINE.max_searched_px, REFINE.max_refined_px
    step, fine = (max(1.0, float(np.sqrt(box[2] * box[3] / most))) for most in limits)
    min_reach, max_reach = REFINE.min_reach_px * step, REFINE.max_reach_px * step
    base, reach = search_base(sparse, matches.subset(field.fit.inliers_used), field.plane, max_reach)
    reach = float(np.clip(reach, min_reach, max_reach))
    lines = EpipolarLines.over(base, box, fine)
    field_at = (lines.at(sparse) - lines.inverse_depth) / lines.depth_per_px
    coarse_views = _views(pictures, step)
    views = coarse_views if fine == step else _views(pictures, fine)
    along, found = search(lines, base, coarse_views[0], coarse_views[1], step, reach)
    along = np.where(found > 0, along, field_at)
    # smooth surfaces that look alike in both pictures are matched well without texture, noise is not
    similar = found * np.square(np.maximum(likeness(lines, views[0], views[1], along), 0))
    plain = _plain(lines, sparse, views[0]) * (1 - similar)
    guide = _guide(pictures[0].view, lines)
    whole = filled(guide, along, found, plain)
    polished = polish(lines, views[0], views[1], whole.along, whole.known, whole.weights, slack)
    along = at_outlines(lines, polished.along, polished.across, whole.known, whole.edges, views)
    confidence = np.clip(likeness(lines, *views, along, polished.across), 0, 1)
    confidence *= cv2.blur(found, (REFINE.confidence_nodes,) * 2)
    overlap = _in_both(lines, along, polished.across, pictures)
    if not overlap.any():
        return Dense(None, "the overlap is too small")
    both = overlap & _in_both(lines, field_at, np.zeros_like(field_at), pictures)
    along = borne_out(lines, Found(along, polished.across, field_at, confidence, plain), both, guide, views)
    overlap = _in_both(lines, along, polished.across, pictures)
    along = unfolded(lines, two_view, cameras[1].size, along, polished.across) - field_at
    refinement = build_refinement(lines, base, along, polished.across, confidence, overlap)
    along_rms, across_rms = (float(np.sqrt(np.square(v[overlap]).mean())) for v in (along, polished.across))
    return Dense(refinement, "", reach, float((found[overlap] > 0).mean()), along_rms, across_rms)


def _overlap(sparse: SparseMap, target_size: tuple[int, int]) -> Box | None:
    """The box (left, top, width, height) px around the part of the reference that the field maps into the target, with
    one node of margin; None if it is too small."""
    width, height = sparse.camera.size
    lines = EpipolarLines.over(sparse, (0, 0, width, height), max(1.0, max(width, height) / REFINE.overlap_nodes))
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
    return (int(low[0]), int(low[1]), across, down) if min(across, down) >= REFINE.min_overlap_px else None


def _views(pictures: tuple[Picture, Picture], step: float) -> tuple[ComparedPicture, ComparedPicture]:
    """Reference and target, shrunk by `step`."""
    reference, target = in_order(lambda picture: ComparedPicture.of(picture.view, picture.alpha, step), pictures)
    return reference, target


def _guide(view: NDArray[np.uint8], lines: EpipolarLines) -> NDArray[np.float32]:
    """The reference's colours (h, w, C) at the nodes, slightly blurred so that noise makes no edges."""
    left, top, width, height = lines.box
    part = view[top : top + height, left : left + width]
    rows, columns = lines.shape
    if (rows, columns) != part.shape[:2]:
        part = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    result: Plane = cv2.GaussianBlur(part, (0, 0), 1.0).astype(np.float32)
    return result


def _plain(lines: EpipolarLines, sparse: SparseMap, reference: ComparedPicture) -> Plane:
    """Lack of texture (h, w) around the nodes, by the gradient along their epipolar lines: 0 for much, 1 for none."""
    epipole = np.linalg.svd(sparse.two_view.F)[2][2]
    gray = cv2.GaussianBlur(reference.gray, (0, 0), 1.0)
    slope, length = np.zeros((2, *lines.shape), np.float32)
    for k in (0, 1):
        # the line through a node leads to the epipole
        to_epipole = (lines.ideal[..., k] * epipole[2] - epipole[k]).astype(np.float32)
        gradient = cv2.Scharr(gray, cv2.CV_32F, 1 - k, k, scale=1 / 32)
        slope += reference.at_nodes(gradient, lines)[0] * to_epipole
        to_epipole *= to_epipole
        length += to_epipole
    slope *= slope
    slope /= np.maximum(length, np.float32(1e-24))
    result: Plane = REFINE.half_texture / (REFINE.half_texture + cv2.blur(slope, (7, 7)))
    return result


def _in_both(lines: EpipolarLines, along: Plane, across: Plane, pictures: tuple[Picture, Picture]) -> NDArray[np.bool_]:
    """The nodes (h, w) at which, after moves (h, w) px, both pictures show something."""
    height, width = pictures[1].view.shape[:2]
    x, y = lines.target(along, across)
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    if pictures[1].alpha is not None:
        inside &= fetch(pictures[1].alpha[..., None], x, y, cv2.INTER_LINEAR)[..., 0] > 0
    if pictures[0].alpha is not None:
        left, top, across_px, down = lines.box
        part = (pictures[0].alpha[top : top + down, left : left + across_px] > 0).astype(np.uint8)
        inside &= cv2.resize(part, lines.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    return inside
