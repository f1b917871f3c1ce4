"""Which part of the world the panorama shows, and on what surface (docs/method.md, 6).

The frame is found on a coarse map of all pictures on a sphere: which directions are shown, and how sharply. Then the
horizon is levelled, the middle is put halfway between the ends, the surface is chosen by the field of view, and the
resolution so that the sharpest picture in each direction keeps its pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..choices import Level
from ..raster.arrays import Array, angle_of
from ..raster.rectangle import largest_rectangle
from ..system.errors import BadRequest
from .framing_options import FRAMING
from .levelling import gravity, turned, upright
from .projection import Projection, focal_of, round_projection

if TYPE_CHECKING:
    from .warp import Warp

Edges = tuple[Array, Array]


@dataclass(frozen=True)
class FrameRequest:
    """What is asked for.

    Attributes
    ----------
    kind : str
        "auto", or a kind of projection.
    distance : float or None
        Pannini's; chosen if not given.
    level : Level
        "auto", "none" (the reference looks straight ahead), or (yaw, pitch, roll) in degrees.
    centre : (yaw, pitch), optional
        Degrees right and up from the middle of what is shown, where the middle of the frame is put.
    fov : float, optional
        Degrees from left to right; by default all that is shown.
    """

    kind: str = "auto"
    distance: float | None = None
    level: Level = "auto"
    centre: tuple[float, float] | None = None
    fov: float | None = None
    guided: bool = False

    @property
    def needs_edges(self) -> bool:
        """Whether straight edges have a say in the frame: which way is down, and whether the scene is frontal."""
        return self.level == "auto" or (self.kind in ("auto", "pannini") and self.distance is None)


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the pictures show, sampled on a sphere.

    projection: of that sphere; offset: see `Canvas`; mask (h, w): where its canvas shows something; and for each of
    these pixels its ray (N, 3) in the reference's frame, its solid angle (N,) in steradian, and the picture px per
    steradian (N,) of the sharpest picture there.
    """

    projection: Projection
    offset: tuple[int, int]
    mask: NDArray[np.bool_]
    rays: Array
    solid_angle: Array
    sharpness: Array

    def at(self, rays: Array) -> NDArray[np.bool_]:
        """Whether rays (…, 3) are shown."""
        column, row = np.moveaxis(np.rint(self.projection.points(rays) + np.array(self.offset)).astype(int), -1, 0)
        height, width = self.mask.shape
        known = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        shown: NDArray[np.bool_] = known & self.mask[np.where(known, row, 0), np.where(known, column, 0)]
        return shown


def frame_for(
    asked: FrameRequest, views: Sequence[View], edges: Edges | None, down: Array | None,
    warp_on: Callable[[Projection], Warp],
) -> Projection:  # fmt: skip
    """Choose the surface that the panorama is drawn on, how it is turned, and how large it is.

    Parameters
    ----------
    asked : FrameRequest
    views : sequence of View
        What is known of the pictures, the reference's first.
    edges : ((N, 3) array, (N,) array) or None
        Normals, in the reference's frame, and lengths of straight edges (see `gravity_by_edges`); None if not needed.
    down : (3,) array or None
        Which way is down by these edges; None if the panorama is not levelled.
    warp_on : callable
        Gives the maps of all pictures on a projection.

    Returns
    -------
    Projection

    Raises
    ------
    BadRequest
        The frame that is asked for shows nothing.
    """
    return frame_of(asked, views, edges, down, coverage(warp_on(coarse_sphere(views))))


def coarse_sphere(views: Sequence[View]) -> Projection:
    """The sphere on which what the pictures show is sampled."""
    K = views[0].K
    coarse = FRAMING.side_px / max(max(view.size) for view in views)
    return round_projection("equirectangular", K, np.eye(3), coarse * focal_of(K))


def frame_of(
    asked: FrameRequest, views: Sequence[View], edges: Edges | None, down: Array | None, covered: Coverage
) -> Projection:
    """As `frame_for`, where it is known what the pictures show."""
    K = views[0].K
    if asked.level == "auto":
        frame = _levelled(asked, views, edges, down, covered, K)
    else:
        angles = (0.0, 0.0, 0.0) if isinstance(asked.level, str) else asked.level
        frame = _surface(asked, turned(*angles), edges, covered, K)
    frame = _resized(frame, covered)
    if asked.centre is None and asked.fov is None:
        return frame
    return _windowed(frame, covered, asked.centre or (0.0, 0.0), asked.fov)


def coverage(warp: Warp) -> Coverage:
    """What a coarse warp on a sphere shows."""
    canvas = warp.canvas
    projection = canvas.projection
    assert projection is not None
    level = np.cos((canvas.ys - projection.centre[1]) / projection.focal)
    solid_angle = np.broadcast_to(level[:, None] / projection.focal**2, (canvas.height, canvas.width))
    px = np.zeros((canvas.height, canvas.width))
    for one in warp.maps:
        here = one.arrays()
        (x_down, x_across), (y_down, y_across) = (np.gradient(values.astype(np.float64)) for values in (here.x, here.y))
        with np.errstate(invalid="ignore"):
            area = np.nan_to_num(np.abs(x_across * y_down - x_down * y_across), posinf=0.0)
        px = np.maximum(px, np.where(here.inside(), area, 0))
    mask = px > 0
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1)[mask])
    return Coverage(projection, canvas.offset, mask, rays, solid_angle[mask], px[mask] / solid_angle[mask])


def _levelled(
    asked: FrameRequest, views: Sequence[View], edges: Edges | None, down: Array | None, covered: Coverage, K: Array
) -> Projection:
    """The frame that is turned upright: by edges where they can be believed, else by how the cameras were held."""
    best = gravity([view.R for view in views if np.isfinite(view.R).all()])

    def frame(down: Array, more: float = 0.0) -> Projection:
        return _surface(asked, _centred(down, covered, more), edges, covered, K)

    if asked.guided and down is not None:
        return frame(down, -np.inf)
    # where there are many pictures, they know better than the first alone how it was held
    believed = down is not None and (_believed(down) or (len(views) > 2 and _agree(down, best)))
    if down is not None and believed and not np.allclose(down, best):
        room, room_by_edges = (_room(frame(one), covered)[0] for one in (best, down))
        best = down if room_by_edges >= FRAMING.least_kept * room else best
    frames = [frame(best, more) for more in FRAMING.more_kept_deg]
    rooms = [_room(one, covered)[1] for one in frames]
    return next(one for one, room in zip(frames, rooms, strict=True) if room >= FRAMING.least_room * max(rooms))


def _believed(down: Array) -> bool:
    """Whether somebody may have held the reference so, `down` (3,) being down in its frame."""
    roll, pitch = np.degrees([np.arctan2(down[0], down[1]), np.arcsin(np.clip(down[2], -1, 1))])
    return bool(abs(roll) <= FRAMING.max_roll_deg and abs(pitch) <= FRAMING.max_pitch_deg)


def _agree(down: Array, other: Array) -> bool:
    """Whether two directions (3,) down differ by less than anybody tilts a camera by mistake."""
    return bool(down @ other >= np.cos(np.radians(FRAMING.max_roll_deg)))


def _centred(down: Array, covered: Coverage, more: float) -> Array:
    """The rotation (3, 3) of a panorama that looks at the middle of what is shown, `down` (3,) being down; more:
    degrees of tilt that are kept beside what is always kept, −∞ for none at all."""
    base = upright(down)
    mean = covered.solid_angle @ covered.rays @ base
    ahead = np.arctan2(mean[0], mean[2])
    left, right = _ends(covered.rays @ base @ turned(np.degrees(-ahead), 0, 0))
    if np.degrees(right - left) > FRAMING.ring_fov_deg:  # what crosses the back may have its gap elsewhere
        ahead = _away_from_gap(covered.rays @ base, ahead)
        left, right = _ends(covered.rays @ base @ turned(np.degrees(-ahead), 0, 0))
    level: Array = base @ turned(-np.degrees(ahead + (left + right) / 2), 0, 0)
    if np.degrees(right - left) > FRAMING.ring_fov_deg:
        return level  # what goes round has no side to be tilted to
    mean = covered.solid_angle @ covered.rays @ level
    pitch = np.degrees(np.arctan2(-mean[1], np.hypot(mean[0], mean[2])))
    kept = np.sign(pitch) * max(0.0, min(abs(pitch), max(0.0, abs(pitch) - FRAMING.full_pitch_deg) + more))
    rotation: Array = level @ turned(0, -kept, 0)
    return rotation


def _ends(rays: Array) -> tuple[float, float]:
    """The headings of the outermost rays (N, 3) in a panorama's axes, left and right, in radians."""
    outer = FRAMING.outermost_percent
    left, right = np.percentile(angle_of(rays[:, 0], rays[:, 2]), (outer, 100 - outer))
    return float(left), float(right)


def _away_from_gap(rays: Array, otherwise: float) -> float:
    """The heading, in radians, opposite to the middle of the widest gap between rays (N, 3) in a panorama's axes; if
    there is none, the other."""
    headings = np.sort(angle_of(rays[:, 0], rays[:, 2]))
    gaps = np.diff(np.append(headings, headings[0] + 2 * np.pi))
    widest = int(np.argmax(gaps))
    if np.degrees(gaps[widest]) < FRAMING.least_gap_deg:
        return otherwise
    return float(headings[widest] + gaps[widest] / 2 - np.pi)


def _surface(asked: FrameRequest, rotation: Array, edges: Edges | None, covered: Coverage, K: Array) -> Projection:
    """The projection that suits what is shown, or that is asked for, turned by a rotation (3, 3)."""
    own = covered.rays @ rotation
    fov = np.degrees(2 * max(abs(end) for end in _ends(own)))
    outer = FRAMING.outermost_percent
    steepest = np.degrees(np.abs(np.arcsin(np.percentile(own[:, 1], (outer, 100 - outer))))).max()
    kind = asked.kind
    if kind == "auto":
        kind = "cylindrical" if fov > FRAMING.cylinder_fov_deg else "pannini"
        round_about = steepest > FRAMING.sphere_elevation_deg or fov > FRAMING.ring_fov_deg
        kind = "equirectangular" if round_about else kind
    if kind in ("cylindrical", "equirectangular"):
        return round_projection(kind, K, rotation)
    distance = 0.0 if kind == "perspective" else asked.distance
    if distance is None:
        wide = (fov - FRAMING.flat_fov_deg) / FRAMING.fov_per_distance_deg
        distance = float(np.clip(wide, 0, FRAMING.max_distance))
        if edges is not None and _frontal_length(edges, rotation) > FRAMING.frontal_length:
            distance = min(distance, FRAMING.frontal_distance)
    if asked.kind == "auto" and not distance:
        kind = "perspective"
    return Projection(kind, focal_of(K), (0.0, 0.0), rotation, K, distance)


def _frontal_length(edges: Edges, rotation: Array) -> float:
    """How much there is of level lines that are square to one direction near ahead, in sides of a picture, each line
    weighted by the sine of its elevation."""
    normals, lengths = edges[0] @ rotation, edges[1]
    elevation = np.arctan2(np.abs(normals[:, 2]), np.abs(normals[:, 1]))
    counts = (elevation > np.radians(FRAMING.frontal_elevation_deg)) & (lengths > FRAMING.frontal_least_length)
    # a line whose plane is steeper than 60 degrees is an upright or seen from straight below
    counts &= np.abs(normals[:, 1]) > 0.5
    normals, weights = normals[counts], (lengths * np.sin(elevation))[counts]
    most, step = FRAMING.frontal_turn_deg, FRAMING.frontal_step_deg
    turns = np.radians(np.arange(-most, most + step / 2, step))
    along = np.stack([np.cos(turns), np.zeros_like(turns), np.sin(turns)])
    return float((weights @ (np.abs(normals @ along) < FRAMING.frontal_sine)).max()) if len(normals) else 0.0


def _room(projection: Projection, covered: Coverage) -> tuple[float, float]:
    """The largest rectangle that a frame has room for, as a share of what it shows and of its canvas."""
    limits = projection.limits
    points = projection.points(covered.rays)
    left, top = np.maximum(points.min(axis=0), limits[:2])
    right, bottom = np.minimum(points.max(axis=0), limits[2:])
    step = max(right - left, bottom - top) / FRAMING.side_px
    grid = np.stack(np.meshgrid(np.arange(left, right, step), np.arange(top, bottom, step)), axis=-1)
    mask = covered.at(projection.rays(grid))
    _, _, width, height = largest_rectangle(mask)
    return width * height / max(1, int(mask.sum())), width * height / mask.size


def _resized(projection: Projection, covered: Coverage) -> Projection:
    """The projection with as many px as the sharpest picture in each direction has, in the middle of all, and hardly
    more anywhere."""
    area = projection.area(covered.rays)
    limits, points = projection.limits, projection.points(covered.rays)
    # a pixel beyond the limits is rounding: a sphere's are whole numbers
    drawn = np.isfinite(area) & ((points >= limits[:2] - 1) & (points <= limits[2:] + 1)).all(axis=1)
    if not drawn.any():
        raise BadRequest(
            f"the pictures lie behind a {projection.kind} panorama that is turned so: choose another level, or the "
            "projection cylindrical or equirectangular"
        )
    weights = (area * covered.solid_angle)[drawn]
    enlarged = np.sqrt(area[drawn] / covered.sharpness[drawn])
    median, most = _weighted_percentiles(enlarged, weights, (50.0, FRAMING.enlarged_percent))
    focal = projection.focal / (median * np.clip(most / (median * FRAMING.max_enlarged), 1, FRAMING.max_reduction))
    if projection.sphere is not None:
        return round_projection(projection.kind, projection.K, projection.rotation, focal)
    return replace(projection, focal=focal)


def _weighted_percentiles(values: Array, weights: Array, percents: Sequence[float]) -> Array:
    """Percentiles of values (N,) with weights (N,)."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    found: Array = values[order][np.searchsorted(below, np.array(percents) / 100 * below[-1]).clip(0, len(values) - 1)]
    return found


def _within(points: Array, box: Array) -> NDArray[np.bool_]:
    """Which points (N, 2) lie in a box: left, top, right, bottom."""
    within: NDArray[np.bool_] = ((points >= box[:2]) & (points < box[2:])).all(axis=1)
    return within


def _windowed(
    projection: Projection, covered: Coverage, centre: tuple[float, float], fov: float | None
) -> Projection:
    """The projection with a window: as large as all that is shown, or fov degrees wide, with its middle moved by centre
    (yaw, pitch) in degrees."""
    points = projection.points(covered.rays)
    limits = projection.limits
    low, high = np.maximum(points.min(axis=0), limits[:2]), np.minimum(points.max(axis=0), limits[2:])
    x, y, z = projection.rays((low + high) / 2) @ projection.rotation
    yaw = np.arctan2(x, z) + np.radians(centre[0])
    pitch = np.arctan2(-y, np.hypot(x, z)) + np.radians(centre[1])

    def point(heading: float) -> Array:
        level = np.cos(pitch)
        ray = np.array([level * np.sin(heading), -np.sin(pitch), level * np.cos(heading)])
        return projection.points(projection.rotation @ ray)

    half = (high - low) / 2
    (left, top), (right, bottom) = point(yaw) - half, point(yaw) + half
    if fov is not None:
        most = np.pi - FRAMING.behind if projection.kind == "cylindrical" else np.radians(FRAMING.widest_flat_deg)
        # what goes on beyond straight behind would come back in at the other end
        ends = (np.clip(yaw + sign * np.radians(fov) / 2, -most, most) for sign in (-1, 1))
        left, right = (point(end)[0] for end in ends)
    window = (round(left), round(top), round(right) + 1, round(bottom) + 1)
    if not _within(points, np.array(window)).any():
        raise BadRequest("the frame lies beside all pictures: give a centre nearer to 0,0, or a larger field of view")
    return replace(projection, window=window)
