"""Where things lie that are drawn over a picture in the Image Editor: points, lines and colours. No bpy.

Three kinds of coordinates: *px* of a picture (integer pixel centres, y down), *view* (0 to 1 over the picture, y up; it
is what Blender's View2D counts in) and *region* (px of the window's region, y up).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.cameras.camera import Camera
from ...core.cameras.lens import distort, undistort
from ...core.cameras.projective import homogeneous, project
from ...core.panorama.projection import Projection
from ...core.panorama.rig_viewpoint import RigViewpoint
from ...core.panorama.viewpoint import Viewpoint
from ...core.raster.arrays import Array
from ..scene.scene_geometry import matrix, projection_of, viewpoint_of

Colours = NDArray[np.float32]
Size = tuple[int, int]

REFERENCE, TARGET = "reference", "target"
# From a good match to a bad one. Light and dark, so that they also differ for those who do not see red and green.
RAMP = np.array([[0.10, 0.62, 0.95, 1.0], [0.45, 0.90, 0.45, 1.0], [1.00, 0.85, 0.15, 1.0], [0.95, 0.20, 0.15, 1.0]])
GRAY = np.array([0.62, 0.62, 0.62, 0.9])
# px of error that the ramp ends at.
WORST = 4.0
_CORNERS = 12  # of a disc
_CURVE = 48  # points of an epipolar line that a lens bends


def to_view(points: Array, size: Size) -> Array:
    """px (N, 2) of a picture of `size` (W, H) to view coordinates."""
    width, height = size
    return np.stack([(points[..., 0] + 0.5) / width, 1 - (points[..., 1] + 0.5) / height], axis=-1)


def from_view(points: Array, size: Size) -> Array:
    """View coordinates (N, 2) to px: the inverse of `to_view`."""
    width, height = size
    return np.stack([points[..., 0] * width - 0.5, (1 - points[..., 1]) * height - 0.5], axis=-1)


def to_region(points: Array, size: Size, seen: Array, region: Size) -> Array:
    """px (N, 2) of a picture to region px; seen (2, 2): the view coordinates of the region's two corners."""
    low, high = seen
    return (to_view(points, size) - low) / (high - low) * np.array(region)


def on_panorama(known: dict[str, Any], points: Array, others: Array | None = None) -> Array:
    """Reference px (N, 2) to px of a result's panorama. Where its viewpoint slides, depth decides: as px of the target
    that show the same, `others` (N, 2), have it, or else as the panorama has it nearby."""
    projection, viewpoint = projection_of(known), viewpoint_of(known)
    if projection is None:
        return project(homogeneous(points) @ matrix(known["geometry"]["S"]).T)
    cameras = cameras_of(known["geometry"])
    ideal = undistort(points, cameras[REFERENCE])
    if viewpoint is None:
        return projection.of_reference(ideal)
    q = homogeneous(ideal) @ np.linalg.inv(projection.K).T
    if others is None:
        d = _depth_nearby(known, projection, viewpoint, q)
    else:
        d = _depth_of_matches(known["geometry"], q, undistort(others, cameras[TARGET]))
    return projection.points(viewpoint.seen_from(q, d)[0])


def from_panorama(known: dict[str, Any], points: Array) -> Array:
    """px of the panorama (N, 2) to reference px: the inverse of `on_panorama`; NaN behind the reference camera."""
    projection, viewpoint = projection_of(known), viewpoint_of(known)
    if projection is None:
        return project(homogeneous(points) @ np.linalg.inv(matrix(known["geometry"]["S"])).T)
    seen = projection.rays(points)
    if viewpoint is not None:
        seen = _from_reference(viewpoint, seen, depth_at(known, points))
    seen = seen @ projection.K.T
    ahead = np.where(seen[:, 2:] > 1e-6, seen[:, 2:], np.nan)
    return distort(seen[:, :2] / ahead, cameras_of(known["geometry"])[REFERENCE])


def _from_reference(viewpoint: Viewpoint | RigViewpoint, rays: Array, d: Array) -> Array:
    """In which directions (N, 3), as long as 1/d is to be taken, the reference's place has what rays (N, 3) show."""
    directions: Array = rays + d[:, None] * viewpoint.place(rays)
    return directions


def depth_at(known: dict[str, Any], points: Array) -> Array:
    """The inverse depth (N,) that a panorama has at its node nearest to px (N, 2); 0 where it is not known."""
    grid, size = known["depth"], np.array(known["geometry"]["canvas"])
    nodes = np.array([int(grid["columns"]), int(grid["rows"])])
    column, row = np.rint(np.clip(points / np.maximum(size - 1, 1), 0, 1) * (nodes - 1)).astype(int).T
    d = np.nan_to_num(matrix(grid["inverse_depth"]).ravel()[row * nodes[0] + column])
    return np.maximum(d, 0.0)


def _depth_nearby(
    known: dict[str, Any], projection: Projection, viewpoint: Viewpoint | RigViewpoint, q: Array
) -> Array:
    """The inverse depth (N,) of what the reference shows in directions q (N, 3), z = 1, by the panorama's nodes."""
    grid, (width, height) = known["depth"], known["geometry"]["canvas"]
    x, y = np.linspace(0, width - 1, int(grid["columns"])), np.linspace(0, height - 1, int(grid["rows"]))
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    d = depth_at(known, nodes)
    seen = _from_reference(viewpoint, projection.rays(nodes), d)
    seen, d = seen[seen[:, 2] > 1e-6], d[seen[:, 2] > 1e-6]
    there, d = seen[:, :2] / seen[:, 2:], d / seen[:, 2]
    return np.array([d[np.linalg.norm(there - one, axis=1).argmin()] if len(d) else 0.0 for one in q[:, :2]])


def _depth_of_matches(geometry: dict[str, Any], q: Array, ideal: Array) -> Array:
    """The inverse depth d ≥ 0 (N,) at which K' (R q + d t) is nearest to ideal px (N, 2) of the target; q (N, 3)."""
    R, t, K_prime = (matrix(geometry[name]) for name in ("R", "t", "K_prime"))
    ray = homogeneous(ideal) @ np.linalg.inv(K_prime).T
    at_infinity, moved = np.cross(ray, q @ R.T), np.cross(ray, t)
    d = -(at_infinity * moved).sum(axis=-1) / np.maximum((moved * moved).sum(axis=-1), 1e-12)
    return np.maximum(d, 0.0)


def line_on_panorama(known: dict[str, Any], polyline: Array) -> NDArray[np.float32]:
    """An epipolar line, a polyline of reference px, as line segments (2·N, 2) of panorama px: bent where the panorama
    is round, and cut where that ends on one side and goes on on the other. Wherever between the two places a viewpoint
    stands, it sees the plane of that line in the same directions."""
    projection = projection_of(known)
    if projection is not None:
        at = np.linspace(0, len(polyline) - 1, _CURVE)
        polyline = np.stack([np.interp(at, np.arange(len(polyline)), polyline[:, axis]) for axis in (0, 1)], axis=-1)
        ideal = undistort(polyline, cameras_of(known["geometry"])[REFERENCE])
        points = projection.of_reference(ideal)
    else:
        points = on_panorama(known, polyline)
    pieces = segments(points).reshape(-1, 2, 2)
    width = known["geometry"]["canvas"][0]
    return pieces[np.abs(pieces[:, 1, 0] - pieces[:, 0, 0]) < width / 2].reshape(-1, 2)


def residual_colours(errors: Array, worst: float = WORST) -> Colours:
    """Colours (N, 4) of errors (N,) in px: RAMP from 0 to `worst`; gray where there is none (NaN)."""
    errors = np.asarray(errors, np.float64)
    at = np.clip(np.nan_to_num(errors) / worst, 0, 1) * (len(RAMP) - 1)
    channels = [np.interp(at, np.arange(len(RAMP)), RAMP[:, channel]) for channel in range(4)]
    return np.where(np.isnan(errors)[:, None], GRAY, np.stack(channels, axis=-1)).astype(np.float32)


def display_encoded(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Light (…, 4), alpha last and left alone, by the curve of sRGB (IEC 61966-2-1), clipped to what a screen shows."""
    light = np.clip(pixels[..., :3], 0, 1)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** np.float32(1 / 2.4) - 0.055)
    return np.concatenate([shown, pixels[..., 3:]], axis=-1).astype(np.float32)


def discs(centres: Array, radius: float, colours: Colours) -> tuple[NDArray[np.float32], Colours]:
    """Triangles (N·12·3, 2) that fill discs around centres (N, 2), and a colour for each of their corners."""
    angle = np.linspace(0, 2 * np.pi, _CORNERS + 1)
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    wedge = np.stack([np.zeros_like(rim[:-1]), rim[:-1], rim[1:]], axis=1).reshape(-1, 2)
    corners = centres[:, None] + wedge
    return corners.reshape(-1, 2).astype(np.float32), np.repeat(colours, len(wedge), axis=0)


def rings(centres: Array, radius: float) -> NDArray[np.float32]:
    """Line segments (N·12·2, 2), start and end alternating, of circles around centres (N, 2)."""
    angle = np.linspace(0, 2 * np.pi, _CORNERS + 1)
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    segments = np.stack([rim[:-1], rim[1:]], axis=1).reshape(-1, 2)
    return (centres[:, None] + segments).reshape(-1, 2).astype(np.float32)


def segments(polyline: Array) -> NDArray[np.float32]:
    """A polyline (N, 2) as line segments (2·(N − 1), 2), start and end alternating."""
    return np.stack([polyline[:-1], polyline[1:]], axis=1).reshape(-1, 2).astype(np.float32)


def places(report: dict[str, Any]) -> NDArray[np.float32]:
    """Line segments (8·N, 2) px around the places of a panorama at which its report's verdict says to look."""
    sides = [np.zeros((0, 2), np.float32)]
    for place in (report.get("verdict") or {}).get("places", ()):
        x, y, width, height = place["box"]
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]]) + (x - 0.5, y - 0.5)
        sides.append(segments(corners))
    return np.concatenate(sides)


def nearest(points: Array, at: Array, within: float) -> int | None:
    """Index of the point (N, 2) nearest to `at` (2,), or None if none lies within that many px."""
    if not len(points):
        return None
    distance = np.linalg.norm(points - at, axis=1)
    distance = np.where(np.isnan(distance), np.inf, distance)
    best = int(distance.argmin())
    return best if distance[best] <= within else None


def clipped(line: Array, size: Size) -> Array | None:
    """The two ends (2, 2) of the part of a line a·x + b·y + c = 0 inside a picture of `size` (W, H), or None."""
    a, b, c = (float(value) for value in line)
    if not np.isfinite([a, b, c]).all() or (a == 0 and b == 0):
        return None
    width, height = size
    low, high = np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
    # the point of the line nearest to the picture's middle, and the way along; a slab at a time (Liang and Barsky 1984)
    middle = (low + high) / 2
    normal = np.array([a, b]) / np.hypot(a, b)
    start = middle - normal * (normal @ middle + c / np.hypot(a, b))
    along = np.array([-normal[1], normal[0]])
    first, last = -np.inf, np.inf
    for axis in (0, 1):
        if abs(along[axis]) < 1e-12:
            if not low[axis] <= start[axis] <= high[axis]:
                return None
            continue
        ends = sorted(((low[axis] - start[axis]) / along[axis], (high[axis] - start[axis]) / along[axis]))
        first, last = max(first, ends[0]), min(last, ends[1])
    if first > last:
        return None
    return np.stack([start + first * along, start + last * along])


def has_lines(geometry: dict[str, Any]) -> bool:
    """Whether the model has epipolar lines: those of a rotation and of a plane without a pose do not."""
    F = matrix(geometry["F"])
    return bool(np.isfinite(F).all() and F.any())


def epipolar_lines(geometry: dict[str, Any], point: Array, side: str) -> dict[str, Array]:
    """The epipolar lines of a point (2,) in the picture `side`: in the other picture the line that its counterpart lies
    on, in its own the line through it, by side, as polylines (N, 2) px inside the pictures; lenses bend them.

    geometry: that of a result: F, K, K_prime, full_sizes, and the pictures' distortion where it is known.
    """
    if not has_lines(geometry):
        return {}
    F = matrix(geometry["F"])
    cameras = cameras_of(geometry)
    x = homogeneous(undistort(np.asarray(point, np.float64), cameras[side]))
    other = TARGET if side == REFERENCE else REFERENCE
    far = F @ x if side == REFERENCE else F.T @ x
    # through the point and the epipole, which is where all lines of the picture meet
    u, _, vt = np.linalg.svd(F)
    near = np.cross(vt[2] if side == REFERENCE else u[:, 2], x)
    found = {other: _bent(far, cameras[other]), side: _bent(near, cameras[side])}
    return {name: line for name, line in found.items() if line is not None}


def _bent(line: Array, camera: Camera) -> Array | None:
    """The part of a line of ideal px inside the picture, as a polyline of raw px."""
    if not camera.distortion.any():
        return clipped(line, camera.size)
    # ideal px reach further than the picture: clip generously, distort, and keep what falls inside
    width, height = camera.size
    margin = np.array([width, height]) * 0.5
    shift = np.array([line[0], line[1], line[2] - line[:2] @ margin])
    ends = clipped(shift, (2 * width, 2 * height))
    if ends is None:
        return None
    share = np.linspace(0, 1, _CURVE)[:, None]
    raw = distort(ends[0] - margin + share * (ends[1] - ends[0]), camera)
    inside = ((raw >= -0.5) & (raw <= np.array(camera.size) - 0.5)).all(axis=1)
    return raw[inside] if inside.sum() > 1 else None


def cameras_of(geometry: dict[str, Any]) -> dict[str, Camera]:
    """The cameras of a result's pictures, by side."""
    sizes = [tuple(int(side) for side in size) for size in geometry["full_sizes"]]
    found = {}
    for name, K, dist, size in (
        (REFERENCE, "K", "distortion", sizes[0]), (TARGET, "K_prime", "distortion_prime", sizes[1]),
    ):  # fmt: skip
        known = geometry.get(dist)
        bend = np.zeros(5) if known is None else np.nan_to_num(matrix(known))
        found[name] = Camera(matrix(geometry[K]), (size[0], size[1]), "", 0.0, bend)
    return found


def upright(points: Array, stored: Size, orientation: int) -> Array:
    """px (N, 2) of a picture as it is stored, `stored` (W, H), to px of the upright one; orientation 1..8 as in EXIF
    (see core.decoding.turn)."""
    width, height = stored
    x, y = points[..., 0], points[..., 1]
    if orientation >= 5:
        x, y, width, height = y, x, height, width
    x = width - 1 - x if orientation in (2, 3, 6, 7) else x
    y = height - 1 - y if orientation in (3, 4, 7, 8) else y
    return np.stack([x, y], axis=-1)


def as_stored(points: Array, stored: Size, orientation: int) -> Array:
    """The inverse of `upright`."""
    width, height = stored if orientation < 5 else stored[::-1]
    x, y = points[..., 0], points[..., 1]
    x = width - 1 - x if orientation in (2, 3, 6, 7) else x
    y = height - 1 - y if orientation in (3, 4, 7, 8) else y
    return np.stack([y, x] if orientation >= 5 else [x, y], axis=-1)
