"""The last fraction of a pixel: photometric alignment along every epipolar line, by Gauss-Newton.

This is Lucas and Kanade's method (IJCAI 1981) with one unknown per pixel, a local gain and bias between the pictures,
robust weights, and edge-aware smoothing between the steps. Where the field may leave its lines, a second, very smooth
unknown across them is estimated with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane, beside
from ..system.threads import each
from .edge_aware_smoothing import Smoother
from .epipolar_lines import EpipolarLines
from .local_means import local_gain, mean, mean_there, without_means
from .matching import ComparedPicture
from .options import POLISH


@dataclass(frozen=True)
class Polished:
    """What polishing found at each node (h, w).

    Attributes
    ----------
    along, across : (h, w) float32 arrays
        Moves along the epipolar lines and across them, px.
    evidence : (h, w) float32 array
        0..1, how much texture there is to go by.
    """

    along: Plane
    across: Plane
    evidence: Plane


def polish(
    lines: EpipolarLines, reference: ComparedPicture, target: ComparedPicture, along: Plane, known: Plane,
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], slack: bool,
) -> Polished:  # fmt: skip
    """Refine moves along epipolar lines until both pictures look alike.

    Parameters
    ----------
    lines : EpipolarLines
    reference, target : ComparedPicture
        Gray levels of the two pictures.
    along : (h, w) float32 array
        Moves to start from, px.
    known : (h, w) float32 array
        0..1, how well they are known: guesses count less among their neighbours.
    weights : pair of float32 arrays
        Connections of neighbours (see `edge_weights`).
    slack : bool
        Whether the lines may be left.

    Returns
    -------
    Polished
    """
    across = np.zeros_like(along)
    start = along
    smoother = Smoother.of(weights, POLISH.smoothness)
    steps_px = target.gray.shape[1] / target.size[0], target.gray.shape[0] / target.size[1]
    evidence, moved = np.empty_like(along), np.empty_like(along)
    for blur, count in POLISH.schedule:
        first, shown = reference.at_nodes(cv2.GaussianBlur(reference.gray, (0, 0), blur), lines)
        smooth = cv2.GaussianBlur(target.gray, (0, 0), blur)
        slopes = [cv2.Scharr(smooth, cv2.CV_32F, 1 - k, k, scale=steps_px[k] / 32) for k in (0, 1)]
        second = cv2.merge([smooth, *slopes])
        for _ in range(count):
            compared = _compared(lines, first, shown, target, second, along, across)

            def move(rows: slice, compared: _Compared = compared, along: Plane = along) -> None:
                """A Gauss-Newton step of some rows into `moved`, and how much each node counts into `evidence`."""
                near, own = beside(rows, POLISH.window_px // 2, len(along))
                weight = compared.trust(near)
                weight *= compared.slope[near]
                step = mean(weight * compared.residual[near], POLISH.window_px)[own]
                weight *= compared.slope[near]
                curvature = mean(weight, POLISH.window_px)[own]
                step += np.float32(POLISH.start_evidence) * (start[rows] - along[rows])
                step /= curvature + np.float32(POLISH.start_evidence + POLISH.damping)
                np.add(along[rows], np.clip(step, -POLISH.max_step_px, POLISH.max_step_px, out=step), out=moved[rows])
                np.add(curvature, np.float32(POLISH.min_evidence), out=evidence[rows])
                evidence[rows] /= curvature + np.float32(POLISH.half_evidence)
                evidence[rows] *= known[rows]

            each(move, _strips(len(along)))
            along = smoother.smoothed(moved, evidence, floor=POLISH.min_confidence)
            if slack:
                weight = compared.trust(slice(None)) * compared.slope_across
                across = across + _smooth_step(weight * compared.residual, weight * compared.slope_across)
    return Polished(along, across, evidence)


def likeness(
    lines: EpipolarLines, reference: ComparedPicture, target: ComparedPicture, along: Plane,
    across: Plane | None = None,
) -> Plane:
    """Correlation of the two pictures around each node.

    Parameters
    ----------
    lines : EpipolarLines
    reference, target : ComparedPicture
        Gray levels of the two pictures.
    along, across : (h, w) float32 arrays
        Moves along the epipolar lines and across them, px; none across if not given.

    Returns
    -------
    (h, w) float32 array
        −1..1, 0 where the target shows nothing.
    """
    first, shown = reference.at_nodes(reference.gray, lines)
    out = np.empty_like(along)

    def compare(rows: slice) -> None:
        near, here = beside(rows, POLISH.surroundings_px, len(along))
        fetched, valid = target.sample(target.gray, *lines.target(along, across, near))
        valid &= shown[near]
        a, b, share = without_means(first[near], fetched, valid)
        both, own, other = (mean_there(u * v, share) for u, v in ((a, b), (a, a), (b, b)))
        both /= np.sqrt((own + 1) * (other + 1))
        both *= valid
        out[rows] = both[here]

    each(compare, _strips(len(along)))
    return out


@dataclass(frozen=True)
class _Compared:
    """The reference beside the target where moves lead, at each node (h, w).

    residual: gray levels, 0 where not valid; slope, slope_across: gray levels per px along the lines and across them;
    valid: where both pictures show something; half_residual: gray levels at which a residual counts half.
    """

    residual: Plane
    slope: Plane
    slope_across: Plane
    valid: NDArray[np.bool_]
    half_residual: np.float32

    def trust(self, rows: slice) -> Plane:
        """Robust weights (…, w), 0..1, of some rows: those of a Cauchy loss."""
        out = self.residual[rows] * (1 / self.half_residual)
        out *= out
        out += 1
        return np.divide(self.valid[rows], out, out=out)


def _compared(
    lines: EpipolarLines, first: Plane, shown: NDArray[np.bool_], target: ComparedPicture, second: NDArray[np.float32],
    along: Plane, across: Plane,
) -> _Compared:  # fmt: skip
    """The reference at the nodes (h, w) beside the target and its slopes (h', w', 3) where the moves lead."""
    residual, slope, slope_across, valid = *(np.empty_like(along) for _ in range(3)), np.empty(along.shape, bool)

    def compare(rows: slice) -> None:
        near, own = beside(rows, POLISH.surroundings_px, len(along))
        fetched, both_shown = target.sample(second, *lines.target(along, across, near))
        both_shown &= shown[near]
        gray, gx, gy = cv2.split(fetched)
        a, b, share = without_means(first[near], gray, both_shown)
        gain = local_gain(a, b, share)[own]
        valid[rows] = both_shown[own]
        np.multiply(gain, b[own], out=residual[rows])
        np.subtract(a[own], residual[rows], out=residual[rows])
        residual[rows] *= valid[rows]
        gx, gy = gx[own] * gain, gy[own] * gain
        x, y = (lines.direction[rows, :, k] for k in (0, 1))
        np.add(gx * x, gy * y, out=slope[rows])
        np.subtract(gy * x, gx * y, out=slope_across[rows])

    each(compare, _strips(len(along)))
    some = np.abs(residual[::4, ::4][valid[::4, ::4]])  # a sixteenth tells the median as well
    typical = float(np.median(some)) if some.size else 0.0
    half_residual = np.float32(max(POLISH.min_half_residual, POLISH.half_residual_factor * typical))
    return _Compared(residual, slope, slope_across, valid, half_residual)


def _strips(rows: int) -> list[slice]:
    """Rows that a thread works on at once."""
    return [slice(top, min(top + POLISH.strip_rows, rows)) for top in range(0, rows, POLISH.strip_rows)]


def _smooth_step(gradient: Plane, curvature: Plane) -> Plane:
    """A Gauss-Newton step (h, w) px across the lines, over a wide window; damped where there is little to go by."""
    rows, columns = gradient.shape
    small = max(1, columns // POLISH.across_step), max(1, rows // POLISH.across_step)
    width = max(1.0, POLISH.across_width * np.sqrt(rows * columns) / POLISH.across_step)

    def gathered(values: Plane) -> Plane:
        smooth: Plane = cv2.GaussianBlur(cv2.resize(values, small, interpolation=cv2.INTER_AREA), (0, 0), width)
        return smooth

    gradient, curvature = gathered(gradient), gathered(curvature)
    curvature += POLISH.across_damping * curvature.mean()
    curvature += 1e-6
    coarse = np.clip(gradient / curvature, -POLISH.max_step_px, POLISH.max_step_px)
    step_across: Plane = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return step_across
