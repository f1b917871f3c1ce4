"""What it costs each node of a patch to lie at each of many inverse ranges, and the best of them.

The picture that shows a node best is compared with the others at every inverse range (plane sweep: Collins, CVPR 1996).
Of those that see a node the best two count, for something nearer may hide it from one; semi-global matching then finds
the surface through these costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane
from ..options import REFINE
from .choice import Compared, Levels
from .options import SWEEP
from .semi_global import summed_costs

# Gray levels of colours and a mask: the mean of the first three.
MEAN_OF_COLOURS = np.array([[1 / 3, 1 / 3, 1 / 3, 0]], np.float32)
UNSEEN = 255


@dataclass(frozen=True, eq=False)
class Swept:
    """What the search found at the nodes (h, w) of a patch.

    along: px from the base to the best place; cost: levels of difference there; summed: the same along all paths;
    field_cost: levels of difference where the field lies; unique: whether no other place is nearly as good.
    """

    along: Plane
    cost: NDArray[np.uint8]
    summed: NDArray[np.uint16]
    field_cost: NDArray[np.uint8]
    unique: NDArray[np.bool_]


def swept(compared: Compared, least: int, most: int) -> Swept:
    """Search all inverse ranges from `least` to `most` px from the base."""
    costs = _costs(compared, range(least, most + 1))
    sums = summed_costs(costs, SWEEP.step_cost, _jump_costs(compared))
    best = sums.argmin(axis=0)
    lowest = np.take_along_axis(sums, best[None], 0)[0]
    second = np.full(best.shape, np.iinfo(np.uint16).max, np.uint16)
    beyond = compared.infinity_px - least  # levels below it all lie at infinity
    for level, values in enumerate(sums):
        np.minimum(second, values, out=second, where=(np.abs(best - level) > SWEEP.beside) & (level >= beyond))
    middle = np.clip(best, 1, max(1, len(sums) - 2))
    before, at, after = (np.take_along_axis(sums, middle[None] + k, 0)[0].astype(np.float32) for k in (-1, 0, 1))
    # the vertex of a parabola through three costs
    offset = np.clip((before - after) / (2 * np.maximum(before - 2 * at + after, 1)), -0.5, 0.5)
    field = np.clip(np.rint(compared.field_px).astype(int) - least, 0, len(costs) - 1)
    return Swept(
        (least + middle + offset).astype(np.float32), np.take_along_axis(costs, best[None], 0)[0], lowest,
        np.take_along_axis(costs, field[None], 0)[0], second > SWEEP.uniqueness * lowest,
    )  # fmt: skip


def _costs(compared: Compared, moves: Sequence[int]) -> NDArray[np.uint8]:
    """Costs (K, h, w) at moves px from the base; where only one picture shows the field, those of the field's place."""
    out = np.empty((len(moves), *compared.owner.shape), np.uint8)
    plain = lack_of_texture(compared.best(compared.sampled(compared.field))[..., :3])
    at_rim = SWEEP.rim_levels * plain + SWEEP.rim_levels_textured * (1 - plain)
    levels_of_prior = SWEEP.prior_levels + at_rim * (1 - np.minimum(compared.from_rim, 1))
    for k, move in enumerate(moves):
        d = np.maximum(compared.coarse_base + move * compared.coarse_per_px, 0)
        taken = [
            seen.sampled_at(d, levels) for seen, levels in zip(compared.seen, compared.levels, strict=True)
        ]
        cost = difference(compared, taken, SWEEP.window)[0]
        prior = np.abs(move - compared.field_px)
        prior *= np.float32(1 / SWEEP.prior_px)
        prior = np.minimum(prior, np.float32(1)) * levels_of_prior
        out[k] = np.where(compared.several, cost + prior, SWEEP.most_levels * (prior > 0))
    return out


def difference(
    compared: Compared, taken: Sequence[Levels], window: int = 1, hidden: Sequence[NDArray[np.bool_]] = ()
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Gray levels (h, w) by which pictures (h, w, 4) differ from the one that shows a node best, `most_levels` where no
    other does, and how many (h, w) do; hidden: what each does not see."""
    best = compared.best(taken)
    known = cv2.inRange(best[..., 3], 255, 255)
    first = np.full(compared.owner.shape, UNSEEN, np.uint8)
    second, count = first.copy(), np.zeros_like(first)
    for number, (levels, mask) in enumerate(zip(taken, compared.masks, strict=True)):
        apart = cv2.min(cv2.transform(cv2.absdiff(levels, best), MEAN_OF_COLOURS), SWEEP.most_levels)
        if window > 1:
            apart = cv2.blur(apart, (window, window))
        shown = cv2.inRange(levels[..., 3], 255, 255)
        shown = cv2.bitwise_and(cv2.bitwise_and(shown, known), (1 - mask) * np.uint8(255))
        if hidden:
            shown[hidden[number]] = 0
        apart = cv2.bitwise_or(apart, cv2.bitwise_not(shown))
        count += shown >> 7
        second = cv2.min(second, cv2.max(first, apart))
        first = cv2.min(first, apart)
    # one: that one; two: mostly the better; more: the better two
    two, more = (cv2.addWeighted(first, share, second, 1 - share, 0) for share in (2 / 3, 1 / 2))
    apart = np.select([count == 0, count == 1, count == 2], [np.uint8(SWEEP.most_levels), first, two], more)
    return apart, count


def lack_of_texture(levels: Levels) -> Plane:
    """Lack of texture (h, w) around nodes of colours (h, w, 3), gray levels: 0 for much, 1 for none."""
    gray = cv2.transform(levels.astype(np.float32), MEAN_OF_COLOURS[:, :3])
    gray = cv2.GaussianBlur(gray, (0, 0), 1.0)
    slope = np.zeros_like(gray)
    for k in (0, 1):
        slope += np.square(cv2.Scharr(gray, cv2.CV_32F, 1 - k, k, scale=1 / 32))
    plain: Plane = REFINE.half_texture / (REFINE.half_texture + cv2.blur(slope, (7, 7)))
    return plain


def _jump_costs(compared: Compared) -> NDArray[np.int16]:
    """P2 (h, w): less where the picture has an edge."""
    best = compared.best(compared.sampled(compared.field))
    gray = cv2.cvtColor(best[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32)
    slope = np.hypot(*(cv2.Sobel(gray, cv2.CV_32F, 1 - k, k, scale=1 / 8) for k in (0, 1)))
    jump = SWEEP.jump_cost / (1 + slope / np.float32(SWEEP.edge_levels))
    least = SWEEP.step_cost + 2
    costs: NDArray[np.int16] = np.maximum(jump, least).astype(np.int16)
    return costs
