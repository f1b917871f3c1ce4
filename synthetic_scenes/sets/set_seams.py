"""Whether borders between pictures show as steps of tone that the world does not have."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .set_measures import Found, percentile

# px of the sphere on each side of a border over which tones are averaged: more than grain, less than shading.
SIDE_PX = 4


def seam_figures(found: Found, exposed: NDArray[np.uint8], where: NDArray[np.bool_]) -> dict[str, float]:
    """`seam_steps` of a panorama as the true sphere lies (H, W, 3), exposed like it, where it shows what is seen."""
    return seam_steps(np.where(where, found.labels_on_sphere, -1), exposed, found.truth.picture)


def seam_steps(labels: NDArray[np.int16], picture: NDArray[np.uint8], true: NDArray[np.uint8]) -> dict[str, float]:
    """seam_levels, seam_p90_levels: along all borders between labels (H, W; −1: not judged), by how much the mean step
    across them differs from the true picture's at the same place, levels of 8 bit, worst channel (median, 90th
    percentile)."""
    error = picture.astype(np.float32) - true
    everything, first, second = slice(None), slice(-1), slice(1, None)
    pairs = [((everything, first), (everything, second)), ((first, everything), (second, everything))]
    border = [(labels[a] != labels[b]) & (labels[a] >= 0) & (labels[b] >= 0) for a, b in pairs]
    sides = [[np.zeros((int(part.sum()), 3), np.float32) for part in border] for _ in range(2)]
    box = (2 * SIDE_PX + 1, 2 * SIDE_PX + 1)
    for label in np.unique(labels[labels >= 0]):
        own = (labels == label).astype(np.float32)
        weight = cv2.boxFilter(own, -1, box, normalize=False)
        mean = cv2.boxFilter(error * own[..., None], -1, box, normalize=False) / np.maximum(weight, 1)[..., None]
        for k, (pair, part) in enumerate(zip(pairs, border, strict=True)):
            for side, place in zip(sides, pair, strict=True):
                mine = labels[place][part] == label
                side[k][mine] = mean[place][part][mine]
    steps = np.concatenate([np.abs(a - b).max(axis=1) for a, b in zip(*sides, strict=True)])
    return {"seam_levels": percentile(steps, 50), "seam_p90_levels": percentile(steps, 90)}
