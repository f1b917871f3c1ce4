"""Decodes one HEIC or camera RAW file: run as a script by `decoder_process`, in a process of its own.

    decoder_main.py heic|raw    the file on stdin; on stdout a line of JSON, then the samples as they lie in memory

It imports nothing of this package, so that it runs under whichever name that is installed.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any


def heic(data: bytes, _asked: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """The main picture, upright; samples of more than 8 bits stand at the upper end of 16."""
    find_libraries()
    # The C module alone: its Python face needs Pillow, 7 MB more for each Python in the extension.
    import _pi_heif

    # threads, HDR to 8 bits, BGR, without stride, more than 8 bits as 16, decoder, without limits
    found = _pi_heif.load_file(data, 1, False, False, True, True, "", False)
    image = next((one for one in found if one is not None and one.primary), None)
    if image is None:
        raise ValueError("no main picture")
    (width, height), mode = image.size_mode
    facts = {"width": width, "height": height, "mode": mode, "bits": image.bit_depth}
    return facts, bytes(image.data)  # a view would outlive the image, whose memory it shows


def find_libraries() -> None:
    """On Windows: Blender 4.2 leaves a wheel's libraries in the folder that pip would have emptied."""
    add: Any = getattr(os, "add_dll_directory", None)
    for folder in sys.path if add is not None else ():
        for libraries in Path(folder).glob("pi_heif-*.data/platlib"):
            add(str(libraries))


def raw(data: bytes, asked: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """What the file says of its light, and unless no pixels are asked for the linear picture (H, W, C) of 16 bits.

    asked: `most_pixels` of the sensor, 0 for none; `white` and `daylight` of the camera whose white it gets, if any.
    """
    import io

    import rawpy

    with rawpy.imread(io.BytesIO(data)) as file:
        # rawpy 0.25, the last for Intel Macs, does not say what the maker's notes hold
        sizes, other, lens = file.sizes, getattr(file, "other", None), getattr(file, "lens", None)
        daylight, as_shot = _factors(file.daylight_whitebalance), _factors(file.camera_whitebalance)
        white = as_shot or daylight or [1.0] * 4
        if asked.get("white"):
            # the same light balances another sensor by as much more or less as daylight does
            known = daylight and asked["daylight"]
            shares = [own / its for own, its in zip(daylight, asked["daylight"], strict=True)] if known else [1.0] * 4
            white = [factor * share for factor, share in zip(asked["white"], shares, strict=True)]
        facts = {
            "width": sizes.raw_width, "height": sizes.raw_height, "flip": sizes.flip, "white": white,
            "daylight": daylight, "is_balanced": bool(as_shot), "lens": getattr(lens, "model", ""),
        }  # fmt: skip
        for name in ("iso_speed", "shutter_speed", "aperture", "focal_length"):
            facts[name] = float(getattr(other, name, 0))
        # what the header says of its size is not believed before the caller has: memory is taken from here on
        if sizes.raw_width * sizes.raw_height > asked["most_pixels"]:
            return facts, b""
        pixels = file.postprocess(
            user_wb=white, no_auto_bright=True, gamma=(1, 1), output_bps=16, adjust_maximum_thr=0.0, user_flip=0,
        )  # fmt: skip
    height, width, channels = pixels.shape
    return {**facts, "width": width, "height": height, "channels": channels}, pixels.data.cast("B")


def _factors(values: Any) -> list[float]:
    """Red, green, blue and second green, the least 1; none where one of them is missing."""
    red, green, blue, second = map(float, values)
    if not 0 < min(red, green, blue) <= max(red, green, blue) < 1e6:
        return []
    least = min(red, green, blue)
    return [red / least, green / least, blue / least, (second if second > 0 else green) / least]


def main(kind: str) -> int:
    """Reads stdin, writes stdout; what goes wrong is said in the line."""
    asked = json.loads(sys.stdin.buffer.readline())
    data = sys.stdin.buffer.read()
    out, samples = sys.stdout.buffer, b""
    try:
        facts, samples = {"heic": heic, "raw": raw}[kind](data, asked)
    except ImportError as error:
        facts = {"missing": str(error)}
    except Exception as error:  # whatever the libraries raise about damaged files
        facts = {"trouble": f"{type(error).__name__}: {error}"}
    out.write(json.dumps({**facts, "bytes": len(samples)}).encode() + b"\n")
    out.write(samples)
    out.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
