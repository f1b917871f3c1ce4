"""Matches that the user gives, as a CSV file or an array; and matches as a CSV file.

A file that a stitch wrote holds all the matches that were found, and says of each what became of it. Read back, they
count as found and go through the same estimation, so that they make the same panorama. A file without that column holds
the user's own matches, which are used as they are.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.programs.hugin import Project, project_in
from ..pictures.naming import number_of
from ..raster.resizing import resized_points
from ..system.errors import BadRequest
from ..system.text_files import name_in_table, quoted, read_lines

COLUMNS = ("x", "y", "x2", "y2")
WEIGHT = "weight"
# What became of a match that was found, and the px that its noise is measured in.
STATE, NOISE = "state", "noise_px"
USED, NOT_BY_GEOMETRY, NOT_BY_FIELD = STATES = "used", "left out by the geometry", "left out by the field"
# The same points in px of the pictures that were worked on, where that was not their full size: there and back, the
# last digit of a float may change.
WORKED = ("worked_x", "worked_y", "worked_x2", "worked_y2")
# Names of the two pictures, in a file about more than two.
PICTURES = ("picture", "picture2")
KNOWN = (*PICTURES, *COLUMNS, WEIGHT, STATE, NOISE, *WORKED)
# A point in px of the full picture that lies within this, px, of the one worked on has not been moved since.
SAME_POINT = 1e-6
_LAYOUT = "each line holds x,y,x2,y2 or x,y,x2,y2,weight"

Size = tuple[int, int]


class _Table(NamedTuple):
    """The rows of a file or array: points (N, 4), weight (N,), state (N) of a file that has it, noise (N,), worked
    (N, 4), NaN where the file has none; what to call each row; and the two pictures (N, 2) of each, by names or
    numbers, of a file that has them.
    """

    points: NDArray[np.float64]
    weight: NDArray[np.float64]
    state: list[str] | None
    noise: NDArray[np.float64]
    worked: NDArray[np.float64]
    places: list[str]
    pictures: NDArray[Any] | None = None

    def between(self, first: str | int, second: str | int) -> _Table:
        """The rows of two pictures, with the points of the first one first, whichever way a row has them."""
        if self.pictures is None:
            return self
        turned = (self.pictures == (second, first)).all(axis=1)
        rows = np.flatnonzero(turned | (self.pictures == (first, second)).all(axis=1))

        def straight(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.where(turned[rows, None], values[rows][:, [2, 3, 0, 1]], values[rows])

        state = None if self.state is None else [self.state[row] for row in rows]
        return _Table(
            straight(self.points), self.weight[rows], state, self.noise[rows], straight(self.worked),
            [self.places[row] for row in rows],
        )  # fmt: skip


def read_matches_of_pairs(
    source: str | Path | NDArray[Any], names: Sequence[str], sizes: Sequence[Size], worked: Sequence[Size]
) -> dict[tuple[int, int], Matches]:
    """Matches between several pictures, from a file whose columns `picture` and `picture2` name them.

    Parameters
    ----------
    source : str or path
        As for `read_matches`.
    names : sequence of str
        Of all pictures; in the file, with or without their suffix.
    sizes, worked : sequence of (int, int)
        (W, H) px of the pictures, and of those in which the matches are wanted.

    Returns
    -------
    dict
        Matches by the numbers i < j of their pictures.

    Raises
    ------
    BadRequest
        For the content, with the line.
    UnreadableImage
        For the file.
    """
    columns = " and ".join(PICTURES)
    if isinstance(source, np.ndarray):
        raise BadRequest(f"matches of {len(names)} pictures are given as a file whose columns {columns} name them")
    table = _from_file(Path(source))
    if table.pictures is None:
        raise BadRequest(f"{source}: of {len(names)} pictures, a header must name the columns {columns} as well")
    numbers: dict[str, int] = {}
    for place, named in zip(table.places, table.pictures.tolist(), strict=True):
        for name in named:
            if name not in numbers:
                numbers[name] = number_of(name, names, place)
        if numbers[named[0]] == numbers[named[1]]:
            raise BadRequest(f"{place}: both points lie in {names[numbers[named[0]]]}; a match is of two pictures")
    pairs = np.array([[numbers[name] for name in named] for named in table.pictures.tolist()])
    table = table._replace(pictures=pairs)
    return {
        (i, j): _matches_in(
            table.between(i, j), source, (sizes[i], sizes[j]), (worked[i], worked[j]), (names[i], names[j])
        )
        for i, j in np.unique(np.sort(pairs, axis=1), axis=0).tolist()
    }


def read_matches(
    source: str | Path | NDArray[Any], size: Size, size_prime: Size, worked: tuple[Size, Size] | None = None,
    names: tuple[str, str] | None = None,
) -> Matches:  # fmt: skip
    """Matches from a file or an array: the user's own, or those that a stitch found and reported.

    Parameters
    ----------
    source : str, path or (N, 4) or (N, 5) array
        A CSV file in UTF-8: x, y in the reference and x2, y2 in the target, px of the upright pictures with integer
        pixel centres, and optionally a weight (default 1; 0 leaves the match out). Separated by commas, semicolons or
        white space; a header may name the columns in any order, among others; lines that start with # are skipped. Or
        an array of the same columns, or a Hugin project with control points.
    size, size_prime : (int, int)
        (W, H) px of the reference and of the target.
    worked : ((int, int), (int, int)), optional
        Sizes that the matches are wanted in, if the pictures were resized.
    names : (str, str), optional
        Of the pictures: of a file about more than two, only their matches are read.

    Returns
    -------
    Matches
        With `weight` above 0 and `given` True; of several matches between the same two points the first. From a file
        with a column `state` (see `matches_csv`): as they were found, `given` False, without those that were used and
        have a weight of 0 by now.

    Raises
    ------
    BadRequest
        For the content, with the line.
    UnreadableImage
        For the file.
    """
    table = _from_array(source) if isinstance(source, np.ndarray) else _from_file(Path(source))
    if names is not None:
        table = table.between(*names)
    return _matches_in(table, source, (size, size_prime), worked)


def _matches_in(
    table: _Table, source: str | Path | NDArray[Any], sizes: tuple[Size, Size], worked: tuple[Size, Size] | None,
    called: tuple[str, str] = ("the reference", "the target"),
) -> Matches:  # fmt: skip
    """The matches of two pictures, which messages call so; see `read_matches`."""
    if not len(table.points):
        raise BadRequest(f"{_whole(source)}: no matches between these two pictures in it; it names others")
    _check(table, sizes, called)
    if table.state is None:
        weight = table.weight
        kept = np.flatnonzero(weight > 0)
        _, first = np.unique(table.points[kept], axis=0, return_index=True)
        kept = kept[np.sort(first)]
    else:
        weight = np.where([state == USED for state in table.state], table.weight, 1.0)
        kept = np.flatnonzero(weight > 0)
    if not len(kept):
        raise BadRequest(f"{_whole(source)}: every match has weight 0, which leaves it out; give some a weight above 0")
    points = table.points[kept]
    if worked is not None:
        points = np.hstack([
            resized_points(points[:, part], full, small)
            for part, full, small in zip((slice(2), slice(2, 4)), sizes, worked, strict=True)
        ])  # fmt: skip
        exact = table.worked[kept]
        points = np.where(np.abs(points - exact) < SAME_POINT, exact, points)
    x, y = (np.ascontiguousarray(part) for part in (points[:, :2], points[:, 2:]))
    if table.state is None:
        return Matches(x, y, weight=weight[kept], given=True)
    found = Matches(x, y, float(table.noise[kept].max()))
    return found if (weight[kept] == 1).all() else replace(found, weight=weight[kept])


def matches_csv(
    matches: Matches, states: Sequence[str] | None = None, worked: Matches | None = None,
    pictures: Sequence[tuple[str, str]] | None = None,
) -> bytes:  # fmt: skip
    """The matches as a CSV file that `read_matches` reads back to the same floats.

    Parameters
    ----------
    matches : Matches
        In px of the full pictures.
    states : sequence of str, optional
        What became of each match that was found (of STATES). Those that were left out get weight 0, for programs that
        know no states.
    worked : Matches, optional
        The same matches in px of the pictures that were worked on, if these were resized.
    pictures : sequence of (str, str), optional
        Names of the pictures of each match, of more than two.

    Returns
    -------
    bytes
    """
    weight = matches.weights
    if states is not None:
        weight = np.where([state == USED for state in states], weight, 0.0)
    names: list[str] = [*COLUMNS, WEIGHT]
    columns = [*matches.x.T.tolist(), *matches.y.T.tolist(), weight.tolist()]
    cells = [[repr(value) for value in column] for column in columns]
    if states is not None:
        names += [STATE, NOISE]
        cells += [list(states), [repr(float(matches.scale))] * len(matches)]
    if worked is not None:
        names += WORKED
        cells += [[repr(value) for value in column] for column in (*worked.x.T.tolist(), *worked.y.T.tolist())]
    if pictures is not None:
        names = [*PICTURES, *names]
        cells = [*([quoted(name_in_table(name)) for name in column] for column in zip(*pictures, strict=True)), *cells]
    lines = [",".join(names), *map(",".join, zip(*cells, strict=True))]
    return ("\n".join(lines) + "\n").encode()


def _whole(source: str | Path | NDArray[Any]) -> str:
    return "the array of matches" if isinstance(source, np.ndarray) else str(source)


def _from_array(array: NDArray[Any]) -> _Table:
    if array.ndim != 2 or array.shape[1] not in (4, 5) or not len(array) or array.dtype.kind not in "iuf":
        raise BadRequest(
            f"the array of matches has the shape {array.shape} and {array.dtype} values: N × 4 (x, y, x2, y2) or N × 5 "
            "(and a weight) numbers are needed"
        )
    rows = np.ones((len(array), 5))
    rows[:, : array.shape[1]] = array
    places = [f"the array of matches, row {number} (the first is 0)" for number in range(len(array))]
    return _Table(rows[:, :4], rows[:, 4], None, np.ones(len(array)), np.full((len(array), 4), np.nan), places)


def _from_project(project: Project, path: Path) -> _Table:
    """The control points of a Hugin project."""
    if not len(project.points):
        raise BadRequest(f"{path}: no control points in this project; let Hugin find some, or give none")
    ends = [name.replace("\\", "/").rpartition("/")[2] for name in project.names]
    names = np.array(ends if len(set(ends)) == len(ends) else project.names)
    count = len(project.points)
    places = [f"{path}, line {line}" for line in project.lines]
    worked = np.full((count, 4), np.nan)
    return _Table(project.points, np.ones(count), None, np.ones(count), worked, places, names[project.pairs])


def _from_file(path: Path) -> _Table:
    project = project_in(path)
    if project is not None:
        return _from_project(project, path)
    rows: list[list[float]] = []
    places: list[str] = []
    states: list[str] = []
    pictures: list[list[str]] = []
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
        defaults = dict.fromkeys((*COLUMNS, WEIGHT, NOISE), "1") | dict.fromkeys(WORKED, "nan")
        rows.append([_number(named.get(name, default), name, place) for name, default in defaults.items()])
        places.append(place)
        if STATE in named:
            states.append(_state(named[STATE], place))
        if all(name in named for name in PICTURES):
            pictures.append([named[name].removeprefix("./") for name in PICTURES])
    if not rows:
        raise BadRequest(f"{path}: no matches in it; {_LAYOUT}, one line for each match")
    table = np.array(rows, np.float64)
    named_in = np.array(pictures) if pictures else None
    return _Table(table[:, :4], table[:, 4], states or None, table[:, 5], table[:, 6:], places, named_in)


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The cells of each line that holds some, with its number as editors count, from 1."""
    for number, line in read_lines(path, "the file of matches", _LAYOUT):
        # a semicolon first: where it separates, commas are decimal; names in quotation marks may hold either
        separator = next((mark for mark in ";," if mark in re.sub(r'"[^"]*"', "", line)), None)
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
    for name in KNOWN:
        if names.count(name) > 1:
            raise BadRequest(f"{place}: the header names the column {name} {names.count(name)} times; name it once")
    return tuple(name if name in KNOWN else f"column {at}" for at, name in enumerate(names))


def _number(cell: str, name: str, place: str) -> float:
    if _is_number(cell):
        return float(cell)
    if not cell:
        raise BadRequest(f"{place}: {name} is empty; a number is needed")
    decimal = " with a point for decimals" if "," in cell else ""
    raise BadRequest(f"{place}: {name} is {_shortened(cell)}; a number{decimal} is needed")


def _state(cell: str, place: str) -> str:
    if cell in STATES:
        return cell
    raise BadRequest(
        f"{place}: the {STATE} is {_shortened(cell)}; of matches that were found it is {', '.join(STATES[:-1])} or "
        f"{STATES[-1]}; matches of your own have no such column"
    )


def _counted(cells: list[str]) -> str:
    return f"{len(cells)} column{'s' if len(cells) != 1 else ''} ({_listed(cells)})"


def _listed(cells: list[str]) -> str:
    return ", ".join(map(_shortened, cells[:6])) + (", …" if len(cells) > 6 else "")


def _shortened(cell: str) -> str:
    return repr(cell if len(cell) <= 30 else cell[:29] + "…")


def _check(table: _Table, sizes: tuple[Size, Size], called: tuple[str, str]) -> None:
    """Raises BadRequest for the first row with a value that is not finite, a negative weight, no noise, or a point
    outside its picture."""

    def refuse(bad: NDArray[np.bool_], found: str, needed: str) -> NoReturn:
        more = int(bad.sum()) - 1
        also = f" (and {more} more line{'s' if more > 1 else ''})" if more else ""
        raise BadRequest(f"{table.places[int(bad.argmax())]}: {found}{also}; {needed}")

    for name, values in zip((*COLUMNS, WEIGHT, NOISE), (*table.points.T, table.weight, table.noise), strict=True):
        bad = ~np.isfinite(values)
        if bad.any():
            refuse(bad, f"{name} is {values[bad.argmax()]}", "correct it, or leave the line out")
    if (bad := table.weight < 0).any():
        refuse(bad, f"the weight is {table.weight[bad.argmax()]:g}", "0 leaves a match out, larger counts more")
    if (bad := table.noise <= 0).any():
        refuse(bad, f"{NOISE} is {table.noise[bad.argmax()]:g}", "it is a length above 0")
    for name, columns, (width, height) in zip(called, (slice(2), slice(2, 4)), sizes, strict=True):
        points = table.points[:, columns]
        # pixel centres are integers: the picture's own edges lie half a pixel beyond the outer centres
        bad = ((points < -0.5) | (points > np.array([width, height]) - 0.5)).any(axis=1)
        if bad.any():
            x, y = points[bad.argmax()]
            refuse(
                bad, f"the point ({x:g}, {y:g}) lies outside {name}, which has {width}×{height} pixels",
                "x,y are pixels of the line's first picture, x2,y2 of its second one, both upright and at full size",
            )  # fmt: skip
