"""From the bytes of a file to raw samples: OpenCV and OpenEXR, with what they get wrong put right."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.errors import StitchError, UnreadableImage
from .containers import Structure, neutral_png, neutral_tiff
from .exr import read_exr
from .options import READING


def read_file(path: Path) -> bytes:
    """The bytes of a file. Raises UnreadableImage for what is missing, empty, a folder, a device or not permitted."""
    try:
        if path.is_dir():
            raise UnreadableImage("a folder, not a picture; name one file in it")
        if path.exists() and not path.is_file():
            raise UnreadableImage("not a regular file; copy the picture into one")
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise UnreadableImage("no such file; check the name") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UnreadableImage(f"cannot be opened: {reason}; check its permissions and the disk, or copy it") from error
    if not data:
        raise UnreadableImage("the file is empty; copy or export it again")
    return data


def check_size(width: int, height: int, stored: int, pixels_per_byte: int = READING.photograph_pixels_per_byte) -> None:
    """Raises UnreadableImage where a header promises no picture, one too large to hold (pixels), or more than a file of
    `stored` bytes can mean: pixels_per_byte (see `ReadingOptions`) (a decompression bomb, or a damaged header)."""
    if width < 1 or height < 1:
        raise UnreadableImage("the file is damaged: its header gives no size; copy or export it again")
    if width * height > READING.max_pixels or max(width, height) > READING.max_side:
        raise UnreadableImage(
            f"{width} × {height} pixels are too many: at most {READING.max_pixels // 10**6} megapixels and"
            f" {READING.max_side} pixels a side can be read; scale the picture down")
    if width * height > max(READING.small_pixels, pixels_per_byte * stored):
        raise UnreadableImage(
            f"{width} × {height} pixels cannot come out of {stored} bytes: the file is damaged or was made to fill the"
            " memory; copy or export it again")


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


def decode_file(data: bytes, structure: Structure) -> tuple[NDArray[Any], list[str]]:
    """Raw samples, and warnings.

    data: a whole file of the given structure (not EXR). Returns H×W×C (1 to 4) uint8, uint16 or float32 as stored, in
    R, G, B, A order, not turned. Raises UnreadableImage.
    """
    tiff, warnings = structure.tiff, []
    if structure.kind == "png":
        data = neutral_png(data)
    if tiff is not None:
        data = neutral_tiff(data)
        if tiff.photometric == 5 and tiff.bits > 8:
            raise UnreadableImage("CMYK of more than 8 bits cannot be read; convert the picture to RGB")
        if tiff.pages > 1:
            warnings.append(f"the TIFF file has {tiff.pages} pages; only the first is used")
        if tiff.samples == 2:
            warnings.append("the alpha of a gray TIFF file cannot be read; it is treated as opaque, with 8 bits")
    try:
        with quiet_opencv():
            # Unchanged: depth and alpha stay, and OpenCV leaves the orientation of JPEG and PNG alone.
            raw = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):
        raw = None
    if raw is None or raw.shape[:2] != (structure.height, structure.width):
        raise UnreadableImage(
            f"the {structure.kind.upper()} file cannot be decoded: it is damaged or of an unusual kind; open it in an"
            " image editor and save it as PNG or TIFF")
    if raw.dtype == np.float64:
        raw = raw.astype(np.float32)
    if raw.dtype not in (np.uint8, np.uint16, np.float32):
        raise UnreadableImage(f"{raw.dtype} samples cannot be read; save the picture with 8, 16 or (float) 32 bits")
    if raw.ndim == 2:
        raw = raw[..., None]
    elif structure.gray:
        raw = np.ascontiguousarray(raw[..., [0, 3]] if raw.shape[2] == 4 else raw[..., :1])
    else:
        raw = cv2.cvtColor(raw, cv2.COLOR_BGR2RGB if raw.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)
    # White is zero: OpenCV minds that up to 8 bits.
    if tiff is not None and tiff.photometric == 0 and raw.dtype == np.uint16:
        raw = 65535 - raw
    return raw, warnings


def decode_exr(
    data: bytes, pixels_per_byte: int = READING.photograph_pixels_per_byte
) -> tuple[NDArray[Any], list[str]]:
    """Like `decode_file` for EXR: float32, premultiplied by alpha where there is one; see `check_size`."""

    def check(sizes: list[tuple[int, int]], samples: int) -> None:
        for width, height in sizes:
            check_size(width, height, len(data), pixels_per_byte)
        if samples > READING.max_exr_samples:
            raise UnreadableImage(
                f"the layers of the EXR file hold {samples // 10**6} million numbers together, at most"
                f" {READING.max_exr_samples // 10**6} can be read; render only the picture (Combined) into the file")

    try:
        pixels, alpha, warning = read_exr(data, check)
    except StitchError:
        raise
    except Exception as error:  # OpenEXR raises whatever its C++ side threw
        raise UnreadableImage("the EXR file is damaged or cut off; copy or render it again") from error
    return pixels if alpha is None else np.dstack([pixels, alpha]), [warning] if warning else []


def turn(raw: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Brings stored rows and columns upright; orientation as in EXIF (1..8): where row 0 and column 0 are seen."""
    if orientation >= 5:
        raw = raw.transpose(1, 0, 2)  # now 5 is 1, 6 is 2 (mirrored), 7 is 3 (turned about), 8 is 4 (upside down)
    flip_x = orientation in (2, 3, 6, 7)
    flip_y = orientation in (3, 4, 7, 8)
    return np.ascontiguousarray(raw[:: -1 if flip_y else 1, :: -1 if flip_x else 1])
