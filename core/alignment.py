"""How the target lies on the reference: from pictures to matches, geometry, field and map.

Everything that is decided about a pair before a pixel of it is fetched. Several frames of two fixed cameras share one
alignment: their matches are pooled, so that a clip does not swim.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .cameras.camera import Camera
from .cameras.lens import undistort
from .cameras.matches import Matches
from .cameras.sources import cameras_for
from .cameras.two_view import TwoView
from .dense.refine import Dense, refine
from .field.field import Field
from .field.slack import SlackField
from .field.strict import StrictField
from .fields import fit_field
from .options import StitchOptions
from .panorama.levelling import rotation_for
from .panorama.projection import Projection, round_projection
from .panorama.upright_edges import edges
from .panorama.warp import Warp, build_warp
from .pictures.masks import read_mask, read_painted, without
from .pictures.picture import Picture, resized
from .pose import features
from .pose.estimation import MIN_MATCHES, estimate
from .pose.match_files import read_matches
from .system.cache import Cache
from .system.errors import BadRequest, NoOverlap, TooFewMatches
from .system.threads import in_order

# With fewer points of detail than this a picture is to blame, not the pair.
SCARCE = 100
# Called with a stage's name and how much of it is done.
ReportProgress = Callable[[str, float], None]


@dataclass(frozen=True)
class Alignment:
    """Where every canvas pixel is seen in the target, and why.

    cameras: as known before; matches: all found or given, in px of the (raw) pictures; two_view: the geometry, its
    inliers among them; field; dense: its refinement, None where none was asked for; warp; warnings in plain words.
    """

    cameras: tuple[Camera, Camera]
    matches: Matches
    two_view: TwoView
    field: Field
    warp: Warp
    warnings: tuple[str, ...]
    dense: Dense | None = None


@dataclass(frozen=True)
class Frame:
    """Two pictures as they are worked on, without what is masked and at the scale asked for; their full sizes; and what
    was painted over the panorama (see `masks.read_painted`)."""

    reference: Picture
    target: Picture
    full_sizes: tuple[tuple[int, int], tuple[int, int]]
    painted: NDArray[np.int8] | None = None


def prepare(reference: Picture, target: Picture, options: StitchOptions) -> Frame:
    """A frame of two full pictures in one colour space. Raises BadRequest or UnreadableImage about a mask."""

    def worked_on(picture: Picture, mask: Path | np.ndarray | None, name: str) -> Picture:
        shown = picture if mask is None else without(picture, read_mask(mask, size_of(picture), name))
        return resized(shown, options.scale)

    return Frame(
        worked_on(reference, options.ignore_reference, "the reference"),
        worked_on(target, options.ignore_target, "the target"),
        (size_of(reference), size_of(target)),
        None if options.mask is None else read_painted(options.mask),
    )


@dataclass(frozen=True)
class Geometry:
    """How two cameras stood, before any field: what all fields of a pair have in common.

    cameras, matches, two_view, warnings: as in `Alignment`; ideal: the matches in ideal (undistorted) pixels.
    """

    cameras: tuple[Camera, Camera]
    matches: Matches
    ideal: Matches
    two_view: TwoView
    warnings: tuple[str, ...]


def align(frames: Sequence[Frame], options: StitchOptions, steps: ReportProgress) -> Alignment:
    """Aligns the target of each frame with the reference; all frames share both cameras, hence one alignment.

    Raises StitchError and its kinds.
    """
    return fit_and_warp(estimate_geometry(frames, options, steps), frames, options, steps)


def estimate_geometry(frames: Sequence[Frame], options: StitchOptions, steps: ReportProgress) -> Geometry:
    """Matches and two-view geometry of frames that share both cameras. Raises StitchError and its kinds."""
    first, second, sizes = frames[0].reference, frames[0].target, frames[0].full_sizes
    if any(frame.full_sizes != sizes for frame in frames):
        raise BadRequest("the frames of a clip differ in size: one alignment is for one camera each")
    full, warnings = cameras_for(options.camera, (first.name, second.name), sizes, (first.exif, second.exif))
    cameras = full[0].resized(size_of(first)), full[1].resized(size_of(second))
    cache = Cache(options.cache)
    if options.matches is None:
        steps("features", 0.0)
        seen = tuple((p.view, p.alpha) for frame in frames for p in (frame.reference, frame.target))
        quick = options.preview
        matches = cache.remember("matches", (*seen, quick), lambda: _found_in(frames, steps, quick))
    else:
        matches = _given(options.matches, frames[0], cameras)

    steps("geometry", 0.0)
    ideal = replace(matches, x=undistort(matches.x, cameras[0]), y=undistort(matches.y, cameras[1]))
    two_view = cache.remember(
        "two_view", (ideal, cameras, options.seed), lambda: estimate(ideal, *cameras, seed=options.seed)
    )
    return Geometry(cameras, matches, ideal, two_view, (*warnings, *two_view.warnings))


def fit_and_warp(
    registration: Geometry, frames: Sequence[Frame], options: StitchOptions, steps: ReportProgress
) -> Alignment:
    """Field and map of the frames whose geometry is known. Raises StitchError and its kinds."""
    cameras, two_view = registration.cameras, registration.two_view
    steps("field", 0.0)
    inliers, sizes = registration.ideal.subset(two_view.inliers), (cameras[0].size, cameras[1].size)
    decided = (options.field, options.fade, two_view, inliers, *sizes, options.seed)
    field = Cache(options.cache).remember("field", decided, lambda: fit_field(*decided))

    dense = None
    if options.dense:
        steps("dense", 0.0)
        seen = tuple((p.view, p.alpha) for p in (frames[0].reference, frames[0].target))
        dense = Cache(options.cache).remember(
            "dense", (len(frames), field, inliers, seen, cameras),
            lambda: _refined(field, field.two_view, inliers, frames, cameras),
        )  # fmt: skip

    steps("warp", 0.0)
    relief = None if dense is None else dense.relief
    projection = _projection(options, field.two_view, frames[0], cameras)
    warp = build_warp(field, field.two_view, *cameras, projection, relief)
    return Alignment(cameras, registration.matches, field.two_view, field, warp, registration.warnings, dense)


def _refined(
    field: Field, two_view: TwoView, inliers: Matches, frames: Sequence[Frame], cameras: tuple[Camera, Camera]
) -> Dense:
    """The field's dense refinement, or why there is none."""
    if len(frames) > 1:
        return Dense(None, "one smooth field serves all frames of a clip, so that nothing swims")
    if not isinstance(field, (StrictField, SlackField)):
        return Dense(None, f"the field {field.name!r} is shown as it is")
    return refine(field, two_view, inliers, (frames[0].reference, frames[0].target), cameras)


def size_of(picture: Picture) -> tuple[int, int]:
    """(W, H) px of a picture."""
    height, width = picture.light.shape[:2]
    return width, height


def _projection(
    options: StitchOptions, two_view: TwoView, frame: Frame, cameras: tuple[Camera, Camera]
) -> Projection | None:
    """The round projection that is asked for, levelled; None for a flat panorama."""
    if options.projection == "perspective":
        return None
    upright = None
    if options.level == "auto":
        (normals, lengths), (normals_too, lengths_too) = (
            edges(picture, camera, K)
            for picture, camera, K in zip(
                (frame.reference, frame.target), cameras, (two_view.K, two_view.K_prime), strict=True
            )
        )
        upright = normals, lengths
        if np.isfinite(two_view.R).all():
            upright = np.vstack([normals, normals_too @ two_view.R]), np.concatenate([lengths, lengths_too])
    return round_projection(options.projection, two_view.K, rotation_for(options.level, two_view.R, upright))


def _found_in(frames: Sequence[Frame], steps: ReportProgress, quick: bool) -> Matches:
    found = []
    most = (features.PREVIEW_BUDGET, features.PREVIEW_PIXELS) if quick else ()
    for i, frame in enumerate(frames):
        seen = []
        for keypoints in in_order(lambda p: features.detect(p.view, p.alpha, *most), (frame.reference, frame.target)):
            seen.append(keypoints)
            steps("features", (i + 0.45 * len(seen)) / len(frames))
        first, second = seen
        found.append(features.match(first, second))
        if len(frames) == 1 and len(found[0]) < MIN_MATCHES:
            _refuse_scarce(len(found[0]), frame, len(first.points), len(second.points))
    x, y = np.concatenate([m.x for m in found]), np.concatenate([m.y for m in found])
    return Matches(x, y, max(m.scale for m in found))


def _refuse_scarce(matches: int, frame: Frame, *details: int) -> None:
    """Raises TooFewMatches where there are few because one picture has hardly any points of detail; else it is the
    pair's fault, which `estimate` says."""
    for name, picture, count in zip(("reference", "target"), (frame.reference, frame.target), details, strict=True):
        if count < SCARCE:
            width, height = size_of(picture)
            raise TooFewMatches(
                f"only {matches} matching points found, at least {MIN_MATCHES} needed: the {name} ({width}×{height} "
                f"pixels) shows only {count} points of detail; choose a larger or sharper picture of something with "
                "texture, or give matches by hand (--matches)"
            )


def _given(source: Path | np.ndarray, frame: Frame, cameras: tuple[Camera, Camera]) -> Matches:
    """Matches from a file or array, at the scale of the work, without those in masked parts."""
    matches = read_matches(source, *frame.full_sizes, (cameras[0].size, cameras[1].size))
    seen = _shown(frame.reference, matches.x) & _shown(frame.target, matches.y)
    if not seen.any():
        raise NoOverlap("all the given matches lie in parts of the pictures that are masked or transparent")
    return matches.subset(seen)


def _shown(picture: Picture, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    if picture.alpha is None:
        return np.ones(len(points), bool)
    column, row = np.clip(np.rint(points).astype(int), 0, np.array(size_of(picture)) - 1).T
    return picture.alpha[row, column] > 0
