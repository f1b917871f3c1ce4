"""Calls that could not be understood, and the line that says what was meant."""

from __future__ import annotations

from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main


@pytest.mark.parametrize(("words", "told"), [
    (["stitch", "-r.jpg", "a.jpg", "b.jpg"], "write ./-r.jpg"),
    (["stitch", "a.jpg", "-r.jpg", "-o", "o.png"], "write ./-r.jpg"),
    (["stitch", "a", "b", "-o", "o.png", "--level", "-5,0,0"], "write --level=-5,0,0"),
    (["stitch", "a", "b", "-o", "o.png", "--centre", "-10,2"], "write --centre=-10,2"),
    (["stitch", "a", "b", "--preview"], "--preview makes a smaller one, which goes to a file too: add -o"),
    (["stitch", "a", "b"], "is missing: add -o and a name"), (["batch", "list.csv"], "add -o"),
    (["compare", "x"], "add -o"), (["validate"], "add -o"),
    (["stitch", "a", "b", "-o", "o.png", "--focal_px", "3"], "is --focal-px meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--projektion", "x"], "is --projection meant?"),
    (["stich", "a", "b"], "is stitch meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--seam", "GRAPHCUT"], "is graphcut meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--projection", "panini:0.3"], "is pannini meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--exposure", "Refrence"], "is reference meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--exr-depth", "hafl"], "is half meant?"),
    (["stitch", "a", "b", "-o", "o.png", "--focal", "28"], "could match --focal-px, --focal-mm, --focal35"),
])  # fmt: skip
def test_one_line_says_what_to_write(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == "" and told in err and len(err.splitlines()) == 1


def test_a_file_whose_name_begins_with_a_dash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "-left").touch()
    monkeypatch.chdir(tmp_path)
    assert main(["stitch", "-left", "b", "-o", "o.png"]) == 2
    assert "write ./-left" in capsys.readouterr().err
