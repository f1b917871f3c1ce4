"""How pictures lie on the reference: from pictures to matches, geometry, field and maps.

Everything that is decided before pixels are blended. Frames of a clip, whose cameras stand still, share one alignment:
their matches are pooled, so that the panorama does not wobble from frame to frame. The method: docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .cameras.camera import Camera
from .cameras.edge import Edge
from .cameras.lens import undistort
from .cameras.matches import Matches
from .cameras.resized import resized_edge, resized_rig
from .cameras.rig import Rig
from .cameras.scale import Places, Scale, scale_for
from .cameras.sources import cameras_for
from .cameras.two_view import TwoView
from .cameras.view import View, views_of
from .continuation.continuation import Continuation
from .dense.refine import Dense, refine
from .dense.sphere.refine_sphere import DenseSphere, refine_sphere
from .field.field import Field
from .field.slack import SlackField
from .field.sphere_field import SphereField, fit_sphere_field
from .field.strict import StrictField
from .fields import field_of
from .frames.frame import Frame, size_of
from .mapping import map_pictures, map_rig
from .options import StitchOptions
from .panorama.choosing_slide import SlideChoice
from .panorama.upright_edges import straight_edges
from .panorama.warp import Warp
from .pictures.picture import Picture
from .pose.edge_focal import Edges, focal_by_edges
from .pose.estimation import estimate
from .pose.exif_doubt import by_exif_or_without
from .pose.mirrored import unless_mirrored
from .pose.options import EDGE_FOCAL
from .pose.pair_matches import found_in, given_of
from .rig.given_matches import given_matches
from .rig.left_out import check_connected, left_out_warnings
from .rig.pair_edges import edges_of
from .rig.reframing import seen_from
from .system.cache import Cache
from .system.errors import BadRequest, StitchError
from .system.memory import give_back
from .system.progress import ReportProgress

SMOOTH_CLIP = "one smooth field serves all frames of a clip, so that nothing swims"


@dataclass(frozen=True)
class Alignment:
    """Where every canvas pixel is seen in each picture, and what that follows from.

    Attributes
    ----------
    cameras : tuple of Camera
        As they were known before estimation.
    edges : tuple of Edge
        Pairs of pictures with their matches and geometry.
    views : tuple of View
        Each picture's place relative to the reference, as its edges have it.
    field : Field or SphereField
        The displacement field; of more than two pictures, on the sphere.
    warp : Warp
        The maps from the canvas to each picture.
    warnings : tuple of str
        In plain words.
    dense : Dense or None
        Dense refinement of a pair's field; None where it was not asked for.
    continuation : Continuation or None
        What goes on beyond the overlap; None where the field itself does.
    slide : SlideChoice
        How far the viewpoint slides, and why.
    rig : Rig or None
        The cameras of more than two pictures, which `cameras` are then as well; None of a pair.
    left_out : tuple of (str, str)
        Names of the pictures that connect with no others, and why.
    numbers : tuple of int
        Which of the frame's pictures are used, in their order here.
    dense_sphere : DenseSphere or None
        Dense refinement of the field of more than two pictures; None where it was not asked for.
    scale : Scale
        How long the unit of depth is.
    """

    cameras: tuple[Camera, ...]
    edges: tuple[Edge, ...]
    views: tuple[View, ...]
    field: Field | SphereField
    warp: Warp
    warnings: tuple[str, ...]
    dense: Dense | None = None
    continuation: Continuation | None = None
    slide: SlideChoice = SlideChoice(0.0, (), "")
    rig: Rig | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    numbers: tuple[int, ...] = (0, 1)
    dense_sphere: DenseSphere | None = None
    scale: Scale = Scale()

    @property
    def pair_field(self) -> Field:
        """The displacement field of a pair."""
        assert not isinstance(self.field, SphereField)
        return self.field


@dataclass(frozen=True)
class Geometry:
    """What was found before any field was fitted: all fields of the same pictures share it.

    Attributes
    ----------
    cameras, edges, warnings, rig, left_out, scale
        As in `Alignment`.
    numbers : tuple of int
        Which of the frame's pictures are used, in their order from here on.
    """

    cameras: tuple[Camera, ...]
    edges: tuple[Edge, ...]
    warnings: tuple[str, ...]
    numbers: tuple[int, ...] = (0, 1)
    rig: Rig | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    scale: Scale = Scale()

    @property
    def centres(self) -> NDArray[np.float64]:
        """The places (N, 3) of the pictures, NaN where they are not known."""
        if self.rig is not None:
            return self.rig.centres
        pose = self.edges[0].two_view
        return np.stack([np.zeros(3), -pose.R.T @ pose.t])

    def of_resized(self, sizes: Sequence[tuple[int, int]]) -> Geometry:
        """The same of the pictures resized to (W, H) px."""
        if [camera.size for camera in self.cameras] == list(sizes):
            return self
        edges = tuple(resized_edge(edge, self.cameras, sizes) for edge in self.edges)
        cameras = tuple(camera.resized(size) for camera, size in zip(self.cameras, sizes, strict=True))
        rig = None if self.rig is None else resized_rig(self.rig, sizes)
        return replace(self, cameras=cameras, edges=edges, rig=rig)


def align(frames: Sequence[Frame], options: StitchOptions, progress: ReportProgress) -> Alignment:
    """Finds how the pictures of frames lie on their reference.

    Parameters
    ----------
    frames : sequence of Frame
        Of the same cameras, none of which moved: their matches are pooled, and they share the alignment.
    options : StitchOptions
    progress : callable
        progress(stage, share of that stage that is done).

    Returns
    -------
    Alignment

    Raises
    ------
    StitchError
        And its kinds: too few matches, no overlap, a geometry that explains nothing.
    """
    geometry = estimate_geometry(frames, options, progress)
    return fit_and_warp(geometry, [frame.only(geometry.numbers) for frame in frames], options, progress)


def estimate_geometry(frames: Sequence[Frame], options: StitchOptions, progress: ReportProgress) -> Geometry:
    """The first half of `align`: finds or reads matches, and estimates the geometry of the cameras from them.

    Parameters
    ----------
    frames : sequence of Frame
        Of the same cameras; of more than two, the first frame alone is looked at.
    options : StitchOptions
        What is known of cameras, matches and a distance; seed and cache. The field does not matter.
    progress : callable
        As for `align`.

    Returns
    -------
    Geometry

    Raises
    ------
    BadRequest
        Frames of different sizes, or cameras and matches that do not fit the pictures.
    UnreadableImage
        A file of cameras or matches that cannot be read.
    TooFewMatches, NoOverlap, DegenerateGeometry
        There is no geometry to rely on.
    """
    pictures, sizes = frames[0].pictures, frames[0].full_sizes
    if any(frame.full_sizes != sizes for frame in frames):
        raise BadRequest("the frames of a clip differ in size: one alignment is for one camera each")
    full, warnings = cameras_for(options.camera, frames[0].names, sizes, frames[0].exifs, frames[0].known)
    cameras = tuple(camera.resized(size_of(picture)) for camera, picture in zip(full, pictures, strict=True))
    if len(pictures) > 2:
        found = _of_many(frames[0], cameras, warnings, options, progress)
    else:
        pair = partial(_of_pair, frames, cameras, warnings, options, progress)
        found = pair() if options.matches is not None else unless_mirrored(pictures, pair, not options.few_features)
    places = Places(frames[0].called, frames[0].shown_by, found.numbers, found.centres)
    return replace(found, scale=scale_for(options.scale_metres, cameras, places))


def _of_pair(
    frames: Sequence[Frame], cameras: tuple[Camera, ...], warnings: Sequence[str], options: StitchOptions,
    progress: ReportProgress,
) -> Geometry:  # fmt: skip
    """The geometry of two pictures."""
    pictures = frames[0].pictures
    cache = Cache(options.cache)
    if options.matches is None:
        progress("features", 0.0)
        seen = tuple((picture.view, picture.alpha) for frame in frames for picture in frame.pictures)
        quick = options.few_features
        shown = [frame.pictures for frame in frames]
        matches = cache.remember("matches", (*seen, quick), lambda: found_in(shown, progress, quick))
    else:
        matches = given_of(options.matches, pictures, frames[0].names, frames[0].full_sizes, cameras)

    progress("geometry", 0.0)
    ideal = replace(matches, x=undistort(matches.x, cameras[0]), y=undistort(matches.y, cameras[1]))
    looked_at = pictures if all(camera.log_sigma for camera in cameras) else ()
    two_view, used = cache.remember(
        "two_view", (ideal, cameras, options.seed, tuple((picture.view, picture.alpha) for picture in looked_at)),
        lambda: by_exif_or_without(
            ideal, cameras, options.seed, lambda these, known: _estimated(these, known, options.seed, pictures)
        ),
    )  # fmt: skip
    return Geometry(used, (Edge(0, 1, matches, ideal, two_view),), (*warnings, *two_view.warnings))


def _of_many(
    frame: Frame, cameras: tuple[Camera, ...], warnings: Sequence[str], options: StitchOptions,
    progress: ReportProgress,
) -> Geometry:  # fmt: skip
    """The geometry of more than two pictures; of two of them, if no more connect."""
    from .rig.exif_doubt import exif_warnings, without_wrong_exif, wrong_exif
    from .rig.from_pictures import content_order, matched_pictures, registered  # a pair starts sooner without it

    pictures, cache = frame.pictures, Cache(options.cache)
    order = content_order(pictures)
    if options.matches is None:
        matched = matched_pictures(pictures, order, frame.bodies, options.few_features, cache, progress)
    else:
        matched = given_matches(options.matches, pictures, frame.full_sizes, [camera.size for camera in cameras])
    doubted = cache.remember(
        "exif", (cameras, matched, options.seed), lambda: wrong_exif(cameras, matched, options.seed)
    )
    by_exif, cameras = cameras, without_wrong_exif(cameras, doubted, frame.names)
    found = registered(pictures, order, cameras, matched, options.seed, cache, progress)
    check_connected(found, frame.called, options.require_all)
    left_out = tuple((frame.called[number], why) for number, why in found.left_out.items())
    warnings = (*warnings, *exif_warnings(by_exif, doubted, frame.names, found.focals),
                *left_out_warnings(found, cameras, frame.called))  # fmt: skip
    found = seen_from(found, options.viewpoint, frame.called, frame.shown_by)
    if len(found.numbers) == 2:
        pair_options = replace(options, viewpoint=None, scale_metres=None)
        pair = estimate_geometry([frame.only(found.numbers)], pair_options, progress)
        return replace(pair, warnings=(*warnings, *pair.warnings), numbers=found.numbers, left_out=left_out)
    edges = edges_of(found.rig, matched, found.numbers)
    return Geometry(found.rig.cameras, edges, warnings, found.numbers, found.rig, left_out)


def _estimated(ideal: Matches, cameras: Sequence[Camera], seed: int, pictures: Sequence[Picture]) -> TwoView:
    """The geometry by matches, ideal px; where nothing is known of the cameras with a focal length that straight edges
    of the pictures ask for, if that explains as many matches."""
    two_view = estimate(ideal, cameras[0], cameras[1], seed=seed)
    if not all(camera.assumed for camera in cameras) or two_view.model != "general":
        return two_view
    found = [straight_edges(one, camera, np.eye(3)) for one, camera in zip(pictures, cameras, strict=True)]
    first, second = (Edges(edges.rays[..., :2] / edges.rays[..., 2:], edges.lengths) for edges in found)
    known = focal_by_edges(ideal.subset(two_view.inliers), two_view, (cameras[0], cameras[1]), (first, second))
    if known is None:
        return two_view
    try:
        other = estimate(ideal, *known, seed=seed)
    except StitchError:
        return two_view
    fewer = other.inliers.sum() < EDGE_FOCAL.inlier_share * two_view.inliers.sum()
    return two_view if fewer or other.model != two_view.model else other


def fit_and_warp(
    geometry: Geometry, frames: Sequence[Frame], options: StitchOptions, progress: ReportProgress
) -> Alignment:
    """The second half of `align`: fits the displacement field, refines it, and builds the maps.

    Parameters
    ----------
    geometry : Geometry
        Of these frames.
    frames : sequence of Frame
        Only a single one is refined: a clip keeps one smooth field.
    options : StitchOptions
        Field, fade, dense, slide, projection, level, centre and fov; seed and cache.
    progress : callable
        As for `align`.

    Returns
    -------
    Alignment

    Raises
    ------
    DegenerateGeometry
        The matches determine no field.
    NoOverlap, OutputTooLarge, BadRequest
        There is no canvas for it (see `build_warp`).
    """
    if geometry.rig is not None:
        return _many_mapped(geometry, geometry.rig, frames, options, progress)
    cameras = geometry.cameras
    (edge,) = geometry.edges
    progress("field", 0.0)
    inliers, pair = edge.inliers, edge.pair(cameras)
    field = field_of(edge, cameras, frames[0].pictures, options)

    dense = None
    if options.dense:
        progress("dense", 0.0)
        seen = tuple((picture.view, picture.alpha) for picture in frames[0].pictures)
        dense = Cache(options.cache).remember(
            "dense", (len(frames), field, inliers, seen, cameras),
            lambda: _refined(field, edge, inliers, frames, pair),
        )  # fmt: skip
        give_back()

    progress("warp", 0.0)
    # the field's own geometry: a rival knows no depth, so its views have none
    views = views_of(field.two_view, cameras)
    refined = None if dense is None else dense.refined
    # what goes on beyond the overlap follows colours and edges, which are another frame's in a clip
    shown = options if len(frames) == 1 or options.fade != "continue" else replace(options, fade="plane")
    mapped = map_pictures(field, views, refined, frames[0].pictures, shown, progress)
    edges = (replace(edge, two_view=field.two_view),)
    return Alignment(
        cameras, edges, views, field, mapped.warp, (*geometry.warnings, *mapped.warnings), dense, mapped.continuation,
        mapped.slide,
        left_out=geometry.left_out, numbers=geometry.numbers, scale=geometry.scale,
    )  # fmt: skip


def _many_mapped(
    geometry: Geometry, rig: Rig, frames: Sequence[Frame], options: StitchOptions, progress: ReportProgress
) -> Alignment:
    """The second half of `align` for the pictures of a rig."""
    progress("field", 0.0)
    slack = options.field == "slack"
    field = Cache(options.cache).remember(
        "sphere", (rig, slack), lambda: fit_sphere_field(rig, slack, lambda: progress("field", 0.0))
    )
    dense = None
    if options.dense:
        seen = tuple((picture.view, picture.alpha) for picture in frames[0].pictures)
        dense = Cache(options.cache).remember(
            "dense_sphere", (len(frames), rig, field, seen), lambda: _refined_sphere(field, rig, frames, progress)
        )
        give_back()
    progress("warp", 0.0)
    refined = None if dense is None else dense.refined
    mapped = map_rig(rig, field, frames[0].pictures, options, progress, refined)
    warnings = (*geometry.warnings, *field.warnings, *mapped.warnings)
    return Alignment(
        geometry.cameras, geometry.edges, rig.views, field, mapped.warp, warnings, None, mapped.continuation,
        mapped.slide, rig, geometry.left_out, geometry.numbers, dense, geometry.scale,
    )  # fmt: skip


def _refined_sphere(
    field: SphereField, rig: Rig, frames: Sequence[Frame], progress: ReportProgress
) -> DenseSphere:
    """The dense refinement of a field on the sphere, or why there is none."""
    if len(frames) > 1:
        return DenseSphere(None, SMOOTH_CLIP)
    return refine_sphere(field, rig, frames[0].pictures, lambda share: progress("dense", share))


def _refined(
    field: Field, edge: Edge, inliers: Matches, frames: Sequence[Frame], cameras: tuple[Camera, Camera]
) -> Dense:
    """The field's dense refinement, or why there is none."""
    if len(frames) > 1:
        return Dense(None, SMOOTH_CLIP)
    if not isinstance(field, (StrictField, SlackField)):
        return Dense(None, f"the field {field.name!r} is shown as it is")
    return refine(field, field.two_view, inliers, edge.pair(frames[0].pictures), cameras)
