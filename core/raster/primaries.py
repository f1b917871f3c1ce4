"""From the primaries that a file names to those of sRGB."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .arrays import Array

# CIE 1931 xy of red, green, blue and white of Rec. 709 and sRGB (ITU-R BT.709-6, IEC 61966-2-1).
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
# ICC profiles connect by this white (ICC.1:2010, 7.2.16), as XYZ.
D50 = (0.9642, 1.0, 0.8249)
# From XYZ to cone responses: K. M. Lam, Metamerism and Colour Constancy, 1985, as in ICC.1:2010, annex E.
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def rgb_to_xyz(chromaticities: Sequence[float]) -> Array:
    """The matrix (3, 3) from linear R, G, B to XYZ, white's Y being 1.

    Parameters
    ----------
    chromaticities : sequence of eight numbers
        CIE xy of red, green, blue and white.

    Raises
    ------
    ValueError
        They are no primaries: not finite, on one line, or without a white between them.
    """
    xy: Array = np.asarray(chromaticities, np.float64).reshape(4, 2)
    if not np.isfinite(xy).all() or not xy[3, 1] > 0:
        raise ValueError("no primaries")
    columns = np.column_stack([xy, 1 - xy.sum(axis=1)]).T
    if abs(np.linalg.det(columns[:, :3])) < 1e-9:
        raise ValueError("no primaries")
    shares: Array = np.linalg.solve(columns[:, :3], columns[:, 3] / xy[3, 1])
    if shares.min() <= 0:
        raise ValueError("no primaries")
    matrix: Array = columns[:, :3] * shares
    return matrix


def adapted(white: Array, to: Array) -> Array:
    """Bradford's matrix (3, 3) that takes XYZ under one white to what looks the same under another, both XYZ (3,)."""
    gain = np.diag((_BRADFORD @ to) / (_BRADFORD @ white))
    matrix: Array = np.linalg.inv(_BRADFORD) @ gain @ _BRADFORD
    return matrix


def to_rec709(chromaticities: Sequence[float]) -> Array:
    """The matrix (3, 3) from linear R, G, B of these primaries to those of Rec. 709. Raises as `rgb_to_xyz` does."""
    own, wanted = rgb_to_xyz(chromaticities), rgb_to_xyz(REC709)
    matrix: Array = np.linalg.inv(wanted) @ adapted(own.sum(axis=1), wanted.sum(axis=1)) @ own
    return matrix


def columns_under_d50(chromaticities: Sequence[float]) -> list[list[float]]:
    """XYZ of red, green and blue of these primaries as they look under D50, as ICC profiles have them; those of sRGB
    where these are none."""
    try:
        matrix = rgb_to_xyz(chromaticities)
    except ValueError:
        matrix = rgb_to_xyz(REC709)
    columns: list[list[float]] = (adapted(matrix.sum(axis=1), np.array(D50)) @ matrix).T.tolist()
    return columns
