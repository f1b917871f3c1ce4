"""What a finished panorama is worth, in words: good, good but for some places, or not usable.

It is looked at as a person would, in a small copy: where the seam changes pictures that do not agree, where light is
lost that a picture had, where the map folds. What fails as a whole fails by its geometry.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.sources import called
from ..field.folding import breaks
from ..raster.arrays import NEIGHBOURS, Box, Plane, dilated, eroded
from .look import Levels, Look
from .options import RIG, VERDICT

GOOD, LOOK, NOT_USABLE = "good", "look", "not usable"
TORN = "the picture is torn or doubled at an outline: depth is doubtful"

PAINT = (
    "paint over these places which picture is shown there (--mask), or leave them out (--ignore-ref, --ignore-target)"
)
LEAVE_OUT = "leave what is wrong there out of the picture that has it (--ignore NAME=MASK)"
DARKER = "make the panorama darker by some stops (--exposure=-1)"
CLIPPED = (
    "make the panorama brighter (--exposure=1), so that this light is white again; the next time expose for the "
    "brightest part, or merge bracketed pictures into one EXR"
)
FOCAL = "give the focal length (--focal35, --focal-px) if it is known"
FOCAL_OR_STAY = f"{FOCAL}, or keep the reference's place (--slide 0)"
FILL = "fill holes (--holes inpaint)"
MORE = "take more pictures, from places closer together"
UNTIED = "how far apart some pictures were taken is not known"


@dataclass(frozen=True)
class Place:
    """Where (left, top, width, height in px of the panorama) to look, and at what; size: how much of it is wrong, in
    px of the small copy; help: what would help."""

    box: Box
    what: str
    size: float
    help: str = PAINT


@dataclass(frozen=True)
class Verdict:
    """What a panorama is worth.

    Attributes
    ----------
    rating : str
        GOOD, LOOK or NOT_USABLE.
    because : str
        Why, in plain words.
    what_to_do : str
        What would help; empty where nothing has to be done.
    places : tuple of Place
        Where to look, the worst first.
    """

    rating: str
    because: str
    what_to_do: str
    places: tuple[Place, ...] = ()

    @property
    def entry(self) -> dict[str, Any]:
        """As the report holds it."""
        places = [{"box": list(place.box), "what": place.what} for place in self.places]
        return {"is": self.rating, "because": self.because, "what_to_do": self.what_to_do, "places": places}


def judge(look: Look, shift: tuple[int, int], report: dict[str, Any]) -> Verdict:
    """Judge a panorama.

    Parameters
    ----------
    look : Look
    shift : (int, int)
        px from the panorama's first pixel to that of the canvas which was looked at.
    report : dict
        It tells how far the map misses 5 % of its own matches, which share of it is folded, and where there are holes;
        and of more than two pictures, how sure their cameras are.

    Returns
    -------
    Verdict
    """
    pairs = _compared(look)
    names = [picture["name"] for picture in report.get("pictures", [{"name": ""}] * len(look.shows))]
    places = sorted(
        (*(place for pair in pairs for place in _seam_places(look, pair, names, shift)),
         *_torn_places(look, pairs, shift), *_light_places(look, shift),
         # in a frame that was asked for, pictures are squeezed as that has it
         *(_bent_places(look, shift, report) if report["options"]["projection"] == "auto" else ()),
         *(Place(tuple(box), "no picture shows this: a hole", box[2] * box[3] / look.step**2, FILL)
           for box in report["composition"]["holes"])),
        key=lambda place: -place.size,
    )  # fmt: skip
    missed = (report["measured"]["alignment_p95_px"] or 0.0) / (look.side * look.step)
    # of many pictures one may be folded where it is not shown
    folded = 0.0 if "rig" in report else report["measured"]["folds"] or 0.0
    cause = _cause(look, pairs, missed, folded)
    if cause:
        return Verdict(NOT_USABLE, *cause, tuple(places[: VERDICT.most_places]))
    places += _untied_places(look, report, shift)
    doubts = dict(_doubts(report))
    if not places and not doubts:
        return Verdict(GOOD, "the pictures agree where the seam changes from one to the other", "")
    kinds = dict.fromkeys([*doubts, *(place.what for place in places)])
    instead = {PAINT: LEAVE_OUT} if len(look.shows) > 2 else {}
    if report["options"]["slide"] == 0:
        instead[FOCAL_OR_STAY] = FOCAL
    helps = dict.fromkeys([*(instead.get(place.help, place.help) for place in places), *doubts.values()])
    return Verdict(LOOK, "; ".join(kinds), "; ".join(helps), tuple(places[: VERDICT.most_places]))


def _doubts(report: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What is doubtful about given matches and the cameras of more than two pictures, and what would help."""
    matches = report["matches"]
    if matches["contradicting"] > VERDICT.contradicting * matches["found"]:
        what = f"{matches['contradicting']} of the {matches['found']} given matches contradict the rest"
        yield what, "correct those that are wrong in the file of --matches, or leave them out"
    if report.get("left_out"):
        names = ", ".join(entry["name"] for entry in report["left_out"])
        yield f"what does not connect with the others is left out: {names}", MORE
    if "rig" not in report:
        return
    if report["rig"]["scale"] in ("continuity", "none"):
        yield UNTIED, MORE
    if (report["field"]["leave_one_out_px"] or 0.0) > VERDICT.deep_px:
        yield "the scene is too near and deep for the points that were found", MORE
    if (report["measured"]["folds"] or 0.0) > VERDICT.folded:
        yield f"the map folds over in {report['measured']['folds']:.0%} of a picture: depth is doubtful there", MORE
    if report["rig"]["focal_spread"] > VERDICT.focal_spread:
        yield "the focal length is not sure", "give the focal length (--focal35, --focal-px)"


def _untied_places(look: Look, report: dict[str, Any], shift: tuple[int, int]) -> list[Place]:
    """Where two pictures meet whose distance is not known, the first few of many."""
    rig = report.get("rig", {"scale": "measured", "edges": []})
    found = []
    for edge in rig["edges"] if rig["scale"] in ("continuity", "none") else ():
        one, other = edge["numbers"]
        both = look.shows[one] & look.shows[other]
        shown = both & (look.shown(one) | look.shown(other))
        parts = list(_parts(shown if shown.any() else both, 1)) if edge["baseline"] == rig["scale"] else []
        if parts:
            found.append(Place(look.box(max(parts, key=np.sum), shift), UNTIED, 0.0, MORE))
    return found[: RIG.most_named]


def _cause(look: Look, pairs: Sequence[_Pair], missed: float, folded: float) -> tuple[str, str] | None:
    """Why a panorama is not usable, and what to do; None where it is. missed: share of the longer side."""
    if folded > VERDICT.folded:
        return (
            f"the target would be folded in {folded:.0%} of what it shows: it is mirrored, or another place that looks "
            "alike",
            "check that neither picture is mirrored and that both show the same things; else give matches by hand "
            "(--matches)",
        )
    along = np.concatenate([pair.seam[pair.seam >= 0] for pair in pairs])
    seen = along.size and (along > VERDICT.step).mean() > VERDICT.seen_seam
    both = np.sum(look.shows, axis=0, dtype=np.int16) > 1
    unlike = np.logical_or.reduce([pair.unlike > VERDICT.step for pair in pairs])
    hidden, differ = ((both & part).sum() / max(1, both.sum()) for part in (look.hidden, unlike))
    # of more than two pictures no single one can hide that the others are wrong
    if missed > (VERDICT.missed if seen or len(look.shows) > 2 else VERDICT.missed_by_far):
        why = f"5 % of the matches are missed by more than {missed:.0%} of the panorama: the geometry is wrong"
    elif not seen:
        return None
    elif hidden > VERDICT.hidden:
        why = f"{hidden:.0%} of the overlap is hidden from one of the pictures: they were taken too far apart"
    elif differ > VERDICT.unlike:
        why = f"the pictures differ in {differ:.0%} of what both show: they have only a part in common"
    else:
        return None
    return why, (
        "take the pictures from places nearer to each other, with a larger overlap; give the focal length (--focal35, "
        "--focal-px) if it is known, or matches by hand (--matches)"
    )


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two pictures that meet at a seam: their numbers; unlike: levels (h, w) by which they differ where both show
    something, else 0; seam: the same along the seam between them, −1 elsewhere."""

    numbers: tuple[int, int]
    unlike: Plane
    seam: Plane


def _compared(look: Look) -> list[_Pair]:
    """The pictures that meet at a seam, two by two; of two pictures these."""
    met = [(0, 1)]
    if len(look.shows) > 2:
        met = []
        labels = np.full((0, 0), -1) if look.labels is None else look.labels
        for here, there in NEIGHBOURS:
            both = np.stack([labels[here], labels[there]], axis=-1)
            met += np.unique(np.sort(both[(both >= 0).all(axis=-1)], axis=-1), axis=0).tolist()
        met = sorted({(one, other) for one, other in met if one != other}) or [(0, 1)]
    pairs = []
    for numbers in met:
        unlike = _unlike(look, *numbers)
        pairs.append(_Pair(numbers, unlike, _along_seam(look, unlike, *numbers)))
    return pairs


def _unlike(look: Look, one: int, other: int) -> Plane:
    """Levels (h, w) by which two pictures differ where both show something, else 0; not counted is what changes so
    slowly that blending evens it out."""
    both = (look.shows[one] & look.shows[other]).astype(np.float32)
    window = (2 * round(VERDICT.evened_share * look.side) + 1,) * 2
    shown = np.maximum(cv2.blur(both, window), np.float32(1e-6))
    total = np.zeros_like(both)
    tones = (cv2.split(look.tones[number].astype(np.float32)) for number in (one, other))
    for first, second in zip(*tones, strict=True):
        apart = (second - first) * both
        total += np.abs(apart - cv2.blur(apart, window) / shown)
    unlike: Plane = cv2.blur(total * both, (3, 3)) / look.tones[one].shape[2]
    return unlike


def _along_seam(look: Look, unlike: Plane, one: int, other: int) -> Plane:
    """`_unlike` (h, w) along the seam between two pictures, where both show something, −1 elsewhere."""
    steps = np.full(look.hidden.shape, np.float32(-1))
    if look.labels is None:
        return steps
    seam = np.zeros(steps.shape, bool)
    for here, there in NEIGHBOURS:
        first, second = look.labels[here], look.labels[there]
        changes = (first == one) & (second == other) | (first == other) & (second == one)
        seam[here] |= changes
        seam[there] |= changes
    return np.where(seam & look.shows[one] & look.shows[other], unlike, steps)


def _seam_places(look: Look, pair: _Pair, names: Sequence[str], shift: tuple[int, int]) -> Iterator[Place]:
    """Where a seam is seen."""
    apart = VERDICT.together_share * look.side
    least = 2 * max(VERDICT.seam_px, VERDICT.seam_share * look.side)
    across = VERDICT.many_seams_share * look.side if len(look.shows) > 2 else 0.0
    for part in _parts(pair.seam > VERDICT.step, least, apart):
        if max(cv2.boundingRect(part.astype(np.uint8))[2:]) < across:
            continue
        near = dilated(part, max(1, round(VERDICT.rim_share * look.side)))
        cut_by = [
            called(number, names) for number, other in (pair.numbers, pair.numbers[::-1])
            if (near & ~look.shows[number] & look.shows[other]).any()
        ]  # fmt: skip
        if cut_by:
            what = f"a thing is cut by the border of {' and '.join(cut_by)}"
        elif look.hidden[part].mean() > VERDICT.mostly:
            what = "near and far do not meet at the seam: depth is doubtful"
        else:
            what = "the pictures differ at the seam: something moved, or its depth is wrong"
        yield Place(look.box(part, shift), what, float((pair.seam[part] - VERDICT.step).sum()))


def _torn_places(look: Look, pairs: Sequence[_Pair], shift: tuple[int, int]) -> Iterator[Place]:
    """Where the map of the picture that is shown folds or jumps, with detail that shows it, and another picture does
    not agree."""
    torn = np.zeros(look.hidden.shape, bool)
    for number, one in enumerate(look.maps):
        apart = breaks(one, look.shown(number), VERDICT.jump)
        others = [pair.unlike > VERDICT.torn_step for pair in pairs if number in pair.numbers]
        if apart.any() and others:
            torn |= apart & _detailed(look.tones[number]) & np.logical_or.reduce(others)
    for part in _parts(torn, VERDICT.torn_share * look.side * look.side):
        yield Place(look.box(part, shift), TORN, float(part.sum()))


def _bent_places(look: Look, shift: tuple[int, int], report: dict[str, Any]) -> Iterator[Place]:
    """Where a picture is sheared or squeezed over a larger part: what is straight bends, what is upright leans."""
    wide = _width_of_pixels(look, shift, report)
    side = 2 * max(4, round(VERDICT.smooth_share * look.side)) + 1
    for number, one in enumerate(look.maps):
        known = look.shown(number) & np.isfinite(one.x) & np.isfinite(one.y) & (wide > VERDICT.least_width)
        x, y = (cv2.blur(np.where(known, values, np.float32(0)), (side, side)) for values in (one.x, one.y))
        (x_y, x_x), (y_y, y_x) = np.gradient(x), np.gradient(y)
        x_x, y_x = x_x / wide, y_x / wide
        # half the sum and half the difference of the singular values of the Jacobian
        alike, unlike = np.hypot(x_x + y_y, y_x - x_y) / 2, np.hypot(x_x - y_y, y_x + x_y) / 2
        bent = alike + unlike > VERDICT.squeeze * np.abs(alike - unlike)
        # of a blank sky or wall nobody sees how it is mapped
        bent &= eroded(known, side // 2 + 1) & dilated(_detailed(look.tones[number]), side // 2)
        opened = cv2.morphologyEx(bent.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side // 2,) * 2, np.uint8)) > 0
        for part in _parts(opened, VERDICT.bent_share * opened.size):
            what = "the picture is bent or stretched: depth or the focal length is doubtful"
            yield Place(look.box(part, shift), what, float(part.sum()), FOCAL_OR_STAY)


def _width_of_pixels(look: Look, shift: tuple[int, int], report: dict[str, Any]) -> NDArray[np.float32]:
    """How wide pixels (h, 1) are for one of their height: on a sphere they narrow towards the poles, by nature."""
    rows, projection = look.hidden.shape[0], report.get("canvas", {}).get("projection", {})
    if projection.get("kind") != "equirectangular":
        return np.ones((rows, 1), np.float32)
    fall = (np.arange(rows) * look.step + shift[1] - projection["centre"][1]) / projection["focal_px"]
    wide: NDArray[np.float32] = np.maximum(np.cos(fall), 1e-3).astype(np.float32)[:, None]
    return wide


def _detailed(tones: Levels) -> NDArray[np.bool_]:
    """Where (h, w) there is an edge near by."""
    green, window = tones[..., tones.shape[2] // 2], np.ones((7, 7), np.uint8)
    detailed: NDArray[np.bool_] = cv2.subtract(cv2.dilate(green, window), cv2.erode(green, window)) >= VERDICT.edge
    return detailed


def _light_places(look: Look, shift: tuple[int, int]) -> Iterator[Place]:
    """Where light is lost that the picture had, or clipped light got a colour."""
    for number, (tones, taken) in enumerate(zip(look.tones, look.taken, strict=True)):
        shown = look.shown(number)
        clipped = [before >= VERDICT.white for before in cv2.split(taken)]
        white = np.logical_and.reduce([now >= VERDICT.white for now in cv2.split(tones)])
        blown = shown & white & ~np.logical_and.reduce(clipped)
        greyed = shown & _greyed(tones, taken, clipped)
        own = greyed & look.shows[number]
        other = max(set(range(len(look.shows))) - {number}, key=lambda one: (own & look.shows[one]).sum())
        both = own & look.shows[other]
        apart = np.abs(look.tones[other][both].astype(int) - tones[both]).max(axis=1)
        if both.sum() >= VERDICT.compared_px and np.median(apart) <= VERDICT.cast:
            greyed[:] = False  # darker, but as the other picture has it
        for mask, share, what, help_ in (
            (blown, VERDICT.blown_share, "light is blown here that the picture has", DARKER),
            (greyed, VERDICT.greyed_share, "light that was too bright for the picture got a cast or a step", CLIPPED),
        ):
            if mask.sum() > share * mask.size:
                yield Place(look.box(max(_parts(mask, 1), key=np.sum), shift), what, float(mask.sum()), help_)


def _greyed(tones: Levels, taken: Levels, clipped: list[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Where (h, w) a clipped channel is darkened with the others: there was more light in it than the picture tells."""
    changes = [(now + np.float32(1)) / (before + np.float32(1))
               for now, before in zip(cv2.split(tones), cv2.split(taken), strict=True)]  # fmt: skip
    others = np.maximum.reduce([np.where(gone, np.float32(0), by) for gone, by in zip(clipped, changes, strict=True)])
    as_others = [(by <= VERDICT.restored * others) | (others == 0) for by in changes]
    dark = [now < VERDICT.greyed for now in cv2.split(tones)]
    parts = zip(clipped, dark, as_others, strict=True)
    greyed: NDArray[np.bool_] = np.logical_or.reduce([np.logical_and.reduce(one) for one in parts])
    return greyed


def _parts(mask: NDArray[np.bool_], least: float, apart: float = 2.0) -> Iterator[NDArray[np.bool_]]:
    """The parts (h, w) of a mask with at least so many pixels; those less than twice `apart` px apart are one."""
    if mask.sum() < least:
        return
    number = cv2.connectedComponents(dilated(mask, max(1, round(apart))).astype(np.uint8))[1]
    number[~mask] = 0
    for one in np.flatnonzero(np.bincount(number[mask]) >= max(1, least)):
        yield number == one
