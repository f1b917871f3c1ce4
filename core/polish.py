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

from .edge_aware import Smoother
from .line_map import Lines, Plane
from .line_search import View

# (blur of both pictures in px, steps at it)
SCHEDULE = ((1.0, 1), (0.6, 2))
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
    lines: Lines, reference: View, target: View, along: Plane, known: Plane,
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], slack: bool,
) -> Polished:  # fmt: skip
    """Starts at moves `along` (h, w) px.

    known (h, w) 0..1: how well, so that guesses do not pull at what was found; weights: see `edge_weights`; slack:
    whether the lines may be left.
    """
    across = np.zeros_like(along)
    start = along
    nodes = lines.nodes
    smoother = Smoother.of(weights, SMOOTHNESS)
    steps_px = target.gray.shape[1] / target.size[0], target.gray.shape[0] / target.size[1]
    for blur, count in SCHEDULE:
        first, shown = reference.sample(cv2.GaussianBlur(reference.gray, (0, 0), blur), *nodes)
        smooth = cv2.GaussianBlur(target.gray, (0, 0), blur)
        slopes = [cv2.Scharr(smooth, cv2.CV_32F, 1 - k, k) * (steps_px[k] / 32) for k in (0, 1)]
        second = np.stack([smooth, *slopes], axis=-1)
        for _ in range(count):
            fetched, inside = target.sample(second, *lines.target(along, across))
            there = (inside & shown).astype(np.float32)
            a, b, gain, _ = _alike(first, np.ascontiguousarray(fetched[..., 0]), there)
            gx, gy = gain * fetched[..., 1], gain * fetched[..., 2]
            left = (a - gain * b) * there
            typical = float(np.median(np.abs(left[::4, ::4][there[::4, ::4] > 0]))) if there.any() else 0.0
            trust = there / (1 + np.square(left / np.float32(max(2.0, 1.5 * typical))))
            slope = gx * lines.direction[..., 0] + gy * lines.direction[..., 1]
            evidence, wanted = _mean(trust * slope * slope, WINDOW), _mean(trust * slope * left, WINDOW)
            step = (wanted + np.float32(BELIEF) * (start - along)) / (evidence + np.float32(BELIEF + 1))
            share = (evidence + np.float32(LEAST_BELIEF)) / (evidence + np.float32(LITTLE_EVIDENCE)) * known
            along = smoother.smoothed(along + np.clip(step, -1, 1), share, floor=1e-4)
            if slack:
                slope = gy * lines.direction[..., 0] - gx * lines.direction[..., 1]
                across = across + _smooth_step(trust * slope * left, trust * slope * slope, lines.step)
    return Polished(along, across, likeness(lines, reference, target, along, across), share)


def likeness(lines: Lines, reference: View, target: View, along: Plane, across: Plane | None = None) -> Plane:
    """Correlation (h, w) of the two pictures around each node after moves along and across its line, 0 where the target
    shows nothing."""
    first, shown = reference.sample(reference.gray, *lines.nodes)
    fetched, inside = target.sample(target.gray, *lines.target(along, across))
    there = (inside & shown).astype(np.float32)
    return _alike(first, fetched, there)[3] * there


def _mean(values: Plane, side: int) -> Plane:
    return cv2.blur(values, (side, side), borderType=cv2.BORDER_REFLECT_101)


def _alike(a: Plane, b: Plane, there: Plane) -> tuple[Plane, Plane, Plane, Plane]:
    """Both without their local mean, the local gain from b to a, and their local correlation."""
    share = np.maximum(_mean(there, SURROUNDINGS), np.float32(1e-3))
    a, b = (values - _mean(values * there, SURROUNDINGS) / share for values in (a, b))
    both, own, other = (_mean(v * there, SURROUNDINGS) / share for v in (a * b, a * a, b * b))
    gain = np.clip((both + 25) / (other + 25), np.float32(0.5), np.float32(2))
    return a, b, gain, both / np.sqrt((own + 1) * (other + 1))


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
