"""What `--help` says: first what most people need, all of it on request."""

from __future__ import annotations

import re

import pytest
from edf_stitch.core.commands import parser as parsers
from edf_stitch.core.commands.cli import main
from edf_stitch.core.commands.parser import edf_parser


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(list(words)) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


@pytest.mark.parametrize("command", parsers._COMMON)
def test_help_is_short_and_says_where_the_rest_is(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    short, full = said(capsys, command, "--help"), said(capsys, command, "--help-all")
    names = {name for action in edf_parser().commands[command]._actions for name in action.option_strings}
    shown = set(re.findall(r"^  (?:-o \w+, )?(--[\w-]+)", short, re.MULTILINE))
    assert all(name in full for name in names) and shown == set(parsers._COMMON[command])
    assert len(short) < len(full) / 2 and f"edf {command} --help-all" in short
    assert all("Exit codes: 0" in " ".join(text.split()) for text in (short, full))


def test_the_number_of_options_that_are_left_is_right(capsys: pytest.CaptureFixture[str]) -> None:
    options = [action for action in edf_parser().commands["stitch"]._actions if action.option_strings]
    assert f"\n{len(options) - len(parsers._COMMON['stitch'])} more options" in said(capsys, "stitch", "--help")


def test_the_commands_help_says_all_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    text = " ".join(said(capsys, "--help").split())
    for code in ("0 done", "1 measured", "2 the call", "3 the pictures", "4 a file", "130 interrupted"):
        assert code in text


def test_scenes_of_every_switch_are_taken_and_no_call_keeps_those_of_another() -> None:
    line = ["validate", "-o", "out", "--scene", "street", "relief", "--scene", "toe_in"]
    for _ in range(2):
        assert edf_parser().parse_args(line).scene == ["street", "relief", "toe_in"]
    assert edf_parser().parse_args(line[:3]).scene == []
