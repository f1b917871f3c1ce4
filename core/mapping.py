"""From a field to the maps of all pictures: what goes on beyond the overlap, from where it is seen, and in what frame.

The order counts: how far the viewpoint slides is chosen with the depth that goes on beyond the overlap, and the frame
by what is shown from there (docs/method.md, 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from .panorama.framing import FrameRequest, coarse_sphere, frame_for
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

# The maps on a projection, and whether to keep its depth as an array.
WarpOn = Callable[..., Warp]


@dataclass(frozen=True)
class Mapped:
    """The maps of all pictures, what goes on beyond the overlap (None without depth), and how far the viewpoint slides.
    """

    warp: Warp
    continuation: Continuation | None
    slide: SlideChoice


@dataclass(frozen=True, eq=False)
class Lines:
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
    lines = Lines(pictures, views)
    progress("warp", 0.0)
    continuation = None
    has_depth = isinstance(field, (StrictField, SlackField)) and np.isfinite(views[1].R).all()
    if options.fade == "continue" and has_depth:
        continuation = Cache(options.cache).remember(
            "continuation", (field, refined, views, pictures[1].view),
            lambda: continue_beyond(
                field, views, refined, pictures[1].view, lines.each[1].rays @ views[1].R.T, lines.down,
                lines.down_is_sure,
            ),
        )  # fmt: skip

    def warp_on(projection: Projection | None, hold: bool = False) -> Warp:
        return build_warp(field, views, projection, refined, continuation, hold)

    if options.surface[0] == "reference":
        return Mapped(warp_on(None), continuation, SlideChoice(0.0, (), "the reference's own plane has one viewpoint"))
    slide = SlideChoice(0.0, (), "as asked for")
    progress("warp", 0.2)
    if options.slide == "auto" and field.two_view.model != "general":
        slide = SlideChoice(0.0, (), "the pictures show one plane, or were taken from one place")
    elif options.slide and has_depth:
        slide = _slide(warp_on, views, pictures, lines, options, lambda share: progress("warp", 0.2 + 0.2 * share))
    progress("warp", 0.4)
    shown = _seen_from(slide.s1, warp_on, views, lines, coarse_sphere(views).focal)
    kind, distance = options.surface
    asked = FrameRequest(kind, distance, options.level, options.centre, options.fov)
    edges, down = lines.together if asked.needs_edges else None, lines.down if asked.level == "auto" else None
    frame = frame_for(asked, views, edges, down, shown)
    progress("warp", 0.5)
    return Mapped(_seen_from(slide.s1, warp_on, views, lines, focal_of(views[0].K))(frame), continuation, slide)


def _slide(
    warp_on: WarpOn, views: tuple[View, ...], pictures: Sequence[Picture], lines: Lines,
    options: StitchOptions, progress: Callable[[float], None],
) -> SlideChoice:  # fmt: skip
    """How far the viewpoint slides: as asked for, or chosen."""
    base = _base(warp_on, views, lines, CHOICE.base_px_per_radian)
    if options.slide != "auto":
        if viewpoint_between(base, views) is None:
            return SlideChoice(0.0, (), "the pictures do not lie side by side, or were taken from one place")
        return SlideChoice(float(options.slide), (), "as asked for")
    seam = RoughSeam.of(pictures, views, CHOICE.base_px_per_radian)
    return choose_slide(base, views, lines.each, lines.down if lines.down_is_sure else None, seam, progress)


def _seen_from(
    s1: float, warp_on: WarpOn, views: tuple[View, ...], lines: Lines, px_per_radian: float
) -> Callable[[Projection], Warp]:
    """Gives the maps on a projection as the viewpoint that slides by s1 sees them; depth is carried over from a map of
    some px per radian."""
    if not s1:
        return warp_on
    base = _base(warp_on, views, lines, px_per_radian)
    viewpoint = viewpoint_between(base, views)
    if viewpoint is None:
        return warp_on
    sliding = viewpoint.sliding(s1)
    return lambda projection: slid_warp(base, views, sliding, projection)


def _base(warp_on: WarpOn, views: Sequence[View], lines: Lines, px_per_radian: float) -> Warp:
    """The maps on a levelled cylinder, seen from the reference's place."""
    projection = round_projection("cylindrical", views[0].K, upright(lines.down))
    return warp_on(replace(projection, focal=px_per_radian), True)
