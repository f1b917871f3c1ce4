"""HEIC files: what they say, what is found to be damaged before it is decoded, and the pixels that come out."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures import heif_decoding
from edf_stitch.core.pictures.containers import read_structure
from edf_stitch.core.pictures.heif import HeifFacts, read_heif
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.system.errors import UnreadableImage

from .raw_and_heic import heic

NOISE = cv2.GaussianBlur(np.random.default_rng(8).integers(0, 256, (64, 96, 4), dtype=np.uint8), (0, 0), 2)
COLOUR = np.ascontiguousarray(NOISE[..., :3])


def loaded(folder: Path, data: bytes, name: str = "a.heic") -> Picture:
    (folder / name).write_bytes(data)
    return load_picture(folder / name)


def patched(data: bytes, old: bytes, new: bytes) -> bytes:
    assert old in data
    return data.replace(old, new)


def exif_of(orientation: int) -> bytes:
    image = pytest.importorskip("PIL.Image").Exif()
    image[274], image[271] = orientation, "Maker"
    return image.tobytes()


def test_a_picture_comes_out_as_it_went_in(tmp_path: Path) -> None:
    picture = loaded(tmp_path, heic(COLOUR), "named.jpg")
    assert picture.bits == 8 and picture.icc is None and picture.alpha is None and not picture.warnings
    assert np.abs(picture.view.astype(int) - COLOUR).max() <= 2, "HEVC stores brightness and two differences"


def test_gray_and_alpha(tmp_path: Path) -> None:
    gray = loaded(tmp_path, heic(NOISE[..., 0]))
    assert gray.view.shape == (64, 96, 1) and np.abs(gray.view[..., 0].astype(int) - NOISE[..., 0]).max() <= 1
    picture = loaded(tmp_path, heic(NOISE))
    assert picture.alpha is not None and np.abs(picture.alpha * 255 - NOISE[..., 3]).max() <= 2
    assert np.abs(picture.view.astype(int) - COLOUR).max() <= 2, "straight, as it was written"


def test_ten_bits_reach_from_black_to_white(tmp_path: Path) -> None:
    ramp = np.repeat(np.linspace(0, 65535, 96).astype(np.uint16)[None, :, None], 64, axis=0).repeat(3, axis=2)
    picture = loaded(tmp_path, heic(ramp, "RGB;16"))
    assert picture.bits == 16
    levels = picture.light.levels  # type: ignore[union-attr]
    assert levels.min() == 0 and levels.max() == 65535, "10 bits stand at the upper end of 16"
    assert np.abs(levels.astype(int) - ramp).max() <= 65535 // 1023 * 2


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_it_comes_out_upright_once(tmp_path: Path, orientation: int) -> None:
    plain = loaded(tmp_path, heic(COLOUR)).view
    picture = loaded(tmp_path, heic(COLOUR, exif=exif_of(orientation)))
    turns = {1: 0, 3: 2, 6: 3, 8: 1}[orientation]
    assert (picture.view == np.rot90(plain, turns)).all()
    assert picture.exif.make == "Maker" and picture.exif.orientation == 1, "nothing is left to be turned"


def test_a_colour_profile_is_kept(tmp_path: Path) -> None:
    profiles = pytest.importorskip("PIL.ImageCms")
    icc = profiles.ImageCmsProfile(profiles.createProfile("sRGB")).tobytes()
    assert loaded(tmp_path, heic(COLOUR, icc_profile=icc)).icc == icc


def test_wider_primaries_get_a_profile_and_light_beyond_a_display_is_refused(tmp_path: Path) -> None:
    data = heic(COLOUR)
    at = data.index(b"nclx") + 4
    made = {number: loaded(tmp_path, data[:at] + struct.pack(">H", number) + data[at + 2 :]) for number in (9, 12, 11)}
    assert made[12].icc is not None and b"D\0i\0s\0p\0l\0a\0y\0 \0P\0003" in made[12].icc and not made[12].warnings
    assert made[9].icc not in (None, made[12].icc) and made[11].icc is None and "kind 11" in made[11].warnings[0]
    for number, word in ((16, "PQ"), (18, "HLG"), (99, "number 99")):
        with pytest.raises(UnreadableImage, match=f"{word}.*export it as JPEG, or as EXR"):
            loaded(tmp_path, data[: at + 2] + struct.pack(">H", number) + data[at + 4 :])


@pytest.mark.parametrize(("coding", "words"), [("av01", "AVIF"), ("unci", "uncompressed"), ("abcd", "'abcd'")])
def test_other_codings_are_refused_by_name(tmp_path: Path, coding: str, words: str) -> None:
    data = heic(COLOUR)
    at = data.index(b"hvc1", data.index(b"infe"))  # not the brand
    with pytest.raises(UnreadableImage, match=f"HEIF pictures that are .*{words}.*export it as PNG or JPEG"):
        loaded(tmp_path, data[:at] + coding.encode() + data[at + 4 :])


def test_what_is_cut_off_or_lost_is_found_before_it_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heif_decoding, "decoded", lambda *_: pytest.fail("the decoder was asked"))
    data = heic(COLOUR)
    assert not read_heif(data).damage
    hole, end = bytearray(data), len(data)
    hole[end - 900 : end - 800] = bytes(100)
    tail = data[: end - 200] + bytes(200)
    for name, damaged in {
        "half": data[: end // 2], "last byte": data[:-1], "head": data[:60], "tables": data[:300], "hole": bytes(hole),
        "tail": tail, "no meta": patched(data, b"meta", b"free"), "no places": patched(data, b"iloc", b"free"),
        "no units": patched(data, b"hvcC", b"free"), "no size": patched(data, b"ispe", b"free"),
        "no names": patched(data, b"iinf", b"free"), "no properties": patched(data, b"ipma", b"free"),
    }.items():  # fmt: skip
        with pytest.raises(UnreadableImage, match="the HEIC file is damaged: .*; copy or export it again"):
            loaded(tmp_path, damaged)
            pytest.fail(name)


def test_sizes_are_checked_wherever_they_stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heif_decoding, "decoded", lambda *_: pytest.fail("the decoder was asked"))
    small, size = heic(COLOUR), struct.pack(">II", 96, 64)
    with pytest.raises(UnreadableImage, match="16000 × 16000 pixels cannot come out of"):
        loaded(tmp_path, patched(small, size, struct.pack(">II", 16_000, 16_000)))
    large = heic(np.zeros((1200, 1600, 3), np.uint8))
    lie = patched(large, struct.pack(">II", 1600, 1200), size)
    with pytest.raises(UnreadableImage, match="larger than its header says"):
        loaded(tmp_path, lie)


def test_a_size_that_the_decoder_contradicts_is_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = {"width": 95, "height": 64, "mode": "RGB", "bits": 8}
    monkeypatch.setattr(heif_decoding, "decoded", lambda *_: (other, np.zeros(95 * 64 * 3, np.uint8)))
    with pytest.raises(UnreadableImage, match="95 × 64 pixels came out of it, its header says 96 × 64"):
        loaded(tmp_path, heic(COLOUR))


# --- a grid of tiles, as phones write it -----------------------------------------------------------------------------


def box(kind: bytes, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return struct.pack(">I", 8 + len(body)) + kind + body


def full(kind: bytes, *parts: bytes, version: int = 0) -> bytes:
    return box(kind, bytes([version, 0, 0, 0]), *parts)


def grid(
    rows: int = 1, columns: int = 2, size: tuple[int, int] = (180, 60), tiles: int = 2, copies: int = 2
) -> bytes:
    """Item 1: a grid in idat, turned by a quarter; items 2 …: the same coded tile of 96 × 64 px, which the file holds
    some times."""
    single = heic(COLOUR)
    facts = single.index(b"hvcC") - 4
    configuration = single[facts : facts + struct.unpack_from(">I", single, facts)[0]]
    coded = single[single.index(b"mdat") + 4 :]
    described = struct.pack(">BBBBHH", 0, 0, rows - 1, columns - 1, *size)
    properties = box(
        b"ipco", full(b"ispe", struct.pack(">II", *size)), full(b"ispe", struct.pack(">II", 96, 64)), configuration,
        box(b"irot", b"\1"),
    )  # fmt: skip
    names = [full(b"infe", struct.pack(">HH4s", number, 0, kind), b"\0", version=2)
             for number, kind in [(1, b"grid"), *((2 + k, b"hvc1") for k in range(tiles))]]  # fmt: skip
    uses = [struct.pack(">HBBB", 1, 2, 1, 4), *(struct.pack(">HBBB", 2 + k, 2, 2, 3) for k in range(tiles))]

    def file(coded_at: int) -> bytes:
        places = [struct.pack(">HHHHII", 1, 1, 0, 1, 0, len(described))]
        places += [struct.pack(">HHHHII", 2 + k, 0, 0, 1, coded_at, len(coded)) for k in range(tiles)]
        meta = full(
            b"meta", full(b"hdlr", bytes(4), b"pict", bytes(13)), full(b"pitm", struct.pack(">H", 1)),
            full(b"iinf", struct.pack(">H", len(names)), *names),
            full(b"iref", box(b"dimg", struct.pack(f">{2 + tiles}H", 1, tiles, *range(2, 2 + tiles)))),
            full(b"iloc", b"\x44\0", struct.pack(">H", len(places)), *places, version=1),
            box(b"iprp", properties, full(b"ipma", struct.pack(">I", len(uses)), *uses)), box(b"idat", described),
        )  # fmt: skip
        return box(b"ftyp", b"heic", bytes(4), b"mif1heic") + meta + box(b"mdat", coded * copies)

    return file(file(0).index(b"mdat") + 4)


def test_a_grid_of_tiles_is_read(tmp_path: Path) -> None:
    """The two tiles lie one behind the other, but show the same."""
    facts = read_heif(grid())
    assert facts == HeifFacts(60, 180, "", "hvc1", 8)
    picture = loaded(tmp_path, grid())
    upright = np.rot90(np.hstack([COLOUR, COLOUR])[:60, :180])
    assert picture.view.shape == (180, 60, 3) and np.abs(picture.view.astype(int) - upright).max() <= 2


@pytest.mark.parametrize("asked", [
    {"columns": 3}, {"rows": 2}, {"tiles": 1}, {"size": (193, 60)}, {"size": (96, 60)}, {"size": (180, 65)},
])  # fmt: skip
def test_tiles_that_do_not_make_the_picture_are_damage(asked: dict[str, int]) -> None:
    assert "tiles" in read_heif(grid(**asked)).damage


def test_one_tile_that_is_used_for_ever_is_no_picture() -> None:
    """Tiles by the thousand could each be walked through, in a small file."""
    endless = grid(rows=1, columns=20, size=(20 * 96, 64), tiles=20, copies=2)
    assert read_heif(endless).damage == "its picture data overlap"
    assert not read_heif(grid(rows=1, columns=20, size=(20 * 96, 64), tiles=20, copies=20)).damage


def test_a_broken_alpha_is_damage_too() -> None:
    data = heic(NOISE)
    assert not read_heif(data).damage
    sizes = [read_heif(data[: len(data) - cut]).damage for cut in (1, len(data) // 3)]
    assert all(sizes), "colour stands before alpha or behind it"


def test_what_is_appended_or_unknown_hurts_nobody() -> None:
    data = heic(COLOUR)
    plain = read_heif(data)
    assert read_heif(data + b"SEFH" + bytes(99)) == plain
    assert read_heif(data + b"\0\0\1\0free") == plain, "a box that is cut off and is not needed"
    structure = read_structure(data)
    assert structure is not None and structure.heif == replace(plain)
