"""What a call that could not be understood was meant to be, in a line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path


def what_was_meant(message: str, given: Sequence[str], options: Sequence[str]) -> str:
    """A line that says what to write instead, "" where nothing is known.

    Parameters
    ----------
    message : str
        What argparse said.
    given : sequence of str
        The arguments.
    options : sequence of str
        Of the command, as they are written.
    """
    for word in given:
        if word.startswith("-") and word not in options and _names_a_file(word):
            return f"{word} begins like an option: write ./{word} for the file of that name"
    lacking = re.match(r"argument ([^:]+): expected (one|at least one) argument", message)
    if lacking is not None:
        names = lacking[1].split("/")
        for option, value in pairwise(given):
            if option in names and re.match(r"-[\d.]", value):
                return f"{value} begins like an option: write {option}={value}"
    if message == "the following arguments are required: -o/--output":
        more = "--preview makes a smaller one, which goes to a file too: " if "--preview" in given else ""
        return f"where the panorama or the results go is missing: {more}add -o and a name, like -o panorama.png"
    wrong = re.search(r"'([^']*)' ?(?:is not known; choose from:|is neither .* one of:|\(choose from) (.*)", message)
    if wrong is not None:
        near = get_close_matches(wrong[1].lower(), re.findall(r"[\w.]+", wrong[2]), 1)
        return f"{message}: is {near[0]} meant?" if near else ""
    if message.startswith("ambiguous option"):
        return message
    unknown = re.match(r"unrecognized arguments: (--[^\s=]+)", message)
    near = get_close_matches(unknown[1].replace("_", "-"), options, 1, 0.7) if unknown is not None else []
    return f"{message}: is {near[0]} meant?" if near else ""


def _names_a_file(word: str) -> bool:
    return re.fullmatch(r"-[^-=].*\.[A-Za-z]\w{1,3}", word) is not None or (word[:2] != "--" and Path(word).is_file())
