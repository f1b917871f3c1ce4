"""From the bytes of a HEIC file to samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.matrix_profile import matrix_profile
from ..system.errors import UnreadableImage
from .containers import Structure
from .decoder_process import decoded

# What else HEIF files hold, by the letters of its coding.
_CODINGS = {
    "av01": "AVIF", "jpeg": "JPEG", "j2k1": "JPEG 2000", "avc1": "H.264", "vvc1": "H.266", "unci": "uncompressed",
}  # fmt: skip
# Numbers of ITU-T H.273. Transfer: curves of display-encoded pictures, which all are read as sRGB's where no profile
# says better; and of light beyond a display. Primaries: those of sRGB, unknown, and of old television, which differ
# from them by less than cameras do.
_DISPLAY_TRANSFERS = {1, 2, 4, 5, 6, 7, 13, 14, 15}
_TRANSFERS = {16: "HDR (PQ)", 18: "HDR (HLG)"}
_PRIMARIES_OF_SRGB = {1, 2, 5, 6, 7}
# Those with the white of daylight, for which a profile is made: name, and chromaticities of red, green and blue.
_WIDER = {
    9: ("Rec. 2020", ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046))),
    12: ("Display P3", ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class HeifPixels:
    """pixels: upright (H, W, 1 to 4) uint8 or uint16, in R, G, B, A order; associated: multiplied by alpha; icc: the
    file's profile, or one of the primaries that it names."""

    pixels: NDArray[Any]
    associated: bool
    icc: bytes | None
    warnings: tuple[str, ...]


def decode_heif(data: bytes, structure: Structure) -> HeifPixels:
    """Decode a whole HEIC file of the given structure, which was found without damage. Raises UnreadableImage."""
    heif = structure.heif
    assert heif is not None, "the structure of a HEIC file"
    if heif.coding != "hvc1":
        coding = _CODINGS.get(heif.coding, f"of the coding {heif.coding!r}")
        raise UnreadableImage(f"HEIF pictures that are {coding} inside cannot be read; export it as PNG or JPEG")
    if heif.transfer not in _DISPLAY_TRANSFERS:
        kind = _TRANSFERS.get(heif.transfer, f"a transfer function of number {heif.transfer}")
        raise UnreadableImage(f"HEIC pictures with {kind} cannot be read; export it as JPEG, or as EXR with its range")
    facts, samples = decoded("heic", data, {})
    width, height, mode = facts["width"], facts["height"], str(facts["mode"])
    if (width, height) != (structure.width, structure.height):
        raise UnreadableImage(
            f"the HEIC file is damaged: {width} × {height} pixels came out of it, its header says {structure.width} ×"
            f" {structure.height}; copy or export it again"
        )
    letters = mode.partition(";")[0]
    if mode.endswith(";16"):
        pixels: NDArray[Any] = _whole_range(samples.view(np.uint16), int(facts["bits"]))
    else:
        pixels = samples
    pixels = pixels.reshape(height, width, len(letters))
    icc, warnings = structure.icc, []
    if icc is None and heif.primaries in _WIDER:
        icc = matrix_profile(*_WIDER[heif.primaries])
    elif icc is None and heif.primaries not in _PRIMARIES_OF_SRGB:
        warnings = [f"its primaries are of the unknown kind {heif.primaries}; its colours are taken as sRGB"]
    return HeifPixels(pixels, letters.endswith("a"), icc, tuple(warnings))


def _whole_range(levels: NDArray[np.uint16], bits: int) -> NDArray[np.uint16]:
    """Levels of 9 to 15 bits that stand at the upper end of 16, with white at 65535."""
    most = (1 << bits) - 1
    table = ((np.arange(1 << bits, dtype=np.uint32) * 65535 + most // 2) // most).astype(np.uint16)
    whole: NDArray[np.uint16] = table[levels >> np.uint16(16 - bits)]
    return whole
