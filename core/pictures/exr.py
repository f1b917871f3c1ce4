"""OpenEXR in and out: which of a render's many channels are the picture, and where it lies in its frame."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..choices import EXR_COMPRESSIONS, EXR_DEPTHS
from ..raster.arrays import strips
from ..raster.lazy import AnyImage
from ..raster.primaries import REC709
from ..system.errors import BadRequest, UnreadableImage
from ..system.streams import overheard
from ..system.threads import in_order
from .exr_colour import from_luminance_chroma, in_rec709, with_square_pixels
from .metadata import SOFTWARE, Exif
from .options import WRITING

# The bit of a file's second byte of flags that says that parts are not flat (OpenEXR, File Layout).
_DEEP = 0x08


class ExrPixels(NamedTuple):
    """pixels: float32 H×W×C (1 or 3) as stored, premultiplied, in Rec. 709; alpha: float32 H×W as stored, or None;
    warnings; surround: whether the header calls it a map of all directions."""

    pixels: NDArray[Any]
    alpha: NDArray[Any] | None
    warnings: tuple[str, ...]
    surround: bool = False


class _Layer(NamedTuple):
    name: str
    colours: list[NDArray[Any]]
    alpha: NDArray[Any] | None
    part: Any


def read_exr(data: bytes, check: Callable[[list[tuple[int, int]], int], None]) -> ExrPixels:
    """Reads the picture of an EXR file: R, G, B or Y, with A where there is one; in a render the Combined pass.

    check(sizes, samples) is asked before pixels are read and raises what it likes; sizes: (W, H) of all windows;
    samples: numbers in all channels together. The data window is placed in the display window; what lies outside is
    transparent. Raises UnreadableImage where no layer has the colours, RuntimeError or ValueError (from OpenEXR) where
    the file is damaged.
    """
    import OpenEXR

    if len(data) > 5 and data[5] & _DEEP:
        raise UnreadableImage("deep data, many depths at each pixel: flatten it, or render the picture without them")
    # OpenEXR prints a line to sys.stdout for a damaged part and leaves it out, and others to standard error.
    with contextlib.redirect_stdout(io.StringIO()), overheard(_is_openexrs):
        headers = OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=True).parts
        sizes = [(_window(part.header["displayWindow"])[1], _window(part.header["dataWindow"])[1]) for part in headers]
        samples = sum(
            width * height * len(part.header["channels"])
            for part, (_, (width, height)) in zip(headers, sizes, strict=True)
        )
        check([size for both in sizes for size in both], samples)
        parts = OpenEXR.File(io.BytesIO(data), separate_channels=True).parts
    if len(parts) < len(headers):
        raise ValueError("damaged part")
    layers = list(_layers(parts))
    if not layers:
        raise UnreadableImage("no layer with the channels R, G, B or Y; render a colour pass (Combined) into the file")
    best = min(layers, key=_rank)  # the first of equals
    header = best.part.header
    pixels, alpha = _in_display_window(best)
    pixels, alpha, stretched = with_square_pixels(in_rec709(pixels, header), alpha, header)
    others = [layer.name for layer in layers if layer is not best and _rank(layer) == _rank(best)]
    warning = ""
    if _rank(best) > 2 and len(layers) > 1:
        warning = f"no combined picture among the layers of the file; the layer {best.name!r} was taken"
    elif others:
        warning = f"several pictures in the file; {best.name!r} was taken, not {', '.join(map(repr, others))}"
    return ExrPixels(pixels, alpha, tuple(filter(None, (warning, stretched))), "envmap" in header)


def exr_size(data: bytes) -> tuple[int, int]:
    """(W, H) px of the largest picture in an EXR file; (0, 0) where it cannot be told."""
    import OpenEXR

    try:
        with contextlib.redirect_stdout(io.StringIO()), overheard(_is_openexrs):
            parts = OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=True).parts
        return max((_window(part.header["displayWindow"])[1] for part in parts), key=lambda size: size[0] * size[1])
    except Exception:  # OpenEXR raises whatever its C++ side threw
        return 0, 0


def _is_openexrs(line: str) -> bool:
    """Whether a line on standard error is OpenEXR's own."""
    return "EXR_ERR" in line or "<python_buffer>" in line


def _layers(parts: list[Any]) -> Iterator[_Layer]:
    for part in parts:
        # Channels of one layer share everything before the last dot; a part's name stands for a missing prefix.
        groups: dict[str, dict[str, NDArray[Any]]] = {}
        for name, channel in part.channels.items():
            layer, _, component = name.rpartition(".")
            groups.setdefault(layer, {})[component.upper()] = channel.pixels
        for layer, found in groups.items():
            colours = [found[name] for name in "RGB" if name in found]
            if len(colours) < 3 and {"Y", "RY", "BY"} <= found.keys():
                colours = from_luminance_chroma(found, part.header)
            elif len(colours) < 3:
                colours = [found["Y"]] if "Y" in found else []
            # Depth and normals come as X, Y, Z
            if not colours or (len(colours) == 1 and ("X" in found or "Z" in found)):
                continue
            if len({colour.shape for colour in colours}) > 1:  # subsampled
                continue
            name = layer or (str(part.header.get("name", "")) if len(parts) > 1 else "")
            alpha = found.get("A")
            yield _Layer(name, colours, alpha if alpha is not None and alpha.shape == colours[0].shape else None, part)


def _rank(layer: _Layer) -> int:
    """0 the unnamed layer, 1 Blender's Composite, 2 a view layer's Combined pass, 3 anything else."""
    levels = layer.name.split(".")
    if layer.name == "" or layer.name.lower() in ("rgb", "rgba"):
        return 0
    if "Combined" in levels:
        return 1 if levels[0] == "Composite" else 2
    return 3


def _window(window: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    """((x, y), (width, height)) of an EXR box, whose corners are both inside."""
    (left, top), (right, bottom) = ((int(corner[0]), int(corner[1])) for corner in window)
    return (left, top), (right - left + 1, bottom - top + 1)


def _in_display_window(layer: _Layer) -> tuple[NDArray[Any], NDArray[Any] | None]:
    pixels = np.dstack(layer.colours).astype(np.float32)
    alpha = None if layer.alpha is None else layer.alpha.astype(np.float32)
    (left, top), data_size = _window(layer.part.header["dataWindow"])
    (frame_left, frame_top), frame_size = _window(layer.part.header["displayWindow"])
    x, y = left - frame_left, top - frame_top
    if (x, y) == (0, 0) and data_size == frame_size:
        return pixels, alpha
    whole = np.zeros((frame_size[1], frame_size[0], pixels.shape[2]), np.float32)
    whole_alpha = np.zeros(whole.shape[:2], np.float32)
    frame = np.s_[max(y, 0) : max(y + data_size[1], 0), max(x, 0) : max(x + data_size[0], 0)]
    inside = whole[frame].shape
    source = np.s_[max(-y, 0) : max(-y, 0) + inside[0], max(-x, 0) : max(-x, 0) + inside[1]]
    whole[frame] = pixels[source]
    whole_alpha[frame] = 1.0 if alpha is None else alpha[source]
    return whole, whole_alpha


@dataclass(frozen=True)
class ExrForm:
    """How an EXR file of colours is written.

    Attributes
    ----------
    depth : str, default "float"
        One of EXR_DEPTHS: 32 bits a channel, or "half", which are 16: three digits, up to 65504.
    compression : str, default "zip"
        One of EXR_COMPRESSIONS: without loss, or "dwab", which is smaller and loses what is not seen.
    """

    depth: str = "float"
    compression: str = "zip"

    def __post_init__(self) -> None:
        for what, value, known in (
            ("depth", self.depth, EXR_DEPTHS), ("compression", self.compression, EXR_COMPRESSIONS),
        ):  # fmt: skip
            if value not in known:
                raise BadRequest(f"the {what} {value!r} of EXR is not offered; choose from: {', '.join(known)}")


DEFAULT_FORM = ExrForm()


def write_exr(
    pixels: AnyImage, alpha: NDArray[Any] | None, exif: Exif, form: ExrForm = DEFAULT_FORM, whole_sphere: bool = False
) -> tuple[bytes, float]:
    """An EXR file in memory, and the share of its pixels that are brighter than it can hold.

    pixels: float32 H×W×C (1 or 3), scene-linear in Rec. 709 primaries, straight; stored premultiplied. alpha: float32
    H×W or None. whole_sphere: it is a whole sphere, which the attribute `envmap` says. Photographer, time, camera and
    primaries go into the standard attributes.
    """
    import OpenEXR

    kind = np.float16 if form.depth == "half" else np.float32
    most = WRITING.max_half if form.depth == "half" else np.inf
    names = "RGB" if pixels.shape[2] == 3 else "Y"
    channels: dict[str, NDArray[Any]] = {name: np.empty(pixels.shape[:2], kind) for name in names}

    def put(rows: slice) -> int:
        part = pixels[rows, 0 : pixels.shape[1]]
        stored = part if alpha is None else part * alpha[rows][..., None]
        for index, name in enumerate(names):
            channels[name][rows] = np.clip(stored[..., index], -most, most)
        return int(np.count_nonzero((stored > most).any(axis=2)))

    beyond = sum(in_order(put, strips(pixels.shape)))
    if alpha is not None:
        channels["A"] = np.ascontiguousarray(alpha, kind)
    attributes: dict[str, Any] = {
        "owner": exif.text(33432) or exif.text(315), "capDate": exif.text(36867) or exif.text(306),
        "comments": " ".join(filter(None, (exif.make, exif.model, exif.lens))), "software": SOFTWARE,
    }
    attributes = {name: text for name, text in attributes.items() if text}
    if len(names) == 3:
        attributes["chromaticities"] = REC709
    if whole_sphere:
        attributes["envmap"] = OpenEXR.ENVMAP_LATLONG
    return exr_of_channels(channels, attributes, form.compression), beyond / max(1, pixels.shape[0] * pixels.shape[1])


def exr_of_channels(channels: dict[str, NDArray[Any]], attributes: dict[str, Any], compression: str = "zip") -> bytes:
    """An EXR file in memory of channels (H, W), float32 or float16, by their names, with attributes; compression: one
    of EXR_COMPRESSIONS."""
    import OpenEXR

    header = {"compression": getattr(OpenEXR, f"{compression.upper()}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    stream = io.BytesIO()
    with OpenEXR.File(header | attributes, channels) as file:
        file.write(stream)
    return stream.getvalue()
