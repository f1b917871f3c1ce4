"""Kinds of JPEG that decoders do not read, by name."""

from __future__ import annotations

import re

from ..system.errors import UnreadableImage

_FRAME = re.compile(rb"\xff([\xc0-\xc3\xc5-\xc7\xc9-\xcb\xcd-\xcf])..(.)", re.DOTALL)
_LOSSLESS = (0xC3, 0xC7, 0xCB, 0xCF)


def refuse_unusual_jpeg(data: bytes) -> None:
    """Raises UnreadableImage for a JPEG that is coded without loss, or has more than 8 bits."""
    at = 2
    while data[at : at + 1] == b"\xff" and at + 4 <= len(data):
        frame = _FRAME.match(data, at)
        if frame is not None:
            if frame[1][0] in _LOSSLESS:
                raise UnreadableImage("JPEG without loss (of scanners and cameras' RAW) is not read; save it as TIFF")
            if frame[2][0] != 8:
                raise UnreadableImage(f"JPEG of {frame[2][0]} bits is not read; save it as a 16-bit TIFF or PNG")
            return
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
