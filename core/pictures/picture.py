"""Pictures come in, and pictures go out: any file or array to one kind of Picture, and back to a file.

A Picture holds light. Display encoding, ICC curves, orientation, premultiplied alpha and channel order are dealt with
here, once on the way in and once on the way out, so that no other room has to know about them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import strips
from ..raster.colour import Curve, encode, icc_channels, parse_icc, srgb_curve
from ..raster.lazy import AnyImage, Coded, whole
from ..system.errors import BadRequest, UnreadableImage
from .camera_raw import is_raw
from .containers import read_structure, says_surround, says_undistorted
from .decoding import check_size, decode_exr, decode_file, read_file, turn
from .foreign import foreign_kind
from .gpano import SpherePart, sphere_part_told, whole_sphere
from .heif_decoding import decode_heif
from .metadata import Exif, read_exif
from .options import READING
from .radiance import decode_radiance
from .raw_development import RawExposure, develop

_READABLE = "PNG, JPEG, TIFF, EXR, HDR, HEIC, WebP or BMP"


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture from outside, upright (any EXIF orientation has been applied), row 0 on top.

    Attributes
    ----------
    light : (H, W, C) array or LazyImage
        float32, C = 1 or 3 (R, G, B), scene-linear, not multiplied by alpha, in the primaries of `icc` or, if that is
        None, of sRGB. Decoded part by part from 8 and 16 bits (see `raster.lazy`).
    alpha : (H, W) float32 in [0, 1], optional
        None if opaque everywhere.
    view : (H, W, C) uint8
        The display-encoded picture that features and photometric metrics see.
    bits : int
        Of the source: 8, 16 or 32 (float).
    exif : Exif
        Upright; its orientation is the source's and was applied.
    icc : bytes, optional
        The embedded profile.
    name : str
        File name, or "array".
    warnings : tuple of str
    clips_at : float
        Light from which a float picture is clipped: camera RAW has such, others have infinity.
    surround : bool
        Whether the file says that it is a map of many directions (a sphere, a cylinder), no flat picture.
    part : SpherePart, optional
        Which part of a sphere it shows, where the file says that.
    circle : (float, float, float), optional
        Middle x, y and radius, px, of the fisheye's circle on black that is all that it shows, where that was found.
    burnt_in : (H, W) bool, optional
        Where a date or a logo was found, which alpha hides.
    wanted : (H, W) bool, optional
        Where the panorama is to come from this picture.
    guides : tuple of (str, (4,) floats)
        Upright and level lines in it, by their names in GUIDES: x, y, x', y' as shares of its sides.
    """

    light: AnyImage
    alpha: NDArray[Any] | None
    view: NDArray[Any]
    bits: int
    exif: Exif
    icc: bytes | None
    name: str
    warnings: tuple[str, ...] = ()
    clips_at: float = float("inf")
    surround: bool = False
    part: SpherePart | None = None
    circle: tuple[float, float, float] | None = None
    burnt_in: NDArray[np.bool_] | None = None
    wanted: NDArray[np.bool_] | None = None
    guides: tuple[tuple[str, tuple[float, ...]], ...] = ()

    @property
    def pixels(self) -> NDArray[Any]:
        """All of its light as an array (H, W, C) float32."""
        return whole(self.light)

    @property
    def is_raw(self) -> bool:
        """Whether it is camera RAW, which alone of all float pictures says where it clips."""
        return bool(np.isfinite(self.clips_at))

    def shows(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points (N, 2) px lie where it is not transparent (N,)."""
        if self.alpha is None:
            return np.ones(len(points), bool)
        height, width = self.alpha.shape
        column, row = np.clip(np.rint(points).astype(int), 0, (width - 1, height - 1)).T
        opaque: NDArray[np.bool_] = self.alpha[row, column] > 0
        return opaque


def load_picture(
    path: str | Path, pixels_per_byte: int = READING.photograph_pixels_per_byte, exposure: RawExposure | None = None
) -> Picture:
    """Read a PNG, JPEG, TIFF, EXR, HDR, HEIC, WebP or BMP file of 8, 16 or 32 bits (float), gray or colour, with any
    alpha, or a camera RAW file, which becomes a float picture.

    Parameters
    ----------
    path : str or Path
        The file.
    pixels_per_byte : int
        Of a larger picture that the file may hold, at most; see `ReadingOptions`.
    exposure : RawExposure, optional
        What camera RAW of one panorama is developed with; by default each file's own.

    Returns
    -------
    Picture

    Raises
    ------
    UnreadableImage
        Missing, damaged, cut off, too large for memory or for its own length, or of a kind that is not read, with what
        to do.
    """
    path = Path(path)
    try:
        return _load(path, pixels_per_byte, exposure)
    except UnreadableImage as error:
        raise UnreadableImage(f"{path}: {error}") from error


def _load(path: Path, pixels_per_byte: int, exposure: RawExposure | None) -> Picture:
    data = read_file(path)
    if is_raw(data, path.suffix.lower()):
        return _developed(data, exposure, path.name)
    structure = read_structure(data)
    if structure is None:
        foreign = foreign_kind(data)
        if foreign is not None:
            raise UnreadableImage(f"it is {foreign[0]}, which is not read; {foreign[1]}")
        raise UnreadableImage(f"not a picture of a known kind; export it as {_READABLE}")
    if structure.kind == "exr":
        found = decode_exr(data, pixels_per_byte)
        picture = _picture(found.raw, True, Exif(), None, path.name, list(found.warnings))
        height, width = found.raw.shape[:2]
        whole = found.surround and width == 2 * height
        return replace(picture, surround=found.surround, part=whole_sphere((width, height)) if whole else None)
    if structure.damage:
        kind = structure.kind.upper()
        raise UnreadableImage(f"the {kind} file is damaged: {structure.damage}; copy or export it again")
    check_size(structure.width, structure.height, len(data), pixels_per_byte)
    if structure.kind == "hdr":
        raw, warnings = decode_radiance(data)
        return _picture(raw, False, Exif(), None, path.name, warnings)
    exif = replace(read_exif(structure.exif), undistorted=says_undistorted(data))
    if structure.heif is not None:  # its decoder has turned it
        heif, upright = decode_heif(data, structure), replace(exif.upright(), orientation=1)
        return _picture(heif.pixels, heif.associated, upright, heif.icc, path.name, [*heif.warnings])
    if structure.tiff is not None:  # the value that decoding set aside, in BigTIFF too, which ExifRead does not know
        exif = replace(exif, orientation=structure.tiff.orientation if 1 <= structure.tiff.orientation <= 8 else 1)
    found = decode_file(data, structure)
    raw, warnings = turn(found.raw, exif.orientation), list(found.warnings)
    picture = _picture(raw, found.associated, exif.upright(), structure.icc, path.name, warnings)
    size = picture.view.shape[1], picture.view.shape[0]
    return replace(picture, surround=says_surround(data), part=sphere_part_told(data, size))


def _developed(data: bytes, exposure: RawExposure | None, name: str) -> Picture:
    """The picture of a camera RAW file, linear in sRGB's primaries."""
    raw = develop(data, exposure, partial(check_size, stored=len(data), pixels_per_byte=READING.raw_pixels_per_byte))
    light = Coded(turn(raw.levels, raw.exif.orientation), (raw.curve,))
    view = _float_view(light, _exposure(light, None))
    exif = replace(raw.exif.upright(), orientation=1)  # as its decoder may well have turned it
    return Picture(light, None, view, 32, exif, None, name, raw.warnings, float(raw.curve.table[-1]))


def picture_from_array(array: NDArray[Any], name: str = "array") -> Picture:
    """Make a Picture of an array, which is copied.

    Parameters
    ----------
    array : (H, W) or (H, W, C)
        uint8 or uint16: display-encoded sRGB; float32 or float64: scene-linear with sRGB primaries. C = 1 gray, 2 gray
        and alpha, 3 RGB, 4 RGBA; colours are not multiplied by alpha; row 0 on top.
    name : str
        In messages.

    Returns
    -------
    Picture

    Raises
    ------
    BadRequest
        The array has another shape or type.
    """
    if not isinstance(array, np.ndarray):
        raise BadRequest(f"{name}: a NumPy array is needed, not {type(array).__name__}")
    dtype = array.dtype.newbyteorder("=")
    if dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        raise BadRequest(f"{name}: {array.dtype} values; uint8, uint16, float32 or float64 are needed")
    if array.ndim not in (2, 3) or array.size == 0 or (array.ndim == 3 and array.shape[2] > 4):
        raise BadRequest(f"{name}: an array of the shape {array.shape}; height × width (× 1 to 4 channels) is needed")
    raw = array[..., None] if array.ndim == 2 else array
    with np.errstate(over="ignore"):  # what float32 cannot hold is infinite, which is told further on
        raw = np.array(raw, dtype=np.float32 if dtype == np.float64 else dtype, order="C")
    try:
        return _picture(raw, False, Exif(), None, name, [])
    except UnreadableImage as error:
        raise BadRequest(f"{name}: {error}") from error


def _picture(
    raw: NDArray[Any], associated: bool, exif: Exif, icc: bytes | None, name: str, warnings: list[str]
) -> Picture:
    """raw: upright H×W×1..4 in R, G, B, A order; associated: the colours are multiplied by alpha as stored."""
    channels = 1 if raw.shape[2] < 3 else 3
    colour, stored_alpha = raw[..., :channels], raw[..., channels] if raw.shape[2] > channels else None
    light: AnyImage
    alpha = None
    if stored_alpha is not None:
        full = 1.0 if raw.dtype == np.float32 else float(np.iinfo(raw.dtype).max)
        with np.errstate(invalid="ignore"):  # NaN stays, the kind that signals too
            alpha = np.clip(stored_alpha.astype(np.float32) / np.float32(full), 0.0, 1.0)
    if associated and alpha is not None:
        colour = _straight(colour, alpha)
    colour = np.ascontiguousarray(colour)
    # RGB profiles on gray pictures are common and harmless: gray stays gray. Anything else does not fit the pixels
    # (CMYK turned to RGB by the decoder) or is damaged.
    if icc is not None and icc_channels(icc) not in (channels, 3):
        warnings = [*warnings, "its colour profile does not fit its pixels; taken as sRGB"]
        icc = None
    if raw.dtype == np.float32:
        light, alpha, share = _finite(colour, alpha)
        if share > READING.max_not_finite:
            raise UnreadableImage(f"{share:.0%} of the pixels are not finite numbers; render or export it again")
        if share > 0:
            warnings = [*warnings, f"{share:.2%} of the pixels are not finite numbers; they are taken as transparent"]
        view = _float_view(light, _exposure(light, alpha))
    else:
        light = Coded(colour, curves_for(icc, channels))
        # 65535 / 255 = 257; OpenCV rounds
        view = colour if raw.dtype == np.uint8 else cv2.convertScaleAbs(colour, alpha=1 / 257).reshape(colour.shape)
    if alpha is not None and (alpha >= 1.0).all():
        alpha = None
    icc = icc if icc is not None and icc_channels(icc) == channels else None
    return Picture(light, alpha, view, raw.dtype.itemsize * 8, exif, icc, name, tuple(warnings))


def _straight(colour: NDArray[Any], alpha: NDArray[Any]) -> NDArray[Any]:
    """Colours divided by alpha, in the encoding they were multiplied in; 0 where alpha is 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        straight = np.where(alpha[..., None] == 0, np.float32(0), colour / alpha[..., None])
    if colour.dtype == np.float32:
        return straight.astype(np.float32)
    levels: NDArray[Any] = np.rint(np.clip(straight, 0, np.iinfo(colour.dtype).max)).astype(colour.dtype)
    return levels


def _finite(colour: NDArray[Any], alpha: NDArray[Any] | None) -> tuple[NDArray[Any], NDArray[Any] | None, float]:
    """Colours, none beyond READING.max_light, and alpha with 0 wherever one of the values is not finite, and the share
    of such pixels."""
    good = np.isfinite(colour).all(axis=2)
    if alpha is not None:
        good &= np.isfinite(alpha)
    share = 1.0 - float(good.mean())
    if share > 0:
        alpha = np.where(good, np.float32(1) if alpha is None else alpha, np.float32(0))
        colour = np.where(good[..., None], colour, np.float32(0))
    most = np.float32(READING.max_light)
    if colour.max() > most or colour.min() < -most:
        colour = np.clip(colour, -most, most)
    return colour, alpha, share


def _exposure(pixels: AnyImage, alpha: NDArray[Any] | None) -> float:
    """The factor that brings the light of a float picture into the range of a display.

    Half way (in stops) between the factor that puts the median on middle gray and the one that keeps the brightest
    hundredth from clipping: a bright sky then leaves features in the shade, and a shade leaves some in the sky.
    """
    width = pixels.shape[1]
    light = np.concatenate([pixels[rows, 0:width].max(axis=2) for rows in strips(pixels.shape)])
    light = light[light > 0] if alpha is None else light[(light > 0) & (alpha > 0)]
    if light.size == 0:
        return 1.0
    middle, bright = (float(value) for value in np.percentile(light[:: max(1, light.size // 1_000_000)], (50, 99)))
    return float(np.clip(np.sqrt(0.18 / middle * 0.9 / bright), 1e-37, 1e37))


def _float_view(pixels: AnyImage, exposure: float) -> NDArray[Any]:
    view = np.empty(pixels.shape, np.uint8)
    with np.errstate(over="ignore"):
        for rows in strips(pixels.shape):
            view[rows] = encode(pixels[rows, 0 : pixels.shape[1]] * np.float32(exposure), 8)
    return view


def curves_for(icc: bytes | None, channels: int) -> tuple[Curve, ...]:
    """The curves for pixels of so many channels; sRGB where the profile is missing or not understood."""
    profile = parse_icc(icc) if icc is not None else None
    if profile is None:
        return (srgb_curve(),)
    if channels == 1 and len(profile.curves) == 3:
        return profile.curves[1:2]
    return profile.curves


def in_same_colour_space(pictures: Sequence[Picture]) -> tuple[Picture, ...]:
    """Bring pictures to the same primaries and number of channels, and float pictures to comparable views.

    Parameters
    ----------
    pictures : sequence of Picture
        The pictures, which stay as they are.

    Returns
    -------
    tuple of Picture
        With equal profiles their light stays in these primaries; otherwise it is converted to linear sRGB. A profile
        that is not understood counts as sRGB, with a warning. Gray beside colour gets three channels.
    """
    if len({picture.icc for picture in pictures}) > 1:
        pictures = [_to_srgb(picture) for picture in pictures]
    if len({picture.light.shape[2] for picture in pictures}) > 1:
        pictures = [_three_channels(picture) for picture in pictures]
    if all(picture.bits == 32 for picture in pictures):
        exposures = [_exposure(picture.light, picture.alpha) for picture in pictures]
        # One factor keeps the same thing equally bright in all; over two stops apart, seeing anything comes first.
        if max(exposures) <= 4.0 * min(exposures):
            shared = float(np.prod(exposures) ** (1 / len(exposures)))
            pictures = [replace(picture, view=_float_view(picture.light, shared)) for picture in pictures]
    return tuple(pictures)


def _to_srgb(picture: Picture) -> Picture:
    if picture.icc is None:
        return picture
    profile = parse_icc(picture.icc)
    if profile is None:
        warning = "its colour profile is no matrix profile and not the other picture's; its colours are taken as sRGB"
        return replace(picture, icc=None, warnings=(*picture.warnings, warning))
    if profile.gray:
        return replace(picture, icc=None)
    pixels = cv2.transform(picture.pixels, profile.to_srgb.astype(np.float32))
    view = _float_view(pixels, _exposure(pixels, picture.alpha)) if picture.bits == 32 else encode(pixels, 8)
    return replace(picture, light=pixels, view=view, icc=None)


def _three_channels(picture: Picture) -> Picture:
    if picture.light.shape[2] == 3:
        return picture
    light = picture.light
    if isinstance(light, Coded) and len(light.curves) == 1:
        light = Coded(np.repeat(light.levels, 3, axis=2), light.curves)
    else:
        light = np.repeat(whole(light), 3, axis=2)
    return replace(picture, light=light, view=np.repeat(picture.view, 3, axis=2))
