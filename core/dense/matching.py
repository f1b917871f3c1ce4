"""Dense matching: where along their epipolar lines the pixels of the reference are found in the target.

Both pictures are resampled so that epipolar lines are rows, the target through the sparse field, which leaves a small
disparity along the rows. They are matched by semi-global matching (Hirschmüller, IEEE TPAMI 2008; OpenCV's).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.matches import Matches
from ..field.transfer import inverse_depths
from ..raster.arrays import Array, Plane, eroded
from ..raster.coarse import COARSE_STEP, coarse_places, in_between
from ..system.memory import give_back
from ..system.threads import each, in_order
from .epipolar_lines import EpipolarLines, SparseMap
from .epipolar_rows import EpipolarRows
from .options import LINES, MATCHING
from .rim_options import RIM
from .tones import rounded_levels, tone_curves


@dataclass(frozen=True)
class ComparedPicture:
    """A picture to be matched, perhaps shrunk.

    levels (h, w, C) uint8; shown (h, w) float32: 1 where it shows something, else 0, None if it does everywhere; full
    (H, W, C) uint8: before shrinking.
    """

    levels: NDArray[np.uint8]
    shown: Plane | None
    full: NDArray[np.uint8]

    @staticmethod
    def of(view: NDArray[np.uint8], alpha: Plane | None, step: float) -> ComparedPicture:
        """An 8-bit picture (H, W, C), shrunk by `step` ≥ 1; alpha (H, W) 0 where it shows nothing."""
        shown = None if alpha is None else (alpha > 0).astype(np.float32)
        if step <= 1:
            return ComparedPicture(view, shown, view)
        small = max(1, round(view.shape[1] / step)), max(1, round(view.shape[0] / step))
        levels = cv2.resize(view, small, interpolation=cv2.INTER_AREA).reshape(*small[::-1], -1)
        if shown is not None:
            shown = (cv2.resize(shown, small, interpolation=cv2.INTER_AREA) > 0.999).astype(np.float32)
        return ComparedPicture(levels, shown, view)

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the full picture."""
        return self.full.shape[1], self.full.shape[0]

    @cached_property
    def gray(self) -> Plane:
        """Gray levels (h, w) float32, averaged without rounding."""
        full, (height, width) = self.full, self.levels.shape[:2]
        gray = (cv2.cvtColor(full, cv2.COLOR_RGB2GRAY) if full.shape[2] == 3 else full[..., 0]).astype(np.float32)
        return (
            gray if gray.shape == (height, width) else cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
        )

    def sample(
        self, picture: NDArray[Any], x: NDArray[Any], y: NDArray[Any], interpolation: int = cv2.INTER_LINEAR
    ) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Values (…) of a picture (h, w[, C]), as large as `levels`, at px x, y (…) of the full picture, and the mask
        (…) of points at which something is shown."""
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

    def at_nodes(self, picture: NDArray[Any], lines: EpipolarLines) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """The same at the nodes, where this is the reference."""
        left, top, width, height = lines.box
        if (width, height) != lines.shape[::-1] or self.levels.shape != self.full.shape:
            return self.sample(picture, *lines.nodes)
        part = slice(int(top), int(top + height)), slice(int(left), int(left + width))
        shown = np.ones(lines.shape, bool) if self.shown is None else self.shown[part] > 0.999
        return picture[part], shown


def search_base(sparse: SparseMap, matches: Matches, plane: Array, most: float) -> tuple[SparseMap, float]:
    """The field to search around, and the px along the lines that a pixel may lie from it.

    A spline that bends at every depth edge stretches the picture there, which disturbs matching: the field is smoothed
    as far as the rest stays within `most` px. matches: those that the field is fitted to; plane m (3,): its affine
    part.
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
    lines: EpipolarLines, sparse: SparseMap, reference: ComparedPicture, target: ComparedPicture, step: float,
    reach: float,
) -> tuple[Plane, Plane]:
    """Moves (h, w) px along the lines to where the nodes are found in the target, and confidences (h, w): 0 where
    nothing was found, 1 where it was found at full size, little where only at half the size.

    sparse: the field to search around; reference, target: views shrunk by `step`; reach: largest move, full px.
    """
    left, top, width, height = lines.box
    box = np.array([left, top, left + width - 1, top + height - 1], float)
    epipole = np.linalg.svd(sparse.two_view.F)[2][2]
    count = 16 * max(1, int(np.ceil(2 * reach / step / 16)))
    rows = EpipolarRows.over(epipole, box, step, count * step)
    reference_levels, target_levels = comparable_levels(reference, target)
    target_levels = cv2.multiply(target_levels, float(MATCHING.sublevels), dtype=cv2.CV_16U)
    points = rows.points(*coarse_places(rows.shape))
    target_points = sparse.target(points)
    arc_lengths = ArcLengths.of(sparse.two_view.e_prime, target_points, rows)

    def reference_rows() -> tuple[NDArray[Any], NDArray[np.bool_]]:
        x, y = in_between(rows.shape, distort(points, sparse.camera))
        return reference.sample(reference_levels, x, y, cv2.INTER_CUBIC)

    def target_rows() -> tuple[NDArray[Any], NDArray[np.bool_]]:
        x, y = in_between(rows.shape, distort(target_points, sparse.camera_prime))
        return target.sample(target_levels, x, y, cv2.INTER_CUBIC)

    (a, in_reference), (b_sublevels, in_target) = in_order(lambda resample: resample(), (reference_rows, target_rows))
    b = in_tones_of(a, b_sublevels, in_reference & in_target)
    # where only one picture shows something it stands for both: a disparity of 0, the field's
    cv2.copyTo(a, (in_reference & ~in_target).view(np.uint8), b)
    cv2.copyTo(b, (in_target & ~in_reference).view(np.uint8), a)
    neither = ~(in_reference | in_target)
    a[neither] = b[neither] = 128
    # half the size searches twice as far, and tells whether that is worth while
    coarse_disparity, coarse_found = _matched_at_half(a, b, 2 * count)
    give_back()  # its costs: those at full size do not fit where they were
    usual = count / 2
    least, count = _range(a, coarse_disparity, coarse_found, count)
    coarse_found &= (coarse_disparity >= least) & (coarse_disparity <= least + count)
    disparity, found = _matched(a, b, least, count)
    inside = _inside(in_reference & in_target)
    found &= inside | (np.abs(disparity) <= usual)
    coarse_found &= inside | (np.abs(coarse_disparity) <= usual)
    confidence = np.where(found, np.float32(1), coarse_found * np.float32(MATCHING.coarse_confidence))
    disparity = np.where(found, disparity, coarse_disparity)
    return _on_nodes(lines, rows, arc_lengths, disparity, confidence * in_reference, in_target)


def comparable_levels(reference: ComparedPicture, target: ComparedPicture) -> tuple[NDArray[np.uint8], ...]:
    """Levels of both pictures (…, C), in colour where both are."""
    both_colour = reference.levels.shape[2] == target.levels.shape[2]
    return tuple(view.levels if both_colour else rounded_levels(view.gray)[..., None] for view in (reference, target))


def in_tones_of(first: NDArray[np.uint8], second: NDArray[np.uint16], both: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The second picture (h, w[, C]), in sublevels, with the tones of the first.

    Each channel goes through the monotone curve that matches its histogram over the mask `both` (h, w) to the first's.
    """
    if not both.any():
        return rounded_levels(second / np.float32(MATCHING.sublevels))
    out = np.empty(second.shape, np.uint8)
    for k, curve in enumerate(tone_curves(first, second, both, 256 * MATCHING.sublevels)):
        channel = np.s_[..., k] if second.ndim == 3 else np.s_[...]
        out[channel] = np.take(curve, second[channel], mode="clip")
    return out


def _inside(both: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What (h, w) of what both pictures show does not lie near its rim. Near it a match from far away has no neighbours
    that would speak against it."""
    return eroded(both, round(RIM.width * min(both.shape)))


def _range(a: NDArray[np.uint8], disparity: Plane, found: NDArray[np.bool_], count: int) -> tuple[int, int]:
    """The least disparity to be searched for and how many, a multiple of 16: as far as points of a (h, w[, C]) with
    texture were found (h, w) at half the size. Beyond `count` around 0 only where these are few."""
    some, half = np.s_[::2, ::2], count / 2
    gradient = cv2.Sobel(cv2.blur(np.ascontiguousarray(a[some]), (3, 3)), cv2.CV_16S, 1, 0)
    texture = np.abs(gradient).reshape(*gradient.shape[:2], -1).max(axis=-1) >= MATCHING.wide_texture
    values = disparity[some][found[some] & texture]
    if not values.size:
        return -16 * -(-count // 32), 32 * -(-count // 32)
    few = (np.abs(values) > half).mean() < MATCHING.max_wide_share
    ends = []
    for side in (-1, 1):
        usual, wide = np.percentile(side * values, [100 - MATCHING.range_share, 100 - MATCHING.wide_share])
        end, limit = (wide, count) if few and wide > half else (usual, 16 * -(-count // 32))
        ends.append(int(np.clip(16 * -(-(end + MATCHING.range_margin_px) // 16), 16, limit)))
    return -ends[0], sum(ends)


def _matched(
    a: NDArray[np.uint8], b: NDArray[np.uint8], least: int, count: int, smoother: int = 1
) -> tuple[Plane, NDArray[np.bool_]]:
    """Disparities (h, w) between least and least + count, columns by which points of a (h, w[, C]) lie further left in
    b, and the mask of pixels where one was found; smoother: factor of the costs of steps and jumps."""
    block = MATCHING.block_px
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
    rows_at_once = max(MATCHING.band_margin_rows, MATCHING.costs_at_once // (width * count))
    for top in range(0, height, rows_at_once):
        low, high = max(0, top - MATCHING.band_margin_rows), min(height, top + rows_at_once + MATCHING.band_margin_rows)
        part = matcher.compute(a[low:high], b[low:high])[top - low :][:rows_at_once]
        found[top : top + rows_at_once] = part.astype(np.float32) / 16
    valid = found > least - 1
    return np.where(valid, found, np.float32(0)), valid


def _matched_at_half(a: NDArray[np.uint8], b: NDArray[np.uint8], count: int) -> tuple[Plane, NDArray[np.bool_]]:
    """The same from pictures of half the size, with a smoother result: less exact, but it finds more."""
    height, width = a.shape[:2]
    half = max(1, width // 2), max(1, height // 2)
    a_half, b_half = (cv2.resize(v, half, interpolation=cv2.INTER_AREA) for v in (a, b))
    # OpenCV wants a multiple of 16, so the range may be wider than asked for
    half_count = 16 * -(-count // 32)
    half_disparity, half_found = _matched(a_half, b_half, -half_count // 2, half_count, MATCHING.coarse_smoothness)
    disparity, found = (
        cv2.resize(v, (width, height), interpolation=cv2.INTER_NEAREST)
        for v in (half_disparity, half_found.astype(np.uint8))
    )
    disparity *= np.float32(width / half[0])
    return disparity, (found > 0) & (np.abs(disparity) <= count / 2)


@dataclass(frozen=True)
class ArcLengths:
    """Arc length along each row's epipolar line in the target: px (rows, n), ideal, at the columns of `coarse_places`,
    from an arbitrary point of the line."""

    px: Plane

    @staticmethod
    def of(e_prime: Array, target: Array, rows: EpipolarRows) -> ArcLengths:
        """target (m, n, 2): ideal target pixels of the `coarse_places` of the rows."""
        direction = e_prime[:2] - target * e_prime[2]
        # a row has one line and one direction
        direction = np.where(np.isfinite(direction), direction, 0.0).sum(axis=1, keepdims=True)
        direction /= np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-300)
        px = (target * direction).sum(axis=-1).astype(np.float32)
        step = COARSE_STEP
        px = cv2.resize(px, (px.shape[1], step * px.shape[0]), interpolation=cv2.INTER_LINEAR)
        return ArcLengths(px[step : step + rows.shape[0]])

    def at(self, u: Plane, row: NDArray[np.intp]) -> Plane:
        """px (…), linear, at columns u (…) of rows with index row (…)."""
        step = COARSE_STEP
        position = u * np.float32(1 / step) + np.float32(0.5 + 0.5 / step)
        before = np.clip(position.astype(np.intp), 0, self.px.shape[1] - 2)
        position -= before
        before += row * self.px.shape[1]
        start, end = np.take(self.px, before), np.take(self.px, before + 1)
        return start + position * (end - start)


def _on_nodes(
    lines: EpipolarLines, rows: EpipolarRows, arc_lengths: ArcLengths, disparity: Plane, confidence: Plane,
    in_target: NDArray[np.bool_],
) -> tuple[Plane, Plane]:  # fmt: skip
    """From disparities and confidences (rows, columns) to moves (h, w) px and confidences (h, w) at the nodes;
    in_target (rows, columns): where the target shows something."""
    moves, certain = np.empty(lines.shape, np.float32), np.empty(lines.shape, np.float32)

    def look_up(top: int) -> None:
        part = slice(top, top + LINES.strip_rows)
        u, v = rows.column_row(lines.ideal[part])
        column = np.clip(np.rint(u).astype(int), 0, rows.shape[1] - 1)
        row = np.clip(np.rint(v).astype(int), 0, rows.shape[0] - 1)
        first = row * rows.shape[1]
        shifted, sure = (np.take(values, first + column) for values in (disparity, confidence))
        found_at = np.rint(column - shifted).astype(int)
        visible = (found_at >= 0) & (found_at < rows.shape[1])
        visible &= np.take(in_target, first + np.clip(found_at, 0, rows.shape[1] - 1))
        start = u.astype(np.float32)
        along = lines.along(arc_lengths.at(start - shifted, row) - arc_lengths.at(start, row), part)
        sure *= visible & np.isfinite(along)
        moves[part], certain[part] = np.where(sure > 0, along, np.float32(0)), sure

    each(look_up, range(0, lines.shape[0], LINES.strip_rows))
    return moves, certain
