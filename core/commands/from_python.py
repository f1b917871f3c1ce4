"""`edf_stitch.stitch`: the whole stitch in one call, with the options of the command line as keywords."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.scale import ScaleMetres
from ..cameras.sources import CameraRequest
from ..choices import Brackets, Crop, Exposing, Level, Slide
from ..frames.reading import Source
from ..options import StitchOptions
from ..pictures.listing import listed
from ..pictures.picture import Picture
from ..pipeline import stitch as stitch_pictures
from ..system.cache import default_folder
from ..system.errors import BadRequest
from .python_result import Panorama, panorama_of

Numbers = float | Sequence[float]
Lines = Sequence[tuple[str, Sequence[float]]]
Mask = str | Path | NDArray[Any]


def stitch(
    pictures: Sequence[Source], options: StitchOptions | None = None,
    progress: Callable[[str, float], None] | None = None, cancelled: Callable[[], bool] | None = None, *,
    focal_px: Numbers = (), focal_mm: Numbers = (), sensor_mm: Numbers = (), focal35: Numbers = (),
    principal: Sequence[float] = (), cameras: str | Path | dict[str, Any] | None = None,
    scale_metres: ScaleMetres | None = None, matches: str | Path | NDArray[Any] | None = None,
    ignore: Mapping[str, Mask] | Sequence[Mask | None] = (), show: Mapping[str, Mask] | None = None,
    viewpoint: int | str | None = None, require_all: bool = False, brackets: Brackets = "auto", scale: float = 1.0,
    crop: Crop = "auto", field: str = "slack", fade: str = "continue", dense: bool = True, slide: Slide = "auto",
    projection: str = "auto", level: Level = "auto", vertical: Lines = (), horizontal: Lines = (),
    centre: tuple[float, float] | None = None, fov: float | None = None, blend: str = "multiband",
    seam: str = "graphcut", mask: Mask | None = None, exposure: Exposing = "auto", holes: str = "auto",
    preview: bool = False, cache: bool | str | Path = False, memory: float | None = None, seed: int = 0,
    measure: bool = True,
) -> Panorama:  # fmt: skip
    """Stitch pictures into one panorama.

    Parameters
    ----------
    pictures : sequence of str, Path or ndarray
        2 to 60 files, folders of them, or arrays (8 and 16 bit display-encoded, float scene-linear; RGB(A) or gray).
        Of two the first is the reference; more may come in any order.
    options : StitchOptions, optional
        All that may be chosen in one object, instead of the keywords from `focal_px` on.
    progress : callable, optional
        Called with a stage's name and the share (0..1) of everything that is done.
    cancelled : callable, optional
        Called between the steps of the work; says whether to stop.
    focal_px, focal_mm, sensor_mm, focal35 : float or (float, float)
        What is known of the cameras: one value for all pictures, or two of a pair. By default EXIF, or an estimate.
    principal : (x, y) or (x, y, x', y')
        Principal point, px.
    cameras : str, Path or dict, optional
        A camera file, or its content (docs/formats.md).
    matches : str, Path or ndarray (N, 4 or 5), optional
        Matches instead of those that are found.
    ignore : dict or sequence of mask
        Masks of what is kept out of everything, white = ignored: by picture's name, or one for each picture, or None.
    show : dict of mask, optional
        By pictures' names, masks of what the panorama is to show of them, white = from this picture.
    mask : str, Path or ndarray, optional
        Painted over the panorama of a pair: black = from the reference, white = from the target.
    vertical, horizontal : sequence of (str, (4,) floats)
        Lines in pictures that level "auto" holds to: a picture's name, and x, y, x', y' px.
    cache : bool, str or Path
        Whether features, geometry and field are kept for the next stitch of the same pictures, or in which folder.
    memory : float, optional
        GB that may be taken; by default half of what is free, for a pair as much as it takes.
    measure : bool
        Whether the report also compares the pictures in the overlap, which takes time.
    scale_metres, viewpoint, require_all, brackets, scale, crop, field, fade, dense, slide, projection, level, centre, \
fov, blend, seam, exposure, holes, preview, seed
        As the options of `edf stitch` of these names, and in StitchOptions.

    Returns
    -------
    Panorama

    Raises
    ------
    StitchError
        And its kinds, each saying what was found, what was needed and what to do. BadRequest: the call is wrong.
        UnreadableImage: a file cannot be read. TooFewMatches, NoOverlap, DegenerateGeometry: the pictures cannot be
        stitched. OutputTooLarge, NotEnoughMemory: the panorama is too large. Cancelled: asked to stop.
    """
    _check_kinds(locals())
    keep = default_folder() if cache is True else Path(cache) if cache else None
    masks = {} if not isinstance(ignore, Mapping) else {"ignore_in": tuple((k, _file(v)) for k, v in ignore.items())}
    guides = tuple(
        (name, kind, tuple(ends)) for kind, lines in (("vertical", vertical), ("horizontal", horizontal))
        for name, ends in lines
    )
    shown = tuple((name, _file(one)) for name, one in (show or {}).items())
    camera = CameraRequest(
        focal_px=_numbers("focal_px", focal_px), focal_mm=_numbers("focal_mm", focal_mm),
        sensor_mm=_numbers("sensor_mm", sensor_mm), focal35=_numbers("focal35", focal35), principal=tuple(principal),
        cameras=cameras,
    )  # fmt: skip
    chosen = StitchOptions(
        field=field, fade=fade, camera=camera,
        matches=_file(matches), ignore=() if masks else tuple(map(_file, ignore)), show=shown, guides=guides,
        viewpoint=viewpoint,
        require_all=require_all, brackets=brackets if isinstance(brackets, str) else int(brackets),
        scale_metres=scale_metres, slide=_shares(slide), projection=projection, level=level, centre=centre, fov=fov,
        scale=scale, crop=crop, dense=dense, blend=blend, seam=seam, mask=_file(mask),
        exposure=exposure, holes=holes, preview=preview, seed=seed, measure=measure,
        memory_gb=memory, cache=keep, **masks,
    )  # fmt: skip
    if options is not None and (given := _not_default(chosen)):
        raise BadRequest(f"{given[0]} is given beside options: put it into the options, or give keywords only")
    used, each = options or chosen, _each(pictures)
    result = stitch_pictures(each, used, progress, cancelled)
    return panorama_of(result, [Path(one) for one in each if isinstance(one, (str, Path))] + used.files_read)


_OR_NONE = type(None)
# What keywords take, of those whose kind is not looked at where they are used; and the same in words.
_FLAG, _NUMBER, _WHOLE = (bool, np.bool_), (Real,), (Integral,)
_KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    **dict.fromkeys(("require_all", "dense", "preview", "measure"), (_FLAG, "True or False")),
    "scale": (_NUMBER, "a number"), "seed": (_WHOLE, "a whole number"),
    **dict.fromkeys(("fov", "memory"), ((*_NUMBER, _OR_NONE), "a number")),
    **dict.fromkeys(("field", "fade", "projection", "blend", "seam", "holes"), ((str,), "a name")),
    "slide": ((str, *_NUMBER, Sequence), "a name, a number, or how far, from and to"),
    "exposure": ((str, *_NUMBER), "a name or a number"),
    "brackets": ((str, *_WHOLE), "a name or a whole number"),
    "crop": ((str, Sequence), "a name, or x, y, width and height"),
    "level": ((str, Sequence), "a name, or yaw, pitch and roll"), "principal": ((Sequence, np.ndarray), "numbers"),
    "ignore": ((Mapping, Sequence), "masks by the pictures' names, or one for each picture"),
    **dict.fromkeys(("vertical", "horizontal"), ((Sequence,), "lines, each a picture's name and four numbers")),
    "show": ((Mapping, _OR_NONE), "masks by the pictures' names"),
    "centre": ((Sequence, np.ndarray, _OR_NONE), "yaw and pitch"),
    "viewpoint": ((str, *_WHOLE, _OR_NONE), "a picture's name or number"),
    "scale_metres": ((Sequence, _OR_NONE), "two pictures and a distance"),
}  # fmt: skip


def _check_kinds(given: Mapping[str, Any]) -> None:
    """Raises BadRequest where a keyword has a value of another kind than it takes."""
    for name, (kinds, words) in _KINDS.items():
        value = given[name]
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            raise BadRequest(f"{name} is {value!r}: it takes {words}")
    if given["scale_metres"] is not None and len(given["scale_metres"]) != 3:
        raise BadRequest(f"scale_metres is {given['scale_metres']!r}: it takes two pictures and a distance")


def _shares(slide: Any) -> Slide:
    """How far the viewpoint slides as options take it: several numbers as a tuple."""
    given: Slide = tuple(slide) if np.ndim(slide) else slide
    return given


def _numbers(name: str, values: Numbers) -> tuple[float, ...]:
    try:
        return tuple(np.atleast_1d(np.asarray(values, np.float64)).tolist())
    except (TypeError, ValueError) as error:
        raise BadRequest(f"{name} is {values!r}: give a number, or one for each picture") from error


def _each(pictures: Sequence[Source]) -> list[Source]:
    """The pictures, those of a folder in its place."""
    if isinstance(pictures, (str, Path, np.ndarray, Picture)):
        raise BadRequest("stitch() takes its pictures as a list: stitch([left, right])")
    return [
        one
        for given in pictures
        for one in (listed([Path(given)]) if isinstance(given, (str, Path)) and Path(given).is_dir() else [given])
    ]


def _file(given: Any) -> Any:
    """A file's name as a path; anything else as it is."""
    return Path(given) if isinstance(given, str) else given


def _not_default(options: StitchOptions) -> list[str]:
    """The names of the options that were chosen."""
    default = StitchOptions()

    def same(name: str) -> bool:
        one, usual = getattr(options, name), getattr(default, name)
        return one is usual or (not isinstance(one, np.ndarray) and bool(one == usual))

    return [one.name for one in fields(options) if not same(one.name)]
