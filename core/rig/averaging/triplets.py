"""Triangles of pairs: rotations around them must close, or one of the three is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from .graph import Pair, is_bridge
from .options import AVERAGING
from .turns import degrees_between


@dataclass(frozen=True, eq=False)
class Triangles:
    """links (T, 3): numbers of the pairs; misfit (T,): how far the best choice of their candidates is from closing, in
    units of what it may be off."""

    links: NDArray[np.intp]
    misfit: Array


def triangles(pairs: Sequence[Pair], choices: Sequence[Array], degrees: Array) -> Triangles:
    """All triangles of pairs.

    Parameters
    ----------
    pairs : sequence of (int, int)
        From which to which picture.
    choices : sequence of (C, 3, 3)
        The rotations that each pair may have.
    degrees : (P,)
        Their standard deviations.

    Returns
    -------
    Triangles
    """
    number = {pair: k for k, pair in enumerate(pairs)} | {(j, i): k for k, (i, j) in enumerate(pairs)}
    beside: dict[int, set[int]] = {}
    for i, j in pairs:
        beside.setdefault(i, set()).add(j)
        beside.setdefault(j, set()).add(i)
    links, misfits = [], []
    for i in sorted(beside):
        for j in sorted(other for other in beside[i] if other > i):
            for k in sorted(other for other in beside[i] & beside[j] if other > j):
                corners = ((i, j), (j, k), (k, i))
                three = [number[corner] for corner in corners]
                around = [
                    choices[n] if pairs[n] == corner else np.swapaxes(choices[n], 1, 2)
                    for n, corner in zip(three, corners, strict=True)
                ]
                loops = around[2][:, None, None] @ around[1][:, None] @ around[0]
                allowed = AVERAGING.triangle_degrees + AVERAGING.triangle_sigmas * np.linalg.norm(degrees[three])
                links.append(three)
                misfits.append(degrees_between(loops, np.eye(3)).min() / allowed)
    return Triangles(np.array(links, np.intp).reshape(-1, 3), np.array(misfits))


def closing(found: Triangles, count: int, used: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """Of each of `count` pairs, by triangles of used pairs only: the least misfit (infinite without any), and how many
    close."""
    least, closed = np.full(count, np.inf), np.zeros(count, np.intp)
    alive = used[found.links].all(axis=1)
    for column in found.links[alive].T:
        np.minimum.at(least, column, found.misfit[alive])
        np.add.at(closed, column, found.misfit[alive] < 1)
    return least, closed


def without_contradicted(
    nodes: int, pairs: Sequence[Pair], found: Triangles, degrees: Array, given: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Which of the given pairs stay (P,) when those go none of whose triangles closes; how many triangles close for
    each.

    The least certain goes first, since it may be why others do not close; one without which pictures would fall apart
    stays.
    """
    used = given.copy()
    while True:
        least, closed = closing(found, len(pairs), used)
        contradicted = np.flatnonzero(used & np.isfinite(least) & (least > 1))
        kept = [pairs[k] for k in np.flatnonzero(used)]
        for k in contradicted[np.argsort(-degrees[contradicted] / np.sqrt(1 + closed[contradicted]), kind="stable")]:
            if not is_bridge(nodes, kept, pairs[k]):
                used[k] = False
                break
        else:
            return used, closed
