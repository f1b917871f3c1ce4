"""Options of a flat panorama; warps and results of two pictures, made or changed by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from edf_stitch.core.alignment import Alignment
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.reference_map import ReferenceMap
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.raster.picture_map import PictureMap

# The reference's own plane, whole, where what holds for single pixels of the reference can be asked; in words as well.
ON_REFERENCE = StitchOptions(
    projection="reference", slide=0.0, fade="plane", crop="full", holes="transparent", exposure="reference"
)  # fmt: skip
REFERENCE_WORDS = (
    "--projection", "reference", "--fade", "plane", "--crop", "full", "--holes", "transparent", "--exposure",
    "reference",
)  # fmt: skip
# What the small pair's fixture `known` says, in words.
KNOWN_WORDS = ("--focal-px", "228", *REFERENCE_WORDS)

Aligned = TypeVar("Aligned", Alignment, StitchResult)


def own_map(canvas: Canvas, camera: Camera) -> PictureMap:
    """Where the reference is seen on a canvas that is not its own plane, from its own place."""
    places = canvas.on_reference(canvas.xs, canvas.ys, camera)[0].astype(np.float32)
    return PictureMap(places[..., 0], places[..., 1], camera.size)


def warp_of(
    canvas: Canvas, x: np.ndarray, y: np.ndarray, depth: np.ndarray | None = None, *,
    size: tuple[int, int] | None = None, reference: tuple[int, int] | None = None,
) -> Warp:  # fmt: skip
    """A flat warp by the target's map x, y (H, W); size, reference: (W, H) of the pictures, the canvas's by default."""
    own = canvas.width, canvas.height
    camera = Camera(np.eye(3), reference or own, "test", 0.0)
    maps = ReferenceMap(canvas, camera), PictureMap(x.astype(np.float32), y.astype(np.float32), size or own)
    return Warp(canvas, maps, np.zeros(x.shape, np.float32) if depth is None else depth)


def with_map(warp: Warp, x: np.ndarray | None = None, y: np.ndarray | None = None) -> Warp:
    """The warp with another x or y of the target's map."""
    old = warp.maps[1].arrays()
    new = replace(old, x=old.x if x is None else x, y=old.y if y is None else y)
    return replace(warp, maps=(warp.maps[0], new))


def with_two_view(aligned: Aligned, two_view: TwoView) -> Aligned:
    """The alignment or result with another geometry of its pair."""
    edge = replace(aligned.edges[0], two_view=two_view)
    return replace(aligned, edges=(edge,), views=views_of(two_view, aligned.cameras))
