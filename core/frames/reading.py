"""Reads what is to be stitched into a Frame, and refuses what cannot be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.from_circle import camera_of_circle
from ..cameras.sources import called
from ..options import StitchOptions
from ..pictures.masks import read_mask, read_painted, read_wanted, without
from ..pictures.naming import in_words, told_apart
from ..pictures.picture import Picture, in_same_colour_space, load_picture, picture_from_array
from ..pictures.raw_clipping import clipping_warnings
from ..pictures.raw_development import RawExposure, exposure_of_first
from ..pictures.resized import resized
from ..system.errors import BadRequest, NoOverlap, UnreadableImage
from ..system.threads import ask, in_order
from .brackets import brackets_in
from .flatness import usable
from .frame import Frame, size_of
from .merging import MergedBracket, merged
from .overlays import overlays_in
from .own_panoramas import own_panorama_warnings
from .spheres import views_of_sphere
from .used_parts import within_lenses

# What can be stitched: a file's name, an array, or a Picture that was read already.
Source = str | Path | NDArray[Any] | Picture
# Beyond this, pairs and memory were never tried.
MOST_PICTURES = 60
# Exposures of one view that a camera takes in a row, at most.
MOST_EXPOSURES = 9


def check_count(count: int, options: StitchOptions) -> None:
    """Refuses (BadRequest) as many files as cannot be stitched, and options that do not go with so many."""
    if isinstance(options.brackets, int):
        if count % options.brackets:
            raise BadRequest(
                f"{count} pictures are given, which are no brackets of {options.brackets}: leave out what is extra"
            )
        _check_views(count // options.brackets, options)
    elif options.brackets == "off" or count <= MOST_PICTURES:
        _check_views(count, options)
    elif count > MOST_PICTURES * MOST_EXPOSURES:
        _check_views(count, options)


def _check_views(count: int, options: StitchOptions, counted: str = "") -> None:
    """The same of pictures of different views; counted: how, where that is not plain."""
    if count < 2:
        raise BadRequest("one picture alone makes no panorama: give two that were taken from different places")
    if count > MOST_PICTURES:
        raise BadRequest(
            f"{count} pictures given{counted}, at most {MOST_PICTURES} make one panorama: leave out those that show "
            "nothing new"
        )
    if count > 2:  # of two one may be a sphere, which is more
        options.check_goes_with(count)


def read_frame(sources: Sequence[Source], options: StitchOptions) -> Frame:
    """Reads the pictures of one panorama and brings them into one colour space.

    Parameters
    ----------
    sources : sequence of (str, Path, ndarray or Picture)
        Of two the reference first.
    options : StitchOptions
        Their scale and masks, and what is a bracket.

    Returns
    -------
    Frame
        Of several copies of a picture the first, and one of the exposures of one view.

    Raises
    ------
    UnreadableImage
        Files are no pictures, or damaged; all of them are named.
    BadRequest
        A wrong number of pictures, a mask that does not fit, or brackets that are none.
    NoOverlap
        The same picture twice, and no other.
    """
    check_count(len(sources), options)
    given = _named_apart(_all_read(sources), sources)
    names = [picture.name for picture in given]
    views, members, brackets = _views_of(given, options)
    if brackets or len(views) > MOST_PICTURES:
        _check_views(len(views), options)
    views = [replace(one, warnings=(*one.warnings, *clipping_warnings(one))) for one in views]
    pictures = in_same_colour_space(views)
    copies = dict(_copies(pictures))
    if len(pictures) - len(copies) == 1:
        which = "the two pictures are" if len(pictures) == 2 else "all pictures are"
        raise NoOverlap(f"{which} the same picture: choose two photographs taken from different places")
    if copies:
        _check_views(len(pictures) - len(copies), options)
    if not brackets:
        return prepare(pictures, options, copies)
    masks = options.ignored_in(names)
    of_views = tuple(next((masks[number] for number in one if masks[number] is not None), None) for one in members)
    wanted, lines = options.shown_in(names), options.guides_in(names)
    guides = tuple(
        (view + 1, *line) for view, one in enumerate(members) for number in one for line in lines[number]
    )
    of_shown = tuple(
        (view + 1, mask) for view, one in enumerate(members)
        for mask in [wanted[number] for number in one if wanted[number] is not None][:1] if mask is not None
    )
    frame = prepare(pictures, replace(options, ignore=of_views, ignore_in=(), show=of_shown, guides=guides), copies)
    view_of = {number: view for view, numbers in enumerate(members) for number in numbers}
    return replace(
        frame, shown_by=tuple(frame.shown_by[view_of[number]] for number in range(len(names))),
        warnings=(_said_of(brackets), *frame.warnings), brackets=tuple(brackets),
    )  # fmt: skip


def _views_of(
    given: list[Picture], options: StitchOptions
) -> tuple[list[Picture], list[tuple[int, ...]], list[MergedBracket]]:
    """Pictures of different views, exposures of one merged: of each the numbers of the pictures it was made of, in
    order of the first; and what was merged. Exposures that were merged leave the list: each may take 70 MB."""
    found = brackets_in(given, options.brackets)
    of_first = {min(bracket.numbers): bracket for bracket in found}
    joined = {number for bracket in found for number in bracket.numbers}
    views: list[Picture] = []
    members: list[tuple[int, ...]] = []
    brackets: list[MergedBracket] = []
    for number, picture in enumerate(given):
        if number in of_first:
            picture, bracket = merged(given, of_first[number])
            brackets.append(bracket)
            for one in of_first[number].numbers:
                given[one] = picture
            members.append(of_first[number].numbers)
        elif number in joined:
            continue
        else:
            members.append((number,))
        views.append(picture)
    return views, members, brackets


def _said_of(brackets: Sequence[MergedBracket]) -> str:
    """What was merged, in words."""
    count = sum(len(bracket.names) for bracket in brackets)
    of_each = sorted({len(bracket.names) for bracket in brackets})
    many = f"{len(brackets)} brackets" if len(brackets) > 1 else "a bracket"
    exposures = " or ".join(map(str, of_each))
    return f"{count} pictures are {many} of {exposures} exposures and were merged; --brackets off keeps them apart"


def prepare(pictures: Sequence[Picture], options: StitchOptions, copies: dict[int, int] | None = None) -> Frame:
    """A frame of full pictures in one colour space.

    Parameters
    ----------
    pictures : sequence of Picture
    options : StitchOptions
        Their scale, masks and given cameras.
    copies : dict, optional
        Numbers of pictures that are left out since they are the same as another one: its number.

    Returns
    -------
    Frame

    Raises
    ------
    BadRequest, UnreadableImage
        About a mask or the camera file.
    """
    copies, names = copies or {}, [picture.name for picture in pictures]
    masks, wanted, guides = options.ignored_in(names), options.shown_in(names), options.guides_in(names)
    shown: list[Picture] = []
    known: list[Camera | None] = []
    shown_by: list[int] = []
    of_spheres: list[str] = []
    for number, picture in enumerate(pictures):
        ask()
        shown_by.append(shown_by[copies[number]] if number in copies else len(shown))
        if number in copies:
            continue
        if guides[number]:
            picture = replace(picture, guides=guides_of(guides[number], size_of(picture)))
        mask = masks[number]
        if mask is not None:
            picture = without(picture, read_mask(mask, size_of(picture), called(number, names)))
        if picture.part is not None:  # its views carry none
            if wanted[number] is not None:
                raise BadRequest(f"{picture.name} is a sphere, of which no part can be asked for: leave its mask out")
            of_spheres += [f"{picture.name}: {warning}" for warning in picture.warnings]
        elif (drawn := wanted[number]) is not None:
            picture = replace(picture, wanted=read_wanted(drawn, size_of(picture), called(number, names)))
        for view, camera in _as_flat(picture, number):
            shown.append(view)
            known.append(camera)
    if len(shown) > len(pictures):
        _check_views(len(shown), options, " (a sphere counts as its eight views)")
    elif len(shown) == 2:
        options.check_goes_with(2)
    flat = [number for number, camera in enumerate(known) if camera is None]
    overlays = dict(zip(flat, overlays_in([shown[number] for number in flat]), strict=True))
    burnt_in = [overlays.get(number) for number in range(len(shown))]
    worked_on = [
        resized(picture if mask is None else replace(without(picture, mask), burnt_in=mask), options.scale)
        for picture, mask in zip(shown, burnt_in, strict=True)
    ]
    warnings = *of_spheres, *(
        f"{names[number]} is given twice: it is used once"
        if names[number] == names[first]
        else f"{names[number]} is the same picture as {names[first]}: it is used once"
        for number, first in copies.items()
    )
    warnings += *own_panorama_warnings(pictures),
    if options.guides and (options.level != "auto" or options.surface[0] == "reference"):
        warnings += (
            "the lines that are upright or level are left out: they turn a panorama whose level is automatic, and not "
            "the reference's own plane",
        )
    finished = [picture.name for picture in pictures if picture.bits < 32]
    if finished and any(picture.is_raw for picture in pictures):
        warnings += (
            f"camera RAW stands beside {finished[0]}: how its camera changed tones and colours cannot be undone, so "
            "they match only roughly; use RAW files of all pictures, or of none",
        )
    if any(mask is not None for mask in burnt_in):
        marked = [picture.name for picture, mask in zip(shown, burnt_in, strict=True) if mask is not None]
        option = "--ignore-ref, --ignore-target" if len(shown) == 2 else "--ignore NAME=MASK"
        warnings = (*warnings, f"{in_words(marked)}: something is burnt in at the same place (a date, a logo); it is "
                    f"left out ({option} for what else is)")  # fmt: skip
    painted = None if options.mask is None else read_painted(options.mask)
    sizes = tuple(size_of(picture) for picture in shown)
    cameras = tuple(known) if any(known) else ()
    frame = Frame(tuple(worked_on), sizes, painted, warnings, tuple(shown_by), known=cameras)
    return within_lenses(frame, options.camera)


def guides_of(
    lines: Sequence[tuple[str, tuple[float, ...]]], size: tuple[int, int]
) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Lines in px of a picture of `size` (W, H) as `Picture.guides` has them."""
    return tuple(
        (kind, tuple((end + 0.5) / side for end, side in zip(ends, (*size, *size), strict=True)))
        for kind, ends in lines
    )  # fmt: skip


def _as_flat(picture: Picture, number: int) -> Iterator[tuple[Picture, Camera | None]]:
    """A picture as it is worked with, and its camera where that follows from what it is: a sphere as views of it,
    and a fisheye's circle."""
    if picture.part is not None:
        yield from views_of_sphere(picture, picture.part, number)
        return
    yield picture, None if picture.circle is None else camera_of_circle(picture.circle, size_of(picture))


def _all_read(sources: Sequence[Source]) -> list[Picture]:
    """The pictures. Raises UnreadableImage about all that cannot be read at once."""
    pictures: list[Picture] = []
    troubles: list[UnreadableImage] = []
    exposure = exposure_of_first(sources)
    for one in in_order(partial(_picture_or_trouble, exposure=exposure), sources):
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


def _picture_or_trouble(source: Source, exposure: RawExposure | None) -> Picture | UnreadableImage:
    try:
        return _picture(source, exposure)
    except UnreadableImage as trouble:
        return trouble


def _picture(source: Source, exposure: RawExposure | None) -> Picture:
    """A picture that can be worked with, read where it is not one yet. exposure: what camera RAW is developed with."""
    if isinstance(source, Picture):
        picture = source
    elif isinstance(source, np.ndarray):
        picture = picture_from_array(source)
    else:
        picture = load_picture(source, exposure=exposure)
    return usable(picture)


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
