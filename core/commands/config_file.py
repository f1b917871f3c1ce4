"""`--config FILE.toml`: options by their names, as if they had been typed before all others."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ..system.errors import BadRequest, UnreadableImage
from ..system.text_files import read_with_end

# Options that a file cannot give.
_ON_THE_LINE = ("config", "help", "help-all")


def add_config(parser: argparse.ArgumentParser) -> None:
    """Adds the option."""
    parser.add_argument(
        "--config", type=Path, metavar="FILE.toml",
        help='options by their names, like projection = "cylindrical", focal-px = [1200, 1180], dense = false; what is '
        "typed counts more",
    )  # fmt: skip


def with_config(given: Sequence[str], options: Mapping[str, argparse.Action]) -> list[str]:
    """The arguments of a command, those of the file that `--config` names before them.

    Parameters
    ----------
    given : sequence of str
        As they were typed.
    options : mapping of str to Action
        The command's, as they are written.

    Raises
    ------
    UnreadableImage
        The file cannot be read.
    BadRequest
        It is no TOML, or says what the command does not know.
    """
    looking = argparse.ArgumentParser(add_help=False, exit_on_error=False)
    looking.add_argument("--config", type=Path, nargs="?")
    path = looking.parse_known_args(given)[0].config
    if path is None:
        return list(given)
    return [word for name, value in _table(path).items() for word in _words(path, name, value, options)] + list(given)


def _table(path: Path) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(read_with_end(path).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        if isinstance(error, (ValueError, RecursionError)):
            raise BadRequest(f'{path}: not TOML, with lines like crop = "full": {error}') from error
        why = "no such file; check the name" if isinstance(error, FileNotFoundError) else f"cannot be read: {error}"
        raise UnreadableImage(f"{path}: {why}") from error


def _words(path: Path, name: str, value: Any, options: Mapping[str, argparse.Action]) -> Iterator[str]:
    """What would be typed for an entry."""
    option = "--" + name.replace("_", "-")
    action = options.get(option)
    if action is None or option[2:] in _ON_THE_LINE:
        known = [one.removeprefix("--") for one in options if one.startswith("--")]
        near = get_close_matches(option[2:], [one for one in known if one not in _ON_THE_LINE], 1, 0.7)
        raise BadRequest(f"{path}: {name[:80]} is no option here" + (f": is {near[0]} meant?" if near else ""))
    if isinstance(value, bool):
        off = f"--no-{option[2:]}"
        if action.nargs != 0 or not (value or off in action.option_strings or action.const is True):
            takes = "true, or is left out" if action.nargs == 0 else "a value, not true or false"
            raise BadRequest(f"{path}: {name} takes {takes}")
        yield from [option] if value else [off] if off in action.option_strings else []
    elif action.nargs == 0:
        raise BadRequest(f"{path}: {name} is true or false, not {value!r}")
    elif isinstance(value, dict):
        yield from (f"{option}={key}={one}" for key, one in value.items())
    else:
        yield f"{option}=" + (",".join(map(str, value)) if isinstance(value, list) else str(value))
