"""A finished panorama, and everything it was made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.edge import Edge
from ..cameras.matches import Matches
from ..cameras.rig import Rig
from ..cameras.scale import Scale
from ..cameras.view import View
from ..field.field import Field
from ..field.sphere_field import SphereField
from ..panorama.canvas import Canvas
from ..panorama.layers import Layer, layer_of
from ..panorama.warp import Warp
from ..pictures.picture import Picture
from ..raster.arrays import Box, cut
from ..raster.enlarging import EnlargedImage
from ..raster.lazy import AnyImage, Placed
from ..raster.picture_map import CanvasMap
from ..raster.resizing import resized_points
from .decided import Decided
from .enlarging.enlarged import EnlargedPanorama, enlarged_map


@dataclass(frozen=True)
class StitchResult:
    """A finished panorama and everything it was made of.

    Tuples hold one entry for each picture that is used, the reference first: of many, the viewpoint's. Scale and crop
    are done: px are those of the panorama, and of the pictures as they were worked on. `warp`, `layers`, `occluded`,
    `labels`, `inpainted` and `decided` lie on `warp.canvas` (H, W). That is `canvas`, but of a whole sphere only the
    part that the pictures cover (see `spread`), and of a large set a draft of it: one of its px is `times` px of the
    panorama a side, and `full_layer`, `full_map` and `full_labels` enlarge what lies on it.

    Attributes
    ----------
    panorama : Layer
        What `canvas` shows. Its light is a lazy image, worked out where it is asked for.
    canvas : Canvas
        Size and place of the panorama.
    pictures : tuple of Picture
        As they were worked on: scaled, and without what was masked.
    layers : tuple of Layer
        Each picture on the canvas, before exposure and blending.
    warp : Warp
        The maps from the canvas to each picture, with inverse depth and confidence.
    occluded : tuple of ndarray (H, W) bool
        What a picture cannot see though its map falls inside it.
    labels : ndarray (H, W) int16 or None
        Which picture a pixel comes from, −1 for none; None without a seam.
    inpainted : ndarray (H, W) bool
        What no picture shows and was filled.
    decided : tuple of Decided
        What was decided about each picture, on the uncropped canvas.
    edges : tuple of Edge
        Pairs of pictures with their geometry and all matches, before inliers were chosen.
    views : tuple of View
        Each picture's place relative to the reference.
    field : Field or SphereField
        The displacement field.
    cameras : tuple of Camera
        As they were known before estimation; of more than two pictures, as they were estimated.
    rig : Rig or None
        The cameras and points of more than two pictures.
    scale : Scale
        How long a baseline is, the unit of depth.
    warnings : tuple of str
        In plain words.
    report : dict
        What was measured and decided, JSON-ready (docs/formats.md).
    seconds : dict of float
        Wall time of each stage, s.
    full_sizes : tuple of (W, H)
        px of the pictures as they came.
    enlarged : EnlargedPanorama or None
        Of a large set: what makes a full panorama of what was decided on small pictures.
    """

    panorama: Layer
    canvas: Canvas
    pictures: tuple[Picture, ...]
    layers: tuple[Layer, ...]
    warp: Warp
    occluded: tuple[NDArray[np.bool_], ...]
    labels: NDArray[np.int16] | None
    inpainted: NDArray[np.bool_]
    decided: tuple[Decided, ...]
    edges: tuple[Edge, ...]
    views: tuple[View, ...]
    field: Field | SphereField
    cameras: tuple[Camera, ...]
    warnings: tuple[str, ...]
    report: dict[str, Any]
    seconds: dict[str, float]
    full_sizes: tuple[tuple[int, int], ...]
    rig: Rig | None = None
    scale: Scale = Scale()
    enlarged: EnlargedPanorama | None = None

    @property
    def times(self) -> int:
        """How many px of the panorama lie along one of `warp.canvas`."""
        return 1 if self.enlarged is None else self.enlarged.draft.times

    @property
    def pixels(self) -> NDArray[np.float32]:
        """The panorama's colours (H, W, C) float32, scene-linear."""
        return self.panorama.pixels

    @property
    def alpha(self) -> NDArray[np.float32]:
        """The panorama's alpha (H, W) float32, straight."""
        return self.panorama.alpha.astype(np.float32)

    @property
    def pair_field(self) -> Field:
        """The displacement field of a pair."""
        assert not isinstance(self.field, SphereField)
        return self.field

    @property
    def full_matches(self) -> Matches:
        """All matches of a pair, before any was left out, in px of the full pictures."""
        return self.matches_of(self.edges[0])

    def matches_of(self, edge: Edge) -> Matches:
        """The same of one of its edges."""
        matches = edge.matches
        sides = zip((matches.x, matches.y), edge.pair(self.cameras), edge.pair(self.full_sizes), strict=True)
        x, y = (resized_points(points, camera.size, full) for points, camera, full in sides)
        return replace(matches, x=x, y=y)

    @property
    def used_matches(self) -> Matches:
        """The matches of a pair that the field stands on, in px of the full pictures."""
        return self.full_matches.subset(self.used)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which of all matches of a pair the field stands on (N,), bool."""
        return self.used_of(self.edges[0])

    def used_of(self, edge: Edge) -> NDArray[np.bool_]:
        """The same of one of its edges; of more than two pictures, which are points of the rig."""
        inliers = edge.two_view.inliers
        if isinstance(self.field, SphereField):
            return inliers
        used = np.zeros(len(inliers), bool)
        used[np.flatnonzero(inliers)[self.field.fit.inliers_used]] = True
        return used

    @property
    def spread(self) -> Box:
        """The panorama's box on the canvas of warp and layers, in px of the panorama; it may reach beyond that."""
        (x, y), (left, top) = self.warp.canvas.offset, self.canvas.offset
        return self.times * x - left, self.times * y - top, self.canvas.width, self.canvas.height

    def full_map(self, number: int) -> CanvasMap:
        """Where the canvas of `warp`, in px of the panorama, shows a picture."""
        one = self.warp.maps[number]
        if self.enlarged is None:
            return one
        height, width = self.pictures[number].light.shape[:2]
        return enlarged_map(one, self.times, (width, height))

    def full_layer(self, number: int) -> Layer:
        """A picture on the canvas of `warp`, in px of the panorama."""
        if self.enlarged is None:
            return self.layers[number]
        return layer_of(self.pictures[number], self.full_map(number), by_root=True)

    def in_full(self, values: AnyImage, beyond: float) -> AnyImage:
        """Values (h, w) of the canvas of `warp` at each pixel of the panorama, of a large set bilinear; beyond that
        canvas a constant."""
        left, top, width, height = self.spread
        values = values if self.times == 1 else EnlargedImage(values, self.times)
        return Placed(values, (-top, -left), (height, width), beyond)

    def full_labels(self) -> NDArray[np.int16] | None:
        """Which picture each pixel of the panorama comes from, −1 for none; None without a seam."""
        if self.labels is None:
            return None
        if self.enlarged is None:
            return cut(self.labels, self.spread, -1)
        x, y = np.subtract(self.enlarged.canvas.offset, self.canvas.offset).tolist()
        return cut(self.enlarged.labels(), (x, y, self.canvas.width, self.canvas.height), -1)

    def spread_out(self) -> StitchResult:
        """The same with warp, layers and masks as large as the panorama."""
        if (self.canvas.width, self.canvas.height) == (self.warp.canvas.width, self.warp.canvas.height):
            return self
        box = self.spread
        return replace(
            self, warp=self.warp.within(box), layers=tuple(layer.within(box) for layer in self.layers),
            occluded=tuple(cut(mask, box) for mask in self.occluded),
            labels=None if self.labels is None else cut(self.labels, box, -1), inpainted=cut(self.inpainted, box),
        )  # fmt: skip

    @property
    def confidence(self) -> NDArray[np.float32]:
        """Confidence (H, W) float32 of dense refinement on the warp's canvas, 0 to 1; 0 where nothing was refined."""
        confidence = self.warp.confidence
        shape = self.warp.canvas.height, self.warp.canvas.width
        return np.zeros(shape, np.float32) if confidence is None else confidence

    @property
    def bits(self) -> int:
        """Bits per channel of the deepest input (32: float)."""
        return max(picture.bits for picture in self.pictures)
