"""Names of pictures are data: shown as they are, they neither run, nor are calculated, nor lead out of the folder."""

from __future__ import annotations

import csv
import json
import os
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture

from ...sets import make_set

NAMES = (
    '"><img src=x onerror="document.title=1">.png', "=HYPERLINK(1)\x1b[2J\n.png", "..;x,'&amp;\u202e\\..\\b\udcff.png",
)  # fmt: skip


class Page(HTMLParser):
    """What a page holds: its elements, their attributes, and all texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_set_of_hostile_names(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pictures, out = tmp_path / "pictures", tmp_path / "out"
    pictures.mkdir()
    out.mkdir()
    for one, name in zip(make_set(3, size=(240, 180)).pictures, NAMES, strict=True):
        (pictures / name).write_bytes(encode_picture(one.pixels, None, 8, ".png")[0])
    before = {path.name: path.read_bytes() for path in pictures.iterdir()}
    words = ["--no-dense", "--seam=none", "--blend=feather", "--no-cache", "--json"]
    files = {"--report": "r.json", "--layers": "layers", "--cameras-out": "c.json", "--warp": "w.npz"}
    asked = [word for option, file in files.items() for word in (option, str(out / file))]
    given = [os.fspath(pictures / name) for name in NAMES]
    code = main(["stitch", *given, "-o", str(out / "o.png"), *asked, *words])
    said, told = capfd.readouterr()
    assert code == 0, told
    assert not {"\x1b", "\u202e"} & set(said + told) and json.loads(said)["files"]
    made = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.suffix == ".png"}
    layers = {name for name in made if re.match(r"layers/\d", name)}
    assert len(layers) == 3 and all(re.fullmatch(r"o\.png|layers/[a-z]+(_\d\d)?\.png", one) for one in made - layers)
    assert {path.name for path in tmp_path.iterdir()} == {"pictures", "out"}
    assert {path.name: path.read_bytes() for path in pictures.iterdir()} == before
    page = Page((out / "r.html").read_text("utf-8"))
    assert page.elements.count("img") == 1 and "script" not in page.elements
    assert ("content", "default-src 'none'; img-src data:; style-src 'unsafe-inline'") in page.attributes
    assert not [name for name, _ in page.attributes if name.startswith("on")] and NAMES[0] in page.text
    with (out / "r.matches.csv").open(newline="") as file:
        cells = {cell for row in csv.reader(file) for cell in row}
    assert not [cell for cell in cells if re.match(r"[=+@\t\r]|-(?!\d)", cell)]
    named = [one["name"] for one in json.loads((out / "r.json").read_text())["pictures"]]
    shown = [name.encode(errors="replace").decode() for name in NAMES]
    assert sorted(named) == sorted(shown) == sorted(json.loads((out / "c.json").read_text())["cameras"])
