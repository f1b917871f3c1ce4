"""The list of pictures in the panel: which are used, and which of two is the reference."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from . import idnames, pair

# What is said where something needs two pictures, and the list has more.
PAIRS_ONLY = "This is for two pictures: switch all but two of the list off"

# The masks of a row.
MASKS = ("ignore", "show")
# Called with a scene's settings when a guide or a place of its lists is switched on or off.
on_joined: list[Callable[[Any], None]] = []


def used(settings: Any) -> list[Any]:
    """The entries of the list that are switched on, in their order."""
    return [entry for entry in settings.pictures if entry.use]


def images(settings: Any) -> list[Any]:
    """Their images; None in place of one that was deleted."""
    return [entry.image for entry in used(settings)]


def is_set(settings: Any) -> bool:
    """Whether more than two pictures are stitched."""
    return len(used(settings)) > 2


def side(settings: Any, number: int) -> Any:
    """The image of the first (0) or second (1) picture that is used; None where there is none."""
    entries = used(settings)
    return entries[number].image if number < len(entries) else None


def set_side(settings: Any, number: int, image: Any) -> None:
    """Puts an image in the place of the first (0) or second (1) picture that is used."""
    with pair.choosing(settings):
        while len(used(settings)) <= number:
            settings.pictures.add()
        used(settings)[number].image = image


def choose(settings: Any, chosen: Sequence[Any]) -> None:
    """These images are the list, all of them used."""
    with pair.choosing(settings):
        settings.pictures.clear()
        settings.picture_index = 0
        for image in chosen:
            settings.pictures.add().image = image


def add(settings: Any, further: Iterable[Any]) -> int:
    """Appends those images that are not in the list yet, the first of them active; returns how many these are."""
    count, known = len(settings.pictures), {entry.image for entry in settings.pictures}
    new = [image for image in dict.fromkeys(further) if image not in known]
    with pair.choosing(settings):
        for image in new:
            settings.pictures.add().image = image
        if new:
            settings.picture_index = count
    return len(new)


def viewpoint(settings: Any) -> int | None:
    """The number, counted from 1, of the picture from whose place a set is seen; None where that is not chosen, or not
    used."""
    chosen = images(settings)
    return chosen.index(settings.seen_from) + 1 if settings.seen_from in chosen and settings.seen_from else None


def masks(settings: Any) -> dict[str, Any]:
    """The masks of the pictures that are used, by "NUMBER KIND", as a panorama holds them."""
    return {
        f"{number} {kind}": getattr(entry, kind) for number, entry in enumerate(used(settings)) for kind in MASKS
    }


def places(settings: Any) -> list[dict[str, Any]]:
    """The places that come from pictures that are used: the number of the picture, and circles in px of it upright."""
    chosen = images(settings)
    return [
        {"picture": chosen.index(place.picture), "circles": json.loads(place.circles)}
        for place in settings.places if place.use and place.picture is not None and place.picture in chosen
    ]


def guides(settings: Any) -> list[list[Any]]:
    """The guides in pictures that are used: the number of the picture, the kind by the engine's name, and both ends."""
    chosen = images(settings)
    return [
        [chosen.index(guide.picture), guide.kind.lower(), list(guide.ends)]
        for guide in settings.guides if guide.use and guide.picture is not None and guide.picture in chosen
    ]


def add_place(settings: Any, picture: Any, circles: Sequence[Sequence[float]]) -> None:
    """A place comes from a picture from now on: circles of column, row and radius, px of it upright."""
    place = settings.places.add()
    place.picture, place.circles = picture, json.dumps([[round(one, 1) for one in circle] for circle in circles])
    settings.place_index = len(settings.places) - 1


def bring_back(settings: Any, held: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    """The masks of the pictures, which are all used, places and guides as a panorama has them: held by `masks`' keys,
    known as `places` and `guides` gave them."""
    for number, entry in enumerate(used(settings)):
        for kind in MASKS:
            setattr(entry, kind, held.get(f"{number} {kind}"))
    settings.places.clear()
    for place in known.get("places", ()):
        add_place(settings, images(settings)[place["picture"]], place["circles"])
    settings.guides.clear()
    for number, kind, ends in known.get("guides", ()):
        guide = settings.guides.add()
        guide.picture, guide.kind, guide.ends = images(settings)[number], kind.upper(), ends


def mask_of(settings: Any, image: Any) -> tuple[Any, str] | None:
    """The row whose mask an image is, and which one: "ignore" or "show"; None for any other image."""
    found = ((entry, kind) for entry in settings.pictures for kind in MASKS if getattr(entry, kind) == image)
    return None if image is None else next(found, None)


def changed(entry: Any, context: Any) -> None:
    """A picture of the list was exchanged, or switched on or off: what the last stitch said of it is no longer so."""
    entry.state, entry.why = "NEW", ""
    pair.chosen(getattr(entry.id_data, idnames.SETTINGS), context)


def joined(entry: Any) -> None:
    """A guide or a place of the lists was switched on or off."""
    for follow in on_joined:
        follow(getattr(entry.id_data, idnames.SETTINGS))


def fates(names: Sequence[str], report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What became of pictures of these names by the report of their stitch: for each USED or LEFT_OUT, and why."""
    shown = {entry["name"] for entry in report["pictures"]}
    shown |= {name for bracket in report.get("brackets", ()) for name in bracket["names"]}
    why = {one["name"]: one["why"] for one in report.get("left_out", ())}
    return [
        ("USED", "") if name in shown else ("LEFT_OUT", why.get(name, "it is the same picture as another one"))
        for name in names
    ]


def mark(settings: Any, told: Sequence[tuple[str, str]]) -> None:
    """The list shows what became of the pictures that are used."""
    for entry, (state, why) in zip(used(settings), told, strict=True):
        entry.state, entry.why = state, why
