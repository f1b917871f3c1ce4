"""Damaged picture files for `test_decoder_fuzz.py`: made, mutated by number, and read one after the other.

    decoder_fuzz.py FIRST LAST        says "N" before it reads case N and "N outcome" after it

Run in a process of its own, so that a native crash or a hang takes nobody along. Every case follows from its number.
"""

from __future__ import annotations

import io
import random
import re
import resource
import struct
import sys
import tempfile
import time
import zlib
from pathlib import Path

import cv2
import numpy as np

# MB: what a refusal may cost beyond the process as it stands, and what stops a run before the machine suffers
REFUSAL_MB, ADDRESS_SPACE_MB = 96, 3000
# bytes of working memory a pixel of an accepted picture may cost: float pixels, alpha, view, and a copy of each
BYTES_PER_PIXEL = 96
WIDTH, HEIGHT = 96, 64


def whole_files() -> dict[str, bytes]:
    """Real files of every kind that is read, in many of its dialects; name → bytes."""
    made: dict[str, bytes] = {}
    rng = np.random.default_rng(8)
    noise = cv2.GaussianBlur(rng.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8), (0, 0), 1.5)
    deep = noise.astype(np.uint16) * 257
    for suffix in (".png", ".jpg", ".tif", ".webp", ".bmp"):
        made[f"bgr{suffix}"] = _encoded(suffix, noise[..., :3])
        made[f"gray{suffix}"] = _encoded(suffix, noise[..., 0])
    for suffix in (".png", ".tif", ".webp", ".bmp"):
        made[f"bgra{suffix}"] = _encoded(suffix, noise)
    for suffix in (".png", ".tif"):
        made[f"deep{suffix}"] = _encoded(suffix, deep[..., :3])
        made[f"deep_alpha{suffix}"] = _encoded(suffix, deep)
    made["float.tif"] = _encoded(".tif", noise[..., :3].astype(np.float32) / 255)
    made["progressive.jpg"] = _encoded(".jpg", noise[..., :3], cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    made["restarts.jpg"] = _encoded(".jpg", noise[..., :3], cv2.IMWRITE_JPEG_RST_INTERVAL, 2)
    made["lossy.webp"] = _encoded(".webp", noise[..., :3], cv2.IMWRITE_WEBP_QUALITY, 60)
    made |= _by_pillow(noise) | _by_tifffile(noise) | _by_openexr(noise) | _radiance(noise) | _by_hand(noise)
    return made


def _encoded(suffix: str, array: np.ndarray, *options: int) -> bytes:
    return cv2.imencode(suffix, array, list(options))[1].tobytes()


def _by_pillow(noise: np.ndarray) -> dict[str, bytes]:
    """Palettes, codecs of TIFF, CMYK, EXIF and ICC blocks, several pages, and an animation."""
    from PIL import Image, ImageCms

    picture = Image.fromarray(noise[..., :3])
    exif = Image.Exif()
    exif[274], exif[271], exif[36867] = 6, "Maker", "2020:01:01 00:00:00"
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    described = {"exif": exif.tobytes(), "icc_profile": icc}
    kinds = {
        "palette.png": (picture.convert("P"), {}), "bits.png": (picture.convert("1"), {}),
        "described.png": (picture, described), "described.jpg": (picture, described),
        "cmyk.jpg": (picture.convert("CMYK"), {}), "described.webp": (picture, described),
        "palette.bmp": (picture.convert("P"), {}),
        **{f"animated.{kind}": (picture, {"save_all": True, "append_images": [picture.rotate(9), picture.rotate(40)]})
           for kind in ("webp", "png")},
        "pages.tif": (picture, {"save_all": True, "append_images": [picture.rotate(9)]}),
        "palette.tif": (picture.convert("P"), {}), "bits.tif": (picture.convert("1"), {"compression": "group4"}),
        **{f"{name}.tif": (picture, {"compression": name})
           for name in ("tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg")},
    }  # fmt: skip
    made = {}
    for name, (image, options) in kinds.items():
        stream = io.BytesIO()
        image.save(stream, {"jpg": "jpeg", "tif": "tiff"}.get(name[-3:], name.rpartition(".")[2]), **options)
        made[name] = stream.getvalue()
    return made


def _by_tifffile(noise: np.ndarray) -> dict[str, bytes]:
    """Tiles, BigTIFF, planes, the other byte order, half floats, further channels."""
    import tifffile

    made = {}
    for name, how, options in (
        ("tiled.tif", {}, {"tile": (16, 32), "compression": "zlib"}), ("big.tif", {"bigtiff": True}, {}),
        ("motorola.tif", {"byteorder": ">"}, {"rowsperstrip": 5}), ("planes.tif", {}, {"planarconfig": "separate"}),
    ):  # fmt: skip
        stream = io.BytesIO()
        with tifffile.TiffWriter(stream, **how) as file:
            pixels = np.ascontiguousarray(noise[..., :3])
            file.write(np.moveaxis(pixels, 2, 0) if name == "planes.tif" else pixels, photometric="rgb", **options)
        made[name] = stream.getvalue()
    deep = np.ascontiguousarray(noise[..., :3]).astype(np.uint16) * 257
    for name, pixels, options in (
        ("deep_planes.tif", np.moveaxis(deep, 2, 0), {"planarconfig": "separate", "compression": "zlib"}),
        ("half.tif", (deep / 65535).astype(np.float16), {"compression": "zlib"}),
        ("infrared.tif", np.ascontiguousarray(noise), {"extrasamples": ["unspecified"]}),
        ("inks.tif", np.ascontiguousarray(noise), {"photometric": "separated"}),
        ("small_tiles.tif", deep, {"tile": (16, 16), "compression": "zlib"}),
    ):  # fmt: skip
        stream = io.BytesIO()
        tifffile.imwrite(stream, np.ascontiguousarray(pixels), **{"photometric": "rgb"} | options)
        made[name] = stream.getvalue()
    return made


def _by_hand(noise: np.ndarray) -> dict[str, bytes]:
    """A BMP of OS/2, a PNG with a transparent level, a gamma and EXIF in a text."""
    rows = noise[::-1, :, :3].reshape(HEIGHT, -1)
    head = struct.pack("<2sIHHIIHHHH", b"BM", 26 + rows.size, 0, 0, 26, 12, WIDTH, HEIGHT, 1, 24)
    png = _encoded(".png", noise[..., 0])
    exif = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    further = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in (
            (b"gAMA", struct.pack(">I", 100_000)), (b"tRNS", b"\0\x50"),
            (b"tEXt", b"Raw profile type exif\0\nexif\n %d\n%s" % (len(exif), exif.hex().encode())),
        )
    )  # fmt: skip
    return {"os2.bmp": head + rows.tobytes(), "chunks.png": png[:33] + further + png[33:]}


def _by_openexr(noise: np.ndarray) -> dict[str, bytes]:
    """Codecs, half floats, tiles, layers and parts."""
    import OpenEXR

    light = noise.astype(np.float32) / 255
    colours = {name: np.ascontiguousarray(light[..., index]) for index, name in enumerate("RGBA")}
    layers = {f"ViewLayer.Combined.{name}": plane for name, plane in colours.items()}
    layers["ViewLayer.Depth.Z"] = colours["R"]
    half = {name: plane.astype(np.float16) for name, plane in colours.items()}
    scan, tiled = OpenEXR.scanlineimage, OpenEXR.tiledimage
    kinds = {
        "half.exr": ({"compression": OpenEXR.PIZ_COMPRESSION, "type": scan}, half),
        "layers.exr": ({"compression": OpenEXR.ZIPS_COMPRESSION, "type": scan}, layers),
        "aces.exr": (
            {"compression": OpenEXR.ZIP_COMPRESSION, "type": scan,
             "chromaticities": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)}, colours,
        ),
        "tiles.exr": (
            {"compression": OpenEXR.ZIP_COMPRESSION, "type": tiled, "tiles": OpenEXR.TileDescription()}, colours,
        ),
    }  # fmt: skip
    codecs = ("NO", "RLE", "ZIP", "PXR24", "B44", "DWAA")
    kinds |= {f"{name}.exr": ({"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": scan}, colours)
              for name in codecs}  # fmt: skip
    made = {}
    for name, (header, channels) in kinds.items():
        stream = io.BytesIO()
        with OpenEXR.File(header, channels) as file:
            file.write(stream)
        made[name] = stream.getvalue()
    stream = io.BytesIO()
    parts = [OpenEXR.Part({"name": name, "type": scan}, colours) for name in ("left", "right")]
    with OpenEXR.File(parts) as file:
        file.write(stream)
    made["parts.exr"] = stream.getvalue()
    return made


def _radiance(noise: np.ndarray) -> dict[str, bytes]:
    """Pixels in runs of either kind, and plain; rows and columns."""
    light = np.float32(2.0) ** (noise[..., :3] / np.float32(16) - 8)
    light[20:40] = light[20, 20]
    lines = b"EXPOSURE=2\nCOLORCORR=1 2 1\nPRIMARIES=0.7 0.3 0.2 0.8 0.1 0.05 0.3127 0.329\nPIXASPECT=1\n"
    packed = _encoded(".hdr", light, cv2.IMWRITE_HDR_COMPRESSION, cv2.IMWRITE_HDR_COMPRESSION_RLE)
    plain = _encoded(".hdr", light, cv2.IMWRITE_HDR_COMPRESSION, cv2.IMWRITE_HDR_COMPRESSION_NONE)
    repeated = plain[: -4 * (WIDTH * HEIGHT - 1)] + bytes([1, 1, 1, (WIDTH * HEIGHT - 1) % 256])
    repeated += bytes([1, 1, 1, (WIDTH * HEIGHT - 1) // 256])
    rows, columns = (f"-Y {HEIGHT} +X {WIDTH}".encode(), f"+X {HEIGHT} +Y {WIDTH}".encode())
    return {
        "packed.hdr": packed.replace(b"FORMAT", lines + b"FORMAT"), "plain.hdr": plain, "repeated.hdr": repeated,
        "columns.hdr": packed.replace(rows, columns).replace(b"rgbe", b"xyze"),
    }  # fmt: skip


def case(number: int, files: dict[str, bytes]) -> tuple[str, bytes]:
    """The name of the file that case `number` began as, and its mutated bytes."""
    rng = random.Random(number)
    names = sorted(files)
    name = names[number % len(names)]
    data = bytearray(files[name])
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        rng.choice(MUTATIONS)(data, rng, files)
    # a wrong checksum is found at once: most cases get past it
    return name, _checksums_mended(bytes(data)) if rng.random() < 0.7 else bytes(data)


def _flip_bits(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    for _ in range(rng.choice((1, 3, 10, 50))):
        if data:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _flip_in_the_head(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    for _ in range(rng.choice((1, 2, 5))):
        if data:
            data[rng.randrange(min(len(data), 300))] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))


def _cut(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    del data[rng.randrange(len(data) + 1) :]


def _drop(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    start = rng.randrange(len(data) + 1)
    del data[start : start + rng.choice((1, 2, 4, 16, 200))]


def _repeat(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    start = rng.randrange(len(data) + 1)
    data[start:start] = data[start : start + rng.choice((1, 4, 64, 1000))] * rng.choice((1, 2, 20))


def _insert(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    start = rng.randrange(len(data) + 1)
    data[start:start] = rng.randbytes(rng.choice((1, 4, 64)))


def _lie(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    """A number where a size, a count or an offset may stand."""
    value = rng.choice((0, 1, 2, 255, 4096, 16383, 20_000, 30_000, 65_535, 65_536, 100_000, 2**24, 2**31 - 1, 2**31,
                        2**32 - 1, len(data), WIDTH - 1, WIDTH + 1))  # fmt: skip
    form = rng.choice(("<H", ">H", "<I", ">I"))
    width = struct.calcsize(form)
    if len(data) >= width:
        at = rng.randrange(min(len(data) - width, rng.choice((40, 400, 10**6))) + 1)
        struct.pack_into(form, data, at, value % 256**width)


def _lie_about_the_size(data: bytearray, rng: random.Random, _files: dict[str, bytes]) -> None:
    """Width and height as they stand in the file, replaced by large ones, everywhere."""
    for old, form in ((WIDTH, "<H"), (HEIGHT, "<H"), (WIDTH, ">H"), (HEIGHT, ">H"), (WIDTH, "<I"), (HEIGHT, "<I"),
                      (WIDTH, ">I"), (HEIGHT, ">I"), (WIDTH - 1, "<I"), (HEIGHT - 1, "<I")):  # fmt: skip
        found = struct.pack(form, old)
        value = rng.choice((1, 5000, 16_384, 20_000, 40_000, 65_535))
        for at in (match.start() for match in re.finditer(re.escape(found), bytes(data[:1000]))):
            if rng.random() < 0.5:
                data[at : at + len(found)] = struct.pack(form, value)


def _splice(data: bytearray, rng: random.Random, files: dict[str, bytes]) -> None:
    """The tail of another file."""
    other = files[rng.choice(sorted(files))]
    data[rng.randrange(len(data) + 1) :] = other[rng.randrange(len(other)) :]


MUTATIONS = (
    _flip_bits, _flip_bits, _flip_in_the_head, _flip_in_the_head, _cut, _drop, _repeat, _insert, _lie, _lie,
    _lie_about_the_size, _splice,
)  # fmt: skip


def _checksums_mended(data: bytes) -> bytes:
    """A PNG with the checksums its chunks now ought to have; everything else as it is."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        return data
    mended, at = bytearray(data), 8
    while at + 12 <= len(data):
        length = struct.unpack_from(">I", data, at)[0]
        if at + 12 + length > len(data):
            break
        struct.pack_into(">I", mended, at + 8 + length, zlib.crc32(data[at + 4 : at + 8 + length]))
        at += 12 + length
    return bytes(mended)


def outcome_of(path: Path) -> str:
    """What reading the file came to: "picture", "refused", or in words what went wrong."""
    from edf_stitch.core.pictures.picture import load_picture
    from edf_stitch.core.system.errors import StitchError

    Path("/proc/self/clear_refs").write_text("5")  # the high water mark starts anew
    before, began = _resident_mb("VmRSS"), time.process_time()
    allowed = REFUSAL_MB
    try:
        picture = load_picture(path)
        outcome = "picture"
        allowed += picture.view.shape[0] * picture.view.shape[1] * BYTES_PER_PIXEL // 10**6
        shapes_fit = picture.pixels.shape == picture.view.shape and picture.pixels.dtype == np.float32
        if not shapes_fit or not np.isfinite(picture.pixels).all():
            outcome = f"no sound picture: {picture.pixels.shape} {picture.pixels.dtype} {picture.view.shape}"
    except StitchError as error:
        outcome = "refused" if str(error).startswith(f"{path}: ") and len(str(error)) < 1000 else f"says: {error}"
    except Exception as error:
        outcome = f"raises {type(error).__name__}: {error}"
    took, seconds = _resident_mb("VmHWM") - before, time.process_time() - began
    if took > allowed:
        return f"takes {took} MB ({outcome}, {allowed} MB allowed)"
    return outcome if seconds < 5 else f"takes {seconds:.1f} s of CPU ({outcome})"


def _resident_mb(name: str) -> int:
    return int(re.search(rf"{name}:\s+(\d+)", Path("/proc/self/status").read_text())[1]) // 1024


def main(first: int, last: int) -> None:
    """Reads the cases first … last − 1."""
    files = whole_files()
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_MB << 20,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, last):
            name, data = case(number, files)
            path = Path(folder) / name
            path.write_bytes(data)
            print(number, end=" ", flush=True)
            print(outcome_of(path), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
