"""Whether pictures show at each pixel of a panorama what lies on its ray, from wherever the viewpoint slides to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import homogeneous, project
from ..core.pipeline import StitchResult
from ..core.raster.arrays import Array
from .ground_truth import inverse_depth_at, visible
from .measures import Truth
from .rendered import RenderedPair
from .scene_camera import SceneCamera
from .sets.bent_lens import bent, straightened

# 1/m: what is farther away counts as being that far, and has no parallax.
LEAST_INVERSE = 1e-6
# Canvas pixels from one that is asked to the next: neighbours say the same.
STEP = 2


@dataclass(frozen=True, eq=False)
class CanvasRays:
    """Every STEP-th pixel of a round panorama's canvas in the world: rays (H, W, 3) of length 1 and the places
    (H, W, 3), m, from which they are seen."""

    rays: Array
    places: Array

    @staticmethod
    def of(result: StitchResult, to_world: Array, first: Array, unit: float) -> CanvasRays:
        """to_world (3, 3): from the first picture's directions to the world's, as v @ to_world; first (3,): its place
        there; unit: metres to the stitch's unit."""
        canvas, viewpoint = result.warp.canvas, result.warp.viewpoint
        assert canvas.projection is not None
        rays = canvas.projection.rays(np.stack(np.meshgrid(canvas.xs[::STEP], canvas.ys[::STEP]), axis=-1))
        moved = np.zeros_like(rays) if viewpoint is None else viewpoint.place(rays)
        return CanvasRays(rays @ to_world, first + unit * moved @ to_world)


@dataclass(frozen=True, eq=False)
class Beside:
    """How far beside their rays things are that a picture shows, px of that picture; NaN (H, W) where it shows none;
    things (H, W, 3): where they are."""

    px: Array
    things: Array


def beside_rays(result: StitchResult, number: int, camera: SceneCamera, depth: NDArray, canvas: CanvasRays) -> Beside:
    """Of one picture, by its true camera and depths (H, W). Each ray's true point C + r / d is the one on it that is
    nearest to the thing."""
    found = result.warp.maps[number].arrays()
    shown = (found.inside() & ~result.occluded[number])[::STEP, ::STEP]
    x, y = found.x[::STEP, ::STEP][shown], found.y[::STEP, ::STEP][shown]
    inverse = np.maximum(inverse_depth_at(depth, x, y), LEAST_INVERSE)
    raw = np.stack([x, y], axis=-1).astype(np.float64)
    rays = homogeneous(straightened(raw, camera)) @ np.linalg.inv(camera.K).T @ camera.R
    things = camera.place + rays / inverse[:, None]
    ray, place = canvas.rays[shown], canvas.places[shown]
    on_ray = place + ((things - place) * ray).sum(axis=1)[:, None] * ray
    px, where = np.full(shown.shape, np.nan), np.full((*shown.shape, 3), np.nan)
    px[shown], where[shown] = np.linalg.norm(seen_at(camera, on_ray) - raw, axis=1), things
    return Beside(px, where)


def seen_at(camera: SceneCamera, points: Array) -> Array:
    """Pixels (…, 2) at which a camera sees points (…, 3); NaN behind it."""
    seen = (points @ camera.R.T + camera.t) @ camera.K.T
    return bent(project(np.where(seen[..., 2:] > 0, seen, np.nan)), camera)


def sees(camera: SceneCamera, depth: NDArray, points: Array) -> NDArray[np.bool_]:
    """Which points (…, 3) a camera really sees."""
    return visible(seen_at(camera, points), (points @ camera.R.T + camera.t)[..., 2], depth)


def pair_beside_rays(result: StitchResult, pair: RenderedPair, truth: Truth) -> dict[str, float]:
    """reference_px, reference_p95_px, target_px, target_p95_px: how far beside their rays what each picture shows lies
    (median, 95th percentile), where the other camera sees it too. Of a stitch whose K is known."""
    reference, target = pair.cameras["reference"], pair.cameras["target"]
    canvas = CanvasRays.of(result, reference.R, reference.place, truth.geometry.baseline)
    rows, columns = pair.frame
    cameras, depths = (reference, target), (pair.wide_depth[rows, columns], pair.target_depth)
    out = {}
    for number, name in enumerate(("reference", "target")):
        off = beside_rays(result, number, cameras[number], depths[number], canvas)
        px = off.px[sees(cameras[1 - number], depths[1 - number], off.things) & np.isfinite(off.px)]
        for key, share in ((f"{name}_px", 50), (f"{name}_p95_px", 95)):
            out[key] = float(np.percentile(px, share)) if px.size else float("nan")
    return out
