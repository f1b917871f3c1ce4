"""A rendered set and a stitch of it without anything wrong, made at once of the room in `analytic_room`."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.panorama.rig_viewpoint import RigViewpoint
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet
from edf_stitch.synthetic_scenes.sets.set_measures import SetTruth
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera
from edf_stitch.synthetic_scenes.sets.sphere_truth import seen_by

from .analytic_room import camera_passes, hit, lines, passes_along, sphere_passes

VIEWS = (View(lens=24.0), View((0.4, 0.1, 1.4), 24.0, 5.0, 3.0, 24.0), View((-0.3, 0.2, 1.6), -26.0, -4.0, 2.0, 24.0))
FOCAL = 90.0
# From the world, z up, to the stitch's axes, y down and z ahead, a little turned.
TURN = rotation_from_vector(np.array([0.05, -0.3, 0.1])) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def analytic_truth() -> SetTruth:
    """Three pictures of the room."""
    cameras = tuple(view.camera((120, 90)) for view in VIEWS)
    sphere = SphereCamera(cameras[0].place, (480, 240))
    seen = sphere_passes(sphere)
    passes = [camera_passes(camera) for camera in cameras]
    depths, things = tuple(one.depth for one in passes), tuple(one.things for one in (*passes, seen))
    names = tuple(Path(f"{number:02d}.png") for number in range(3))
    rendered = RenderedSet(names, cameras, depths, sphere, seen.light, seen.depth, {}, "", things, lines())
    return SetTruth.of(rendered)


def perfect(
    truth: SetTruth, unit: float = 0.5, numbers: tuple[int, ...] = (0, 1, 2), aside: tuple[float, ...] = (0, 0, 0)
) -> Any:
    """What stitching would give if nothing were wrong: the world turned, in its own unit, on the whole sphere, seen
    from a place so many metres aside of the first picture's."""
    cameras = [truth.rendered.cameras[number] for number in numbers]
    first = truth.rendered.sphere.place
    place = first + np.array(aside)
    projection = Projection("equirectangular", FOCAL, (0.0, 0.0), np.eye(3), cameras[0].K)
    left, top, width, height = projection.sphere or (0, 0, 0, 0)
    x, y = np.meshgrid(np.arange(width) + left, np.arange(height) + top)
    directions = projection.rays(np.stack([x, y], axis=-1).astype(float)) @ TURN
    away = hit(place, directions)
    maps = []
    for camera in cameras:
        pixels, _ = seen_by(camera, SphereCamera(place, truth.rendered.sphere.size), directions, away)
        maps.append(PictureMap(*np.moveaxis(pixels.astype(np.float32), -1, 0), camera.size))
    R = np.array([camera.R @ TURN.T for camera in cameras])
    t = np.array([camera.R @ first + camera.t for camera in cameras]) / unit
    known = tuple(Camera(camera.K, camera.size, "", 0.0) for camera in cameras)
    centres = -np.einsum("nji,nj->ni", R, t)
    parts = dict(R=R, t=t, centres=centres, cameras=known, stations=(), edges=())
    rig = type("Rig", (), {**parts, "__len__": lambda _: len(numbers)})()
    deviation = np.where(np.arange(width) < width // 2, 0.01, 0.02)[None].repeat(height, axis=0)
    canvas = Canvas(width, height, (-left, -top), projection=projection)
    viewpoint = RigViewpoint(0.5, np.eye(3), np.tile(2 * TURN @ np.array(aside) / unit, (8, 1)))
    inside = [np.isfinite(one.x) & (one.x >= 0) & (one.y >= 0) & (one.x <= 119) & (one.y <= 89) for one in maps]
    labels = np.where(np.any(inside, axis=0), np.argmax(inside, axis=0), -1).astype(np.int16)
    return SimpleNamespace(
        rig=rig, canvas=canvas, occluded=[np.zeros((height, width), bool) for _ in numbers],
        warp=SimpleNamespace(
            maps=maps, canvas=canvas, inverse_depth=unit / away, deviation=deviation, viewpoint=viewpoint,
            confidence=np.ones(away.shape, np.float32),
        ),
        labels=labels, alpha=np.ones(away.shape, np.float32),
        pixels=passes_along(place, directions, np.ones(away.shape)).light,
        pictures=[SimpleNamespace(name=f"{number:02d}.png") for number in numbers],
    )  # fmt: skip
