"""Which program a file is of; names of pictures; hostile files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest
from edf_stitch.core.cameras.programs import values
from edf_stitch.core.cameras.programs.values import by_our_names
from edf_stitch.core.cameras.sources import read_camera_file
from edf_stitch.core.system.errors import BadRequest, StitchError

from .program_files import NAMES, SIZES, cameras, colmap_binary, colmap_text, project, transforms

WRITERS: dict[str, Callable[[Path], Path]] = {
    "text": lambda folder: colmap_text(folder, "OPENCV") / "images.txt",
    "binary": lambda folder: colmap_binary(folder, "OPENCV_FISHEYE") / "images.bin",
    "cameras": lambda folder: colmap_binary(folder, "RADIAL") / "cameras.bin", "hugin": project,
    "transforms": transforms,
}  # fmt: skip
every_program = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS.keys())


@every_program
def test_the_content_says_which_program_it_is(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path)
    if path.suffix in (".pto", ".json"):
        path = path.rename(tmp_path / "anything.dat")
    assert len(cameras(path)) == 2


@every_program
def test_damaged_files_are_read_or_refused_and_nothing_else(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path)
    data, random = path.read_bytes(), Random(0)
    refused = 0
    for _ in range(120):
        damaged = bytearray(data)
        for _ in range(random.randint(1, 6)):
            at = random.randrange(len(damaged))
            what = random.randrange(3)
            if what == 0:
                damaged[at] = random.randrange(256)
            elif what == 1:
                del damaged[at : at + random.randint(1, 20)]
            else:
                damaged[at:at] = random.choice((b"\0", b"-", b"1e999", b"nan", b"=0", b'"', b"\xff\xff", b"\n", b"../"))
        path.write_bytes(damaged)
        try:
            read_camera_file(path, NAMES, SIZES)
        except StitchError as error:
            refused += 1
            assert str(error)
    assert refused > 30


def test_a_text_or_a_picture_is_refused_with_what_is_read(tmp_path: Path) -> None:
    for content in (b"\x89PNG\r\n\x1a\n", b"hello"):
        (tmp_path / "a").write_bytes(content)
        with pytest.raises(BadRequest, match=r"transforms.json, a Hugin project \(.pto\), .* the folder of a COLMAP"):
            cameras(tmp_path / "a")


@pytest.mark.parametrize(("given", "names", "meant"), [
    (["images/a.png"], ["a.png"], "images/a.png"), (["images\\A.PNG"], ["a.png"], "images\\A.PNG"),
    (["a"], ["x/a.png"], "a"),
    (["east/1.jpg", "west/1.jpg"], ["west/1.jpg"], "west/1.jpg"), (["a.jpg", "a.png"], ["a.png"], "a.png"),
    (["../../etc/a.png"], ["a.png"], "../../etc/a.png"), (["/a.png"], ["a.png"], "/a.png"),
])  # fmt: skip
def test_a_picture_is_meant_by_the_end_of_its_path(given: list[str], names: list[str], meant: str) -> None:
    entries = {name: {"is": name} for name in given}
    assert by_our_names(entries, names, "file")[names[0]] == {"is": meant}


def test_names_that_mean_none_stay_and_doubtful_ones_are_refused() -> None:
    assert by_our_names({"b.png": 1, "x/a.png": 2}, ["a.png"], "file") == {"a.png": 2, "b.png": 1}
    assert by_our_names({"..": 1, "": 2, ".": 3}, ["a.png"], "file") == {"..": 1, "": 2, ".": 3}
    with pytest.raises(BadRequest, match=r"file: a.png may be x/a.png, y/a.png"):
        by_our_names({"x/a.png": 1, "y/a.png": 2}, ["a.png"], "file")


def test_a_picture_is_compared_with_those_of_its_name_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[str] = []

    def likeness(given: str, name: str) -> tuple[int, int, int]:
        compared.append(given)
        return 1, 1, len(given)

    monkeypatch.setattr(values, "_likeness", likeness)
    entries = {f"images/{k}.png": k for k in range(10_000)} | {"other\\7.JPG": -1}
    assert by_our_names(entries, ["7.png"], "x")["7.png"] == 7
    assert compared == ["images/7.png", "other\\7.JPG"], "a million images took minutes"


def test_a_camera_of_another_size_is_brought_to_the_picture(tmp_path: Path) -> None:
    path = project(tmp_path)
    half = read_camera_file(path, NAMES, [(400, 300), (400, 300)])
    full = cameras(path)
    for small, large in zip(half, full, strict=True):
        assert small is not None and small.size == (400, 300) and abs(small.focal - large.focal / 2) < 1e-9
        assert abs(small.K[0, 2] - ((large.K[0, 2] + 0.5) / 2 - 0.5)) < 1e-9 and small.lens == large.lens
    with pytest.raises(BadRequest, match="EXIF turns it"):
        read_camera_file(path, NAMES, [(600, 800), (600, 800)])
    with pytest.raises(BadRequest, match="one of 800 × 600 px, the picture has 800 × 500"):
        read_camera_file(path, NAMES, [(800, 500), (800, 500)])


def test_nothing_but_the_named_file_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = json.loads(transforms(tmp_path).read_text())
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "a.png").write_bytes(b"not to be read")
    content["frames"][0]["file_path"] = str(outside / "a.png")
    content["frames"][1]["file_path"] = "../../b.png"
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(content))
    opened: list[str] = []
    real = Path.open

    def watched(self: Path, *args: Any, **kwargs: Any) -> Any:
        opened.append(self.name)
        return real(self, *args, **kwargs)

    monkeypatch.setattr(Path, "open", watched)
    assert len(cameras(path)) == 2
    assert set(opened) == {"transforms.json"}
