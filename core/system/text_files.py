"""Text files that users write: lists and tables, with the line ends and marks of any editor or spreadsheet."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from .errors import BadRequest, UnreadableImage

# What acts on a terminal, turns the direction of what follows, ends a line, or is half a character.
_NOT_SHOWN = re.compile("[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
# What a spreadsheet takes for the start of a formula.
_FORMULA = ("=", "+", "-", "@")


def read_with_end(path: Path) -> bytes:
    """The bytes of a file, or of a pipe that this process was given open (/dev/fd/N).

    Raises OSError where it cannot be read, for a device, which may have no end, and for a pipe with a name, whose
    writer may never come.
    """
    if path.is_char_device() or path.is_block_device():
        raise OSError(f"{path} is a device, not a file; name a file")
    # an open pipe has no name: what /dev/fd/N links to does not exist
    if path.is_fifo() and os.path.exists(os.path.realpath(path)):
        raise OSError(f"{path} is a named pipe, not a file; name a file")
    return path.read_bytes()


def read_text(path: Path, what: str, layout: str) -> str:
    """A file in UTF-8, with or without a byte order mark.

    path: - is stdin; what: of the file, in messages, like "the list"; layout: what it should hold. Raises
    UnreadableImage where it cannot be read, BadRequest where it is no text.
    """
    try:
        if path == Path("-"):
            with open(0, "rb", closefd=False) as stream:
                data = stream.read()
        else:
            data = read_with_end(path)
    except (OSError, ValueError) as error:
        raise UnreadableImage(f"{what} cannot be read: {error}") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise BadRequest(f"{path}: not a text in UTF-8; {what} is a CSV file: {layout}")
    return text


def read_lines(path: Path, what: str, layout: str) -> Iterator[tuple[int, str]]:
    """Lines that are neither blank nor comments (#), with their numbers as editors count, from 1; see `read_text`."""
    for number, line in enumerate(re.split("\r\n|\r|\n", read_text(path, what, layout)), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


def printable(text: str) -> str:
    """A text for one line of a terminal: names and EXIF are others' data, and must neither steer it nor end the
    line."""
    return _NOT_SHOWN.sub(lambda found: found[0].encode("unicode_escape", "surrogatepass").decode(), text)


def name_in_table(name: str) -> str:
    """A file's name as the text of a table's cell: in one line, and no formula to a spreadsheet (./=1.png is the same
    file as =1.png)."""
    shown = printable(name)
    return f"./{shown}" if shown.startswith(_FORMULA) else shown


def quoted(text: str) -> str:
    """A text as a cell of a CSV file."""
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',;"#') else text
