"""Matches that the user gives, as a CSV file or an array; and matches as a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..system.errors import BadRequest
from ..system.text_files import read_lines

COLUMNS = ("x", "y", "x2", "y2")
WEIGHT = "weight"
_LAYOUT = "each line holds x,y,x2,y2 or x,y,x2,y2,weight"


def read_matches(source: str | Path | NDArray[Any], size: tuple[int, int], size_prime: tuple[int, int]) -> Matches:
    """The user's matches, with `weight` (N,) float64 above 0 and `given` True.

    source: a CSV file in UTF-8, x,y in the reference ↔ x2,y2 in the target in px of the upright pictures, pixel centres
    integer, optionally a weight (1 where there is none, 0 leaves the match out); separated by commas, semicolons or
    white space; a header may name the columns in any order, among others, and lines starting with # are left out. Or
    an array (N, 4) or (N, 5) of the same. size, size_prime: (W, H) px of the reference and the target. Of several
    matches between the same two points the first is kept.
    Raises BadRequest (content) with the line, UnreadableImage (file).
    """
    if isinstance(source, np.ndarray):
        rows, places = _from_array(source)
    else:
        rows, places = _from_file(Path(source))
    _check(rows, places, size, size_prime)
    rows = rows[rows[:, 4] > 0]
    if not len(rows):
        raise BadRequest(f"{_whole(source)}: every match has weight 0, which leaves it out; give some a weight above 0")
    _, first = np.unique(rows[:, :4], axis=0, return_index=True)
    rows = rows[np.sort(first)]
    x, y, weight = (np.ascontiguousarray(part) for part in (rows[:, :2], rows[:, 2:4], rows[:, 4]))
    return Matches(x, y, weight=weight, given=True)


def matches_csv(matches: Matches) -> bytes:
    """The matches as a CSV file that `read_matches` reads back to the same floats."""
    rows = np.column_stack([matches.x, matches.y, matches.weights]).tolist()
    lines = [",".join((*COLUMNS, WEIGHT)), *(",".join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _whole(source: str | Path | NDArray[Any]) -> str:
    return "the array of matches" if isinstance(source, np.ndarray) else str(source)


def _from_array(array: NDArray[Any]) -> tuple[NDArray[np.float64], list[str]]:
    """Rows (N, 5) with weights, and what to call each of them."""
    if array.ndim != 2 or array.shape[1] not in (4, 5) or not len(array) or array.dtype.kind not in "iuf":
        raise BadRequest(
            f"the array of matches has the shape {array.shape} and {array.dtype} values: N × 4 (x, y, x2, y2) or N × 5 "
            "(and a weight) numbers are needed"
        )
    rows = np.ones((len(array), 5))
    rows[:, : array.shape[1]] = array
    return rows, [f"the array of matches, row {number} (the first is 0)" for number in range(len(array))]


def _from_file(path: Path) -> tuple[NDArray[np.float64], list[str]]:
    """Rows (N, 5) with weights, and what to call each of them."""
    rows: list[list[float]] = []
    places: list[str] = []
    columns: tuple[str, ...] = ()
    for number, cells in _lines(path):
        place = f"{path}, line {number}"
        if not columns and _is_header(cells):
            columns = _header(cells, place)
            continue
        if not columns:
            columns = (*COLUMNS, WEIGHT)[: len(cells)]
            if len(cells) not in (4, 5):
                raise BadRequest(f"{place}: {_counted(cells)}; {_LAYOUT}")
        if len(cells) != len(columns):
            raise BadRequest(f"{place}: {_counted(cells)} where the lines before have {len(columns)}; {_LAYOUT}")
        named = dict(zip(columns, cells, strict=True))
        rows.append([_number(named.get(name, "1"), name, place) for name in (*COLUMNS, WEIGHT)])
        places.append(place)
    if not rows:
        raise BadRequest(f"{path}: no matches in it; {_LAYOUT}, one line for each match")
    return np.array(rows, np.float64), places


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The cells of each line that holds some, with its number as editors count, from 1."""
    for number, line in read_lines(path, "the file of matches", _LAYOUT):
        # a semicolon first: where it separates, commas are decimal
        separator = next((mark for mark in ";," if mark in line), None)
        try:
            cells = line.split() if separator is None else next(csv.reader([line], delimiter=separator))
        except csv.Error as error:
            raise BadRequest(f"{path}, line {number}: {error}; {_LAYOUT}") from error
        yield number, [cell.strip().strip('"') for cell in cells]


def _is_header(cells: list[str]) -> bool:
    return any(cell.lower() in COLUMNS for cell in cells) or not any(map(_is_number, cells))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _header(cells: list[str], place: str) -> tuple[str, ...]:
    """Column names; those without meaning are numbered, so that all differ."""
    names = [cell.lower() for cell in cells]
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise BadRequest(
            f"{place}: the header names {_listed(cells)} and lacks {', '.join(missing)}; it must name x, y, x2 and y2, "
            "or be left out"
        )
    for name in (*COLUMNS, WEIGHT):
        if names.count(name) > 1:
            raise BadRequest(f"{place}: the header names the column {name} {names.count(name)} times; name it once")
    return tuple(name if name in (*COLUMNS, WEIGHT) else f"column {at}" for at, name in enumerate(names))


def _number(cell: str, name: str, place: str) -> float:
    if _is_number(cell):
        return float(cell)
    if not cell:
        raise BadRequest(f"{place}: {name} is empty; a number is needed")
    decimal = " with a point for decimals" if "," in cell else ""
    raise BadRequest(f"{place}: {name} is {_shortened(cell)}; a number{decimal} is needed")


def _counted(cells: list[str]) -> str:
    return f"{len(cells)} column{'s' if len(cells) != 1 else ''} ({_listed(cells)})"


def _listed(cells: list[str]) -> str:
    return ", ".join(map(_shortened, cells[:6])) + (", …" if len(cells) > 6 else "")


def _shortened(cell: str) -> str:
    return repr(cell if len(cell) <= 30 else cell[:29] + "…")


def _check(rows: NDArray[np.float64], places: list[str], size: tuple[int, int], size_prime: tuple[int, int]) -> None:
    """Raises BadRequest for the first row (of N, 5) with a value that is not finite, a negative weight or a point
    outside its picture."""

    def refuse(bad: NDArray[np.bool_], found: str, needed: str) -> NoReturn:
        more = int(bad.sum()) - 1
        also = f" (and {more} more line{'s' if more > 1 else ''})" if more else ""
        raise BadRequest(f"{places[int(bad.argmax())]}: {found}{also}; {needed}")

    for column, name in enumerate((*COLUMNS, WEIGHT)):
        bad = ~np.isfinite(rows[:, column])
        if bad.any():
            refuse(bad, f"{name} is {rows[bad.argmax(), column]}", "correct it, or leave the line out")
    bad = rows[:, 4] < 0
    if bad.any():
        refuse(bad, f"the weight is {rows[bad.argmax(), 4]:g}", "0 leaves a match out, larger counts more")
    for name, columns, (width, height) in (("reference", (0, 1), size), ("target", (2, 3), size_prime)):
        points = rows[:, columns]
        # pixel centres are integers: the picture's own edges lie half a pixel beyond the outer centres
        bad = ((points < -0.5) | (points > np.array([width, height]) - 0.5)).any(axis=1)
        if bad.any():
            x, y = points[bad.argmax()]
            refuse(
                bad,
                f"the point ({x:g}, {y:g}) lies outside the {name}, which has {width}×{height} pixels",
                "x,y are pixels of the upright reference, x2,y2 of the upright target, both at full size",
            )
