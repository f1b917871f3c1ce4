"""The maps of a panorama where its depth is taken to be another than what was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.view import View
from ..field.transfer import transfer
from ..raster.arrays import Array, Plane, bounds
from ..raster.lazy import AnyImage, LazyImage, Placed, whole
from ..raster.picture_map import CanvasMap, PictureMap
from .canvas import Canvas
from .depth import Confidence
from .reference_map import ReferenceMap
from .viewpoint import Viewpoint
from .warp import Warp


def every_nth(warp: Warp, step: int) -> Warp:
    """A warp of every `step`-th column and row of its canvas; all it has are arrays.

    step 1: the warp itself, where it has no others.
    """
    lazy = (warp.depth, warp.lazy_confidence, warp.slide, *warp.maps)
    if step == 1 and not any(isinstance(one, LazyImage | ReferenceMap) for one in lazy):
        return warp
    first = step // 2
    here = (slice(first, None, step), slice(first, None, step))
    height, width = (len(range(first, side, step)) for side in (warp.canvas.height, warp.canvas.width))
    offset = (warp.canvas.offset[0] - first, warp.canvas.offset[1] - first)
    coarse = replace(warp.canvas, width=width, height=height, offset=offset, step=step)
    maps = (
        PictureMap(one.x[here].copy(), one.y[here].copy(), one.size) for one in (one.arrays() for one in warp.maps)
    )
    return replace(
        warp, canvas=coarse,
        maps=tuple(maps),
        depth=np.ascontiguousarray(warp.inverse_depth[here]),
        lazy_confidence=None if warp.lazy_confidence is None else _confidence(warp.lazy_confidence, coarse, here),
        slide=None if warp.slide is None else np.ascontiguousarray(whole(warp.slide)[here]),
        behind=None if warp.behind is None else warp.behind[here],
        refilled=None if warp.refilled is None else warp.refilled[here], beside=None,
    )  # fmt: skip


def _confidence(image: AnyImage, canvas: Canvas, here: tuple[slice, slice]) -> Plane:
    """Confidence on a coarser canvas, worked out for it alone where that can be; else every so many pixels of it."""
    inner = image
    while isinstance(inner, Placed):
        inner = inner.light
    return whole(replace(inner, canvas=canvas)) if isinstance(inner, Confidence) else whole(image)[here].copy()


def with_depth(warp: Warp, views: Sequence[View], depth: Plane, where: NDArray[np.bool_]) -> Warp:
    """A warp with another inverse depth in some pixels, where nothing counts as hidden any more.

    Parameters
    ----------
    warp : Warp
    views : sequence of View
        What is known of the pictures, the reference first.
    depth : (H, W) float32 array
        Inverse depth from each pixel's viewpoint.
    where : (H, W) bool array
        The pixels that take it.

    Returns
    -------
    Warp
        What its pictures show beside their epipolar lines stays.
    """
    box = bounds(where)
    if box is None:
        return warp
    here = where[box]
    maps: list[CanvasMap] = []
    for number, one in enumerate(warp.maps):
        if number == 0 and warp.slide is None:  # seen from its own place the reference only turns
            maps.append(one)
            continue
        old, new = (seen_at(warp, views, number, box, d[box]) for d in (warp.inverse_depth, depth))
        values = one.arrays()
        x, y = values.x.copy(), values.y.copy()
        for out, before, after in zip((x, y), old, new, strict=True):
            out[box] = np.where(here, out[box] + (after - before), out[box])
        maps.append(PictureMap(x, y, one.size))
    behind = None if warp.behind is None else warp.behind & ~where
    refilled = where if warp.refilled is None else where | warp.refilled
    deeper = np.where(where, depth, warp.inverse_depth)
    return replace(warp, maps=tuple(maps), depth=deeper, behind=behind, refilled=refilled)


def seen_at(
    warp: Warp, views: Sequence[View], number: int, box: tuple[slice, slice], depth: Plane
) -> tuple[Array, Array]:
    """Raw px x, y (h, w) of a picture that rows and columns of the canvas show at inverse depth (h, w)."""
    view, reference = views[number], views[0]
    d = depth.astype(np.float64)
    seen = warp.canvas.project_rows(
        view.H_inf, warp.canvas.xs[box[1]], warp.canvas.ys[box[0]], reference.camera
    )
    if warp.slide is not None and isinstance(warp.viewpoint, Viewpoint):
        moved = d * np.asarray(warp.slide[box], np.float64)
        seen = [part + moved * k for part, k in zip(seen, view.H_inf @ reference.K @ warp.viewpoint.c, strict=True)]
    x, y = transfer(view, seen, d)
    if not view.camera.bent:
        return x, y
    raw = distort(np.stack([x, y], axis=-1), view.camera)
    return raw[..., 0], raw[..., 1]
