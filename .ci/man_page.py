"""docs/edf.1, the page of `man edf`, made from the parser: `make reference` writes it, a wheel installs it."""

from __future__ import annotations

import argparse
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "edf.1"
EXIT_CODES = {
    0: "done", 1: "measured but not within its limits, not usable (--strict-verdict), or not all made (--keep-going)",
    2: "the call is wrong", 3: "the pictures cannot be stitched", 4: "a file cannot be read or written",
    130: "interrupted; nothing half made is left",
}  # fmt: skip
NAME = "edf \\- stitches photographs taken from different places into one picture"
MANNERS = """Each command says with --help what most people need of it. Messages go to stderr, without colours; stdout
holds only what was asked for. Files appear whole or not at all, and nothing is replaced unless told to."""
FURTHER = "The documentation in docs/ of the sources: index.md is the map, farm.md is about farms."
ENVIRONMENT = {"EDF_CACHE": "the folder of what is kept for the next stitch of the same pictures"}


def man_page() -> str:
    """The whole page, in the macros of man(7)."""
    parser = importlib.import_module("edf_stitch.core.commands.parser").edf_parser()
    version = importlib.import_module("edf_stitch").__version__
    lines = [f'.TH EDF 1 "" "EDF Stitch {version}" "User Commands"', *_section("name", NAME)]
    lines += _section("synopsis", *(f"{_call(name, one)}\n.br" for name, one in parser.commands.items()))
    lines += _section("description", _escaped(parser.description), ".PP", _escaped(MANNERS))
    for name, command in parser.commands.items():
        lines += _section(f"edf {name}", _escaped(command.description), *_groups(command))
    lines += _section("exit status", *(f".TP\n.B {code}\n{_escaped(what)}" for code, what in EXIT_CODES.items()))
    lines += _section("environment", *(f".TP\n.B {name}\n{_escaped(what)}" for name, what in ENVIRONMENT.items()))
    lines += _section("see also", _escaped(FURTHER))
    return "\n".join(lines) + "\n"


def _section(title: str, *lines: str) -> list[str]:
    return [f'.SH "{title.upper()}"', *lines]


def _call(name: str, command: argparse.ArgumentParser) -> str:
    """How a command is called, but for options that may be left out."""
    words = [f"\\fBedf {name}\\fR"]
    for action in command._actions:
        if not action.option_strings:
            words.append(_written(action) + " ..." * (action.nargs == "+"))
        elif action.required:
            words.append(f"\\fB{_escaped(action.option_strings[0])}\\fR \\fI{_escaped(str(action.metavar))}\\fR")
    return " ".join([*words, "[options]"])


def _groups(command: argparse.ArgumentParser) -> Iterator[str]:
    """The arguments of a command, group by group."""
    for group in command._action_groups:
        actions = [action for action in group._group_actions if action.help != argparse.SUPPRESS]
        if not actions:
            continue
        yield f'.SS "{str(group.title).removeprefix("positional ")}"'
        if group.description:
            yield _escaped(group.description)
        for action in actions:
            yield f".TP\n{_written(action)}\n{_escaped(_help(action))}"


def _written(action: argparse.Action) -> str:
    """How an argument is written, its name bold and its value in italics."""
    if not action.option_strings:
        return f"\\fI{_escaped(str(action.metavar))}\\fR"
    value = "" if action.nargs == 0 else f" \\fI{_escaped(str(action.metavar))}\\fR"
    return ", ".join(f"\\fB{_escaped(name)}\\fR{value}" for name in action.option_strings)


def _help(action: argparse.Action) -> str:
    return (action.help or "").removesuffix(" (default: %(default)s)").replace("%%", "%")


def _escaped(text: str) -> str:
    """Text as roff takes it: no character of its own, and no line that begins as a request."""
    text = " ".join(text.split()).replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^(?=[.'])", r"\\&", text)


if __name__ == "__main__":
    FILE.write_text(man_page(), "utf-8")
