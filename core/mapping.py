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

from .cameras.rig import Rig
from .cameras.view import View
from .compose.seams.cut_things import without_cut_things
from .compose.seams.rough_seam import RoughSeam
from .continuation.continuation import Continuation, continue_beyond
from .field.field import Field
from .field.refined_depth import RefinedDepth
from .field.refined_sphere import RefinedSphere
from .field.remembered import Remembered
from .field.slack import SlackField
from .field.sphere_field import SphereField
from .field.strict import StrictField
from .options import StitchOptions
from .panorama.choosing_slide import NO_WAY, SlideChoice, choose_rig_slide, choose_slide
from .panorama.framing import FrameRequest, frame_for
from .panorama.guides import constraints, guide_warnings, guided
from .panorama.levelling import confirmed, gravity_by_edges, upright
from .panorama.options import CHOICE
from .panorama.projection import Projection, focal_of, round_projection
from .panorama.rig_viewpoint import RigViewpoint, rig_viewpoint
from .panorama.rig_warp import RigSurface, build_rig_warp
from .panorama.slid_warp import slid_warp
from .panorama.upright_edges import StraightEdges, straight_edges
from .panorama.viewpoint import Viewpoint, viewpoint_between
from .panorama.warp import Warp, build_warp
from .raster.arrays import Array
from .system.cache import Cache
from .system.progress import ReportProgress, Tick, unwatched

if TYPE_CHECKING:
    from .pictures.picture import Picture


@dataclass(frozen=True)
class Mapped:
    """The maps of all pictures, what goes on beyond the overlap (None without depth), how far the viewpoint slides, and
    what is said of a user's lines."""

    warp: Warp
    continuation: Continuation | None
    slide: SlideChoice
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class AllEdges:
    """Straight edges (N) of each picture whose orientation is known, in the reference's frame, found when asked for;
    tick is called before each picture; cache: where it is kept which way is down."""

    pictures: Sequence[Picture]
    views: Sequence[View]
    tick: Tick = unwatched
    cache: Cache = Cache(None)

    @cached_property
    def each(self) -> list[StraightEdges]:
        """The edges of each such picture."""
        found = []
        for picture, view in zip(self.pictures, self.views, strict=True):
            if np.isfinite(view.R).all():
                self.tick()
                found.append(straight_edges(picture, view.camera, view.K).in_reference(view.R))
        return found

    @cached_property
    def together(self) -> tuple[Array, Array]:
        """Normals (N, 3) and lengths (N,) of all of them."""
        return np.vstack([one.normals for one in self.each]), np.concatenate([one.lengths for one in self.each])

    @cached_property
    def down(self) -> Array:
        """The unit vector (3,) along gravity."""
        return guided(self.down_by_edges, self.guides) if len(self.guides) else self.down_by_edges

    @cached_property
    def guides(self) -> Array:
        """What a user's lines (N, 3) say of it (see `guides.constraints`)."""
        return constraints(self.pictures, self.views)

    @cached_property
    def down_by_edges(self) -> Array:
        """The same without a user's lines."""
        rotations = tuple(view.R for view in self.views if np.isfinite(view.R).all())
        edges = self.together
        self.tick()
        return self.cache.remember("down", (rotations, *edges), lambda: gravity_by_edges(rotations, *edges))

    @cached_property
    def down_is_sure(self) -> bool:
        """Whether a user's lines or upright edges confirm which way is down."""
        return len(self.guides) > 0 or confirmed(self.down, *self.together)


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
    if options.fade == "continue" and has_depth(field, views):
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
        still = SlideChoice(0.0, (), "the reference's own plane has one viewpoint")
        return Mapped(known.on(None), continuation, still)
    progress("warp", 0.2)
    slide, sliding = _slide(known, pictures, lines, options, lambda share: progress("warp", 0.2 + 0.2 * share))

    def coarsely(projection: Projection) -> Warp:
        if sliding is None:
            return known.on(projection)
        return slid_warp(sliding.base, views, sliding.viewpoint, projection)

    progress("warp", 0.4)
    frame = _frame(lines, options, coarsely)
    progress("warp", 0.5)
    if sliding is None:
        warp = known.on(frame)
    else:
        # who sets the slide by hand tries others
        cache = Cache(options.cache if options.slide != "auto" else None)
        base = known.base(lines.down, focal_of(views[0].K), cache)
        warp = slid_warp(base, views, sliding.viewpoint, frame)
    return Mapped(_settled(warp, known, pictures), continuation, slide, _guide_warnings(lines, options))


def map_rig(
    rig: Rig, field: SphereField, pictures: Sequence[Picture], options: StitchOptions, progress: ReportProgress,
    refined: RefinedSphere | None = None,
) -> Mapped:
    """Choose a frame, and map N pictures onto the canvas, seen from the first one's place.

    Parameters
    ----------
    rig : Rig
    field : SphereField
        Fitted to its points.
    pictures : sequence of Picture
        In the rig's order.
    options : StitchOptions
        Projection, level, centre and fov.
    progress : callable
        progress(stage, share of that stage that is done).

    Returns
    -------
    Mapped

    Raises
    ------
    NoOverlap, OutputTooLarge, BadRequest
        There is no canvas for it (see `build_rig_warp`).
    """
    views, done = rig.views, 0.0

    def tell(share: float = 0.0) -> None:
        """Never less than was told: edges are found when they are first asked for."""
        nonlocal done
        done = max(done, share)
        progress("warp", done)

    tell()
    surface = RigSurface.of(field, views, refined)
    if options.surface[0] == "reference":
        still = SlideChoice(0.0, (), "the first picture's own plane has one viewpoint")
        return Mapped(build_rig_warp(surface, tick=tell), None, still)
    lines = AllEdges(pictures, views, tell, Cache(options.cache))
    slide, viewpoint = _rig_slide(surface, lines, options, lambda share: tell(0.3 * share))
    surface = surface.seen_from(viewpoint)
    tell(0.3)
    frame = _frame(lines, options, lambda one: build_rig_warp(surface, one, tell))
    tell(0.5)
    return Mapped(build_rig_warp(surface, frame, tell), None, slide, _guide_warnings(lines, options))


def _rig_slide(
    surface: RigSurface, lines: AllEdges, options: StitchOptions, progress: Callable[[float], None]
) -> tuple[SlideChoice, RigViewpoint | None]:
    """How far the viewpoint slides among the places of N pictures, as asked for or chosen; None where it stays."""
    asked, views = options.slide_by_hand, lines.views
    if asked is not None and not asked[0]:
        return SlideChoice(0.0, (), "as asked for"), None
    if not any(view.t.any() for view in views):
        return SlideChoice(0.0, (), "the pictures were taken from one place"), None
    if asked is None and options.surface[0] == "equirectangular":
        return SlideChoice(0.0, (), "a sphere that is asked for is seen from one place"), None
    axes = upright(lines.down)
    viewpoint = rig_viewpoint(views, surface.outlines, axes)
    if asked is not None:
        s1 = float(asked[0])
        return SlideChoice(s1, (), "as asked for"), viewpoint.sliding(s1)
    cylinder = round_projection("cylindrical", views[0].K, axes, CHOICE.base_px_per_radian)
    down = lines.down if lines.down_is_sure else None
    # who changes the frame by hand sees the same slide again
    choice = lines.cache.remember(
        "slide", (surface.field, surface.refined, tuple(views), viewpoint, tuple(lines.each), down, cylinder),
        lambda: choose_rig_slide(build_rig_warp(surface, cylinder), views, viewpoint, lines.each, down, progress),
    )  # fmt: skip
    return choice, viewpoint.sliding(choice.s1) if choice.s1 else None


def _frame(lines: AllEdges, options: StitchOptions, warp_on: Callable[[Projection], Warp]) -> Projection:
    """The frame that is asked for; warp_on: coarse maps of all pictures on a projection."""
    kind, distance = options.surface
    asked = FrameRequest(kind, distance, options.level, options.centre, options.fov, len(lines.guides) > 0)
    edges, down = lines.together if asked.needs_edges else None, lines.down if asked.level == "auto" else None
    return frame_for(asked, lines.views, edges, down, warp_on)


def _guide_warnings(lines: AllEdges, options: StitchOptions) -> tuple[str, ...]:
    """What is said of a user's lines, where they turn the panorama."""
    if not len(lines.guides) or options.level != "auto":
        return ()
    return guide_warnings(lines.down, lines.guides, lines.down_by_edges)


def _settled(warp: Warp, known: _Known, pictures: Sequence[Picture]) -> Warp:
    """The warp without what a border cuts, if depth goes on beyond the border as well."""
    return warp if known.continuation is None else without_cut_things(warp, known.views, pictures)


def has_depth(field: Field, views: Sequence[View]) -> bool:
    """Whether a field knows depth, and the pose that goes with it."""
    return isinstance(field, (StrictField, SlackField)) and bool(np.isfinite(views[1].R).all())


@dataclass(frozen=True, eq=False)
class _Known:
    """What all maps are made from (see `build_warp`)."""

    field: Field
    views: tuple[View, ...]
    refined: RefinedDepth | None
    continuation: Continuation | None

    def on(self, projection: Projection | None, hold: bool = False) -> Warp:
        """The maps on a projection, or on the reference's plane, seen from the reference's place."""
        return build_warp(self._remembered, self.views, projection, self.refined, self.continuation, hold)

    @cached_property
    def _remembered(self) -> Remembered:
        """The field, whose nodes several maps share."""
        return Remembered(self.field)

    def base(self, down: Array, px_per_radian: float, cache: Cache | None = None) -> Warp:
        """The maps on a levelled cylinder, with what a sliding viewpoint needs of them."""
        projection = round_projection("cylindrical", self.views[0].K, upright(down), px_per_radian)
        cache = cache or Cache(None)
        return cache.remember("base", (self, projection), lambda: self.on(projection, True))


@dataclass(frozen=True)
class _Sliding:
    """A viewpoint that slides, and a coarse map of both pictures from the reference's place."""

    base: Warp
    viewpoint: Viewpoint


def _slide(
    known: _Known, pictures: Sequence[Picture], lines: AllEdges, options: StitchOptions,
    progress: Callable[[float], None],
) -> tuple[SlideChoice, _Sliding | None]:  # fmt: skip
    """How far the viewpoint slides, as asked for or chosen; None where it stays."""
    asked, views, field = options.slide_by_hand, known.views, known.field
    if asked is not None and not asked[0]:
        return SlideChoice(0.0, (), "as asked for"), None
    if not has_depth(field, views) or (asked is None and field.two_view.model != "general"):
        return SlideChoice(0.0, (), "the pictures show one plane, or were taken from one place"), None
    if asked is None and known.refined is None:
        return SlideChoice(0.0, (), "the smooth field knows no edges of near things, which a slide would bend"), None
    base = known.base(lines.down, CHOICE.base_px_per_radian)
    viewpoint = viewpoint_between(base, views)
    if viewpoint is None:
        return NO_WAY, None
    if asked is not None:
        s1, part = float(asked[0]), (float(asked[1][0]), float(asked[1][1]))
        sliding = _Sliding(base, viewpoint.within(part).sliding(s1))
        return SlideChoice(s1, (), "as asked for", part), sliding
    rough = RoughSeam.of(pictures, views, CHOICE.base_px_per_radian)

    def seam(warp: Warp) -> float:
        """px of a rough seam that is seen, without what a border cuts, as it will be (see `_settled`)."""
        return rough(without_cut_things(warp, views, pictures, rough) if known.continuation else warp)

    down = lines.down if lines.down_is_sure else None
    choice = choose_slide(base, views, viewpoint, lines.each, down, seam, progress)
    return choice, _Sliding(base, viewpoint.within(choice.part).sliding(choice.s1)) if choice.s1 else None
