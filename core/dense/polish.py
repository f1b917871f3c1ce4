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
from .matching import View

# (blur of both pictures in px, steps at it)
SCHEDULE = ((1.0, 2), (0.6, 1))
# Rows of nodes that are worked on at once. Means of what has lost its local mean take two windows beside them.
STRIP = 128
WINDOW, SURROUNDINGS = 5, 15
SMOOTHNESS = 1.5
# squared gradient (gray levels per px) below which a place says little of its own; in the same unit what the search
# itself is worth, and what counts at least between neighbours
LITTLE_EVIDENCE, BELIEF, LEAST_BELIEF = 25.0, 15.0, 10.0
# what is sought across the lines varies over this share of the picture's side, at most so many px
ACROSS, COARSE = 0.03, 8


@dataclass(frozen=True)
class Polished:
    """Moves (h, w) px along the lines and across them; likeness (h, w): correlation of the two pictures around each
    node, 0 where the target shows nothing; evidence (h, w) 0..1: how much texture says so."""

    along: Plane
    across: Plane
    likeness: Plane
    evidence: Plane


def polish(
    lines: EpipolarLines, reference: View, target: View, along: Plane, known: Plane,
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], slack: bool,
) -> Polished:  # fmt: skip
    """Starts at moves `along` (h, w) px.

    known (h, w) 0..1: how well, so that guesses do not pull at what was found; weights: see `edge_weights`; slack:
    whether the lines may be left.
    """
    across = np.zeros_like(along)
    start = along
    smoother = Smoother.of(weights, SMOOTHNESS)
    steps_px = target.gray.shape[1] / target.size[0], target.gray.shape[0] / target.size[1]
    share, wanted = np.empty_like(along), np.empty_like(along)
    for blur, count in SCHEDULE:
        first, shown = reference.at_nodes(cv2.GaussianBlur(reference.gray, (0, 0), blur), lines)
        smooth = cv2.GaussianBlur(target.gray, (0, 0), blur)
        slopes = [cv2.Scharr(smooth, cv2.CV_32F, 1 - k, k, scale=steps_px[k] / 32) for k in (0, 1)]
        second = cv2.merge([smooth, *slopes])
        for _ in range(count):
            seen = _compared(lines, first, shown, target, second, along, across)

            def move(rows: slice, seen: _Compared = seen, along: Plane = along) -> None:
                """What these rows want and how much that counts, into `wanted` and `share`."""
                near, own = beside(rows, WINDOW // 2, len(along))
                told = seen.trust(near)
                told *= seen.slope[near]
                pull = _mean(told * seen.left[near], WINDOW)[own]
                told *= seen.slope[near]
                evidence = _mean(told, WINDOW)[own]
                pull += np.float32(BELIEF) * (start[rows] - along[rows])
                pull /= evidence + np.float32(BELIEF + 1)
                np.add(along[rows], np.clip(pull, -1, 1, out=pull), out=wanted[rows])
                np.divide(evidence + np.float32(LEAST_BELIEF), evidence + np.float32(LITTLE_EVIDENCE), out=share[rows])
                share[rows] *= known[rows]

            each(move, _strips(len(along)))
            along = smoother.smoothed(wanted, share, floor=1e-4)
            if slack:
                trust = seen.trust(slice(None)) * seen.aside
                across = across + _smooth_step(trust * seen.left, trust * seen.aside, lines.step)
    return Polished(along, across, likeness(lines, reference, target, along, across), share)


def likeness(lines: EpipolarLines, reference: View, target: View, along: Plane, across: Plane | None = None) -> Plane:
    """Correlation (h, w) of the two pictures around each node after moves along and across its line, 0 where the target
    shows nothing."""
    first, shown = reference.at_nodes(reference.gray, lines)
    out = np.empty_like(along)

    def compare(rows: slice) -> None:
        near, here = beside(rows, SURROUNDINGS, len(along))
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
    lines: EpipolarLines, first: Plane, shown: NDArray[np.bool_], target: View, second: NDArray[np.float32],
    along: Plane, across: Plane,
) -> _Compared:  # fmt: skip
    """The reference at the nodes (h, w) beside the target and its slopes (h', w', 3) where the moves lead."""
    left, slope, aside, there = *(np.empty_like(along) for _ in range(3)), np.empty(along.shape, bool)

    def compare(rows: slice) -> None:
        near, own = beside(rows, SURROUNDINGS, len(along))
        fetched, both_seen = target.sample(second, *lines.target(along, across, near))
        both_seen &= shown[near]
        gray, gx, gy = cv2.split(fetched)
        a, b, share = _without_means(first[near], gray, both_seen)
        gain = _mean_there(a * b, share)[own]
        gain += 25
        gain /= _mean_there(b * b, share)[own] + 25
        np.clip(gain, np.float32(0.5), np.float32(2), out=gain)
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
    return _Compared(left, slope, aside, there, np.float32(max(2.0, 1.5 * typical)))


def _strips(rows: int) -> list[slice]:
    """Rows that are worked on at once, so that what is made of them stays near the processor."""
    return [slice(top, min(top + STRIP, rows)) for top in range(0, rows, STRIP)]


def _mean(values: Plane, side: int) -> Plane:
    return cv2.blur(values, (side, side), borderType=cv2.BORDER_REFLECT_101)


def _mean_there(values: Plane, share: Plane | None) -> Plane:
    """The mean of the surroundings of which a share (None: all) is seen, of values that are 0 elsewhere."""
    mean = _mean(values, SURROUNDINGS)
    return mean if share is None else np.divide(mean, share, out=mean)


def _without_means(a: Plane, b: Plane, there: NDArray[np.bool_]) -> tuple[Plane, Plane, Plane | None]:
    """Both without their local mean, 0 where they are not there, and the share of the surroundings that is: None where
    all is."""
    if there.all():
        return a - _mean(a, SURROUNDINGS), b - _mean(b, SURROUNDINGS), None
    weight = there.astype(np.float32)
    share = np.maximum(_mean(weight, SURROUNDINGS), np.float32(1e-3))
    a, b = ((values - _mean_there(values * weight, share)) * weight for values in (a, b))
    return a, b, share


def _smooth_step(wanted: Plane, evidence: Plane, step: float) -> Plane:
    """A step across the lines: evidence gathered over a wide window; where there is little, little is done."""
    rows, columns = wanted.shape
    small = max(1, columns // COARSE), max(1, rows // COARSE)
    width = max(1.0, ACROSS * np.sqrt(rows * columns) / COARSE)

    def gathered(values: Plane) -> Plane:
        return cv2.GaussianBlur(cv2.resize(values, small, interpolation=cv2.INTER_AREA), (0, 0), width)

    wanted, evidence = gathered(wanted), gathered(evidence)
    coarse = np.clip(wanted / (evidence + 0.5 * evidence.mean() + 1e-6), -1, 1)
    return cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
