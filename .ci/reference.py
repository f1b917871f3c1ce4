"""docs/reference.md, made from the program itself: `make reference` writes it, tests/test_docs.py holds it current."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "reference.md"
HEAD = """# Reference

Made from the program itself by `make reference`: change the program, not this page. What the options are for is in
[how-to.md](how-to.md), what the files hold in [formats.md](formats.md).

"""


def reference() -> str:
    """The whole page."""
    commands = importlib.import_module("edf_stitch.core.commands.parser").edf_parser().commands
    parts = [f"- [`edf {name}`](#edf-{name})" for name in commands]
    text = HEAD + "\n".join(parts) + "\n"
    for name, command in commands.items():
        text += f"\n## `edf {name}`\n\n{command.description}\n" + "".join(_groups(command))
    return text


def _groups(parser: argparse.ArgumentParser) -> Iterator[str]:
    """A table for each group of a command's arguments."""
    for group in parser._action_groups:
        actions = [action for action in group._group_actions if action.help != argparse.SUPPRESS]
        if not actions:
            continue
        about = f"{group.description}\n\n" if group.description else ""
        rows = "".join(f"| {_cell(_written(action))} | {_cell(action.help or '')} |\n" for action in actions)
        title = str(group.title).removeprefix("positional ")
        yield f"\n### {parser.prog.split()[-1]}: {title}\n\n{about}| | |\n|---|---|\n{rows}"


def _written(action: argparse.Action) -> str:
    """How an argument is written."""
    if not action.option_strings:
        return f"`{action.metavar}`"
    value = "" if action.nargs == 0 else f" {action.metavar}"
    return ", ".join(f"`{name}{value}`" for name in action.option_strings)


def _cell(text: str) -> str:
    """Text in a table. Before Python 3.13 argparse adds the default to what is either on or off."""
    return text.removesuffix(" (default: %(default)s)").replace("%%", "%").replace("|", "\\|")


if __name__ == "__main__":
    FILE.write_text(reference(), "utf-8")
