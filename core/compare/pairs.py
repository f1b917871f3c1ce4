"""The pairs and sets to compare: two files, a folder of pictures, or a folder of such folders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..pictures.listing import SUFFIXES, each_once
from ..system.errors import BadRequest

# A folder with files of these names may hold other pictures as well: `edf validate` keeps its true panorama there.
ROLES = ("reference", "target")


@dataclass(frozen=True)
class PairFiles:
    """Two pictures and the name of the pair; of a set, its first two.

    folder: that holds all, None for two files given by name; trouble: why they are no pair, empty if they are; more:
    the further pictures of a set.
    """

    name: str
    reference: Path
    target: Path
    folder: Path | None = None
    trouble: str = ""
    more: tuple[Path, ...] = ()

    @property
    def all_pictures(self) -> tuple[Path, ...]:
        """In order, the reference first."""
        return self.reference, self.target, *self.more


def find_pairs(paths: Sequence[Path]) -> list[PairFiles]:
    """Finds the pairs that paths stand for.

    Parameters
    ----------
    paths : sequence of Path
        Files, two for each pair with the reference first, and folders. In a folder the reference is the picture of that
        name, or the first by name; one with more than two is a set. Folders without pictures are skipped if others
        have some.

    Returns
    -------
    list of PairFiles
        In the order of the paths, those of one folder by name; no two have the same name.

    Raises
    ------
    BadRequest
        A file without its partner, or no pictures.
    """
    found: list[PairFiles] = []
    alone: Path | None = None
    for path in paths:
        if path.is_dir() and alone is not None:
            break
        if path.is_dir():
            found += _in_folder(path)
        elif alone is None:
            alone = path
        else:
            found.append(PairFiles(f"{alone.stem}-{path.stem}", alone, path))
            alone = None
    if alone is not None:
        raise BadRequest(f"{alone} stands alone: name two pictures, the reference first, or folders of two")
    if not found:
        raise BadRequest("no pair of pictures to compare: name two pictures, a folder of two, or a folder of such")
    return list(_named_apart(found))


def _in_folder(folder: Path) -> list[PairFiles]:
    whole = _pair_of(folder)
    if whole is not None:
        return [whole]
    inner = (_pair_of(one) for one in sorted(folder.iterdir()) if one.is_dir())
    pairs = [pair for pair in inner if pair is not None]
    if not pairs:
        raise BadRequest(f"{folder} holds no pictures ({', '.join(sorted(SUFFIXES))}), nor do the folders in it")
    return pairs


def _pair_of(folder: Path) -> PairFiles | None:
    """The pair in a folder; None if it holds no pictures."""
    pictures = each_once(sorted(one for one in folder.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file()))
    if not pictures:
        return None
    name = folder.resolve().name
    roles = [next((one for one in pictures if one.stem == role), None) for role in ROLES]
    if roles[0] is not None and roles[1] is not None:
        return PairFiles(name, roles[0], roles[1], folder)
    trouble = "" if len(pictures) > 1 else "the folder holds one picture: a pair has two, a set more"
    second = pictures[min(1, len(pictures) - 1)]
    return PairFiles(name, pictures[0], second, folder, trouble, tuple(pictures[2:]))


def _named_apart(pairs: list[PairFiles]) -> Iterator[PairFiles]:
    taken: set[str] = set()
    for pair in pairs:
        name, number = pair.name, 2
        while name.casefold() in taken:
            name, number = f"{pair.name}-{number}", number + 1
        taken.add(name.casefold())
        yield replace(pair, name=name)
