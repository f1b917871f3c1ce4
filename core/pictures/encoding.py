"""A Picture becomes the bytes of a file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import in_any_channel, strips
from ..raster.colour import Curve, encode, icc_channels, parse_icc
from ..raster.lazy import AnyImage, whole
from ..system.errors import BadRequest, UnwritableOutput
from ..system.output_files import OutputFiles
from ..system.threads import in_order
from .exr import DEFAULT_FORM, ExrForm, write_exr
from .gpano import SpherePart, xmp_packet
from .metadata import SOFTWARE, Exif, embed
from .opencv import quiet_opencv
from .options import WRITING
from .picture import curves_for
from .png import encode_png
from .radiance import encode_radiance

# suffix: container, bits it can hold
_WRITABLE = {
    ".png": ("png", 16), ".jpg": ("jpeg", 8), ".jpeg": ("jpeg", 8), ".tif": ("tiff", 16), ".tiff": ("tiff", 16),
    ".exr": ("exr", 32), ".hdr": ("hdr", 32),
}
_JPEG_LONGEST_SIDE = 65500  # libjpeg's limit


def output_bits(bits: Iterable[int], suffix: str) -> int:
    """Bits per channel of an output: the deepest input's, as far as the file kind goes; EXR and HDR are always 32.

    suffix: with its dot, any case. Raises BadRequest for a kind that is not written.
    """
    kind, most = _writable(suffix)
    return most if kind in ("exr", "hdr") else min(max(bits), most)


def _writable(suffix: str) -> tuple[str, int]:
    known = _WRITABLE.get(suffix.lower())
    if known is None:
        raise BadRequest(f"pictures are not written as {suffix or 'files of no kind'}; use {', '.join(_WRITABLE)}")
    return known


def encode_picture(
    pixels: AnyImage, alpha: NDArray[Any] | None, bits: int, suffix: str, icc: bytes | None = None,
    exif: Exif | None = None, exr: ExrForm = DEFAULT_FORM, sphere: SpherePart | None = None,
) -> tuple[bytes, tuple[str, ...]]:  # fmt: skip
    """Encode a picture as a file.

    Parameters
    ----------
    pixels : (H, W, C) array or LazyImage
        Light as in Picture.
    alpha : (H, W), optional
        float32 in [0, 1], or bool. JPEG and HDR get black where it is 0, the others keep it.
    bits : int
        The deepest input's: 8, 16 or 32.
    suffix : str
        .png, .jpg, .jpeg, .tif, .tiff, .exr or .hdr. EXR and HDR hold linear sRGB, multiplied by alpha.
    icc, exif : optional
        As in Picture.
    exr : ExrForm
        How an EXR is written.
    sphere : SpherePart, optional
        The part of an equirectangular sphere that it is: viewers are told.

    Returns
    -------
    data : bytes
        The file.
    warnings : tuple of str
        For the user.

    Raises
    ------
    BadRequest
        Another suffix.
    UnwritableOutput
        The picture does not fit into this kind of file.
    """
    pieces: list[bytes] = []
    warnings = encode_into(pieces.append, pixels, alpha, bits, suffix, icc, exif, exr, sphere)
    return pieces[0] if len(pieces) == 1 else b"".join(pieces), warnings


def encode_into(
    put: Callable[[bytes], object], pixels: AnyImage, alpha: NDArray[Any] | None, bits: int, suffix: str,
    icc: bytes | None = None, exif: Exif | None = None, exr: ExrForm = DEFAULT_FORM, sphere: SpherePart | None = None,
) -> tuple[str, ...]:  # fmt: skip
    """Encode a picture as a file, and hand over each piece of it as soon as it is made: of a PNG no more than some rows
    are held. Arguments, warnings returned and errors: see `encode_picture`."""
    kind, _ = _writable(suffix)
    depth = output_bits((bits,), suffix)
    exif = exif or Exif()
    if kind == "exr":
        data, share = write_exr(in_srgb(pixels, icc), alpha, exif, exr, sphere is not None and sphere.is_whole)
        put(data)
        most = f"half floats hold ({WRITING.max_half:.0f})"
        lost = f"{share:.2%} of the pixels are brighter than {most} and were clipped; --exr-depth float keeps them"
        return (lost,) if share else ()
    if kind == "hdr":
        _put_radiance(put, in_srgb(pixels, icc), alpha, exif)
        return ()
    height, width = pixels.shape[:2]
    if kind == "jpeg" and max(width, height) > _JPEG_LONGEST_SIDE:
        raise UnwritableOutput(f"JPEG holds {_JPEG_LONGEST_SIDE} pixels a side, not {width} × {height}; use .png")
    # none of the files has gray with alpha
    channels = 3 if alpha is not None and kind != "jpeg" else pixels.shape[2]
    if icc is not None and icc_channels(icc) != channels:
        icc = None
    xmp = None if sphere is None else xmp_packet(sphere)
    levels = _Levels(pixels, alpha, depth, curves_for(icc, channels), kind == "jpeg")
    if kind == "png":
        brighter = levels.into_png(put, lambda header: embed(header, kind, exif, icc, xmp=xmp))
    else:
        coded, brighter = levels.as_array()
        put(embed(_by_opencv(coded, suffix), kind, exif, icc, levels.shape[2] == 4, xmp))
    if bits < 32:
        return ()
    lost = f", and {brighter:.2%} of its pixels, brighter than white, were clipped" if brighter else ""
    return (f"float input was written display-encoded with {depth} bits{lost}; .exr keeps it",)


def _put_radiance(put: Callable[[bytes], object], light: AnyImage, alpha: NDArray[Any] | None, exif: Exif) -> None:
    """Hands over the pieces of a Radiance file of light in the primaries of sRGB."""

    def shown(rows: slice) -> NDArray[Any]:
        part = light[rows, 0 : light.shape[1]]
        return part if alpha is None else part * alpha[rows][..., None]

    lines = {"SOFTWARE": SOFTWARE, "CAPDATE": exif.text(36867) or exif.text(306)}
    for piece in encode_radiance(light.shape, shown, {name: text for name, text in lines.items() if text}):
        put(piece)


def in_srgb(pixels: AnyImage, icc: bytes | None) -> AnyImage:
    """Light (H, W, C) in the primaries of a profile, in those of sRGB."""
    profile = parse_icc(icc) if icc is not None else None
    if profile is None or pixels.shape[2] != 3:
        return pixels
    light = np.ascontiguousarray(whole(pixels), np.float32)
    converted: NDArray[Any] = cv2.transform(light, profile.to_srgb.astype(np.float32))
    return converted


def _by_opencv(coded: NDArray[Any], suffix: str) -> bytes:
    """The file of levels (H, W, C) in B, G, R, A order."""
    options = [cv2.IMWRITE_JPEG_QUALITY, WRITING.jpeg_quality] if _WRITABLE[suffix.lower()][0] == "jpeg" else []
    try:
        with quiet_opencv():
            done, encoded = cv2.imencode(suffix.lower(), coded, options)
    except (cv2.error, MemoryError):
        done = False
    if not done:
        height, width = coded.shape[:2]
        raise UnwritableOutput(f"{width} × {height} pixels do not fit into a {suffix} file; use .exr or a smaller size")
    data: bytes = encoded.tobytes()
    return data


@dataclass(frozen=True, eq=False)
class _Levels:
    """Light as files hold it: levels (H, W, 1, 3 or 4) of 8 or 16 bits. flat: black where alpha says so, instead of
    alpha."""

    light: AnyImage
    alpha: NDArray[Any] | None
    bits: int
    curves: tuple[Curve, ...]
    flat: bool

    @property
    def shape(self) -> tuple[int, int, int]:
        """(H, W, C)."""
        height, width, channels = self.light.shape
        return height, width, channels if self.alpha is None or self.flat else 4  # no gray with alpha

    def into_png(self, put: Callable[[bytes], object], embedded: Callable[[bytes], bytes]) -> float:
        """Hands over the pieces of a PNG file, the first with what is to be `embedded` in it; the share of pixels
        brighter than white."""
        beyond: list[int] = []

        def levels(rows: slice) -> NDArray[Any]:
            out, brighter = self._of(rows)
            beyond.append(brighter)
            return out

        for number, piece in enumerate(encode_png(self.shape, self.bits, levels)):
            put(piece if number else embedded(piece))
        return self._share(beyond)

    def as_array(self) -> tuple[NDArray[Any], float]:
        """All of them as OpenCV writes them, in B, G, R, A order, and the share of pixels brighter than white."""
        out = np.empty(self.shape, np.uint8 if self.bits == 8 else np.uint16)
        order = {1: [0], 3: [2, 1, 0], 4: [2, 1, 0, 3]}[self.shape[2]]

        def put(rows: slice) -> int:
            levels, brighter = self._of(rows)
            for to, channel in enumerate(order):
                out[rows, :, to] = levels[..., channel]
            return brighter

        return out, self._share(in_order(put, strips(self.shape)))

    def _of(self, rows: slice) -> tuple[NDArray[Any], int]:
        """The levels of some rows, in R, G, B, A order, and how many of the pixels are brighter than white."""
        part = self.light[rows, 0 : self.light.shape[1]]
        brighter = int(in_any_channel(part > 1).sum()) if part.max(initial=0) > 1 else 0
        if self.flat and self.alpha is not None:
            part = part * self.alpha[rows][..., None]
        coded = encode(part, self.bits, self.curves)
        if self.flat or self.alpha is None:
            return coded, brighter
        most = np.iinfo(coded.dtype).max
        alpha = self.alpha[rows]
        levels = alpha * coded.dtype.type(most) if alpha.dtype == bool else np.rint(np.clip(alpha, 0, 1) * most)
        if coded.shape[2] == 1:
            coded = cv2.merge([coded] * 3)
        out = cv2.merge([coded, levels.astype(coded.dtype, copy=False)])
        return out, brighter

    def _share(self, counts: Iterable[int]) -> float:
        return sum(counts) / max(1, self.shape[0] * self.shape[1])


def save_picture(
    path: str | Path, pixels: NDArray[Any], alpha: NDArray[Any] | None, bits: int, icc: bytes | None = None,
    exif: Exif | None = None, overwrite: bool = False,
) -> tuple[str, ...]:
    """Writes a picture file, whole or not at all. Arguments, warnings returned and errors: see `encode_picture`."""
    with OutputFiles(overwrite) as files:
        files.check(path)
        return files.add_by(
            path, lambda file: encode_into(file.write, pixels, alpha, bits, Path(path).suffix, icc, exif)
        )
