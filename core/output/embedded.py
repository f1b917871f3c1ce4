"""Pictures inside a page."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def jpeg_uri(pixels: NDArray[np.uint8]) -> str:
    """A picture (H, W, 1 or 3) uint8 RGB as the address of a JPEG that is the address itself."""
    stored: NDArray[Any] = cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR) if pixels.shape[2] == 3 else pixels
    return "data:image/jpeg;base64," + b64encode(cv2.imencode(".jpg", stored)[1].tobytes()).decode()
