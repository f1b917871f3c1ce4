"""Where along their epipolar lines the pixels of the reference are found in the target: semi-global matching.

Both pictures are resampled so that epipolar lines are rows, the target by the sparse field: what is left is a small
move along the rows. Matching: Hirschmüller, IEEE TPAMI 2008, as OpenCV has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .displacement import inverse_depths
from .epipolar import Array
from .features import Matches
from .lens import distort
from .line_map import Lines, Plane, SparseMap
from .rectify import EpipolarRows
from .threads import in_order

BLOCK, STEP_COST, JUMP_COST, UNIQUE = 3, 8, 48, 2
# Costs (of a pixel at a place) that are held at once, four bytes each; more rows than that are matched band by band,
# each with so many rows beside it.
MOST_COSTS, NEIGHBOURS = 100_000_000, 32
# How much more smoothly is matched at half the size what was not found at full size, and how much that counts.
COARSE_SMOOTHER, COARSE_SHARE = 4, 0.1
# A patch of fewer pixels (share of the rows' side, squared) than this is a speck.
SPECK, SPECK_RANGE = 0.012, 2
# Bends finer than this share of the picture's side are taken out of the field, the first that will do; how far all
# but the furthest matches lie from it (percentile), and how much further is looked.
BENDS = (0.2, 0.1, 0.05, 0.025, 0.0)
FURTHEST, REACH, MORE_PX = 99.5, 1.25, 8.0
# Steps of the tone curve between the pictures.
TONES = 64


@dataclass(frozen=True)
class View:
    """A picture to be matched: levels (h, w, C) uint8, gray (h, w) float32, shown (h, w) float32 0 or 1, None where all
    is; size (W, H) px of the full one."""

    levels: NDArray[np.uint8]
    gray: Plane
    shown: Plane | None
    size: tuple[int, int]

    @staticmethod
    def of(view: NDArray[np.uint8], alpha: Plane | None, step: float) -> View:
        """An 8-bit picture (H, W, C) with `step` px to each of its own."""
        height, width = view.shape[:2]
        gray = (cv2.cvtColor(view, cv2.COLOR_RGB2GRAY) if view.shape[2] == 3 else view[..., 0]).astype(np.float32)
        shown = None if alpha is None else (alpha > 0).astype(np.float32)
        if step > 1:
            small = max(1, round(width / step)), max(1, round(height / step))
            view = cv2.resize(view, small, interpolation=cv2.INTER_AREA).reshape(*small[::-1], -1)
            gray = cv2.resize(gray, small, interpolation=cv2.INTER_AREA)
            if shown is not None:
                shown = (cv2.resize(shown, small, interpolation=cv2.INTER_AREA) > 0.999).astype(np.float32)
        return View(view, gray, shown, (width, height))

    def sample(
        self, picture: NDArray[np.float32], x: NDArray, y: NDArray, interpolation: int = cv2.INTER_LINEAR
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """A picture of the same shape (h, w[, C]) as `gray` at full px (…), and where (…) that lies on what is
        shown."""
        height, width = self.gray.shape
        x = ((x + 0.5) * (width / self.size[0]) - 0.5).astype(np.float32)
        y = ((y + 0.5) * (height / self.size[1]) - 0.5).astype(np.float32)
        with np.errstate(invalid="ignore"):
            inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        x, y = np.where(inside, x, np.float32(0)), np.where(inside, y, np.float32(0))
        if self.shown is not None:
            inside &= cv2.remap(self.shown, x, y, cv2.INTER_LINEAR) > 0.999
        return cv2.remap(picture, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE), inside


def search_base(sparse: SparseMap, matches: Matches, plane: Array, most: float) -> tuple[SparseMap, float]:
    """The field as it is searched around, and how many px along the lines a pixel may lie from it.

    A spline that bends through every depth edge stretches the picture there, which is bad for matching: the field
    without its finer bends is better, as long as what is left can be searched (`most` px).
    matches: those that the field stands on; plane m (3,): its affine part.
    """
    side = float(np.sqrt(np.prod(sparse.camera.size)))
    raw = distort(matches.x, sparse.camera)
    d, sensitivity = inverse_depths(sparse.two_view, matches.x, matches.y)
    for share in BENDS:
        base = sparse.smoothed(share * side, plane)
        at, _ = base.at(raw[None])
        reach = REACH * float(np.percentile(np.abs((d - at[0]) * sensitivity), FURTHEST)) + MORE_PX
        if reach <= most:
            break
    return base, reach


def search(
    lines: Lines, sparse: SparseMap, reference: View, target: View, step: float, reach: float
) -> tuple[Plane, Plane]:
    """Moves (h, w) px along the lines to where the nodes are seen in the target, and how much (h, w) 0..1 each counts:
    0 where nothing was found, 1 where it was at full size, COARSE_SHARE where only at half.

    reference, target: views with `step` px to each of their own; reach: px a node may move.
    """
    left, top, width, height = lines.box
    box = np.array([left, top, left + width - 1, top + height - 1], float)
    epipole = np.linalg.svd(sparse.two_view.F)[2][2]
    count = 16 * max(1, int(np.ceil(2 * reach / step / 16)))
    rows = EpipolarRows.over(epipole, box, step, count * step)
    ideal = rows.points()
    alike = reference.levels.shape[2] == target.levels.shape[2]
    own, other = ((v.levels.astype(np.float32) if alike else v.gray) for v in (reference, target))

    def of_reference() -> tuple[Plane, NDArray[np.bool_]]:
        raw = distort(ideal, sparse.camera)
        return reference.sample(own, raw[..., 0], raw[..., 1], cv2.INTER_CUBIC)

    def of_target() -> tuple[Plane, NDArray[np.bool_]]:
        sent = distort(sparse.target(ideal), sparse.camera_prime)
        return target.sample(other, sent[..., 0], sent[..., 1], cv2.INTER_CUBIC)

    (first, seen), (second, seen_too) = in_order(lambda rows_of: rows_of(), (of_reference, of_target))
    a, b = _levels(first), _levels(in_tones_of(first, second, seen & seen_too))
    # where one picture shows nothing, the field is believed
    only, only_too = seen & ~seen_too, seen_too & ~seen
    b[only], a[only_too] = a[only], b[only_too]
    a[~(seen | seen_too)] = b[~(seen | seen_too)] = 128
    moved, found = _matched(a, b, count)
    coarse, found_too = _matched_at_half(a, b, count)
    moved = np.where(found, moved, coarse)
    counts = np.where(found, np.float32(1), found_too * np.float32(COARSE_SHARE))
    arrives = np.rint(np.arange(rows.shape[1]) - moved).astype(int)
    counts *= seen & (arrives >= 0) & (arrives < rows.shape[1])
    counts *= np.take_along_axis(seen_too, np.clip(arrives, 0, rows.shape[1] - 1), axis=1)
    return _on_nodes(lines, sparse, rows, moved, counts)


def in_tones_of(first: Plane, second: Plane, both: NDArray[np.bool_]) -> Plane:
    """The second picture (h, w[, C]) with the tones of the first: for each channel the monotone curve that makes their
    histograms over `both` (h, w) one."""
    if not both.any():
        return second
    if first.ndim == 3:
        channels = [in_tones_of(first[..., k], second[..., k], both) for k in range(first.shape[2])]
        return np.stack(channels, axis=-1)
    share = np.linspace(0, 1, TONES + 1)
    own, other = (np.quantile(values[both][::7], share) for values in (second, first))
    own, index = np.unique(own, return_index=True)
    return np.interp(second, own, other[index]).astype(np.float32)


def _levels(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _matched(
    a: NDArray[np.uint8], b: NDArray[np.uint8], count: int, smoother: int = 1
) -> tuple[Plane, NDArray[np.bool_]]:
    """Columns (h, w) by which what a (h, w[, C]) shows lies further left in b, between −count/2 and count/2, and where
    that is sure; smoother: how many times the usual a step costs."""
    least = -count // 2
    matcher = cv2.StereoSGBM_create(
        minDisparity=least, numDisparities=count, blockSize=BLOCK,
        P1=smoother * STEP_COST * BLOCK**2, P2=smoother * JUMP_COST * BLOCK**2,
        disp12MaxDiff=1, preFilterCap=31, uniquenessRatio=UNIQUE,
        speckleWindowSize=int(SPECK**2 * a.shape[0] * a.shape[1]), speckleRange=SPECK_RANGE,
        mode=cv2.STEREO_SGBM_MODE_HH4,
    )  # fmt: skip
    height, width = a.shape[:2]
    found = np.empty((height, width), np.float32)
    at_once = max(NEIGHBOURS, MOST_COSTS // (width * count))
    for top in range(0, height, at_once):
        low, high = max(0, top - NEIGHBOURS), min(height, top + at_once + NEIGHBOURS)
        part = matcher.compute(a[low:high], b[low:high])[top - low :][:at_once]
        found[top : top + at_once] = part.astype(np.float32) / 16
    sure = found > least - 1
    return np.where(sure, found, np.float32(0)), sure


def _matched_at_half(a: NDArray[np.uint8], b: NDArray[np.uint8], count: int) -> tuple[Plane, NDArray[np.bool_]]:
    """The same by pictures of half the size, and more smoothly: less exact, but more often sure."""
    height, width = a.shape[:2]
    half = max(1, width // 2), max(1, height // 2)
    a_half, b_half = (cv2.resize(v, half, interpolation=cv2.INTER_AREA) for v in (a, b))
    moved, sure = _matched(a_half, b_half, 16 * -(-count // 32), COARSE_SMOOTHER)
    moved, sure_too = (
        cv2.resize(v, (width, height), interpolation=cv2.INTER_NEAREST) for v in (moved, sure.astype(np.uint8))
    )
    moved *= np.float32(width / half[0])
    return moved, (sure_too > 0) & (np.abs(moved) <= count / 2)  # its own range is a multiple of 16, too


def _on_nodes(lines: Lines, sparse: SparseMap, rows: EpipolarRows, moved: Plane, counts: Plane) -> tuple[Plane, Plane]:
    """The same at the nodes, in px along their lines."""
    u, v = rows.column_row(lines.ideal)
    column = np.clip(np.rint(u).astype(int), 0, rows.shape[1] - 1)
    row = np.clip(np.rint(v).astype(int), 0, rows.shape[0] - 1)
    arrived = rows.point(u - moved[row, column], v)
    along = lines.along(sparse.target(arrived) - lines.shift)
    counts = counts[row, column] * np.isfinite(along)
    return np.where(counts > 0, along, np.float32(0)), counts
