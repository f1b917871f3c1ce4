"""`edf info` says what was understood of each file."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.gpano import SpherePart, whole_sphere
from edf_stitch.core.pictures.picture import picture_from_array
from PIL import Image, TiffImagePlugin

from ..pictures.raw_and_heic import dng, mosaic
from ..textured_room import circle, sphere

NOISE = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (90, 120, 4), np.uint8), (0, 0), 2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Files of some kinds, one of them damaged, and one that is no flat photograph."""
    exif = Image.Exif()
    exif[271], exif[272], exif[274] = "Canon", "Canon EOS 6D", 6
    lens = {42036: "EF24-105mm", 41989: 50, 37386: TiffImagePlugin.IFDRational(50)}
    exif.get_ifd(0x8769).update(lens | {36867: "2020:01:02 03:04:05"})
    Image.fromarray(NOISE[..., :3]).save(tmp_path / "a.jpg", exif=exif, quality=95)
    cv2.imwrite(str(tmp_path / "b.png"), NOISE.astype(np.uint16) * 257)
    cv2.imwrite(str(tmp_path / "c.tif"), NOISE[..., 0])
    (tmp_path / "d.jpg").write_bytes((tmp_path / "a.jpg").read_bytes()[:-300])
    transparent = NOISE.copy()
    transparent[..., 3] = 0
    cv2.imwrite(str(tmp_path / "e.png"), transparent)
    return tmp_path


def test_a_line_for_each_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(folder)]) == 4
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert err == "" and [Path(line.partition(": ")[0]).name for line in lines] == [
        "a.jpg", "b.png", "c.tif", "d.jpg", "e.png",
    ]  # fmt: skip
    focal = 50 * float(np.hypot(90, 120)) / 43.27
    assert "90×120 JPEG, 8 bit, colour, sRGB; Canon EOS 6D, EF24-105mm; " in lines[0]
    assert f"f {focal:.0f} px (EXIF 35 mm equivalent)" in lines[0] and "orientation 6" in lines[0]
    assert "120×90 PNG, 16 bit, colour and alpha, sRGB; camera unknown; f unknown; upright" in lines[1]
    assert "120×90 TIFF, 8 bit, gray" in lines[2]
    assert "d.jpg: cannot be used: the JPEG file is damaged" in lines[3]
    assert lines[4].endswith("cannot be used: it is entirely transparent: export it without transparency, or with the "
                             "right one")  # fmt: skip


@pytest.mark.parametrize(("said", "removed"), [
    ('aux:DistortionCorrectionAlreadyApplied="True"', True),
    ("<crs:LensProfileEnable>1</crs:LensProfileEnable>", False),
    ('crs:LensProfileEnable="1" crs:AlreadyApplied="True"', True),
    ('crs:LensProfileEnable="0" crs:AlreadyApplied="True"', False),
    ("<aux:DistortionCorrectionAlreadyApplied>False</aux:DistortionCorrectionAlreadyApplied>", False),
])  # fmt: skip
def test_whether_the_distortion_was_removed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], said: str, removed: bool
) -> None:
    body = b"http://ns.adobe.com/xap/1.0/\0" + f"<x:xmpmeta>{said}</x:xmpmeta>".encode()
    jpeg = cv2.imencode(".jpg", NOISE[..., :3])[1].tobytes()
    (tmp_path / "a.jpg").write_bytes(jpeg[:2] + b"\xff\xe1" + (len(body) + 2).to_bytes(2, "big") + body + jpeg[2:])
    assert main(["info", str(tmp_path)]) == 0
    assert ("distortion removed already" in capsys.readouterr().out) is removed


def test_neither_a_name_nor_exif_steers_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exif = Image.Exif()
    exif[271], exif[272] = "\x1b]0;owned\x07", "EOS\x1b[2J"
    Image.fromarray(NOISE[..., :3]).save(tmp_path / "a\n\x1b[31m.jpg", exif=exif)
    assert main(["info", str(tmp_path)]) == 0
    assert main(["info", str(tmp_path / "none\x1b.jpg")]) == 4
    out, err = capsys.readouterr()
    assert "a\\n\\x1b[31m.jpg: " in out and "\x1b" not in out + err and len(out.splitlines()) == 2
    assert main(["stitch", str(tmp_path / "none\x1b.jpg"), "b.png", "-o", str(tmp_path / "o.png")]) == 4
    assert "none\\x1b.jpg" in capsys.readouterr().err


def test_camera_raw_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.dng").write_bytes(dng(mosaic(NOISE[..., :3] / 255)))
    assert main(["info", str(tmp_path)]) == 0
    assert "120×90 RAW, float, colour, scene-linear; Maker Model; " in capsys.readouterr().out


def test_a_document_holds_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(folder / "a.jpg"), str(folder / "d.jpg"), "--json"]) == 4
    found = json.loads(capsys.readouterr().out)
    first, damaged = found["pictures"]
    assert found["schema"] == 1
    assert first | {"file": "", "focal_px": 0} == {
        "file": "", "error": "", "shows": "flat picture",
        "kind": "JPEG", "width": 90, "height": 120, "bits": 8, "channels": 3, "alpha": False,
        "colours": "sRGB", "make": "Canon", "model": "Canon EOS 6D", "lens": "EF24-105mm",
        "taken": "2020:01:02 03:04:05", "focal_px": 0, "focal_source": "EXIF 35 mm equivalent", "focal_mm": 50.0,
        "focal35_mm": 50.0, "undistorted": False, "orientation": 6, "problems": [],
    }  # fmt: skip
    assert set(damaged) == {"file", "error"} and "damaged" in damaged["error"]


def test_spheres_and_circles_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part = SpherePart((400, 200), (100, 20, 120, 90))
    for name, one in ("whole.png", whole_sphere((120, 60))), ("part.png", part):
        pixels = picture_from_array(NOISE[: one.box[3], :, :3]).pixels
        (tmp_path / name).write_bytes(encode_picture(pixels, None, 8, ".png", sphere=one)[0])
    row, column = np.mgrid[:200, :300]
    disc = np.hypot(column - 150, row - 100) < 95
    cv2.imwrite(str(tmp_path / "circle.png"), disc.astype(np.uint8) * 200)
    assert main(["info", str(tmp_path)]) == 0
    circle, part_line, whole_line = capsys.readouterr().out.splitlines()
    assert "sRGB; circle of a fisheye; camera unknown" in circle
    assert "sRGB; part of a sphere of 400×200; " in part_line and "sRGB; whole sphere; " in whole_line


def test_good_files_give_0_and_warnings_are_problems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pages = [Image.fromarray(NOISE[..., 0]), Image.fromarray(NOISE[..., 1])]
    pages[0].save(tmp_path / "pages.tif", save_all=True, append_images=pages[1:])
    assert main(["info", str(tmp_path / "*.tif")]) == 0
    assert "problem: the TIFF file has 2 pages" in capsys.readouterr().out


def test_what_stands_for_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path)]) == 2
    cv2.imwrite(str(tmp_path / "good.png"), NOISE[..., :3])
    assert main(["info", str(tmp_path / "none.jpg"), str(tmp_path / "good.png")]) == 4
    none, good = capsys.readouterr().out.splitlines()
    assert "none.jpg: cannot be used: no such file or folder; check the name" in none and "good.png: " in good


def test_what_is_taken_for_a_sphere_or_a_circle_is_said_with_its_focal_length(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.rint(sphere(np.zeros(3), np.eye(3), 200)))
    cv2.imwrite(str(tmp_path / "b.png"), circle(np.zeros(3), np.eye(3), 140, (320, 300)))
    assert main(["info", str(tmp_path)]) == 0
    whole, eye = capsys.readouterr().out.splitlines()
    assert "whole sphere; camera unknown; no f; " in whole and "problem: taken for a whole sphere" in whole
    assert "circle of a fisheye; camera unknown; f 89 px (its circle)" in eye and "which shows 180°" in eye
    assert main(["info", str(tmp_path / "a.png"), "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)["pictures"]
    assert entry["focal_px"] is None and entry["focal_source"] == "none: it is a sphere"
