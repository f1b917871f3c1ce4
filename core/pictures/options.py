"""Tuning values of reading and writing pictures, with their units and why they are what they are."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReadingOptions:
    """What is read, against damaged files and those made to fill the memory (`containers`, `decoding`, `picture`)."""

    # Pixels of a picture, at most: beyond, a stitch does not fit into the memory of common machines.
    max_pixels: int = 400_000_000
    # px a side, at most: what JPEG can hold.
    max_side: int = 65535
    # Channels of all layers and parts of an EXR file together: four for each of the most pixels.
    max_exr_samples: int = 1_600_000_000
    # Pixels that a file may unpack to whatever its length; beyond, its length has to be in proportion.
    small_pixels: int = 2_000_000
    # Pixels for each byte of a photograph's file, at most: one takes a tenth of a byte or more for each, and JPEG
    # cannot write less than six bits for 256.
    photograph_pixels_per_byte: int = 400
    # The same for a mask, which may have one colour: deflate packs one bit a pixel a thousand times.
    drawing_pixels_per_byte: int = 10_000
    # The same of a camera RAW file: the strongest lossy compression leaves a seventh of a byte for each.
    raw_pixels_per_byte: int = 16
    # Bytes of an unpacked ICC profile; real ones have up to 2 MB, and a PNG's is compressed.
    max_icc_bytes: int = 8 << 20
    # Bytes up to which the header of a Radiance picture is looked for: programs put their whole command into it.
    max_header_bytes: int = 1 << 16
    # Share by which the sides of a pixel may differ and still be taken as square: rounding.
    square_pixels: float = 0.005
    # Least that light may be multiplied by according to a header, and most the other way: floats hold 38 digits.
    least_scale: float = 1e-12
    # x and y by which primaries may differ and still be the same: headers are rounded.
    same_primaries: float = 0.002
    # Share of pixels that are not finite up to which a float picture is used; beyond, something else went wrong.
    max_not_finite: float = 0.5
    # Light up to which a float picture is taken as it is, beyond as that: the blend works on its logarithm and goes
    # beyond it at edges, and floats end at 3.4e38.
    max_light: float = 1e31
    # Times that pixels of an EXR may be wider than high, or higher than wide: anamorphic lenses have 2, and what is
    # beyond is no picture's.
    max_pixel_aspect: float = 4.0


@dataclass(frozen=True)
class WritingOptions:
    """How pictures are written (`encoding`, `png`, `metadata`)."""

    # OpenCV's JPEG quality, 0 to 100: its default, without visible loss.
    jpeg_quality: int = 95
    # zlib's level, 1 to 9: the fastest; photographs hardly pack better on higher ones.
    png_level: int = 1
    # The largest number that half a float (16 bits) holds.
    max_half: float = 65504.0
    # Bytes of a text in EXIF: the whole block has to fit into one JPEG segment of 64 kB.
    max_text_bytes: int = 2000


@dataclass(frozen=True)
class MaskOptions:
    """How masks are understood (`masks`)."""

    # Share of a picture that a mask leaves, at least: one that leaves less is inverted or means something else.
    least_left: float = 0.01
    # Share of white up to which paint over a panorama is black, and as much from the other end white.
    painted: float = 0.25
    # Share of white by which colours may differ and still be one: rounding, and compression that is not lossless.
    one_colour: float = 8 / 255
    # Factor by which the aspect of a mask may differ from the picture's, at most: whole pixels alone would let one of a
    # few pixels fit pictures of every shape.
    same_aspect: float = 1.05


@dataclass(frozen=True)
class DecodingOptions:
    """Decoding HEIC and camera RAW (`decoder_process`, `raw_development`, `raw_clipping`)."""

    # Seconds after which a decoder counts as hung: the largest pictures take some ten, slow machines ten times that.
    most_seconds: float = 300.0
    # Stops by which exposures of one panorama may differ: beyond, what the files say of them is nonsense.
    most_stops: float = 30.0
    # Stops by which a picture is exposed more than another one if that is to be said, and share of it that is clipped:
    # less is hardly seen.
    longer_stops: float = 0.2
    much_clipped: float = 0.01
    # Share of the light at which camera RAW clips from which it counts as clipped: sensors differ by a little.
    raw_clipped: float = 0.99


READING = ReadingOptions()
DECODING = DecodingOptions()
WRITING = WritingOptions()
MASKS = MaskOptions()
