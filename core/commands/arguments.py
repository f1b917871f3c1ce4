"""The options of the command line that say how a pair is stitched, and what they become."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..choices import (
    BLENDS,
    BRACKETS,
    CENTRE,
    EXPOSURES,
    FADES,
    FIELDS,
    GUIDES,
    HOLES,
    PROJECTIONS,
    SEAMS,
    Brackets,
    Exposing,
)

if TYPE_CHECKING:
    from ..options import StitchOptions


def add_options(parser: argparse.ArgumentParser, with_field: bool = True) -> None:
    """Adds everything that decides about a panorama, group by group; where files go is each command's own.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    with_field : bool
        Whether `--field` and `--preview` are among them; not where one command stitches with several fields.
    """
    _add_cameras(parser)
    _add_control(parser)
    _add_many(parser)
    how = parser.add_argument_group("how")
    if with_field:
        how.add_argument(
            "--field", default="slack", type=_choice(FIELDS), metavar="FIELD",
            help="displacement field: slack (default: epipolar lines with a little slack), strict (exactly on them), "
            "paper, or one that knows no depth: rew, apap, spw, lpc, homography",
        )  # fmt: skip
    _add_alignment(how)
    _add_composition(how)
    if with_field:
        _add_preview(how)
    _add_repetition(how)


def _add_cameras(parser: argparse.ArgumentParser) -> None:
    """What is known of the cameras."""
    camera = parser.add_argument_group(
        "cameras",
        "One value serves all pictures; two are REF,TARGET of a pair; of more pictures each has its own in --cameras. "
        "Without any: EXIF, or an estimate.",
    )
    camera.add_argument("--focal-px", type=_numbers, default=(), metavar="F[,F2]", help="focal length in pixels")
    camera.add_argument(
        "--focal-mm", type=_numbers, default=(), metavar="F[,F2]", help="focal length in mm (with --sensor-mm)"
    )
    camera.add_argument(
        "--sensor-mm", type=_numbers, default=(), metavar="W[,W2]",
        help="width of the sensor in mm, along the longer side",
    )  # fmt: skip
    camera.add_argument("--focal35", type=_numbers, default=(), metavar="F[,F2]", help="35 mm equivalent focal length")
    camera.add_argument(
        "--principal", type=_numbers, default=(), metavar="X,Y[,X2,Y2]",
        help="principal point in pixels (default: the middle)",
    )  # fmt: skip
    camera.add_argument(
        "--cameras", type=Path, metavar="FILE",
        help="per picture K, optionally distortion or lens, R and t; of more than two, those that are in it are held; "
        "or a COLMAP model's folder, transforms.json, a Hugin project (.pto), a calibration, a lensfun database",
    )  # fmt: skip


    camera.add_argument(
        "--scale-metres", type=_scale_metres, metavar="A,B,D",
        help="the pictures A and B, by number, counted from 1, or name, were taken D metres apart: ranges are in "
        "metres",
    )  # fmt: skip


def _add_many(parser: argparse.ArgumentParser) -> None:
    """What is decided about more than two pictures."""
    many = parser.add_argument_group("more than two pictures")
    many.add_argument(
        "--viewpoint", type=_viewpoint, metavar="N|NAME|centre",
        help="the picture from whose place all is seen: its number, counted from 1, its name, or centre for the one "
        "that is best connected with all others (default: the first that connects with others)",
    )  # fmt: skip
    many.add_argument(
        "--require-all", action="store_true",
        help="exit with 3 where a picture connects with no others (by default it is left out, and named)",
    )  # fmt: skip
    many.add_argument(
        "--brackets", default="auto", type=_brackets, metavar="auto|off|N",
        help="exposures of one view become one picture of high dynamic range: auto (default: they are looked for), "
        "off, or every N pictures in order",
    )  # fmt: skip


def _add_control(parser: argparse.ArgumentParser) -> None:
    """What of the pictures takes part, and what of the panorama is kept."""
    control = parser.add_argument_group("control")
    control.add_argument(
        "--matches", type=Path, metavar="FILE.csv",
        help="x,y,x2,y2[,weight] in px of REF and TARGET; of more than two pictures the columns picture and picture2 "
        "name whose: used as given, nothing is searched; a report's own: as they were found; or a Hugin project",
    )  # fmt: skip
    control.add_argument(
        "--ignore-ref", type=Path, metavar="MASK",
        help="of a pair: a picture, white where REF is to be ignored altogether",
    )  # fmt: skip
    control.add_argument("--ignore-target", type=Path, metavar="MASK", help="the same for TARGET")
    control.add_argument(
        "--ignore", type=_named_mask, action="append", default=[], metavar="NAME=MASK",
        help="the same for the picture of that name; may be given for several",
    )  # fmt: skip
    control.add_argument(
        "--show", type=_named_mask, action="append", default=[], metavar="NAME=MASK",
        help="a picture, white where the panorama is to come from the one of that name; may be given for several",
    )  # fmt: skip
    control.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="resize all pictures by S ≤ 1 first, for a fast preview"
    )
    control.add_argument(
        "--crop", default="auto", metavar="CROP",
        help="auto (default: the largest full rectangle if that keeps most, else all that is shown), full, inscribed "
        "(that rectangle), reference (its frame), or X,Y,W,H in px",
    )  # fmt: skip


def _add_alignment(how: argparse._ArgumentGroup) -> None:
    """How the pictures are brought onto the canvas, and what canvas that is."""
    how.add_argument(
        "--fade", default="continue", type=_choice(FADES), metavar="FADE",
        help="what becomes of it outside the overlap: continue (default: what lies at the rim goes on as the picture "
        "does), plane (it fades to the one that carries on beyond the border), or infinity",
    )  # fmt: skip
    how.add_argument(
        "--dense", action=argparse.BooleanOptionalAction, default=True,
        help="seek every pixel of the overlap along its epipolar lines (default; --no-dense: the smooth field alone)",
    )
    how.add_argument(
        "--slide", default="auto", type=_slide, metavar="SLIDE",
        help="how far the viewpoint slides from REF's place to TARGET's across the overlap, or among the places of "
        "more pictures: auto (default), or a share from 0 (not at all) to 1; SLIDE,FROM,TO: within a part of the way",
    )  # fmt: skip
    how.add_argument(
        "--projection", default="auto", type=_projection, metavar="PROJECTION",
        help="auto (default: by the field of view, levelled and centred), reference (the plane and place of REF, every "
        "pixel of it kept), perspective (a plane), pannini[:D] (D from 0, a plane, to 1), cylindrical, or "
        "equirectangular (the whole sphere)",
    )  # fmt: skip
    for kind, where in zip(GUIDES, ("upright", "level"), strict=True):
        how.add_argument(
            f"--{kind}", type=_line, action="append", default=[], metavar="NAME=X,Y,X2,Y2",
            help=f"a line in the picture of that name, px, that is {where}, which auto holds to; may be repeated",
        )
    how.add_argument(
        "--level", default="auto", metavar="LEVEL",
        help="how all but reference are turned: auto (default: upright), none (as REF), or YAW,PITCH,ROLL of "
        "REF in degrees (right, up, clockwise); write --level=-5,0,0 where it begins with a minus",
    )  # fmt: skip
    how.add_argument(
        "--centre", type=_numbers, metavar="YAW,PITCH",
        help="move the frame by so many degrees right and up from the middle of what is shown; turns nothing",
    )  # fmt: skip
    how.add_argument(
        "--fov", type=float, metavar="H", help="degrees that the frame shows from left to right (default: all)"
    )


def _add_composition(how: argparse._ArgumentGroup) -> None:
    """How one picture is made of them."""
    how.add_argument(
        "--blend", default="multiband", type=_choice(BLENDS), metavar="BLEND",
        help="multiband (default: light evened out across the seam, detail cut), feather, or linear (plain average)",
    )  # fmt: skip
    how.add_argument(
        "--seam", default="graphcut", type=_choice(SEAMS), metavar="SEAM",
        help="graphcut (default: where the pictures look most alike) or none (midway between their borders)",
    )  # fmt: skip
    how.add_argument(
        "--mask", type=Path, metavar="MASK",
        help="painted over the panorama, whole or cropped: black from REF, white from TARGET, gray or transparent: the "
        "seam's",
    )  # fmt: skip
    how.add_argument(
        "--exposure", default="auto", type=_exposure, metavar="EXPOSURE",
        help="auto (default: all pictures meet at one exposure, and no light is blown), reference (the others are "
        "matched to REF), none (the light stays as it is), or a number of stops to add to auto, as --exposure=-0.5",
    )  # fmt: skip
    how.add_argument(
        "--no-exposure", dest="exposure", action="store_const", const="none", help="the same as --exposure none"
    )
    how.add_argument(
        "--holes", default="auto", type=_choice(HOLES), metavar="HOLES",
        help="what no camera saw: auto (default: small closed holes are filled smoothly), transparent, or inpaint (of "
        "two pictures all that something near hid, of more all holes that are closed)",
    )  # fmt: skip


def _add_preview(how: argparse._ArgumentGroup) -> None:
    """Whether the panorama is only to be looked at."""
    how.add_argument(
        "--preview", action="store_true",
        help="a panorama of one or two megapixels, by the geometry of the full pictures, which the same call without "
        "it takes from the cache",
    )  # fmt: skip


def _add_repetition(how: argparse._ArgumentGroup) -> None:
    """What another stitch of the same pictures takes from this one: what was kept, and the random choices; and what
    memory any of them may take."""
    how.add_argument(
        "--cache", action=argparse.BooleanOptionalAction, default=True,
        help="keep features, geometry and field for the next stitch of the same pictures (default; EDF_CACHE: where)",
    )  # fmt: skip
    how.add_argument(
        "--memory", type=float, metavar="GB",
        help="GB that may be taken (default: half of what is free, for a pair as much as it takes): with less, less is "
        "done at once; the outcome is the same",
    )  # fmt: skip
    how.add_argument("--seed", type=int, default=0, metavar="N", help="seed of every random choice (default 0)")


def options_from(args: argparse.Namespace, measure: bool) -> StitchOptions:
    """What the parsed arguments ask for. Raises BadRequest."""
    from ..cameras.sources import CameraRequest
    from ..compose.crop import parse_crop
    from ..options import StitchOptions
    from ..panorama.levelling import parse_level
    from ..system.cache import default_folder

    return StitchOptions(
        field=getattr(args, "field", "slack"),
        fade=args.fade,
        camera=CameraRequest(
            args.focal_px, args.focal_mm, args.sensor_mm, args.focal35, args.principal, args.cameras
        ),
        matches=args.matches,
        ignore=(args.ignore_ref, args.ignore_target) if args.ignore_ref or args.ignore_target else (),
        ignore_in=tuple(args.ignore),
        show=tuple(args.show),
        guides=tuple((name, kind, ends) for kind in GUIDES for name, ends in getattr(args, kind)),
        viewpoint=args.viewpoint,
        require_all=args.require_all,
        brackets=args.brackets,
        scale_metres=args.scale_metres,
        slide=args.slide,
        projection=args.projection,
        level=parse_level(args.level),
        centre=args.centre,
        fov=args.fov,
        scale=args.scale,
        crop=parse_crop(args.crop),
        dense=args.dense,
        blend=args.blend,
        seam=args.seam,
        mask=args.mask,
        exposure=args.exposure,
        holes=args.holes,
        preview=getattr(args, "preview", False),
        seed=args.seed,
        measure=measure,
        memory_gb=args.memory,
        cache=default_folder() if args.cache else None,
    )


def numbered(options: StitchOptions, pictures: Sequence[Path]) -> StitchOptions:
    """The options with the numbers of the pictures that they name, which may be called by any end of their paths.

    Raises BadRequest where no picture has that name, where one gets two masks, and where a mask is meant for REF or
    TARGET, of more than two pictures.
    """
    from ..pictures.naming import number_of
    from ..system.errors import BadRequest

    count, names = len(pictures), [str(path) for path in pictures]
    if count > 2 and options.ignore:
        raise BadRequest(f"{count} pictures are given, none of them REF or TARGET: name them, as --ignore NAME=MASK")
    masks = [options.ignored(number) for number in range(count)]
    for name, mask in options.ignore_in:
        number = number_of(name, names, "--ignore")
        if masks[number] is not None:
            raise BadRequest(f"--ignore: {name} has another mask already: paint both into one")
        masks[number] = mask
    shown: dict[int, Any] = {}
    for one, mask in options.show:
        number = number_of(str(one), names, "--show")
        if number in shown:
            raise BadRequest(f"--show: {one} has another mask already: paint both into one")
        shown[number] = mask
    viewpoint = options.viewpoint
    if isinstance(viewpoint, int) and viewpoint > count:
        raise BadRequest(f"the viewpoint is picture {viewpoint}, and only {count} are given")
    if isinstance(viewpoint, str) and viewpoint != CENTRE:
        viewpoint = number_of(viewpoint, names, "--viewpoint") + 1
    scale = options.scale_metres
    if scale is not None:
        first, other = (
            number_of(name, names, "--scale-metres") + 1 if isinstance(name, str) else name for name in scale[:2]
        )
        scale = first, other, scale[2]
    return replace(
        options, ignore=tuple(masks) if any(masks) else (), ignore_in=(), viewpoint=viewpoint, scale_metres=scale,
        show=tuple((number + 1, mask) for number, mask in shown.items()),
        guides=tuple((number_of(str(one), names, f"--{kind}") + 1, kind, ends) for one, kind, ends in options.guides),
    )  # fmt: skip


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of numbers like 1200 or 1200,1180") from None


def _viewpoint(text: str) -> int | str:
    if text.casefold() in (CENTRE, "center"):
        return CENTRE
    return int(text) if text.isdecimal() else text


def _brackets(text: str) -> Brackets:
    if text.isdecimal() and int(text) > 1:
        return int(text)
    if text in BRACKETS:
        return text
    known = ", ".join(BRACKETS)
    raise argparse.ArgumentTypeError(f"{text!r} is not known; choose from: {known}, or a number from 2")


def _scale_metres(text: str) -> tuple[int | str, int | str, float]:
    parts = text.split(",")
    try:
        one, other, metres = parts[0], ",".join(parts[1:-1]), float(parts[-1])
    except ValueError:
        metres = 0.0
    if len(parts) < 3 or not metres > 0 or not one or not other:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not like A,B,D: two pictures, by number or name, and their distance in metres"
        )
    first, second = (int(name) if name.isdecimal() else name for name in (one, other))
    return first, second, metres


def _named_mask(text: str) -> tuple[str, Path]:
    name, _, mask = text.rpartition("=")
    if not name or not mask:
        raise argparse.ArgumentTypeError(f"{text!r} is not like NAME=MASK: a picture's name and the mask's file")
    return name, Path(mask)


def _line(text: str) -> tuple[str, tuple[float, ...]]:
    name, _, numbers = text.rpartition("=")
    ends = _numbers(numbers) if name else ()
    if len(ends) != 4:
        raise argparse.ArgumentTypeError(f"{text!r} is not like NAME=X,Y,X2,Y2: a picture's name and two points in px")
    return name, ends


def _projection(text: str) -> str:
    """A kind of projection, with whatever stands behind a colon, which StitchOptions checks."""
    _choice(PROJECTIONS)(text.partition(":")[0])
    return text


def _slide(text: str) -> Any:
    try:
        given = text if text == "auto" else tuple(float(share) for share in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor a share from 0 to 1") from None
    return given if len(given) > 1 else given[0]


def _exposure(text: str) -> Exposing:
    try:
        return text if text in EXPOSURES else float(text)
    except ValueError:
        known = ", ".join(EXPOSURES)
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number of stops nor one of: {known}") from None


def _choice(known: tuple[str, ...]) -> Callable[[str], str]:
    def parse(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(f"{text!r} is not known; choose from: {', '.join(known)}")
        return text

    return parse
