"""Light as the eye takes differences in it: logarithmic, without losing black, without an end at white.

Blending and comparing happen on these tones: a lamp of a thousand times white weighs a few tones, not a thousand, so
that neither seams nor bands of a pyramid follow highlights alone. Tones of 0 to 1 run close to those of sRGB.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Light (of white 1) below which tones run linear.
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
