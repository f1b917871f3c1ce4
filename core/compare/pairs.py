"""Which pairs are meant: two files, a folder of two pictures, or a folder of such folders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..system.errors import BadRequest

SUFFIXES = frozenset((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".webp", ".bmp"))
# A folder that names its two so may hold other pictures beside them: `edf validate` keeps its true panorama there.
ROLES = ("reference", "target")


@dataclass(frozen=True)
class PairFiles:
    """Two pictures and what they are called together; trouble: why they are not two, where they are not.

    folder: where both lie, None for two files that were named.
    """

    name: str
    reference: Path
    target: Path
    folder: Path | None = None
    trouble: str = ""


def find_pairs(paths: Sequence[Path]) -> list[PairFiles]:
    """The pairs that paths name, in their order, those of one folder by name; no two with the same name.

    Of a folder the first picture by name is the reference, or the one called so. Folders without pictures beside
    others that have some are passed over. Raises BadRequest.
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
    """A folder's pair; None where it holds no pictures."""
    pictures = sorted(one for one in folder.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file())
    if not pictures:
        return None
    name = folder.resolve().name
    roles = [next((one for one in pictures if one.stem == role), None) for role in ROLES]
    if roles[0] is not None and roles[1] is not None:
        return PairFiles(name, roles[0], roles[1], folder)
    trouble = "" if len(pictures) == 2 else f"the folder holds {len(pictures)} pictures, a pair has two"
    return PairFiles(name, pictures[0], pictures[-1], folder, trouble)


def _named_apart(pairs: list[PairFiles]) -> Iterator[PairFiles]:
    taken: set[str] = set()
    for pair in pairs:
        name, number = pair.name, 2
        while name.casefold() in taken:
            name, number = f"{pair.name}-{number}", number + 1
        taken.add(name.casefold())
        yield PairFiles(name, pair.reference, pair.target, pair.folder, pair.trouble)
