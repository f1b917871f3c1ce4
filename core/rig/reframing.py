"""The same rig in another order of its pictures, which is the frame of another one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ..cameras.bodies import bodies_of
from ..cameras.rig import Registration, Rig
from ..choices import CENTRE
from ..pictures.naming import number_of
from ..system.errors import BadRequest, NoOverlap


def seen_from(
    registration: Registration, viewpoint: int | str | None, names: Sequence[str], shown_by: Sequence[int]
) -> Registration:
    """The same rig in the frame of the viewpoint, which comes first, then the others in the order of their numbers.

    Parameters
    ----------
    registration : Registration
        Of the same pictures always in the same frame and order, so that what comes out is the same to the last bit
        however they were given.
    viewpoint : int, str or None
        A picture's number among those that were given, from 1, its name, or CENTRE; None is the first.
    names : sequence of str
        Of all pictures.
    shown_by : sequence of int
        Of each picture that was given, its number among these.

    Returns
    -------
    Registration

    Raises
    ------
    BadRequest
        There is no such picture.
    NoOverlap
        It is not in the rig.
    """
    numbers = registration.numbers
    if viewpoint is None:
        asked = min(numbers)
    elif viewpoint == CENTRE and CENTRE not in names:
        asked = numbers[best_connected(registration.rig)]
    elif isinstance(viewpoint, int):
        if viewpoint > len(shown_by):
            raise BadRequest(f"the viewpoint is picture {viewpoint}, and only {len(shown_by)} are given")
        asked = shown_by[viewpoint - 1]
    else:
        asked = number_of(str(viewpoint), names, "--viewpoint")
    if asked not in numbers:
        raise NoOverlap(
            f"{names[asked]} cannot be the viewpoint, since it does not connect with the others: "
            f"{registration.left_out[asked]}; choose another one, or --viewpoint centre"
        )
    order = sorted(range(len(numbers)), key=lambda place: (numbers[place] != asked, numbers[place]))
    return replace(
        registration, rig=reordered(registration.rig, order), numbers=tuple(numbers[place] for place in order)
    )


def reordered(rig: Rig, order: Sequence[int]) -> Rig:
    """The rig with its pictures in another order, in the frame of the one that is first then.

    Parameters
    ----------
    rig : Rig
    order : sequence of int
        Numbers of all its pictures; the first is the one whose frame it will be.

    Returns
    -------
    Rig
        The longest t has length 1 again, or all are 0.
    """
    first = order[0]
    turn, shift = rig.R[first], rig.t[first]
    R = rig.R @ turn.T
    t = rig.t - R @ shift
    t[first] = 0.0
    longest = float(np.linalg.norm(t, axis=1).max()) or 1.0
    # as homogeneous points (r, ρ), which include those at infinity
    turned = rig.rays @ turn.T
    moved = turned + rig.inverse_ranges[:, None] * shift
    lengths = np.maximum(np.linalg.norm(moved, axis=1), np.finfo(np.float64).tiny)
    # the derivative of ρ / |R r + ρ t| by ρ
    shrinks = np.abs((moved * turned).sum(axis=1)) / lengths**3
    framed = replace(
        rig,
        R=R,
        t=t / longest,
        rays=moved / lengths[:, None],
        inverse_ranges=rig.inverse_ranges / lengths * longest,
        deviations=rig.deviations * shrinks * longest,
        position_deviation=rig.position_deviation / longest,
    )
    return framed.renumbered(order)


def best_connected(rig: Rig) -> int:
    """The number of the picture from which all others are reached over the strongest edges: an edge is as long as one
    over the number of its inliers, and the sum of the ways to all others is the shortest; of a sphere its front."""
    count, bodies = len(rig), bodies_of(rig.cameras)
    # int32 is what SciPy's graphs take; a length of 0 is no link to them
    i, j = np.array([*((edge.i, edge.j) for edge in rig.edges), *bodies.pairs], np.int32).T
    lengths = [*(1 / edge.inliers for edge in rig.edges), *[1e-9] * len(bodies.pairs)]
    ways = dijkstra(coo_array((lengths, (i, j)), (count, count)).tocsr(), directed=False)
    return int(bodies.of[np.argmin(ways.sum(axis=1))])
