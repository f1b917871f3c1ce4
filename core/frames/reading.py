"""Reads what is to be stitched into a Frame, and refuses what cannot be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.sources import called
from ..options import StitchOptions
from ..pictures.masks import read_mask, read_painted, without
from ..pictures.naming import in_words, told_apart
from ..pictures.picture import Picture, in_same_colour_space, load_picture, picture_from_array, resized
from ..system.errors import BadRequest, NoOverlap, UnreadableImage
from ..system.threads import in_order
from .flatness import check_flat
from .frame import Frame, size_of
from .overlays import overlays_in

# What can be stitched: a file's name, an array, or a Picture that was read already.
Source = str | Path | NDArray[Any] | Picture
# Beyond this, pairs and memory were never tried.
MOST_PICTURES = 60


def check_count(count: int, options: StitchOptions) -> None:
    """Refuses (BadRequest) as many pictures as cannot be stitched, and options that do not go with so many."""
    if count < 2:
        raise BadRequest("one picture alone makes no panorama: give two that were taken from different places")
    if count > MOST_PICTURES:
        raise BadRequest(
            f"{count} pictures given, at most {MOST_PICTURES} make one panorama: leave out those that show nothing new"
        )
    options.check_goes_with(count)


def read_frame(sources: Sequence[Source], options: StitchOptions) -> Frame:
    """Reads the pictures of one panorama and brings them into one colour space.

    Parameters
    ----------
    sources : sequence of (str, Path, ndarray or Picture)
        Of two the reference first.
    options : StitchOptions
        Their scale and masks.

    Returns
    -------
    Frame
        Of several copies of a picture the first.

    Raises
    ------
    UnreadableImage
        Files are no pictures, or damaged; all of them are named.
    BadRequest
        A wrong number of pictures, or a mask that does not fit.
    NoOverlap
        The same picture twice, and no other.
    """
    check_count(len(sources), options)
    pictures = in_same_colour_space(_named_apart(_all_read(sources), sources))
    copies = dict(_copies(pictures))
    if len(pictures) - len(copies) == 1:
        which = "the two pictures are" if len(pictures) == 2 else "all pictures are"
        raise NoOverlap(f"{which} the same picture: choose two photographs taken from different places")
    if copies:
        check_count(len(pictures) - len(copies), options)
    return prepare(pictures, options, copies)


def prepare(pictures: Sequence[Picture], options: StitchOptions, copies: dict[int, int] | None = None) -> Frame:
    """A frame of full pictures in one colour space.

    Parameters
    ----------
    pictures : sequence of Picture
    options : StitchOptions
        Their scale and masks.
    copies : dict, optional
        Numbers of pictures that are left out since they are the same as another one: its number.

    Returns
    -------
    Frame

    Raises
    ------
    BadRequest, UnreadableImage
        About a mask.
    """
    copies, names = copies or {}, [picture.name for picture in pictures]
    masks = options.ignored_in(names)
    shown: list[Picture] = []
    shown_by: list[int] = []
    for number, picture in enumerate(pictures):
        shown_by.append(shown_by[copies[number]] if number in copies else len(shown))
        if number in copies:
            continue
        mask = masks[number]
        if mask is not None:
            picture = without(picture, read_mask(mask, size_of(picture), called(number, names)))
        shown.append(picture)
    burnt_in = overlays_in(shown)
    worked_on = [
        resized(picture if mask is None else replace(without(picture, mask), burnt_in=mask), options.scale)
        for picture, mask in zip(shown, burnt_in, strict=True)
    ]
    warnings = tuple(
        f"{names[number]} is given twice: it is used once"
        if names[number] == names[first]
        else f"{names[number]} is the same picture as {names[first]}: it is used once"
        for number, first in copies.items()
    )
    if any(mask is not None for mask in burnt_in):
        marked = [picture.name for picture, mask in zip(shown, burnt_in, strict=True) if mask is not None]
        option = "--ignore-ref, --ignore-target" if len(shown) == 2 else "--ignore NAME=MASK"
        warnings = (*warnings, f"{in_words(marked)}: something is burnt in at the same place (a date, a logo); it is "
                    f"left out ({option} for what else is)")  # fmt: skip
    painted = None if options.mask is None else read_painted(options.mask)
    sizes = tuple(size_of(picture) for picture in shown)
    return Frame(tuple(worked_on), sizes, painted, warnings, tuple(shown_by))


def _all_read(sources: Sequence[Source]) -> list[Picture]:
    """The pictures. Raises UnreadableImage about all that cannot be read at once."""
    pictures: list[Picture] = []
    troubles: list[UnreadableImage] = []
    for one in in_order(_picture_or_trouble, sources):
        if isinstance(one, UnreadableImage):
            troubles.append(one)
        else:
            pictures.append(one)
    if len(troubles) > 1:
        raise UnreadableImage(f"{len(troubles)} files cannot be used: {'; '.join(map(str, troubles))}")
    if troubles:
        raise troubles[0]
    return pictures


def _named_apart(pictures: list[Picture], sources: Sequence[Source]) -> list[Picture]:
    """The same, of more than two with as many folders in the names of those from files as tell these apart: cameras
    count their pictures alike in every folder."""
    if len(pictures) == 2:
        return pictures
    files = [number for number, source in enumerate(sources) if isinstance(source, (str, Path))]
    out = list(pictures)
    for number, name in zip(files, told_apart([str(sources[number]) for number in files]), strict=True):
        out[number] = replace(out[number], name=Path(name).as_posix())
    return out


def _picture_or_trouble(source: Source) -> Picture | UnreadableImage:
    try:
        return _picture(source)
    except UnreadableImage as trouble:
        return trouble


def _picture(source: Source) -> Picture:
    """A picture, read where it is not one yet; a flat one."""
    if isinstance(source, Picture):
        picture = source
    else:
        picture = picture_from_array(source) if isinstance(source, np.ndarray) else load_picture(source)
    check_flat(picture)
    return picture


def _copies(pictures: Sequence[Picture]) -> Iterator[tuple[int, int]]:
    """The number of each picture that looks like one before it, and the number of the first such."""
    found: set[int] = set()
    sums = [int(picture.view.sum(dtype=np.int64)) for picture in pictures]  # most differ in it, which is quickly seen
    for first, other in combinations(range(len(pictures)), 2):
        if other in found or sums[first] != sums[other]:
            continue
        if np.array_equal(pictures[first].view, pictures[other].view):
            found.add(other)
            yield other, first
