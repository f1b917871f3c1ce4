"""Logarithmic encoding of light: about equal steps to the eye, linear near black, unbounded above white.

Pictures are compared and blended in it, so that very bright pixels do not dominate seams and pyramids: a lamp of a
thousand times white is encoded as about 3. Between 0 and 1 the encoding is close to that of sRGB.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Light, in units of white, below which the encoding is about linear.
TOE = 0.05
_WHITE = float(np.log1p(1 / TOE))


def log_encode(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """sign(x) ln(1 + |x| / TOE), scaled so that 0 and 1 stay what they are. Any shape, float32."""
    tones = np.abs(light)
    tones *= np.float32(1 / TOE)
    np.log1p(tones, out=tones)
    tones *= np.float32(1 / _WHITE)
    return np.copysign(tones, light, out=tones)


def log_decode(tones: NDArray[np.float32]) -> NDArray[np.float32]:
    """The inverse of `log_encode`, to a few units in the last place."""
    light = np.abs(tones)
    light *= np.float32(_WHITE)
    np.expm1(light, out=light)
    light *= np.float32(TOE)
    return np.copysign(light, tones, out=light)
