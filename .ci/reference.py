"""docs/reference.md, made from the program itself: `make reference` writes it, tests/test_docs.py holds it current."""

from __future__ import annotations

import argparse
import importlib
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "reference.md"
HEAD = """# Reference

Made from the program itself by `make reference`: change the program, not this page. What the options are for is in
[how-to.md](how-to.md), what the files hold in [formats.md](formats.md).

"""
PYTHON = """
## Python

What `edf_stitch.__all__` names is public: it changes its meaning only with a new first number of the version (while
that is 0, with the second), and CHANGELOG.md says so. Everything below `edf_stitch.core` may change with any release.
"""
# Public for Blender, which calls them.
BLENDERS = ("register", "unregister")


def reference() -> str:
    """The whole page."""
    commands = importlib.import_module("edf_stitch.core.commands.parser").edf_parser().commands
    parts = [f"- [`edf {name}`](#edf-{name})" for name in commands]
    text = HEAD + "\n".join([*parts, "- [Python](#python)"]) + "\n"
    for name, command in commands.items():
        text += f"\n## `edf {name}`\n\n{command.description}\n" + "".join(_groups(command))
    return text + PYTHON + "".join(_python())


def _python() -> Iterator[str]:
    """What Python users may use, with its docstrings."""
    package = importlib.import_module("edf_stitch")
    public = {name: getattr(package, name) for name in package.__all__ if name not in BLENDERS}
    errors = {name: one for name, one in public.items() if isinstance(one, type) and issubclass(one, Exception)}
    calls = {"stitch": package.stitch, "Panorama": package.Panorama, "Panorama.save": package.Panorama.save}
    for name, one in (calls | {name: one for name, one in public.items() if name not in (*calls, *errors)}).items():
        if not isinstance(one, str):
            said = _call(name, one) if inspect.isfunction(one) else name
            yield f"\n### `{name}`\n\n```text\n{said}\n\n{inspect.getdoc(one)}\n```\n"
    rows = "".join(f"| `{name}` | {one.exit_code} | {_first(one)} |\n" for name, one in errors.items())
    yield f"\n### Errors\n\n| | exit code of `edf` | when |\n|---|---|---|\n{rows}"


def _call(name: str, function: Callable[..., object]) -> str:
    """How a function is called, an argument on each line."""
    lines, keywords = [f"{name}("], False
    for one in inspect.signature(function).parameters.values():
        if one.kind is one.KEYWORD_ONLY and not keywords:
            lines, keywords = [*lines, "    *,"], True
        default = "" if one.default is one.empty else f" = {one.default!r}"
        annotation = "" if one.annotation is one.empty else f": {one.annotation}"
        lines += [f"    {one.name}{annotation}{default},"]
    return "\n".join([*lines, ")"])


def _first(one: object) -> str:
    """The first sentence of a docstring, in one line."""
    return " ".join((inspect.getdoc(one) or "").split("\n\n")[0].split())


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
