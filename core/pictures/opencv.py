"""OpenCV's decoders, which print what they stumble over and go on: here it is heard, and nothing of it is shown."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.errors import UnreadableImage
from ..system.streams import overheard

# What libjpeg says of damage. Cameras pad before the end marker, which is none: see `_padded`.
_JPEG_DAMAGE = re.compile(
    r"Corrupt JPEG data(?!: bad ICC)|Premature end of JPEG|Inconsistent progression|Invalid (SOS|progressive)"
)
_JPEG_REST = re.compile(r"Corrupt JPEG data: (\d+) extraneous bytes before marker 0xd9")
_LIBRARY = re.compile(
    r"Corrupt JPEG|Premature end of|Inconsistent progression|Invalid (SOS|progressive)|Unsupported marker|"
    r"Unknown Adobe|Warning: unknown JFIF|Application transferred|libpng |TIFF|\[ *(WARN|ERROR|INFO|DEBUG|FATAL)[:@]"
)


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """OpenCV reports damaged files on stderr by itself; the user gets our message instead."""
    # from 4.13 on these two stand in a module of their own
    log = cv2 if hasattr(cv2, "getLogLevel") else cv2.utils.logging
    level = log.getLogLevel()
    log.setLogLevel(0)
    try:
        yield
    finally:
        log.setLogLevel(level)


def decoded(data: bytes) -> NDArray[Any] | None:
    """Raw samples of an encoded picture as OpenCV has them (B, G, R, A), not turned; None where it cannot read it.

    Raises UnreadableImage where the picture data of a JPEG are damaged.
    """
    try:
        with overheard(lambda line: _LIBRARY.search(line) is not None) as lines, quiet_opencv():
            # Unchanged: depth and alpha stay, and OpenCV leaves the orientation of JPEG and PNG alone.
            raw: NDArray[Any] | None = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):
        return None
    if data[:2] == b"\xff\xd8" and any(_JPEG_DAMAGE.match(line) and not _padded(data, line) for line in lines):
        raise UnreadableImage(
            "the JPEG file is damaged: its picture data make no sense from some place on; copy or export it again"
        )
    return raw


def _padded(data: bytes, line: str) -> bool:
    """Whether the bytes that libjpeg has no use for before the end marker are all the same: they fill up."""
    rest = _JPEG_REST.match(line)
    if rest is None:
        return False
    filling = data[: data.rfind(b"\xff\xd9")][-int(rest[1]) :]
    return len(set(filling)) == 1
