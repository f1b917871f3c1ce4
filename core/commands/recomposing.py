"""A small panorama of a set, composed again and again of what its stitch found: nothing is read or registered anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..alignment import Geometry, estimate_geometry, fit_and_warp
from ..frames.frame import Frame, size_of
from ..frames.preview import first_share
from ..frames.reading import guides_of, read_frame
from ..options import StitchOptions
from ..pictures.masks import read_mask, read_wanted, without
from ..pictures.picture import Picture
from ..pipeline import compose
from ..rig.pair_edges import reordered_edges
from ..rig.reframing import reordered
from ..system.errors import BadRequest
from ..system.progress import Progress, Stopwatch, stages_of
from ..system.threads import asking, at_most
from .options import RECOMPOSING

if TYPE_CHECKING:
    from ..pipeline import StitchResult


@dataclass(frozen=True)
class Kept:
    """What a small panorama is composed of again.

    Attributes
    ----------
    frame : Frame
        The small pictures that are used, in the geometry's order, without any mask.
    geometry : Geometry
        Of these small pictures, as it was found on the full ones.
    given : tuple of str
        What all pictures were called that were given, used or not.
    turns : tuple of int
        EXIF's orientation of each of these.
    """

    frame: Frame
    geometry: Geometry
    given: tuple[str, ...]
    turns: tuple[int, ...]

    @property
    def share(self) -> float:
        """Of the sides of the full pictures, how long those of the small ones are."""
        return max(self.frame.sizes[0]) / max(self.frame.full_sizes[0])

    @property
    def sizes(self) -> dict[int, tuple[int, int]]:
        """(W, H) px of the full pictures by their number among those that were given."""
        full = zip(self.frame.names, self.frame.full_sizes, strict=True)
        return {self.given.index(name): size for name, size in full if name in self.given}

    def seen_from(self, viewpoint: int | None) -> Kept:
        """The same in the frame of another picture, by its number, from 1, among those that were given; None: the first
        of them that is used. Raises BadRequest where it is not used."""
        rig = self.geometry.rig
        if rig is None:
            return self
        places = [self.given.index(name) if name in self.given else len(self.given) for name in self.frame.names]
        asked = min(places) if viewpoint is None else viewpoint - 1
        if asked not in places:
            raise BadRequest(
                f"{self.given[asked]} cannot be the viewpoint, since the panorama does not use it: choose another one"
            )
        order = sorted(range(len(places)), key=lambda number: (places[number] != asked, places[number]))
        if order[0] == 0:
            return self
        turned = reordered(rig, order)
        edges = reordered_edges(self.geometry.edges, turned, order)
        geometry = replace(self.geometry, cameras=turned.cameras, edges=edges, rig=turned)
        return replace(self, frame=self.frame.only(order), geometry=geometry)

    def masked(self, options: StitchOptions) -> Frame:
        """The frame without what options ignore, and with what they want to see, of the pictures that were given."""
        ignored, wanted = (
            dict(zip(self.given, masks, strict=True))
            for masks in (options.ignored_in(self.given), options.shown_in(self.given))
        )
        shown = []
        for picture in self.frame.pictures:
            if (mask := ignored.get(picture.name)) is not None:
                picture = without(picture, read_mask(mask, size_of(picture), picture.name))
            if (mask := wanted.get(picture.name)) is not None:
                picture = replace(picture, wanted=read_wanted(mask, size_of(picture), picture.name))
            shown.append(picture)
        return replace(self.frame, pictures=tuple(shown))

    def guided(self, options: StitchOptions) -> Frame:
        """The frame with the lines that options hold its level to."""
        lines = dict(zip(self.given, options.guides_in(self.given), strict=True))
        shown = tuple(
            replace(picture, guides=guides_of(lines.get(picture.name, ()), full))
            for picture, full in zip(self.frame.pictures, self.frame.full_sizes, strict=True)
        )
        return replace(self.frame, pictures=shown)


def kept_of(
    result: StitchResult, originals: Sequence[Picture], options: StitchOptions, turns: tuple[int, ...]
) -> Kept:
    """What is kept of a stitch of pictures, given in this order, by these options."""
    geometry = Geometry(
        result.cameras, result.edges, (), tuple(range(len(result.pictures))), result.rig,
        tuple((one["name"], one["why"]) for one in result.report.get("left_out", ())), result.scale,
    )  # fmt: skip
    numbers = {picture.name: number for number, picture in enumerate(originals)}
    pictures = [
        _unmasked(picture, originals[numbers[picture.name]], options.ignored(numbers[picture.name]))
        if picture.name in numbers else picture
        for picture in result.pictures
    ]  # fmt: skip
    pictures = [replace(picture, wanted=None, guides=()) for picture in pictures]
    return _small(Frame(tuple(pictures), result.full_sizes), geometry, tuple(numbers), turns)


def kept_anew(
    pictures: Sequence[Picture], options: StitchOptions, turns: tuple[int, ...], told: Callable[[str, float], None]
) -> Kept:
    """The same found again, by options without masks, where it is no longer there."""
    stopwatch = Stopwatch(Progress(told, None, stages_of(len(pictures))))
    frame = read_frame(pictures, options)
    geometry = estimate_geometry([frame], options, stopwatch)
    names = tuple(picture.name for picture in pictures)
    frame = replace(frame.only(geometry.numbers), warnings=(), painted=None, brackets=(), shown_by=())
    return _small(frame, replace(geometry, warnings=()), names, turns)


def recomposed(
    kept: Kept, options: StitchOptions, told: Callable[[str, float], None], cancelled: Callable[[], bool]
) -> StitchResult:
    """The small panorama that options ask for now.

    Parameters
    ----------
    kept : Kept
    options : StitchOptions
        Those that need no new geometry: frame, viewpoint, light, blend, masks and guides; a crop in px is one of the
        panorama of the pictures at their scale.
    told, cancelled : callable
        See `pipeline.stitch`.

    Returns
    -------
    StitchResult
    """
    kept = kept.seen_from(options.viewpoint if isinstance(options.viewpoint, int) else None)
    if not isinstance(options.crop, str):
        left, top, width, height = (int(side * kept.share / options.scale) for side in options.crop)
        options = replace(options, crop=(left, top, max(1, width), max(1, height)))
    stopwatch = Stopwatch(Progress(told, cancelled, stages_of(len(kept.frame.pictures))))
    with asking(cancelled), at_most(RECOMPOSING.threads):
        # depth is that of the pictures without masks: a stroke more changes nothing of it
        alignment = fit_and_warp(kept.geometry, [kept.guided(options)], options, stopwatch)
        return compose(kept.masked(options), alignment, options, stopwatch)


def _small(frame: Frame, geometry: Geometry, given: tuple[str, ...], turns: tuple[int, ...]) -> Kept:
    rotations = [np.eye(3), geometry.edges[0].two_view.R] if geometry.rig is None else geometry.rig.R
    share = first_share(geometry.cameras, list(rotations), RECOMPOSING.pixels)
    small = frame.resized(share)
    return Kept(small, geometry.of_resized(small.sizes), given, turns)


def _unmasked(picture: Picture, original: Picture, mask: object) -> Picture:
    """A picture that was worked on, with what a mask hides shown again; as it is where it was scaled, which leaves
    nothing below a mask."""
    if not isinstance(mask, np.ndarray) or picture.alpha is None or size_of(picture) != size_of(original):
        return picture
    before = np.float32(1) if original.alpha is None else original.alpha
    hidden = read_mask(mask, size_of(picture), picture.name)
    return replace(picture, alpha=np.where(hidden, before, picture.alpha))
