"""`--config FILE.toml`: options by their names; what is typed counts more."""

from __future__ import annotations

from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.commands.parser import edf_parser


def parsed(folder: Path, text: str, *typed: str) -> dict[str, object]:
    (folder / "c.toml").write_text(text, "utf-8")
    return vars(edf_parser().parse_args(["stitch", "a", "b", *typed, "--config", str(folder / "c.toml")]))


def test_a_file_says_what_could_be_typed(tmp_path: Path) -> None:
    text = """
        output = "out.png"
        projection = "pannini:0.5"
        focal-px = [1200, 1180.5]
        dense = false
        require_all = true
        preview = false
        level = [-5, 0, 0]
        seed = 7
        ignore = { "left.jpg" = "m.png", "a=b.jpg" = "n.png" }
    """
    found = parsed(tmp_path, text)
    typed = edf_parser().parse_args(
        ["stitch", "a", "b", "-o", "out.png", "--projection", "pannini:0.5", "--focal-px", "1200,1180.5", "--no-dense",
         "--require-all", "--level=-5,0,0", "--seed", "7", "--ignore", "left.jpg=m.png", "--ignore", "a=b.jpg=n.png"]
    )  # fmt: skip
    assert found | {"config": None} == vars(typed)


def test_what_is_typed_counts_more(tmp_path: Path) -> None:
    found = parsed(tmp_path, 'output = "o.png"\ncrop = "full"\ndense = false', "--crop", "inscribed", "--dense")
    assert found["crop"] == "inscribed" and found["dense"] is True
    (tmp_path / "c.toml").write_text('output = "o.png"\ncrop = "full"', "utf-8")
    assert edf_parser().parse_args(["stitch", "a", "b", f"--conf={tmp_path / 'c.toml'}"]).crop == "full"


@pytest.mark.parametrize(("text", "told"), [
    ('projektion = "x"', "projektion is no option here: is projection meant?"),
    ("dense = 3", "dense is true or false, not 3"), ("crop = true", "crop takes a value, not true or false"),
    ("crop = full", "not TOML"), ('config = "other.toml"', "config is no option here"),
    ('seam = "grphcut"', "is graphcut meant?"), ("no-dense = false", "no-dense takes true, or is left out"),
    pytest.param("focal-px = " + "[" * 5000, "not TOML", id="deep"),
    pytest.param("seed = " + "9" * 5000, "not TOML", id="long"),
])  # fmt: skip
def test_what_is_wrong_in_it_is_said(
    text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "c.toml").write_text(text, "utf-8")
    assert main(["stitch", "a", "b", "-o", "o.png", "--config", str(tmp_path / "c.toml")]) == 2
    assert told in capsys.readouterr().err


def test_a_file_that_is_not_there_or_not_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stitch", "a", "b", "-o", "o.png", "--config", str(tmp_path / "none.toml")]) == 4
    assert "none.toml: no such file; check the name" in capsys.readouterr().err
    assert main(["stitch", "a", "b", "-o", "o.png", "--config"]) == 2
    assert "expected one argument" in capsys.readouterr().err
