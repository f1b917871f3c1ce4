"""A match set by hand, moved to where the target really shows the same. No bpy."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...core.raster.arrays import Array

# Half sides, px: of the patch that is compared, and of the square that it is looked for in.
PATCH, SEARCH = 10, 12
# Correlation below which two patches are not the same thing, and the click stands.
LEAST = 0.75
# Towards the fraction of a px.
STEPS = 8


def fine_tuned(reference: NDArray[np.float32], target: NDArray[np.float32], x: Array, y: Array) -> tuple[Array, float]:
    """Where in the target the surroundings of x are found near y, to a fraction of a px, and how well (−1..1).

    reference, target (H, W): brightness; x, y (2,) px. y comes back as it was where nothing fits well enough, the best
    place lies at the search's rim, or a patch reaches over a border. Normalised cross-correlation (Lewis 1995), then
    least squares.
    """
    patch = _around(reference, x, PATCH)
    window = _around(target, y, PATCH + SEARCH)
    if patch is None or window is None or np.ptp(patch) == 0:
        return y, -1.0
    patch = patch - patch.mean()
    places = sliding_window_view(window, patch.shape)
    sums = np.einsum("ijkl,kl->ij", places, patch)
    energy = places.var(axis=(2, 3)) * patch.size
    score = sums / np.sqrt(np.maximum(energy * (patch**2).sum(), 1e-12))
    row, column = (int(place) for place in np.unravel_index(int(score.argmax()), score.shape))
    best = float(score[row, column])
    if best < LEAST or not (0 < row < 2 * SEARCH and 0 < column < 2 * SEARCH):
        return y, best
    moved = np.array([column, row]) + _fraction(patch, window, column, row) - SEARCH
    # the patch was cut at whole pixels, around where x was rounded to
    return np.rint(y) + moved + (x - np.rint(x)), best


def _fraction(patch: Array, window: Array, column: int, row: int) -> Array:
    """(x, y) of at most a px to add to a whole place in the window, so that gain·patch + offset meets it best: Gauss
    and Newton's way, the patch's own gradient in place of the window's (Baker and Matthews 2004)."""
    size = len(patch)
    slopes = np.stack([*np.gradient(patch)[::-1], patch, np.ones_like(patch)], axis=-1).reshape(-1, 4)
    step = np.linalg.pinv(slopes)
    at = np.zeros(2)
    for _ in range(STEPS):
        x, y = column + at[0], row + at[1]
        left, top = (min(max(int(np.floor(value)), 0), len(window) - size - 1) for value in (x, y))
        u, v = x - left, y - top
        cut = window[top : top + size + 1, left : left + size + 1]
        across = (1 - u) * cut[:, :-1] + u * cut[:, 1:]
        a, b, gain, _ = step @ ((1 - v) * across[:-1] + v * across[1:]).ravel()
        at = np.clip(at - np.array([a, b]) / gain, -1, 1)
    return at


def _around(picture: NDArray[np.float32], point: Array, half: int) -> Array | None:
    column, row = (int(value) for value in np.rint(point))
    if row < half or column < half or row + half >= picture.shape[0] or column + half >= picture.shape[1]:
        return None
    return picture[row - half : row + half + 1, column - half : column + half + 1].astype(np.float64)
