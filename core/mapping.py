"""From a field to the maps of all pictures: what goes on beyond the overlap, from where it is seen, and in what frame.

The order counts: how far the viewpoint slides is chosen with the depth that goes on beyond the overlap, and the frame
by what is shown from there (docs/method.md, 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .cameras.view import View
from .compose.rough_seam import RoughSeam
from .continuation.continuation import Continuation, continue_beyond
from .field.field import Field
from .field.refined_depth import RefinedDepth
from .field.slack import SlackField
from .field.strict import StrictField
from .options import StitchOptions
from .panorama.choosing_slide import SlideChoice, choose_slide
from .panorama.framing import FrameRequest, frame_for
from .panorama.levelling import confirmed, gravity_by_edges, upright
from .panorama.options import CHOICE
from .panorama.projection import Projection, focal_of, round_projection
from .panorama.slid_warp import slid_warp
from .panorama.upright_edges import StraightEdges, straight_edges
from .panorama.viewpoint import viewpoint_between
from .panorama.warp import Warp, build_warp
from .raster.arrays import Array
from .system.cache import Cache
from .system.progress import ReportProgress

if TYPE_CHECKING:
    from .pictures.picture import Picture


@dataclass(frozen=True)
class Mapped:
    """The maps of all pictures, what goes on beyond the overlap (None without depth), and how far the viewpoint slides.
    """

    warp: Warp
    continuation: Continuation | None
    slide: SlideChoice


@dataclass(frozen=True, eq=False)
class AllEdges:
    """Straight edges (N) of each picture whose orientation is known, in the reference's frame, found when asked for."""

    pictures: Sequence[Picture]
    views: Sequence[View]

    @property
    def known(self) -> list[View]:
        """The views whose orientation is known."""
        return [view for view in self.views if np.isfinite(view.R).all()]

    @cached_property
    def each(self) -> list[StraightEdges]:
        """The edges of each such picture."""
        return [
            straight_edges(picture, view.camera, view.K).in_reference(view.R)
            for picture, view in zip(self.pictures, self.views, strict=True)
            if np.isfinite(view.R).all()
        ]

    @property
    def together(self) -> tuple[Array, Array]:
        """Normals (N, 3) and lengths (N,) of all of them."""
        return np.vstack([one.normals for one in self.each]), np.concatenate([one.lengths for one in self.each])

    @cached_property
    def down(self) -> Array:
        """The unit vector (3,) along gravity."""
        return gravity_by_edges([view.R for view in self.known], *self.together)

    @cached_property
    def down_is_sure(self) -> bool:
        """Whether upright edges confirm which way is down."""
        return confirmed(self.down, *self.together)


def map_pictures(
    field: Field, views: tuple[View, ...], refined: RefinedDepth | None, pictures: Sequence[Picture],
    options: StitchOptions, progress: ReportProgress,
) -> Mapped:  # fmt: skip
    """Find what goes on beyond the overlap, choose viewpoint and frame, and map all pictures onto the canvas.

    Parameters
    ----------
    field : Field
    views : sequence of View
        What is known of the pictures, the reference's first.
    refined : RefinedDepth or None
        What dense refinement found.
    pictures : sequence of Picture
    options : StitchOptions
        Fade, slide, projection, level, centre and fov; cache.
    progress : callable
        progress(stage, share of that stage that is done).

    Returns
    -------
    Mapped

    Raises
    ------
    NoOverlap, OutputTooLarge, BadRequest
        There is no canvas for it (see `build_warp`).
    """
    lines = AllEdges(pictures, views)
    progress("warp", 0.0)
    continuation = None
    has_depth = isinstance(field, (StrictField, SlackField)) and np.isfinite(views[1].R).all()
    if options.fade == "continue" and has_depth:
        continuation = Cache(options.cache).remember(
            # edges of both pictures tell which way is down
            "continuation", (field, refined, views, tuple((picture.view, picture.alpha) for picture in pictures)),
            lambda: continue_beyond(
                field, views, refined, pictures[1].view, lines.each[1].rays @ views[1].R.T, lines.down,
                lines.down_is_sure,
            ),
        )  # fmt: skip
    known = _Known(field, views, refined, continuation)
    if options.surface[0] == "reference":
        return Mapped(
            known.on(None), continuation, SlideChoice(0.0, (), "the reference's own plane has one viewpoint")
        )
    progress("warp", 0.2)
    coarse, slide = None, SlideChoice(0.0, (), "as asked for")
    if options.slide and (not has_depth or (options.slide == "auto" and field.two_view.model != "general")):
        slide = SlideChoice(0.0, (), "the pictures show one plane, or were taken from one place")
    elif options.slide == "auto" and refined is None:
        slide = SlideChoice(0.0, (), "the smooth field knows no edges of near things, which a slide would bend")
    elif options.slide:
        coarse = known.base(lines.down, CHOICE.base_px_per_radian)
        slide = _slide(coarse, views, pictures, lines, options.slide, lambda share: progress("warp", 0.2 + 0.2 * share))
    viewpoint = viewpoint_between(coarse, views) if coarse is not None and slide.s1 else None

    def seen_on(projection: Projection, base: Warp | None = coarse) -> Warp:
        if base is None or viewpoint is None:
            return known.on(projection)
        return slid_warp(base, views, viewpoint.sliding(slide.s1), projection)

    progress("warp", 0.4)
    kind, distance = options.surface
    asked = FrameRequest(kind, distance, options.level, options.centre, options.fov)
    edges, down = lines.together if asked.needs_edges else None, lines.down if asked.level == "auto" else None
    frame = frame_for(asked, views, edges, down, seen_on)
    progress("warp", 0.5)
    base = None
    if viewpoint is not None:
        # who sets the slide by hand tries others
        cache = Cache(options.cache if options.slide != "auto" else None)
        base = known.base(lines.down, focal_of(views[0].K), cache)
    return Mapped(seen_on(frame, base), continuation, slide)


@dataclass(frozen=True, eq=False)
class _Known:
    """What all maps are made from (see `build_warp`)."""

    field: Field
    views: tuple[View, ...]
    refined: RefinedDepth | None
    continuation: Continuation | None

    def on(self, projection: Projection | None, hold: bool = False) -> Warp:
        """The maps on a projection, or on the reference's plane, seen from the reference's place."""
        return build_warp(self.field, self.views, projection, self.refined, self.continuation, hold)

    def base(self, down: Array, px_per_radian: float, cache: Cache | None = None) -> Warp:
        """The maps on a levelled cylinder, with what a sliding viewpoint needs of them."""
        projection = round_projection("cylindrical", self.views[0].K, upright(down), px_per_radian)
        cache = cache or Cache(None)
        return cache.remember("base", (self, projection), lambda: self.on(projection, True))


def _slide(
    base: Warp, views: tuple[View, ...], pictures: Sequence[Picture], lines: AllEdges, slide: str | float,
    progress: Callable[[float], None],
) -> SlideChoice:  # fmt: skip
    """How far the viewpoint slides: as asked for, or chosen; base: coarse, seen from the reference's place."""
    if slide != "auto":
        if viewpoint_between(base, views) is None:
            return SlideChoice(0.0, (), "the pictures do not lie side by side, or were taken from one place")
        return SlideChoice(float(slide), (), "as asked for")
    seam = RoughSeam.of(pictures, views, CHOICE.base_px_per_radian)
    return choose_slide(base, views, lines.each, lines.down if lines.down_is_sure else None, seam, progress)
