"""Where along their epipolar lines the pixels of the reference are found in the target: semi-global matching.

Both pictures are resampled so that epipolar lines are rows, the target by the sparse field: what is left is a small
move along the rows. Matching: Hirschmüller, IEEE TPAMI 2008, as OpenCV has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.matches import Matches
from ..field.transfer import inverse_depths
from ..raster.arrays import Array, Plane
from ..system.threads import in_order
from .epipolar_lines import EpipolarLines, SparseMap, coarse_places, in_between
from .epipolar_rows import EpipolarRows
from .options import LINES, MATCHING


@dataclass(frozen=True)
class View:
    """A picture to be matched: levels (h, w, C) uint8, shown (h, w) float32 0 or 1, None where all is; full (H, W, C)
    uint8: what they are of."""

    levels: NDArray[np.uint8]
    shown: Plane | None
    full: NDArray[np.uint8]

    @staticmethod
    def of(view: NDArray[np.uint8], alpha: Plane | None, step: float) -> View:
        """An 8-bit picture (H, W, C) with `step` px to each of its own."""
        shown = None if alpha is None else (alpha > 0).astype(np.float32)
        if step <= 1:
            return View(view, shown, view)
        small = max(1, round(view.shape[1] / step)), max(1, round(view.shape[0] / step))
        levels = cv2.resize(view, small, interpolation=cv2.INTER_AREA).reshape(*small[::-1], -1)
        if shown is not None:
            shown = (cv2.resize(shown, small, interpolation=cv2.INTER_AREA) > 0.999).astype(np.float32)
        return View(levels, shown, view)

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the full picture."""
        return self.full.shape[1], self.full.shape[0]

    @cached_property
    def gray(self) -> Plane:
        """(h, w) float32, means of gray levels that are not rounded."""
        full, (height, width) = self.full, self.levels.shape[:2]
        gray = (cv2.cvtColor(full, cv2.COLOR_RGB2GRAY) if full.shape[2] == 3 else full[..., 0]).astype(np.float32)
        return (
            gray if gray.shape == (height, width) else cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
        )

    def sample(
        self, picture: NDArray, x: NDArray, y: NDArray, interpolation: int = cv2.INTER_LINEAR
    ) -> tuple[NDArray, NDArray[np.bool_]]:
        """A picture of the same shape (h, w[, C]) as `levels` at full px (…), and where (…) that lies on what is
        shown."""
        height, width = self.levels.shape[:2]
        x, y = (
            np.multiply(at + np.float32(0.5), np.float32(few / many), dtype=np.float32) - np.float32(0.5)
            if few != many else np.array(at, np.float32)
            for at, few, many in ((x, width, self.size[0]), (y, height, self.size[1]))
        )  # fmt: skip
        within = cv2.bitwise_and(cv2.inRange(x, 0.0, width - 1.0), cv2.inRange(y, 0.0, height - 1.0))
        for at in (x, y):
            cv2.patchNaNs(at, 0.0)
        inside = within > 0
        if self.shown is not None:
            inside &= cv2.remap(self.shown, x, y, cv2.INTER_LINEAR) > 0.999
        return cv2.remap(picture, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE), inside

    def at_nodes(
        self, picture: NDArray[np.float32], lines: EpipolarLines
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """The same at the nodes, of the reference."""
        left, top, width, height = lines.box
        if (width, height) != lines.shape[::-1] or self.levels.shape != self.full.shape:
            return self.sample(picture, *lines.nodes)
        part = slice(int(top), int(top + height)), slice(int(left), int(left + width))
        shown = np.ones(lines.shape, bool) if self.shown is None else self.shown[part] > 0.999
        return picture[part], shown


def search_base(sparse: SparseMap, matches: Matches, plane: Array, most: float) -> tuple[SparseMap, float]:
    """The field as it is searched around, and how many px along the lines a pixel may lie from it.

    A spline that bends through every depth edge stretches the picture there, which is bad for matching: the field
    without its finer bends is better, as long as what is left can be searched (`most` px).
    matches: those that the field stands on; plane m (3,): its affine part.
    """
    side = float(np.sqrt(np.prod(sparse.camera.size)))
    raw = distort(matches.x, sparse.camera)
    d, sensitivity = inverse_depths(sparse.two_view, matches.x, matches.y)
    for share in MATCHING.bend_sizes:
        base = sparse.smoothed(share * side, plane)
        at, _ = base.at(raw[None])
        furthest = float(np.percentile(np.abs((d - at[0]) * sensitivity), MATCHING.reach_percentile))
        reach = MATCHING.reach_factor * furthest + MATCHING.reach_margin_px
        if reach <= most:
            break
    return base, reach


def search(
    lines: EpipolarLines, sparse: SparseMap, reference: View, target: View, step: float, reach: float
) -> tuple[Plane, Plane]:
    """Moves (h, w) px along the lines to where the nodes are seen in the target, and how much (h, w) 0..1 each counts:
    0 where nothing was found, 1 where it was at full size, little where only at half.

    reference, target: views with `step` px to each of their own; reach: px a node may move.
    """
    left, top, width, height = lines.box
    box = np.array([left, top, left + width - 1, top + height - 1], float)
    epipole = np.linalg.svd(sparse.two_view.F)[2][2]
    count = 16 * max(1, int(np.ceil(2 * reach / step / 16)))
    rows = EpipolarRows.over(epipole, box, step, count * step)
    alike = reference.levels.shape[2] == target.levels.shape[2]
    own, other = (v.levels if alike else _levels(v.gray) for v in (reference, target))
    finer = cv2.multiply(other, float(MATCHING.sublevels), dtype=cv2.CV_16U)
    points = rows.points(*coarse_places(rows.shape))
    sent = sparse.target(points)
    ways = ArcLengths.of(sparse.two_view.e_prime, sent, rows)

    def of_reference() -> tuple[NDArray, NDArray[np.bool_]]:
        x, y = in_between(rows.shape, distort(points, sparse.camera))
        return reference.sample(own, x, y, cv2.INTER_CUBIC)

    def of_target() -> tuple[NDArray, NDArray[np.bool_]]:
        x, y = in_between(rows.shape, distort(sent, sparse.camera_prime))
        return target.sample(finer, x, y, cv2.INTER_CUBIC)

    (a, seen), (finer_b, seen_too) = in_order(lambda rows_of: rows_of(), (of_reference, of_target))
    b = in_tones_of(a, finer_b, seen & seen_too)
    # where one picture shows nothing, the field is believed
    cv2.copyTo(a, (seen & ~seen_too).view(np.uint8), b)
    cv2.copyTo(b, (seen_too & ~seen).view(np.uint8), a)
    neither = ~(seen | seen_too)
    a[neither] = b[neither] = 128
    (moved, found), (coarse, found_too) = in_order(lambda match: match(a, b, count), (_matched, _matched_at_half))
    moved = np.where(found, moved, coarse)
    counts = np.where(found, np.float32(1), found_too * np.float32(MATCHING.coarse_confidence))
    return _on_nodes(lines, rows, ways, moved, counts * seen, seen_too)


def in_tones_of(first: NDArray[np.uint8], second: NDArray[np.uint16], both: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The second picture (h, w[, C]), in sublevels, with the tones of the first: for each channel the monotone curve
    that makes their histograms over `both` (h, w) one."""
    ends = 256 * MATCHING.sublevels
    if not both.any():
        return _levels(second / np.float32(MATCHING.sublevels))
    mask, share = both.view(np.uint8), np.linspace(0, 1, MATCHING.tone_quantiles + 1)

    def quantiles(picture: NDArray, k: int, count: int) -> Array:
        """Levels of a channel below which such shares lie, each level's own pixels half below it."""
        n = cv2.calcHist([picture], [k], mask, [count], [0, count]).ravel().astype(np.float64)
        held = np.flatnonzero(n)
        return np.interp(share * n.sum(), (np.cumsum(n) - n / 2)[held], held)

    out = np.empty(second.shape, np.uint8)
    for k in range(second.shape[2] if second.ndim == 3 else 1):
        curve = _levels(np.interp(np.arange(ends), quantiles(second, k, ends), quantiles(first, k, 256)))
        channel = np.s_[..., k] if second.ndim == 3 else np.s_[...]
        out[channel] = np.take(curve, second[channel], mode="clip")
    return out


def _levels(values: NDArray) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _matched(
    a: NDArray[np.uint8], b: NDArray[np.uint8], count: int, smoother: int = 1
) -> tuple[Plane, NDArray[np.bool_]]:
    """Columns (h, w) by which what a (h, w[, C]) shows lies further left in b, between −count/2 and count/2, and where
    that is sure; smoother: how many times the usual a step costs."""
    least, block = -count // 2, MATCHING.block_px
    speckle = MATCHING.speckle_side**2 * a.shape[0] * a.shape[1]
    matcher = cv2.StereoSGBM_create(
        minDisparity=least, numDisparities=count, blockSize=block,
        P1=smoother * MATCHING.step_cost * block**2, P2=smoother * MATCHING.jump_cost * block**2,
        disp12MaxDiff=1, preFilterCap=31, uniquenessRatio=MATCHING.uniqueness_percent,
        speckleWindowSize=int(speckle), speckleRange=MATCHING.speckle_range_px,
        mode=cv2.STEREO_SGBM_MODE_HH4,
    )  # fmt: skip
    height, width = a.shape[:2]
    found = np.empty((height, width), np.float32)
    at_once = max(MATCHING.band_margin_rows, MATCHING.costs_at_once // (width * count))
    for top in range(0, height, at_once):
        low, high = max(0, top - MATCHING.band_margin_rows), min(height, top + at_once + MATCHING.band_margin_rows)
        part = matcher.compute(a[low:high], b[low:high])[top - low :][:at_once]
        found[top : top + at_once] = part.astype(np.float32) / 16
    sure = found > least - 1
    return np.where(sure, found, np.float32(0)), sure


def _matched_at_half(a: NDArray[np.uint8], b: NDArray[np.uint8], count: int) -> tuple[Plane, NDArray[np.bool_]]:
    """The same by pictures of half the size, and more smoothly: less exact, but more often sure."""
    height, width = a.shape[:2]
    half = max(1, width // 2), max(1, height // 2)
    a_half, b_half = (cv2.resize(v, half, interpolation=cv2.INTER_AREA) for v in (a, b))
    moved, sure = _matched(a_half, b_half, 16 * -(-count // 32), MATCHING.coarse_smoothness)
    moved, sure_too = (
        cv2.resize(v, (width, height), interpolation=cv2.INTER_NEAREST) for v in (moved, sure.astype(np.uint8))
    )
    moved *= np.float32(width / half[0])
    return moved, (sure_too > 0) & (np.abs(moved) <= count / 2)  # its own range is a multiple of 16, too


@dataclass(frozen=True)
class ArcLengths:
    """px (rows, n): how far along its line in the target each row is seen, at the columns of `coarse_places`;
    ideal px, from anywhere on the line."""

    px: Plane

    @staticmethod
    def of(e_prime: Array, sent: Array, rows: EpipolarRows) -> ArcLengths:
        """sent (m, n, 2): where the field sends those places."""
        direction = e_prime[:2] - sent * e_prime[2]
        # a row's is one line, and is followed one way only
        direction = np.where(np.isfinite(direction), direction, 0.0).sum(axis=1, keepdims=True)
        direction /= np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-300)
        px = (sent * direction).sum(axis=-1).astype(np.float32)
        step = LINES.coarse_step
        px = cv2.resize(px, (px.shape[1], step * px.shape[0]), interpolation=cv2.INTER_LINEAR)
        return ArcLengths(px[step : step + rows.shape[0]])

    def at(self, u: Plane, row: NDArray[np.intp]) -> Plane:
        """At columns u of whole rows (…)."""
        step = LINES.coarse_step
        place = u * np.float32(1 / step) + np.float32(0.5 + 0.5 / step)
        before = np.clip(place.astype(np.intp), 0, self.px.shape[1] - 2)
        place -= before
        before += row * self.px.shape[1]
        start, end = np.take(self.px, before), np.take(self.px, before + 1)
        return start + place * (end - start)


def _on_nodes(
    lines: EpipolarLines, rows: EpipolarRows, ways: ArcLengths, moved: Plane, counts: Plane, seen: NDArray[np.bool_]
) -> tuple[Plane, Plane]:
    """The same at the nodes, in px along their lines; seen: what of the rows the target shows."""
    u, v = rows.column_row(lines.ideal)
    column = np.clip(np.rint(u).astype(int), 0, rows.shape[1] - 1)
    row = np.clip(np.rint(v).astype(int), 0, rows.shape[0] - 1)
    first = row * rows.shape[1]
    moved, counts = (np.take(values, first + column) for values in (moved, counts))
    arrives = np.rint(column - moved).astype(int)
    ends = (arrives >= 0) & (arrives < rows.shape[1])
    ends &= np.take(seen, first + np.clip(arrives, 0, rows.shape[1] - 1))
    start = u.astype(np.float32)
    along = lines.along(ways.at(start - moved, row) - ways.at(start, row))
    counts *= ends & np.isfinite(along)
    return np.where(counts > 0, along, np.float32(0)), counts
