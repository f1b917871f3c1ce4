"""The last fraction of a pixel: along every line to where both pictures look alike, by Gauss-Newton.

Lucas and Kanade (IJCAI 1981) with one unknown a pixel, a local gain and bias (both pictures lose their local mean, one
is scaled to the other), robust weights, and edge-aware smoothing between the steps. Where the field may leave its
lines, a second, very smooth unknown across them is found on the way.
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
from .matching import ComparedPicture
from .options import POLISH


@dataclass(frozen=True)
class Polished:
    """Moves (h, w) px along the lines and across them; likeness (h, w): correlation of the two pictures around each
    node, 0 where the target shows nothing; evidence (h, w) 0..1: how much texture says so."""

    along: Plane
    across: Plane
    likeness: Plane
    evidence: Plane


def polish(
    lines: EpipolarLines, reference: ComparedPicture, target: ComparedPicture, along: Plane, known: Plane,
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], slack: bool,
) -> Polished:  # fmt: skip
    """Starts at moves `along` (h, w) px.

    known (h, w) 0..1: how well, so that guesses do not pull at what was found; weights: see `edge_weights`; slack:
    whether the lines may be left.
    """
    across = np.zeros_like(along)
    start = along
    smoother = Smoother.of(weights, POLISH.smoothness)
    steps_px = target.gray.shape[1] / target.size[0], target.gray.shape[0] / target.size[1]
    share, wanted = np.empty_like(along), np.empty_like(along)
    for blur, count in POLISH.schedule:
        first, shown = reference.at_nodes(cv2.GaussianBlur(reference.gray, (0, 0), blur), lines)
        smooth = cv2.GaussianBlur(target.gray, (0, 0), blur)
        slopes = [cv2.Scharr(smooth, cv2.CV_32F, 1 - k, k, scale=steps_px[k] / 32) for k in (0, 1)]
        second = cv2.merge([smooth, *slopes])
        for _ in range(count):
            seen = _compared(lines, first, shown, target, second, along, across)

            def move(rows: slice, seen: _Compared = seen, along: Plane = along) -> None:
                """What these rows want and how much that counts, into `wanted` and `share`."""
                near, own = beside(rows, POLISH.window_px // 2, len(along))
                told = seen.trust(near)
                told *= seen.slope[near]
                pull = _mean(told * seen.left[near], POLISH.window_px)[own]
                told *= seen.slope[near]
                evidence = _mean(told, POLISH.window_px)[own]
                pull += np.float32(POLISH.start_evidence) * (start[rows] - along[rows])
                pull /= evidence + np.float32(POLISH.start_evidence + POLISH.damping)
                np.add(along[rows], np.clip(pull, -POLISH.max_step_px, POLISH.max_step_px, out=pull), out=wanted[rows])
                np.add(evidence, np.float32(POLISH.min_evidence), out=share[rows])
                share[rows] /= evidence + np.float32(POLISH.half_evidence)
                share[rows] *= known[rows]

            each(move, _strips(len(along)))
            along = smoother.smoothed(wanted, share, floor=POLISH.min_confidence)
            if slack:
                trust = seen.trust(slice(None)) * seen.aside
                across = across + _smooth_step(trust * seen.left, trust * seen.aside, lines.step)
    return Polished(along, across, likeness(lines, reference, target, along, across), share)


def likeness(
    lines: EpipolarLines, reference: ComparedPicture, target: ComparedPicture, along: Plane,
    across: Plane | None = None,
) -> Plane:
    """Correlation (h, w) of the two pictures around each node after moves along and across its line, 0 where the target
    shows nothing."""
    first, shown = reference.at_nodes(reference.gray, lines)
    out = np.empty_like(along)

    def compare(rows: slice) -> None:
        near, here = beside(rows, POLISH.surroundings_px, len(along))
        fetched, there = target.sample(target.gray, *lines.target(along, across, near))
        there &= shown[near]
        a, b, share = _without_means(first[near], fetched, there)
        both, own, other = (_mean_there(u * v, share) for u, v in ((a, b), (a, a), (b, b)))
        both /= np.sqrt((own + 1) * (other + 1))
        both *= there
        out[rows] = both[here]

    each(compare, _strips(len(along)))
    return out


@dataclass(frozen=True)
class _Compared:
    """left (h, w): gray levels by which the target is wrong, 0 where not both are seen; slope, aside: levels per px
    along the lines and across them; there: where both are seen; usual: levels that count half."""

    left: Plane
    slope: Plane
    aside: Plane
    there: NDArray[np.bool_]
    usual: np.float32

    def trust(self, rows: slice) -> Plane:
        """0..1 (…, w) of some rows."""
        out = self.left[rows] * (1 / self.usual)
        out *= out
        out += 1
        return np.divide(self.there[rows], out, out=out)


def _compared(
    lines: EpipolarLines, first: Plane, shown: NDArray[np.bool_], target: ComparedPicture, second: NDArray[np.float32],
    along: Plane, across: Plane,
) -> _Compared:  # fmt: skip
    """The reference at the nodes (h, w) beside the target and its slopes (h', w', 3) where the moves lead."""
    left, slope, aside, there = *(np.empty_like(along) for _ in range(3)), np.empty(along.shape, bool)

    def compare(rows: slice) -> None:
        near, own = beside(rows, POLISH.surroundings_px, len(along))
        fetched, both_seen = target.sample(second, *lines.target(along, across, near))
        both_seen &= shown[near]
        gray, gx, gy = cv2.split(fetched)
        a, b, share = _without_means(first[near], gray, both_seen)
        gain = _mean_there(a * b, share)[own]
        gain += POLISH.gain_noise
        gain /= _mean_there(b * b, share)[own] + POLISH.gain_noise
        np.clip(gain, np.float32(1 / POLISH.max_gain), np.float32(POLISH.max_gain), out=gain)
        there[rows] = both_seen[own]
        np.multiply(gain, b[own], out=left[rows])
        np.subtract(a[own], left[rows], out=left[rows])
        left[rows] *= there[rows]
        gx, gy = gx[own] * gain, gy[own] * gain
        x, y = (lines.direction[rows, :, k] for k in (0, 1))
        np.add(gx * x, gy * y, out=slope[rows])
        np.subtract(gy * x, gx * y, out=aside[rows])

    each(compare, _strips(len(along)))
    some = np.abs(left[::4, ::4][there[::4, ::4]])
    typical = float(np.median(some)) if some.size else 0.0
    return _Compared(left, slope, aside, there, np.float32(max(POLISH.min_usual, POLISH.usual_factor * typical)))


def _strips(rows: int) -> list[slice]:
    """Rows that are worked on at once, so that what is made of them stays near the processor."""
    return [slice(top, min(top + POLISH.strip_rows, rows)) for top in range(0, rows, POLISH.strip_rows)]


def _mean(values: Plane, side: int) -> Plane:
    mean: Plane = cv2.blur(values, (side, side), borderType=cv2.BORDER_REFLECT_101)
    return mean


def _mean_there(values: Plane, share: Plane | None) -> Plane:
    """The mean of the surroundings of which a share (None: all) is seen, of values that are 0 elsewhere."""
    mean = _mean(values, POLISH.surroundings_px)
    return mean if share is None else np.divide(mean, share, out=mean)


def _without_means(a: Plane, b: Plane, there: NDArray[np.bool_]) -> tuple[Plane, Plane, Plane | None]:
    """Both without their local mean, 0 where they are not there, and the share of the surroundings that is: None where
    all is."""
    if there.all():
        return a - _mean(a, POLISH.surroundings_px), b - _mean(b, POLISH.surroundings_px), None
    weight = there.astype(np.float32)
    share = np.maximum(_mean(weight, POLISH.surroundings_px), np.float32(1e-3))
    a, b = ((values - _mean_there(values * weight, share)) * weight for values in (a, b))
    return a, b, share


def _smooth_step(wanted: Plane, evidence: Plane, step: float) -> Plane:
    """A step across the lines: evidence gathered over a wide window; where there is little, little is done."""
    rows, columns = wanted.shape
    small = max(1, columns // POLISH.across_step), max(1, rows // POLISH.across_step)
    width = max(1.0, POLISH.across_width * np.sqrt(rows * columns) / POLISH.across_step)

    def gathered(values: Plane) -> Plane:
        smooth: Plane = cv2.GaussianBlur(cv2.resize(values, small, interpolation=cv2.INTER_AREA), (0, 0), width)
        return smooth

    wanted, evidence = gathered(wanted), gathered(evidence)
    coarse = np.clip(
        wanted / (evidence + POLISH.across_damping * evidence.mean() + 1e-6), -POLISH.max_step_px, POLISH.max_step_px
    )
    step_across: Plane = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return step_across
