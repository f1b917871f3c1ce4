"""From the bytes of a file to raw samples: OpenCV and OpenEXR, with what they get wrong put right."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.errors import StitchError, UnreadableImage
from .bmp import neutral_bmp
from .containers import Structure, neutral_png, neutral_tiff
from .exr import read_exr
from .jpeg import refuse_unusual_jpeg
from .opencv import decoded
from .options import READING
from .tiff import read_tiff


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


@dataclass(frozen=True)
class Decoded:
    """raw: (H, W, 1 to 4) uint8, uint16 or float32 as stored, in R, G, B, A order, not turned; associated: the colours
    are multiplied by alpha; warnings in words; surround: whether it says to be a map of all directions."""

    raw: NDArray[Any]
    associated: bool = False
    warnings: tuple[str, ...] = ()
    surround: bool = False


def decode_file(data: bytes, structure: Structure) -> Decoded:
    """The samples of a whole file of the given structure (not EXR). Raises UnreadableImage."""
    warnings: tuple[str, ...] = ()
    if structure.tiff is not None:
        if structure.tiff.pages > 1:
            warnings = (f"the TIFF file has {structure.tiff.pages} pages; only the first is used",)
        found = read_tiff(data)
        if found is not None:
            return Decoded(found.raw, found.associated, (*warnings, *found.warnings))
    return Decoded(_decode_by_opencv(data, structure), False, warnings)


def _decode_by_opencv(data: bytes, structure: Structure) -> NDArray[Any]:
    if structure.kind == "png":
        data = neutral_png(data)
    if structure.tiff is not None:
        data = neutral_tiff(data)
    if structure.kind == "bmp":
        data = neutral_bmp(data)
    if structure.kind == "jpeg":
        refuse_unusual_jpeg(data)
    raw = decoded(data)
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
    elif structure.opaque:
        raw = cv2.cvtColor(raw[..., :3], cv2.COLOR_BGR2RGB)
    elif structure.gray:
        raw = np.ascontiguousarray(raw[..., [0, 3]] if raw.shape[2] == 4 else raw[..., :1])
    else:
        raw = cv2.cvtColor(raw, cv2.COLOR_BGR2RGB if raw.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)
    if structure.transparent and raw.shape[2] == len(structure.transparent):
        shown = (raw != np.array(structure.transparent, raw.dtype)).any(axis=2, keepdims=True)
        raw = np.concatenate([raw, shown * np.array(np.iinfo(raw.dtype).max, raw.dtype)], axis=2)
    return raw


def decode_exr(data: bytes, pixels_per_byte: int = READING.photograph_pixels_per_byte) -> Decoded:
    """Like `decode_file` for EXR: float32, premultiplied by alpha where there is one; see `check_size`."""

    def check(sizes: list[tuple[int, int]], samples: int) -> None:
        for width, height in sizes:
            check_size(width, height, len(data), pixels_per_byte)
        if samples > READING.max_exr_samples:
            raise UnreadableImage(
                f"the layers of the EXR file hold {samples // 10**6} million numbers together, at most"
                f" {READING.max_exr_samples // 10**6} can be read; render only the picture (Combined) into the file")

    try:
        pixels, alpha, warnings, surround = read_exr(data, check)
    except StitchError:
        raise
    except Exception as error:  # OpenEXR raises whatever its C++ side threw
        raise UnreadableImage("the EXR file is damaged or cut off; copy or render it again") from error
    with np.errstate(invalid="ignore"):  # of damaged files some are NaN that signal
        nothing = alpha is not None and not alpha.any() and pixels.any()
    if nothing:
        alpha, warnings = None, (*warnings, "its alpha is 0 everywhere, though it shows something: taken as opaque")
    return Decoded(pixels if alpha is None else np.dstack([pixels, alpha]), True, warnings, surround)


def turn(raw: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Brings stored rows and columns upright; orientation as in EXIF (1..8): where row 0 and column 0 are seen."""
    if orientation >= 5:
        raw = raw.transpose(1, 0, 2)  # now 5 is 1, 6 is 2 (mirrored), 7 is 3 (turned about), 8 is 4 (upside down)
    flip_x = orientation in (2, 3, 6, 7)
    flip_y = orientation in (3, 4, 7, 8)
    return np.ascontiguousarray(raw[:: -1 if flip_y else 1, :: -1 if flip_x else 1])
