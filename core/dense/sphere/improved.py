"""Moves go back to the field where they make the pictures less alike than the field does."""

from __future__ import annotations

import numpy as np

from ...raster.arrays import Plane
from ..edge_aware_smoothing import Smoother, Weights
from .choice import Compared
from .options import IMPROVED, SWEEP
from .sweep import difference


def where_improved(compared: Compared, along: Plane, edges: Weights) -> Plane:
    """Keep what makes pictures more alike.

    What was found may be wrong where a picture ends or repeats itself, and what was filled in is a guess.

    Parameters
    ----------
    compared : Compared
    along : (h, w) float32
        Moves, px.
    edges : pair of float32 arrays
        Connections of neighbours in the picture (see `edge_weights`): what is of one colour goes back together.

    Returns
    -------
    (h, w) float32
    """
    own, at_field = (
        difference(compared, compared.sampled(compared.at(moves)), SWEEP.window)[0].astype(np.float32)
        for moves in (along, compared.field_px)
    )
    several = compared.several.astype(np.float32)
    gain = np.clip(at_field - own, -IMPROVED.most_levels, IMPROVED.most_levels) * several
    gain, share = Smoother.of(edges, IMPROVED.smoothness, passes=1).averaged([gain, several])
    gain /= share + np.float32(IMPROVED.least_share)
    kept = np.clip(1 + gain / np.float32(IMPROVED.doubt_levels), 0, 1)
    improved: Plane = compared.field_px + kept * (along - compared.field_px)
    return improved
