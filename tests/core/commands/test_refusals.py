"""What the command refuses: each with its exit code, what was found, what to do, and nothing left behind.

Options and the plain cases (missing, not a picture, an output that exists) are in test_cli.py.
"""

from __future__ import annotations

import errno
import io
import os
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core import pipeline
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.core.system.output_files import OutputFiles
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import KNOWN_WORDS

OpenEXR = pytest.importorskip("OpenEXR")

NOISE = np.random.default_rng(5).integers(0, 256, (60, 80, 3), dtype=np.uint8)
Refused = Callable[..., None]


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def refused(capfd: pytest.CaptureFixture[str]) -> Refused:
    """Runs `edf stitch` and expects an exit code and one line with all the words."""

    def run(code: int, arguments: list[str | Path], *words: str) -> None:
        assert main(["stitch", *map(str, arguments), "--quiet"]) == code
        out, err = capfd.readouterr()
        assert out == "" and "Traceback" not in err and "internal error" not in err
        line = err.splitlines()[-1]
        assert line.startswith("edf: ") and all(word in line for word in words), err
        # OpenEXR has a word of its own about damaged files
        assert all("EXR_ERR" in other for other in err.splitlines()[:-1]), err

    return run


@pytest.fixture
def never_stitched(monkeypatch: pytest.MonkeyPatch) -> None:
    """The refusal comes before the work."""
    monkeypatch.setattr(pipeline, "stitch", lambda *_, **__: pytest.fail("the work began"))


def encoded(array: np.ndarray, suffix: str = ".png") -> bytes:
    return cv2.imencode(suffix, array)[1].tobytes()


def exr(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    channels = {name: np.ascontiguousarray(array[..., index], np.float32) for index, name in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(stream)
    return stream.getvalue()


def with_bad_rows(array: np.ndarray, share: float, value: float) -> np.ndarray:
    out = array.astype(np.float32)
    out[: round(len(out) * share)] = value
    return out


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


# --- pictures that do not go together -------------------------------------------------------------------------------


def test_the_same_picture_under_another_name(folder: Path, tmp_path: Path, refused: Refused) -> None:
    shutil.copy(folder / "reference.png", tmp_path / "copy.png")
    refused(3, [folder / "reference.png", tmp_path / "copy.png", "-o", tmp_path / "out.png"],
            "same picture", "taken from different places")  # fmt: skip
    assert set(files(tmp_path)) == {"copy.png"}


def test_photographs_without_common_content(data: Path, tmp_path: Path, refused: Refused) -> None:
    pairs = data / "pairs"
    for first, second in (("DFW_desk/16.jpg", "DHW-temple/4.jpg"), ("DHW-temple/4.jpg", "DFW_desk/16.jpg")):
        refused(3, [pairs / first, pairs / second, "-o", tmp_path / "out.png"], " needed: ")
    assert files(tmp_path) == {}


TEXTURELESS = {
    "flat": np.full((180, 240, 3), 128, np.uint8), "1x1": NOISE[:1, :1], "3x2": NOISE[:2, :3],
    "20000x10": np.tile(NOISE[:10], (1, 250, 1)), "10x20000": np.tile(NOISE[:50, :10], (400, 1, 1)),
    "ramp": np.dstack([np.tile(np.linspace(40, 220, 240).astype(np.uint8), (180, 1))] * 3),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTURELESS)
def test_pictures_with_nothing_to_hold_on_to(folder: Path, tmp_path: Path, refused: Refused, name: str) -> None:
    paths = [tmp_path / "one.png", tmp_path / "two.png"]
    for path, array in zip(paths, (TEXTURELESS[name], np.flip(TEXTURELESS[name]) // 2 + 3), strict=True):
        path.write_bytes(encoded(array))
    for pair in (paths, [paths[0], folder / "target.png"], [folder / "reference.png", paths[1]]):
        refused(3, [*pair, "-o", tmp_path / "out.png", "--layers", tmp_path / "new"], " needed: ")
    assert {path.name for path in tmp_path.iterdir()} == {"one.png", "two.png"}


# --- files ----------------------------------------------------------------------------------------------------------

HEADER = b"\x89PNG\r\n\x1a\n"
BOMB = (HEADER + chunk(b"IHDR", struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b""))  # fmt: skip
HEIC, AVIF, CR3 = (struct.pack(">I", 24) + b"ftyp" + brand + bytes(4) + b"mif1" + brand + bytes(99)
                   for brand in (b"heic", b"avif", b"crx "))  # fmt: skip
CR2 = b"II*\0\x10\0\0\0CR\2\0" + bytes(99)
RAW_WORDS = ("camera RAW file", "export a 16-bit TIFF")
HEIC_WORDS = ("the HEIC file is damaged", "copy or export it again")
UNKNOWN_WORDS = ("not a picture of a known kind", "export it as PNG")
BAD_FILES: dict[str, tuple[bytes, tuple[str, ...]]] = {
    **{f"half{suffix}": (encoded(NOISE, suffix)[:3000], ("cut off", "copy or export it again"))
       for suffix in (".png", ".jpg", ".tif", ".webp")},
    "half.bmp": (encoded(NOISE, ".bmp")[:9000], ("damaged or of an unusual kind", "save it as PNG or TIFF")),
    "half.exr": (exr(NOISE)[:9000], ("damaged or cut off", "copy or render it again")),
    "empty.png": (b"", ("the file is empty", "copy or export it again")),
    "zeros.jpg": (bytes(5000), UNKNOWN_WORDS), "text.png": (b"a letter and no picture\n", UNKNOWN_WORDS),
    "film.mp4": (b"\0\0\0\x18ftypisom\0\0\2\0isomiso2" + bytes(99), ("a film, which is not read", "export its frames")),
    "page.jpg": (b"<!DOCTYPE html><title>404</title>", ("a web page, which is not read", "download the picture")),
    "a.gif": (b"GIF89a" + bytes(99), ("a GIF, which is not read", "export it as PNG or TIFF")),
    "header.png": (HEADER, ("cut off",)), "cut off and named.png": (encoded(NOISE, ".jpg")[:999], ("JPEG", "cut off")),
    "bomb.png": (BOMB, ("100000 × 100000 pixels are too many", "400 megapixels", "scale the picture down")),
    "a.heic": (HEIC, HEIC_WORDS), "magic.jpg": (HEIC, HEIC_WORDS), "suffix.HEIF": (b"something new", UNKNOWN_WORDS),
    "brand.heic": (HEIC.replace(b"heic", b"new1").replace(b"mif1", b"new2"), UNKNOWN_WORDS),
    "a.avif": (AVIF, ("an AVIF picture, which is not read", "export it as PNG or JPEG")),
    "suffix.avif": (b"something new", UNKNOWN_WORDS),
    "a.cr2": (CR2, RAW_WORDS), "magic.tif": (CR2, RAW_WORDS), "a.cr3": (CR3, RAW_WORDS), "b.jpg": (CR3, RAW_WORDS),
    "suffix.NEF": (encoded(NOISE, ".tif"), RAW_WORDS), "suffix.dng": (b"something new", RAW_WORDS),
    "nan.exr": (exr(with_bad_rows(NOISE, 0.6, np.nan)), ("60% of the pixels are not finite", "export it again")),
    "inf.exr": (exr(with_bad_rows(NOISE, 0.6, -np.inf)), ("60% of the pixels are not finite", "export it again")),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_FILES)
def test_files_that_are_no_whole_picture(folder: Path, tmp_path: Path, refused: Refused, name: str) -> None:
    data, words = BAD_FILES[name]
    bad = tmp_path / name
    bad.write_bytes(data)
    refused(4, [folder / "reference.png", bad, "-o", tmp_path / "out.png"], str(bad), *words)
    refused(4, [bad, folder / "target.png", "-o", tmp_path / "out.png", "--layers", tmp_path / "new"], str(bad), *words)
    assert set(files(tmp_path)) == {name}


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="devices as POSIX has them")
def test_a_device_is_no_picture(folder: Path, tmp_path: Path, refused: Refused) -> None:
    refused(4, [folder / "reference.png", "/dev/null", "-o", tmp_path / "out.png"],
            "/dev/null: not a regular file; copy the picture into one")  # fmt: skip


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(folder: Path, tmp_path: Path, refused: Refused) -> None:
    locked = Path(shutil.copy(folder / "target.png", tmp_path / "locked.png"))
    locked.chmod(0)
    refused(4, [folder / "reference.png", locked, "-o", tmp_path / "out.png"],
            "cannot be opened: Permission denied; check its permissions")  # fmt: skip


def test_a_picture_under_the_suffix_of_another_kind_is_read(folder: Path, tmp_path: Path, small_pair: Pair) -> None:
    shutil.copy(folder / "reference.png", tmp_path / "first.jpg")
    (tmp_path / "second.heic").write_bytes(encoded(small_pair.target[..., ::-1]))
    out = tmp_path / "out.png"
    names = [str(tmp_path / name) for name in ("first.jpg", "second.heic")]
    assert main(["stitch", *names, "-o", str(out), *KNOWN_WORDS]) == 0
    assert out.is_file()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_few_pixels_that_are_no_numbers_are_left_out_with_a_warning(
    tmp_path: Path, small_pair: Pair, capfd: pytest.CaptureFixture[str], value: float
) -> None:
    first, second, out = (str(tmp_path / f"{name}.exr") for name in ("first", "second", "out"))
    light = [((a / 255.0) ** 2.2).astype(np.float32) for a in (small_pair.reference, small_pair.target)]
    Path(first).write_bytes(exr(with_bad_rows(light[0], 0.1, value)))
    Path(second).write_bytes(exr(light[1]))
    assert main(["stitch", first, second, "-o", out, *KNOWN_WORDS, "--quiet"]) == 0
    said = capfd.readouterr().err
    assert "edf: warning: first.exr: 10.00% of the pixels are not finite numbers" in said and "transparent" in said
    panorama = load_picture(out)
    assert panorama.alpha is not None and np.isfinite(panorama.pixels).all()


# --- outputs --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "taken", ["out.png", "r.json", "r.timing.json", "w.npz", "layers/01_target.png", "layers/00_reference.exr"]
)
def test_every_output_that_exists_stays(
    folder: Path, tmp_path: Path, refused: Refused, never_stitched: None, taken: str
) -> None:
    (tmp_path / taken).parent.mkdir(exist_ok=True)
    (tmp_path / taken).write_bytes(b"mine")
    wanted = ["--report", tmp_path / "r.json", "--warp", tmp_path / "w.npz", "--layers", tmp_path / "layers"]
    refused(4, [folder / "reference.png", folder / "target.png", "-o", tmp_path / "out.png", *wanted],
            f"{tmp_path / taken} exists: use --overwrite or choose another name")  # fmt: skip
    assert files(tmp_path) == {taken: b"mine"}


def test_places_where_nothing_can_be_written(
    folder: Path, tmp_path: Path, refused: Refused, never_stitched: None
) -> None:
    pictures = [folder / "reference.png", folder / "target.png"]
    (tmp_path / "file").write_bytes(b"mine")
    (tmp_path / "folder.png").mkdir()
    for out, words in (
        (tmp_path / "missing" / "a" / "out.png", ("no folder", "create it or choose another")),
        (tmp_path / "file" / "out.png", (f"{tmp_path / 'file'} is a file, not a folder", "choose another name")),
        (tmp_path / "folder.png", ("a folder of this name exists", "choose another name")),
        (tmp_path / ("x" * 300 + ".png"), ("cannot be written: File name too long", "choose a shorter name")),
    ):
        refused(4, [*pictures, "-o", out, "--overwrite"], *words)
        refused(4, [*pictures, "-o", tmp_path / "o.png", "--report", out.with_suffix(".png"), "--overwrite"], *words)
    refused(4, [*pictures, "-o", tmp_path / "o.png", "--layers", tmp_path / ("y" * 300)], "choose a shorter name")
    assert files(tmp_path) == {"file": b"mine"}


def test_a_folder_that_may_not_be_written(
    folder: Path, tmp_path: Path, refused: Refused, never_stitched: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(*_args: object, **_kwargs: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "touch", denied)  # root may write into any folder
    refused(4, [folder / "reference.png", folder / "target.png", "-o", tmp_path / "out.png"],
            f"{tmp_path} cannot be written: Permission denied; choose another place")  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
@pytest.mark.parametrize(("limit", "lost"), [(10_000, "out.jpg"), (60_000, "new/layers/00_reference.png")])
def test_a_disk_that_is_full_in_the_end(folder: Path, tmp_path: Path, limit: int, lost: str) -> None:
    """Whichever file does not fit takes the others with it, and the folders made for them."""
    # a limit on file sizes stands for the full disk; it holds for a whole process, so it gets its own
    program = (
        "import resource, sys; from edf_stitch.core.commands.cli import main\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    wanted = ["-o", tmp_path / "out.jpg", "--layers", tmp_path / "new" / "layers", "--report", tmp_path / "report.json"]
    arguments = ["stitch", folder / "reference.png", folder / "target.png", *wanted, *KNOWN_WORDS, "--quiet"]
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True, timeout=120,
        cwd=tmp_path, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.returncode == 4 and done.stdout == "", done.stderr
    assert done.stderr.startswith(f"edf: {tmp_path / lost} cannot be written: ")
    assert done.stderr.endswith("; free some space or choose another disk\n") and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> list[Path]:
    """Photographs that may be lost, in a folder of their own."""
    return [Path(shutil.copy(folder / f"{name}.png", tmp_path / f"{name}.png")) for name in ("reference", "target")]


@pytest.mark.parametrize("overwrite", [[], ["--overwrite"]])
@pytest.mark.parametrize("index", [0, 1])
def test_an_output_never_replaces_what_is_stitched(
    own: list[Path], tmp_path: Path, refused: Refused, never_stitched: None, overwrite: list[str], index: int
) -> None:
    before = files(tmp_path)
    out, words = tmp_path / "out.jpg", ("is read by this work", "choose another name")
    refused(2, [*own, "-o", own[index], *overwrite], str(own[index]), *words)
    for option, name in (("--cameras", "canvas.json"), ("--ignore-target", "occluded_01.png")):  # of the layers' folder
        (tmp_path / name).write_bytes(b"mine")
        refused(2, [*own, "-o", out, option, tmp_path / name, "--layers", tmp_path, *overwrite], *words)
        (tmp_path / name).unlink()
    try:
        (tmp_path / "link.png").symlink_to(own[index])
    except OSError:
        return  # no links here
    refused(2, [*own, "-o", tmp_path / "link.png", *overwrite], str(own[index]), *words)
    assert files(tmp_path) == {**before, "link.png": own[index].read_bytes()}


def test_the_report_never_replaces_the_camera_file(
    own: list[Path], tmp_path: Path, refused: Refused, never_stitched: None
) -> None:
    (tmp_path / "c.json").write_text("{}", "utf-8")
    refused(2, [*own, "-o", tmp_path / "out.jpg", "--cameras", tmp_path / "c.json", "--report", tmp_path / "c.json",
                "--overwrite"], "c.json is read by this work")  # fmt: skip
    assert (tmp_path / "c.json").read_text("utf-8") == "{}"


def test_inputs_are_known_by_what_they_are_not_by_their_name(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"mine")
    os.link(tmp_path / "a.png", tmp_path / "b.png")
    (tmp_path / "c.png").write_bytes(b"another")
    inputs = [tmp_path / "x" / ".." / "a.png", tmp_path / "a.png", tmp_path / "missing.png", "y" * 300]
    for name in ("a.png", "b.png"):
        with pytest.raises(BadRequest, match=rf"{name} is read by this work"):
            OutputFiles(overwrite=True, inputs=inputs).check(tmp_path / name)
    with OutputFiles(overwrite=True, inputs=inputs) as out:
        out.check(tmp_path / "c.png", tmp_path / "missing.png")
        out.add(tmp_path / "c.png", encode_picture(np.zeros((2, 2, 3), np.float32), None, 8, ".png")[0])
    assert (tmp_path / "a.png").read_bytes() == b"mine" and (tmp_path / "c.png").read_bytes() != b"another"
