"""Pictures on the canvas: pasted, or fetched through a map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Box, Part, bounds, cut, shown_only
from ..raster.lazy import AnyImage, Held, LazyImage, Placed, Rooted, SideBySide, Weighed, extent, part_of, whole
from ..raster.picture_map import BoxedMap, CanvasMap, PictureMap
from ..raster.sampling import fetch
from .options import LAYER
from .reference_map import ReferenceMap

if TYPE_CHECKING:
    from ..pictures.picture import Picture


@dataclass(frozen=True)
class Layer:
    """One picture on the canvas.

    Attributes
    ----------
    light : (H, W, C) image
        Scene-linear, float32: an array, or worked out where it is read (see `raster.lazy`).
    alpha : (H, W) array
        Straight alpha in [0, 1], float32, or bool where nothing is translucent; 0 where the picture shows nothing.
    clips_at : float
        Light from which it is clipped, of camera RAW; see `Picture`.
    """

    light: AnyImage
    alpha: NDArray[np.float32] | NDArray[np.bool_]
    clips_at: float = float("inf")

    @property
    def pixels(self) -> NDArray[np.float32]:
        """All of its light as an array."""
        return whole(self.light)

    @property
    def shows(self) -> NDArray[np.bool_]:
        """Where (H, W) it shows anything: its alpha itself if that is bool."""
        return self.alpha.astype(bool, copy=False) if self.alpha.dtype == bool else self.alpha > 0

    def within(self, box: Box) -> Layer:
        """The part in a box (left, top, width, height) of the canvas; nothing where that reaches over its edges."""
        left, top, width, height = box
        if (left, top, height, width) == (0, 0, *self.alpha.shape):
            return self
        return replace(self, light=Placed(self.light, (-top, -left), (height, width)), alpha=cut(self.alpha, box))

    def keep(self, part: Part) -> Layer:
        """The same layer with the light of a part kept as an array, for parts that are read more than once."""
        return replace(self, light=Held(self.light, (part[0].start, part[1].start), part_of(self.light, part)))


def layer_of(picture: Picture, picture_map: CanvasMap, by_root: bool = False, hold: bool = True) -> Layer:
    """Put a picture on the canvas.

    Parameters
    ----------
    picture : Picture
    picture_map : CanvasMap
        Where it is seen on the canvas.
    by_root : bool
        Whether to interpolate the square root of its light (see `Fetched`).
    hold : bool
        Whether what is small is fetched once and kept; else it is fetched wherever it is read: the same bits.

    Returns
    -------
    Layer
        Pasted pixel for pixel where the canvas is the picture's own plane, else resampled; alpha 0 outside it.
    """
    if isinstance(picture_map, ReferenceMap):
        return _pasted_layer(picture, picture_map)
    if isinstance(picture_map, BoxedMap):
        parts = [
            _fetched_layer(picture, part.inner, by_root, hold).within(part.canvas_box(picture_map.shape))
            for part in picture_map.parts
        ]
        if len(parts) == 1:
            return parts[0]
        left, right = parts
        light = SideBySide(left.light, right.light, picture_map.parts[1].corner[0])
        return Layer(light, np.maximum(left.alpha, right.alpha), picture.clips_at)
    return _fetched_layer(picture, picture_map.arrays(), by_root, hold)


def _pasted_layer(picture: Picture, picture_map: ReferenceMap) -> Layer:
    """The reference on a flat canvas, which holds all of it."""
    height, width, _ = picture.light.shape
    canvas = picture_map.canvas
    x, y = canvas.offset
    alpha = np.zeros((canvas.height, canvas.width), bool if picture.alpha is None else np.float32)
    alpha[y : y + height, x : x + width] = True if picture.alpha is None else picture.alpha
    return Layer(Placed(picture.light, (y, x), (canvas.height, canvas.width)), alpha, picture.clips_at)


def _fetched_layer(picture: Picture, picture_map: PictureMap, by_root: bool, hold: bool) -> Layer:
    """A picture resampled through a map (H, W) of its raw pixels."""
    map_x, map_y, inside = picture_map.x, picture_map.y, picture_map.inside()
    channels = picture.light.shape[2]
    box = bounds(inside)
    if box is None:
        return Layer(np.broadcast_to(np.float32(0), (*inside.shape, channels)), inside)
    fetched, alpha = Fetched.of(picture, map_x[box], map_y[box], inside[box], by_root)
    # exposure, seam, blending and the report all read it: what is small is fetched once
    light = whole(fetched) if hold and np.prod(fetched.shape) <= LAYER.held_values else fetched
    placed = Placed(light, (box[0].start, box[1].start), (inside.shape[0], inside.shape[1]))
    if picture.alpha is None:
        return Layer(placed, inside, picture.clips_at)
    whole_alpha = np.zeros(inside.shape, np.float32)
    whole_alpha[box] = alpha
    return Layer(placed, whole_alpha, picture.clips_at)


@dataclass(frozen=True, eq=False)
class Fetched(LazyImage):
    """A picture (h, w, C) through a map of its raw pixels (H, W), bicubic in float.

    Colours are weighted by alpha while interpolating, so that transparent pixels never bleed. Overshoot is clipped to
    the picture's own range, so that a black edge never turns negative. shows (H, W): where it shows anything; by_root:
    interpolates the square root of scene-linear light rather than that itself, whose overshoot leaves dark outlines
    beside bright things. Half a pixel between two pixels is 1 dB closer to the truth by it.
    """

    picture: Picture
    map_x: NDArray[np.float32]
    map_y: NDArray[np.float32]
    shows: NDArray[np.bool_]
    range: tuple[float, float]
    by_root: bool

    @staticmethod
    def of(
        picture: Picture, map_x: NDArray[np.float32], map_y: NDArray[np.float32], inside: NDArray[np.bool_],
        by_root: bool, limits: tuple[float, float] | None = None,
    ) -> tuple[Fetched, NDArray[np.float32] | NDArray[np.bool_]]:  # fmt: skip
        """A picture through a map, and its alpha (H, W); inside (H, W): where the map falls inside the picture; limits:
        the picture's `range`, if it is known."""
        alpha: NDArray[Any] = inside
        if picture.alpha is not None:
            fetched = fetch(picture.alpha[..., None], map_x, map_y)[..., 0]
            alpha = inside * np.where(fetched > LAYER.min_alpha, np.minimum(fetched, 1.0), np.float32(0))
        shows = inside if picture.alpha is None else alpha > 0
        limits = extent(picture.light) if limits is None else limits
        return Fetched(picture, map_x, map_y, shows, limits, by_root), alpha

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return *self.map_x.shape, self.picture.light.shape[2]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        alpha, shows = self.picture.alpha, self.shows[part]
        if not shows.any():
            return np.zeros((*shows.shape, self.shape[2]), np.float32)
        map_x, map_y = self.map_x[part], self.map_y[part]
        light = Rooted(self.picture.light) if self.by_root else self.picture.light
        pixels = fetch(light if alpha is None else Weighed(light, alpha), map_x, map_y)
        if alpha is not None:
            # divided before alpha is clipped, since both overshoot alike
            pixels /= np.maximum(fetch(alpha[..., None], map_x, map_y)[..., 0], LAYER.min_alpha)[..., None]
        if self.by_root:
            pixels *= np.abs(pixels)
        np.clip(pixels, *self.range, out=pixels)
        return pixels if shows.all() else shown_only(pixels, shows)
