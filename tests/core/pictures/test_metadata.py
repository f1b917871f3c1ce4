"""EXIF and ICC in the containers: what is found, what is written, and that damage never raises."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.camera_raw import is_raw
from edf_stitch.core.pictures.containers import container_brand, neutral_tiff, read_structure, tiff_directory
from edf_stitch.core.pictures.metadata import SOFTWARE, Exif, embed, exif_block, read_exif
from hypothesis import given, settings
from hypothesis import strategies as st

DATA = Path(os.environ.get("EDF_DATA", Path(__file__).resolve().parents[4] / "shared" / "data"))
SMALL = np.random.default_rng(3).integers(0, 256, (24, 40, 3), dtype=np.uint8)
ENCODED = {"jpeg": cv2.imencode(".jpg", SMALL)[1].tobytes(), "png": cv2.imencode(".png", SMALL)[1].tobytes(),
           "tiff": cv2.imencode(".tif", SMALL)[1].tobytes()}
FULL = Exif(kept=(
    (271, "Ångström & Co"), (272, "X1"), (306, "2020:01:02 03:04:05"), (315, "Ann"), (33432, "© Ann"), (33434, (1, 60)),
    (33437, (14, 5)), (34855, 400), (36867, "2020:01:02 03:04:05"), (37380, (-1, 3)), (42036, "50 mm"),
))


def tiff(image: dict, exif: dict | None = None, order: str = "<", following: int = 0) -> bytes:
    """A TIFF structure: {tag: (type, value)} with texts, integers or lists of (numerator, denominator)."""
    def directory(tags: dict, at: int) -> bytes:
        values_at, entries, values = at + 6 + 12 * len(tags), struct.pack(order + "H", len(tags)), b""
        for tag, (kind, value) in sorted(tags.items()):
            if kind == 2:
                count, raw = len(value) + 1, value.encode() + b"\0"
            elif kind in (5, 10):
                pair = order + ("II" if kind == 5 else "ii")
                count, raw = len(value), b"".join(struct.pack(pair, *one) for one in value)
            elif kind == 7:
                count, raw = len(value), value
            else:
                count, raw = 1, struct.pack(order + {3: "H", 4: "I"}[kind], value)
            if len(raw) > 4:
                entries += struct.pack(order + "HHII", tag, kind, count, values_at + len(values))
                values += raw + b"\0" * (len(raw) % 2)
            else:
                entries += struct.pack(order + "HHI", tag, kind, count) + raw.ljust(4, b"\0")
        return entries + struct.pack(order + "I", following) + values

    start = b"II*\0" if order == "<" else b"MM\0*"
    tags = dict(image)
    if exif is not None:
        tags[34665] = (4, 0)
        tags[34665] = (4, 8 + len(directory(tags, 8)))
    body = directory(tags, 8)
    return start + struct.pack(order + "I", 8) + body + (directory(exif, 8 + len(body)) if exif is not None else b"")


@pytest.mark.parametrize("order", ["<", ">"])
def test_everything_the_geometry_asks_for(order: str) -> None:
    block = tiff(
        {271: (2, "Canon"), 272: (2, "EOS"), 274: (3, 6)},
        {37386: (5, [(80, 1)]), 41989: (3, 27), 41486: (5, [(5760000, 1461)]), 41487: (5, [(3840000, 972)]),
         41488: (3, 2), 40962: (3, 5760), 40963: (4, 3840), 42036: (2, "EF24-105mm")}, order)
    exif = read_exif(block)
    assert (exif.orientation, exif.make, exif.model, exif.lens) == (6, "Canon", "EOS", "EF24-105mm")
    assert (exif.focal_mm, exif.focal35_mm, exif.width, exif.height) == (80.0, 27.0, 5760, 3840)
    assert exif.focal_plane_x_per_mm == pytest.approx(5760000 / 1461 / 25.4)
    assert exif.focal_plane_y_per_mm == pytest.approx(3840000 / 972 / 25.4)
    turned = exif.upright()
    assert (turned.width, turned.height) == (3840, 5760)
    assert turned.focal_plane_x_per_mm == exif.focal_plane_y_per_mm


@pytest.mark.parametrize(("unit", "per_mm"), [(2, 100 / 25.4), (3, 10.0), (1, None), (None, 100 / 25.4)])
def test_focal_plane_units(unit: int | None, per_mm: float | None) -> None:
    tags: dict = {41486: (5, [(100, 1)])}
    if unit:
        tags[41488] = (3, unit)
    assert read_exif(tiff({}, tags)).focal_plane_x_per_mm == (None if per_mm is None else pytest.approx(per_mm))


@pytest.mark.parametrize("rational", [(0, 0), (0, 1), (5, 0), (2**32 - 1, 1), (1, 2**32 - 1)])
def test_nonsense_counts_as_absent(rational: tuple[int, int]) -> None:
    nonsense = {37386: (5, [rational]), 41486: (5, [rational]), 41989: (3, 0), 40962: (3, 0)}
    exif = read_exif(tiff({274: (3, 9)}, nonsense))
    assert exif.orientation == 1
    assert exif.focal_mm is exif.focal35_mm is exif.focal_plane_x_per_mm is exif.width is None


def test_what_is_written_is_read_again_and_nothing_else() -> None:
    exif = read_exif(tiff(
        {271: (2, "Canon"), 274: (3, 6), 306: (2, "2020:01:02 03:04:05"), 33432: (2, "Ann"), 34853: (4, 4711)},
        {33434: (5, [(1, 60)]), 37386: (5, [(50, 1)]), 37380: (10, [(-1, 3)]), 37500: (7, b"MakerNoteSecret")}))
    block = exif_block(exif)
    again = read_exif(block)
    assert again.kept == exif.kept
    assert dict(again.kept) == {271: "Canon", 306: "2020:01:02 03:04:05", 33432: "Ann", 33434: (1, 60), 37380: (-1, 3)}
    assert again.focal_mm is None, "the panorama is no longer the sensor"
    assert b"Secret" not in block and SOFTWARE.encode() in block
    directory = tiff_directory(block)
    assert directory is not None
    tags = [entry.tag for entry in directory[0]]
    assert 34853 not in tags
    assert 274 in tags and again.orientation == 1, "the pixels are upright by then"


@pytest.mark.parametrize(("north", "heading"), [("T", 87.5), ("M", None)])
def test_where_the_camera_looked_is_known_from_true_north_alone(north: str, heading: float | None) -> None:
    image = {34853: (4, 0)}
    place = len(tiff(image))
    gps = tiff({16: (2, north), 17: (5, [(175, 2)])}, following=0)[8:]
    # the directory of GPS behind the first one, with its values moved there
    count = struct.unpack_from("<H", gps)[0]
    moved = bytearray(gps)
    struct.pack_into("<I", moved, 2 + 12 * (count - 1) + 8, place + 6 + 12 * count)
    exif = read_exif(tiff({34853: (4, place)}) + bytes(moved))
    assert exif.heading == heading and read_exif(exif_block(exif)).heading is None


@pytest.mark.parametrize("kind", ["jpeg", "png", "tiff"])
def test_exif_and_profile_travel_in(kind: str) -> None:
    profile = bytes(np.random.default_rng(1).integers(0, 256, 150_001, dtype=np.uint8))  # three JPEG segments
    done = embed(ENCODED[kind], kind, FULL, profile)
    structure = read_structure(done)
    assert structure is not None and not structure.damage
    assert (structure.kind, structure.width, structure.height) == (kind, 40, 24)
    assert structure.icc == profile
    assert read_exif(structure.exif).kept == FULL.kept
    pixels = cv2.imdecode(np.frombuffer(done, np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(pixels, cv2.imdecode(np.frombuffer(ENCODED[kind], np.uint8), cv2.IMREAD_UNCHANGED))


def test_parts_of_a_jpeg_profile_may_come_in_any_order_but_must_be_complete() -> None:
    def part(number: int, count: int, body: bytes) -> bytes:
        return b"\xff\xe2" + struct.pack(">H", 16 + len(body)) + b"ICC_PROFILE\0" + bytes([number, count]) + body

    def icc_of(*parts: bytes) -> bytes | None:
        structure = read_structure(ENCODED["jpeg"][:2] + b"".join(parts) + ENCODED["jpeg"][2:])
        assert structure is not None
        return structure.icc

    assert icc_of(part(2, 2, b"world"), part(1, 2, b"hello ")) == b"hello world"
    assert icc_of(part(1, 2, b"hello ")) is None


def test_very_long_texts_are_cut_at_a_letter() -> None:
    block = exif_block(Exif(kept=((33432, "é" * 50_000),)))
    assert len(block) < 3000
    assert set(read_exif(block).text(33432)) == {"é"}


def test_webp_blocks() -> None:
    def chunk(name: bytes, body: bytes) -> bytes:
        return name + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)

    plain = cv2.imencode(".webp", SMALL, [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    header = bytes([0x28, 0, 0, 0]) + (39).to_bytes(3, "little") + (23).to_bytes(3, "little")
    for start in (b"", b"Exif\0\0"):
        exif = chunk(b"EXIF", start + exif_block(FULL))
        body = b"WEBP" + chunk(b"VP8X", header) + chunk(b"ICCP", b"icc") + plain[12:] + exif
        structure = read_structure(b"RIFF" + struct.pack("<I", len(body)) + body)
        assert structure is not None and structure.icc == b"icc" and not structure.damage
        assert read_exif(structure.exif).kept == FULL.kept
    for quality in (50, 101):  # VP8 and VP8L
        small = read_structure(cv2.imencode(".webp", SMALL, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes())
        assert small is not None and (small.width, small.height) == (40, 24)


def test_a_profile_that_unpacks_to_gigabytes_is_left_alone() -> None:
    packer = zlib.compressobj(9)
    bomb = packer.compress(bytes(20_000_000)) + packer.flush()
    body = b"bomb\0\0" + bomb
    chunk = struct.pack(">I", len(body)) + b"iCCP" + body + struct.pack(">I", zlib.crc32(b"iCCP" + body))
    structure = read_structure(ENCODED["png"][:33] + chunk + ENCODED["png"][33:])
    assert structure is not None and not structure.damage and structure.icc is None


def test_neutral_tiff_changes_orientation_and_alpha_only() -> None:
    rgba = cv2.imencode(".tif", np.dstack([SMALL, SMALL[..., 0]]))[1].tobytes()
    marked = embed(rgba, "tiff", FULL, None, straight_alpha=True)
    structure = read_structure(marked)
    assert structure is not None and structure.tiff is not None and structure.tiff.extra == 2
    changed = neutral_tiff(marked)
    after = read_structure(changed)
    assert after is not None and after.tiff is not None and (after.tiff.extra, after.tiff.orientation) == (1, 1)
    assert sum(a != b for a, b in zip(marked, changed, strict=True)) == 1


@pytest.mark.parametrize(("start", "kind"), [
    (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC"), (b"\0\0\0\x18ftypmif1\0\0\0\0mif1heic", "HEIC"),
    (b"\0\0\0\x1cftypmif1\0\0\0\0mif1avif", "AVIF"), (b"\0\0\0\x18ftypavif\0\0\0\0mif1miaf", "AVIF"),
    (b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom", "RAW"), (b"\0\0\0\x18ftypmp42\0\0\0\0mp42isom", ""), (b"", ""),
    (ENCODED["jpeg"], ""),
])
def test_containers_are_told_by_their_brands(start: bytes, kind: str) -> None:
    assert container_brand(start) == kind


@settings(max_examples=300)
@given(st.sampled_from(sorted(ENCODED)), st.integers(0, 10**6),
       st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=8))
def test_damage_never_raises(kind: str, length: int, changes: list[tuple[int, int]]) -> None:
    data = bytearray(embed(ENCODED[kind], kind, FULL, bytes(300)))
    # most of what can be misread stands at one of the ends
    for at, value in changes:
        data[(at if at % 2 else -(at % 800)) % len(data)] = value
    for damaged in (bytes(data), bytes(data[: length % len(data)])):
        is_raw(damaged, ".tif")
        structure = read_structure(damaged)
        if structure is not None:
            assert 1 <= read_exif(structure.exif).orientation <= 8


def test_what_stands_behind_a_jpeg_is_not_its_own() -> None:
    structure = read_structure(ENCODED["jpeg"] + embed(ENCODED["jpeg"], "jpeg", FULL, b"profile"))
    assert structure is not None and structure.exif is None and structure.icc is None and not structure.damage


def test_picture_data_beyond_the_end_of_a_tiff() -> None:
    for length, damage in ((100, ""), (101, "cut off")):
        data = tiff({256: (4, 5), 257: (4, 5), 273: (4, 200), 279: (4, length)})
        structure = read_structure(data.ljust(300, b"\0"))
        assert structure is not None and damage in structure.damage and bool(damage) == bool(structure.damage)


def test_a_block_that_makes_the_reader_raise() -> None:
    # a double that stands beyond the end: ExifRead 3.5 raises an IndexError
    assert read_exif(b"II*\0" + struct.pack("<IHHHIII", 8, 1, 271, 12, 1, 9999, 0)) == Exif()


def test_directories_that_point_at_each_other() -> None:
    assert read_exif(tiff({271: (2, "A"), 34665: (4, 8)})).make == "A"
    assert read_exif(tiff({271: (2, "A"), 274: (3, 3)}, following=8)).orientation == 3
    structure = read_structure(tiff({256: (4, 5), 257: (4, 5), 273: (4, 0), 279: (4, 0)}, following=8))
    assert structure is not None and structure.tiff is not None and structure.tiff.pages == 2


@pytest.mark.parametrize(("name", "focal", "focal35", "model"), [
    ("APAP-railtracks/railtracks_01.JPG", 8.5, 52.0, "DMC-TZ10"), ("REW_gym/gym_01.jpg", 3.95, 27.0, "VTR-AL00"),
    ("REW_worktable/worktable_01.JPG", 80.0, None, "Canon EOS 5D Mark III"),
    ("DFW_desk/16.jpg", 3.93, None, "SGH-I997"),
])
def test_real_cameras(name: str, focal: float, focal35: float | None, model: str) -> None:
    path = DATA / "pairs" / name
    if not path.is_file():
        pytest.skip("the photographs are not here")
    structure = read_structure(path.read_bytes())
    assert structure is not None and not structure.damage
    exif = read_exif(structure.exif)
    assert (exif.focal_mm, exif.focal35_mm, exif.model) == (pytest.approx(focal), focal35, model)
    if "worktable" in name:  # 36 mm wide, 5760 pixels
        assert exif.focal_plane_x_per_mm == pytest.approx(5760 / 37.1, rel=0.01)
    assert read_exif(exif_block(exif)).kept == exif.kept
