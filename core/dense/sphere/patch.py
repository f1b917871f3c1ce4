"""Part of a chart of the sphere, and where pictures see its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.lens import distort, undistort
from ...cameras.view import View
from ...field.sphere_chart import SphereChart
from ...raster.arrays import Array, Plane
from ...raster.coarse import coarse_places, in_between
from .options import CHART

if TYPE_CHECKING:
    from ...pictures.picture import Picture

# px of what lies nowhere: far beyond any picture, and small enough to be interpolated.
NOWHERE = -1e4


@dataclass(frozen=True, eq=False)
class Patch:
    """Nodes (h, w) of a chart, from row `top` and column `left` on; columns may run over the ends of a closed one."""

    chart: SphereChart
    top: int
    left: int
    shape: tuple[int, int]

    @cached_property
    def coarse_rays(self) -> Array:
        """Unit rays (m, n, 3) at the centres of cells of `coarse_step` nodes a side, and one cell around."""
        columns, rows = coarse_places(self.shape, CHART.coarse_step)
        return self.chart.rays(rows + self.top, columns + self.left)

    def between(self, coarse: Array) -> list[Plane]:
        """k planes (h, w) of values (m, n, k) at the same places."""
        return in_between(self.shape, coarse, CHART.coarse_step)

    def of_chart(self, values: NDArray[Any], margin: int = 0, times: int = 1) -> NDArray[Any]:
        """Values (H, W) of all nodes of the chart, or of one with so many times fewer a side, at those of the patch and
        a margin around it."""
        height, width = self.shape
        rows = np.clip(np.arange(self.top - margin, self.top + height + margin) // times, 0, len(values) - 1)
        columns = np.arange(self.left - margin, self.left + width + margin) // times
        columns = columns % values.shape[1] if self.chart.closed else np.clip(columns, 0, values.shape[1] - 1)
        here: NDArray[Any] = values[rows[:, None], columns]
        return here

    def at_coarse(self, values: Plane, margin: int) -> Array:
        """Values (h + 2 margin, w + 2 margin) of the patch and a margin, at the coarse places (m, n)."""
        columns, rows = coarse_places(self.shape, CHART.coarse_step)
        x, y = np.meshgrid((columns + margin).astype(np.float32), (rows + margin).astype(np.float32))
        at: Array = cv2.remap(values, x, y, cv2.INTER_LINEAR).astype(np.float64)
        return at


@dataclass(frozen=True, eq=False)
class SweptPicture:
    """A picture as a camera without distortion would see it, perhaps shrunk: colours, and 255 where it shows
    something, (h, w, 4) uint8; corner: of the picture's plane, px, at the first pixel's outer corner; scale: its px,
    across and down, for each px of that plane."""

    number: int
    view: View
    levels: NDArray[np.uint8]
    corner: tuple[float, float]
    scale: tuple[float, float]

    @staticmethod
    def of(number: int, view: View, picture: Picture, per_radian: float) -> SweptPicture:
        """A picture at no more px per radian than a chart has nodes."""
        colours = picture.view if picture.view.shape[2] == 3 else cv2.merge([picture.view[..., 0]] * 3)
        shown = np.full(colours.shape[:2], 255, np.uint8)
        if picture.alpha is not None:
            shown[picture.alpha <= 0] = 0
        levels, corner = np.dstack([colours, shown]), (0.0, 0.0)
        if view.camera.bent:
            levels, corner = _without_lens(levels, view)
        height, width = levels.shape[:2]
        shrink = min(1.0, per_radian / view.camera.focal)
        if shrink < 1:
            small = max(1, round(width * shrink)), max(1, round(height * shrink))
            levels = cv2.resize(levels, small, interpolation=cv2.INTER_AREA)
        return SweptPicture(number, view, levels, corner, (levels.shape[1] / width, levels.shape[0] / height))

    @property
    def place(self) -> Array:
        """Where it was taken (3,)."""
        place: Array = -self.view.R.T @ self.view.t
        return place

    def placed(self, k: int, at: NDArray[Any]) -> NDArray[Any]:
        """px (…) across (k = 0) or down (1) of the levels, `NOWHERE` for NaN, of px (…) of the picture's plane."""
        kind = at.dtype.type
        placed: NDArray[Any] = (at + kind(0.5 - self.corner[k])) * kind(self.scale[k]) - kind(0.5)
        # fmax takes the number beside a NaN
        return np.fmin(np.fmax(placed, kind(NOWHERE)), kind(-NOWHERE * 10))


def _without_lens(levels: NDArray[np.uint8], view: View) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """A picture (H, W, 4) as a camera without distortion would see it, and the corner of its first pixel, px of the
    picture's plane."""
    size = np.array(view.size)
    some = np.meshgrid(*(np.linspace(0, side - 1, CHART.lens_points) for side in view.size))
    ideal = undistort(np.stack(some, axis=-1), view.camera).reshape(-1, 2)
    low = np.maximum(np.floor(ideal.min(axis=0)), -size / 2).astype(int)
    high = np.minimum(np.ceil(ideal.max(axis=0)), 1.5 * size).astype(int) + 1
    columns, rows = (np.arange(*ends, dtype=np.float64) for ends in zip(low, high, strict=True))
    raw = distort(np.stack(np.meshgrid(columns, rows), axis=-1), view.camera).astype(np.float32)
    seen = cv2.remap(levels, raw[..., 0], raw[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return seen, (float(low[0]), float(low[1]))


@dataclass(frozen=True, eq=False)
class SeenPatch:
    """Where a picture sees the nodes of a patch at any inverse range d: at infinite (m, n, 3) + d towards (3,), and
    slack (m, n, 2) px beside, None without, all at the patch's coarse places."""

    patch: Patch
    picture: SweptPicture
    infinite: Array
    towards: Array
    slack: Array | None

    @staticmethod
    def of(patch: Patch, picture: SweptPicture, slack: Array | None) -> SeenPatch:
        """By the picture's camera."""
        view = picture.view
        return SeenPatch(patch, picture, patch.coarse_rays @ (view.K @ view.R).T, view.K @ view.t, slack)

    @cached_property
    def _planes(self) -> NDArray[np.float64]:
        return np.ascontiguousarray(np.moveaxis(self.infinite, -1, 0))

    @cached_property
    def _infinite(self) -> list[Plane]:
        return self.patch.between(self.infinite)

    @cached_property
    def _slack(self) -> list[Plane]:
        return [] if self.slack is None else self.patch.between(self.slack)

    def coarse_pixels(self, d: Array) -> Array:
        """px (m, n, 2) of the picture itself, before the lens, at inverse ranges (m, n); NaN behind it."""
        x, y, depth = (part + d * along for part, along in zip(self._planes, self.towards, strict=True))
        depth = np.where(depth > 0, depth, np.nan)
        with np.errstate(invalid="ignore", over="ignore"):
            pixels = np.stack([x / depth, y / depth], axis=-1)
        return pixels if self.slack is None else pixels + self.slack

    def sampled_at(self, d: Array, levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture (h, w, 4), in some tones, at the nodes for smooth inverse ranges at the coarse places (m, n)."""
        pixels = self.coarse_pixels(d)
        x, y = self.patch.between(np.stack([self.picture.placed(k, pixels[..., k]) for k in (0, 1)], axis=-1))
        return sampled(levels, x, y)

    def places(self, d: Plane) -> tuple[Plane, Plane]:
        """px x, y (h, w) of the shrunk picture at any inverse ranges (h, w)."""
        pixels, _ = self._seen_at(d)
        for beside, part in zip(self._slack, pixels, strict=False):
            part += beside
        return self.picture.placed(0, pixels[0]), self.picture.placed(1, pixels[1])

    def slopes(self, d: Plane) -> tuple[Plane, Plane]:
        """px (h, w), across and down, of the shrunk picture for each unit of inverse range."""
        pixels, depth = self._seen_at(d)
        towards = self.towards.astype(np.float32)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            across, down = (
                np.nan_to_num((towards[k] - pixels[k] * towards[2]) / depth * np.float32(self.picture.scale[k]))
                for k in (0, 1)
            )
        return across, down

    def _seen_at(self, d: Plane) -> tuple[list[Plane], Plane]:
        """px x and y (h, w) of the picture's plane without slack, and depths (h, w) before it; NaN behind it."""
        x, y, depth = (part + d * np.float32(along) for part, along in zip(self._infinite, self.towards, strict=True))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            depth = np.where(depth > 0, depth, np.float32(np.nan))
            return [x / depth, y / depth], depth


def sampled(levels: NDArray[Any], x: Plane, y: Plane) -> NDArray[Any]:
    """Values of a picture at px x, y (h, w), 0 beyond it."""
    values: NDArray[Any] = cv2.remap(levels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return values
