"""The list of a batch: pictures of one panorama each, and frame ranges of two fixed cameras, from a CSV file."""

from __future__ import annotations

import csv
import os
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from ..cameras.programs.values import shortened
from ..cameras.sources import CameraRequest
from ..pictures.listing import SUFFIXES, listed
from ..system.errors import BadRequest, StitchError
from ..system.text_files import read_lines
from .options import CLIP, NAME

COLUMNS = ("reference", "target", "name", "first", "last", "step", "focal_px", "focal35")
_LAYOUT = (
    "each line holds reference,target and optionally a name, or one folder of pictures; a header names the columns in "
    f"any order, from: {', '.join(COLUMNS)}, and picture3, picture4 and so on for more than two"
)
# Columns of the third picture and of those after it.
_FURTHER = re.compile(r"picture([3-9]|[1-5]\d|60)")
# Where the frame's number stands in a file's name: %d, %04d, or #### as Blender and Nuke have it.
_PLACE = re.compile(r"%(?:0(\d{1,2}))?d|#{2,}")
# What a pattern like IMG_*.jpg holds.
_MANY = re.compile(r"[*?\[]")
_NOT_IN_NAMES = re.compile(r'[\x00-\x1f/\\:*?"<>|]')


@dataclass(frozen=True)
class BatchItem:
    """One line of a list: pictures of one panorama, or a clip of cameras that stand still.

    name: of its outputs; reference, target: files, or for clips patterns like a_%04d.png or a_####.png; frames: the
    numbers that all sides have, None for pictures; missing: expected numbers that some side lacks; camera: what this
    line says about the cameras, instead of the options; more: files or patterns beyond two; trouble: why a folder or a
    pattern stands for no panorama, which is then in place of both files. Raises BadRequest for a name that no file can
    have.
    """

    name: str
    reference: Path
    target: Path
    frames: tuple[int, ...] | None = None
    missing: tuple[int, ...] = ()
    camera: CameraRequest | None = None
    more: tuple[Path, ...] = ()
    trouble: StitchError | None = None

    def __post_init__(self) -> None:
        found = _NOT_IN_NAMES.search(self.name)
        if len(self.name.encode("utf-8", "surrogateescape")) > NAME.max_bytes:
            raise BadRequest(
                f"'{self.name[:20]}…' is too long for a name of outputs: {NAME.max_bytes} bytes are the most; give a "
                "shorter one in a column called name"
            )
        if found or not self.name or self.name.startswith(".") or self.name != self.name.strip():
            raise BadRequest(
                f"{self.name!r} is no name for outputs: it names a file, so it must not be empty, start with a dot or "
                r'a space, or hold any of / \ : * ? " < > |'
            )

    @property
    def aligned_on(self) -> tuple[int, ...]:
        """The frames of a clip that its alignment is estimated over: the first, the last and some evenly between.

        They depend on nothing but the frames, so that every shard and every later run finds the same alignment.
        """
        frames = self.frames or ()
        count = min(len(frames), CLIP.aligned_frames)
        return tuple(frames[round(i * (len(frames) - 1) / max(1, count - 1))] for i in range(count))

    def files(self, frame: int | None = None) -> tuple[Path, ...]:
        """The files of its pictures; of a clip, those of a frame."""
        files = self.reference, self.target, *self.more
        return files if frame is None else tuple(_with_number(one, frame) for one in files)

    def numbered(self, frame: int) -> str:
        """The name of a frame's output, with as many digits as the reference's."""
        return f"{self.name}_{frame:0{_pattern(self.reference).digits}d}"


def read_list(path: str | Path) -> list[BatchItem]:
    """Reads a list: a CSV file in UTF-8, separated by commas, semicolons or tabs.

    A header names columns out of COLUMNS, and picture3, picture4 and so on; without one they are reference, target and
    perhaps name. A folder or a pattern like IMG_*.jpg without a target stands for all its pictures. Empty lines and
    those that start with # are skipped. Relative paths start at the list's folder. A missing name is derived from the
    reference's. first, last and step select frames of patterns; without them all frames found are meant.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    list of BatchItem
        Whether the pictures of pairs exist is not checked; a folder that does not exist, and a folder or pattern
        without pictures, is in trouble.

    Raises
    ------
    BadRequest
        For the content, with the line's number.
    UnreadableImage
        The file cannot be read.
    """
    path = Path(path)
    items: list[BatchItem] = []
    lines: dict[str, int] = {}
    folders = _Folders()
    for number, row in _rows(path):
        try:
            item = _item(row, path.parent, folders)
        except BadRequest as error:
            raise BadRequest(f"{path}, line {number}: {error}") from None
        except OSError as error:
            raise BadRequest(f"{path}, line {number}: no name that files can have: {error.strerror}") from error
        before = lines.setdefault(same_name(item.name), number)
        if item.trouble is not None:
            item = replace(item, trouble=type(item.trouble)(f"{path}, line {number}: {item.trouble}"))
        if before != number:
            raise BadRequest(
                f"{path}, line {number}: its outputs would be named {item.name!r} like those of line {before}; give "
                "each its own in a column called name"
            )
        items.append(item)
    if not items:
        raise BadRequest(f"{path}: nothing to stitch in it; {_LAYOUT}")
    return items


def same_name(name: str) -> str:
    """A name without case and in one encoding of accents: names that are equal so are one file on some systems."""
    return unicodedata.normalize("NFC", name).casefold()


def find_frames(
    patterns: Sequence[Path], first: int | None = None, last: int | None = None, step: int = 1
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Frame numbers of patterns.

    Parameters
    ----------
    patterns : sequence of Path
        Of each camera, like a_%04d.png or a_####.png.
    first, last : int, optional
        Bounds; with both, every number between them is expected, otherwise those that any camera has.
    step : int
        Of the numbers, from first.

    Returns
    -------
    frames : tuple of int
        Numbers that all cameras have.
    missing : tuple of int
        Expected numbers that some camera lacks.

    Raises
    ------
    BadRequest
        No pattern, or no range.
    """
    return _find_frames(patterns, first, last, step, _Folders())


class _Pattern(NamedTuple):
    """A file name with a place for the frame's number, of at least `digits` digits."""

    before: str
    digits: int
    after: str

    def number(self, name: str) -> int | None:
        """The frame's number in a file name, None where it is no frame of this pattern."""
        if not (name.startswith(self.before) and name.endswith(self.after)):
            return None
        number = name[len(self.before) : len(name) - len(self.after)]
        fits = number.isascii() and number.isdigit() and number == f"{int(number):0{self.digits}d}"
        return int(number) if fits else None


class _Folders(dict[Path, list[str]]):
    """File names by folder, each folder listed once."""

    def __missing__(self, folder: Path) -> list[str]:
        try:
            self[folder] = os.listdir(folder)
        except OSError:  # reported later, as a clip without frames
            self[folder] = []
        return self[folder]


def _is_pattern(path: Path) -> bool:
    return _PLACE.search(path.name) is not None and not path.exists()  # "100%done.jpg" may be just a name


def _pattern(path: Path) -> _Pattern:
    places = list(_PLACE.finditer(path.name))
    if len(places) != 1:
        raise BadRequest(f"{path}: a pattern has one place for the frame's number, like a_%04d.png or a_####.png")
    place = places[0]
    digits = len(place[0]) if place[0].startswith("#") else int(place[1] or 1)
    return _Pattern(path.name[: place.start()], digits, path.name[place.end() :])


def _with_number(path: Path, frame: int) -> Path:
    pattern = _pattern(path)
    return path.with_name(f"{pattern.before}{frame:0{pattern.digits}d}{pattern.after}")


def _find_frames(
    patterns: Sequence[Path], first: int | None, last: int | None, step: int, folders: _Folders
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    sides: list[set[int]] = []
    for path in patterns:
        numbers = map(_pattern(path).number, folders[path.parent])
        sides.append({number for number in numbers if number is not None})
    in_all, in_any = set.intersection(*sides), set.union(*sides)
    low = min(in_any, default=0) if first is None else first
    high = max(in_any, default=low) if last is None else last
    if low < 0 or step < 1 or (first is not None and last is not None and last < first):
        raise BadRequest(f"frames {low} to {high} by {step}: they count from 0, up from first to last, by 1 or more")
    if (high - low) // step >= CLIP.max_frames:
        raise BadRequest(f"frames {low} to {high} in steps of {step} are more than {CLIP.max_frames}; split the clip")
    asked = range(low, high + 1, step)
    expected = asked if first is not None and last is not None else [n for n in asked if n in in_any]
    return tuple(n for n in expected if n in in_all), tuple(n for n in expected if n not in in_all)


def _item(row: dict[str, str], folder: Path, folders: _Folders) -> BatchItem:
    alone = folder / row.get("reference", "")
    if row.get("reference") and not row.get("target") and _stands_for_many(alone):
        return _set(row, alone)
    for column in ("reference", "target"):
        if not row.get(column):
            raise BadRequest(f"the {column} is missing; {_LAYOUT}")
    further = [column for column in row if _FURTHER.fullmatch(column) and row[column]]
    given = [row[column] for column in ("reference", "target", *further)]
    for one in given:
        parent = Path(one).parent
        if _PLACE.search(str(parent)) and not (folder / parent).exists():
            raise BadRequest(f"{one}: the frame's number may stand in the file's name, not in a folder's")
    files = [folder / one for one in given]
    reference, target, *more = files
    camera = _camera(row)
    span = {column: _whole_number(row[column], column) for column in ("first", "last", "step") if row.get(column)}
    if len({_is_pattern(one) for one in files}) > 1:
        raise BadRequest("one side is a pattern of frames and the other is not; all need to be")
    if not _is_pattern(reference):
        if span:
            raise BadRequest(f"{' and '.join(span)} given, but the files are no patterns like a_%04d.png or a_####.png")
        return BatchItem(row.get("name") or reference.stem, reference, target, camera=camera, more=tuple(more))
    frames, missing = _find_frames(files, span.get("first"), span.get("last"), span.get("step", 1), folders)
    name = row.get("name") or _clip_name(reference)
    return BatchItem(name, reference, target, frames, missing, camera, tuple(more))


def _stands_for_many(path: Path) -> bool:
    """Whether a path is a folder or a pattern, or would be a folder if it were there: it has no picture's ending."""
    if path.is_dir() or _MANY.search(path.name):
        return True
    return not (path.exists() or _is_pattern(path) or path.suffix.lower() in SUFFIXES)


def _set(row: dict[str, str], source: Path) -> BatchItem:
    """The item of a folder or pattern that stands for all its pictures; in trouble where these are fewer than two."""
    camera = _camera(row)
    try:
        files = listed([source])
        if len(files) < 2:
            raise BadRequest(f"{source}: only one picture ({files[0].name}); a panorama needs two or more")
    except StitchError as trouble:
        pattern = _MANY.search(source.name) and not source.is_dir()
        called = _NOT_IN_NAMES.sub("_", row["reference"]).strip(" ._") if pattern else source.resolve().name
        return BatchItem(row.get("name") or called or "pictures", source, source, camera=camera, trouble=trouble)
    name = row.get("name") or (source.resolve().name if source.is_dir() else files[0].stem)
    return BatchItem(name, files[0], files[1], camera=camera, more=tuple(files[2:]))


def _clip_name(reference: Path) -> str:
    pattern = _pattern(reference)
    return (pattern.before + pattern.after.rpartition(".")[0]).strip(" ._-") or reference.parent.resolve().name


def _camera(row: dict[str, str]) -> CameraRequest | None:
    focal_px, focal35 = (_numbers(row.get(column, ""), column) for column in ("focal_px", "focal35"))
    return CameraRequest(focal_px=focal_px, focal35=focal35) if focal_px or focal35 else None


def _numbers(cell: str, column: str) -> tuple[float, ...]:
    """The numbers of a cell, separated by commas, semicolons or spaces; none of an empty one."""
    try:
        return tuple(float(part) for part in re.split(r"[\s,;]+", cell)) if cell else ()
    except ValueError:
        raise BadRequest(f"{column} is {shortened(cell)}; a number is needed, or two") from None


def _whole_number(cell: str, column: str) -> int:
    if not (cell.isascii() and cell.isdigit() and len(cell) < 10):
        raise BadRequest(f"{column} is {shortened(cell)}; a whole number from 0 is needed")
    return int(cell)


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """The line number, from 1, and the cells by column of each line that is not empty."""
    separator = ""
    columns: tuple[str, ...] = ()
    for number, line in read_lines(path, "the list", _LAYOUT):
        if not separator:
            bare = re.sub(r'"[^"]*"', "", line)
            separator = next((mark for mark in ",;\t" if mark in bare), ",")
        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True))]
            if not columns:
                columns, is_header = _columns(cells)
                if is_header:
                    continue
            if len(cells) > len(columns):
                raise BadRequest(f"{len(cells)} cells where there are {len(columns)} columns; {_LAYOUT}")
        except (csv.Error, BadRequest) as error:
            raise BadRequest(f"{path}, line {number}: {error}") from None
        yield number, dict(zip(columns, cells, strict=False))  # the last may be left out


def _columns(cells: list[str]) -> tuple[tuple[str, ...], bool]:
    """The names of the columns by a list's first line, and whether that is a header."""
    names = tuple(cell.lower() for cell in cells)
    if not {"reference", "target"} & set(names):
        return COLUMNS[:3], False
    for column in ("reference", "target"):
        if column not in names:
            raise BadRequest(f"the header lacks {column}; {_LAYOUT}")
    for at, name in enumerate(names):
        if name not in COLUMNS and not _FURTHER.fullmatch(name):
            raise BadRequest(f"the header names a column {shortened(cells[at])} that is not known; {_LAYOUT}")
        if name in names[:at]:
            raise BadRequest(f"the header names the column {name} twice")
    return names, True
