"""Semi-global matching through given costs: Hirschmüller, IEEE TPAMI 2008."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Costs = NDArray[np.uint8]


def summed_costs(costs: Costs, step: int, jump: NDArray[np.int16]) -> NDArray[np.uint16]:
    """Sum the least costs of paths to each node from eight directions.

    Parameters
    ----------
    costs : (K, h, w) uint8
        Of K levels at each node.
    step : int
        P1 of the paper: of a change by one level between neighbours.
    jump : (h, w) int16
        P2 at each node: of any larger change; not less than `step`.

    Returns
    -------
    (K, h, w) uint16
    """
    sums = np.zeros(costs.shape, np.uint16)
    for back in (False, True):
        for beside in (0, 1, -1):
            _add_paths(costs, sums, step, jump, back, beside)
    turned = np.ascontiguousarray(costs.transpose(0, 2, 1))
    turned_sums = np.zeros(turned.shape, np.uint16)
    for back in (False, True):
        _add_paths(turned, turned_sums, step, np.ascontiguousarray(jump.T), back, 0)
    sums += turned_sums.transpose(0, 2, 1)
    return sums


def _add_paths(
    costs: Costs, sums: NDArray[np.uint16], step: int, jump: NDArray[np.int16], back: bool, beside: int
) -> None:
    """Adds the costs (K, n, m) of paths that run along the second axis, or back, from the neighbour that lies `beside`
    (0, 1 or −1) along the third."""
    count = costs.shape[1]
    before: NDArray[np.int16] | None = None
    for line in range(count - 1, -1, -1) if back else range(count):
        here = costs[:, line].astype(np.int16)
        if before is not None:
            if beside:
                before = np.roll(before, beside, axis=1)
                before[:, 0 if beside > 0 else -1] = before[:, 1 if beside > 0 else -2]
            least = before.min(axis=0)
            through = np.minimum(before, least + jump[line])
            np.minimum(through[1:], before[:-1] + np.int16(step), out=through[1:])
            np.minimum(through[:-1], before[1:] + np.int16(step), out=through[:-1])
            through -= least
            here += through
        sums[:, line] += here.view(np.uint16)
        before = here
