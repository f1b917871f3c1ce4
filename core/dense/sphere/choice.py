"""Which pictures are compared on a patch of the sphere, in whose tones, and around which inverse range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array, Plane
from ...raster.distance import distance_inside
from ...raster.enlarging import repeated
from ...raster.picture_map import falls_inside
from ..tones import tone_curves
from .options import CHART, CHOICE, SWEEP
from .patch import Patch, SeenPatch, SweptPicture, sampled
from .place import Place

if TYPE_CHECKING:
    from ...field.sphere_field import SphereField

Levels = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Compared:
    """The pictures that are compared on a patch (h, w).

    seen: where each sees the nodes; levels: each in the same tones (h', w', 4); owner (h, w): which of them, by its
    place here, shows a node best, −1 for none; several (h, w): where at least two show the field; coarse_base,
    coarse_per_px (m, n): the inverse range to search around, and the change of it that moves a node by one px of the
    longest parallax; field (h, w): the field's inverse range.
    """

    patch: Patch
    seen: tuple[SeenPatch, ...]
    levels: tuple[Levels, ...]
    owner: NDArray[np.int8]
    several: NDArray[np.bool_]
    coarse_base: Array
    coarse_per_px: Array
    field: Plane

    @cached_property
    def base(self) -> Plane:
        """The inverse range (h, w) to search around."""
        return self.patch.between(self.coarse_base[..., None])[0]

    @cached_property
    def per_px(self) -> Plane:
        """The change (h, w) of inverse range that moves a node by one px."""
        return self.patch.between(self.coarse_per_px[..., None])[0]

    @cached_property
    def field_px(self) -> Plane:
        """px (h, w) from the base to the field."""
        px: Plane = (self.field - self.base) / self.per_px
        return px

    @cached_property
    def infinity_px(self) -> Plane:
        """px (h, w) from the base to what is infinitely far away."""
        px: Plane = -self.base / self.per_px
        return px

    @cached_property
    def from_rim(self) -> Plane:
        """How far (h, w) the nearest node lies that only one picture shows, in widths of the rim: its border, and
        another's, disturb the comparison there."""
        far: Plane = distance_inside(self.several) / np.float32(SWEEP.rim * self.patch.chart.per_radian)
        return far

    @cached_property
    def masks(self) -> list[NDArray[np.uint8]]:
        """1 (h, w) where each picture is the one that shows a node best."""
        return [(self.owner == number).astype(np.uint8) for number in range(len(self.seen))]

    def at(self, along: Plane) -> Plane:
        """Inverse range (h, w) after moves (h, w) px from the base."""
        d: Plane = np.maximum(self.base + along * self.per_px, np.float32(0))
        return d

    def best(self, taken: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Of values (h, w[, C]) of each picture those of the one that shows a node best; 0 where none does."""
        out = np.zeros_like(taken[0])
        for values, mask in zip(taken, self.masks, strict=True):
            cv2.copyTo(values, mask, out)
        return out

    def sampled(self, d: Plane) -> list[Levels]:
        """Each picture (h, w, 4) at inverse ranges (h, w)."""
        return [
            sampled(levels, *seen.places(d)) for seen, levels in zip(self.seen, self.levels, strict=True)
        ]


def compared_on(
    patch: Patch, pictures: Sequence[SweptPicture], place: Place, field: SphereField
) -> Compared | None:
    """Choose what is compared on a patch.

    Parameters
    ----------
    patch : Patch
    pictures : sequence of SweptPicture
        Their views as they are from the place.
    place : Place
        Where the patch is seen from.
    field : SphereField

    Returns
    -------
    Compared or None
        None where fewer than two pictures show the patch, or none of them stands apart.
    """
    margin = int(4 * CHOICE.base_sigma * patch.chart.per_radian) + 2 * CHART.coarse_step
    around = patch.of_chart(place.d, margin)
    base = patch.at_coarse(_broad(around, CHOICE.base_sigma * patch.chart.per_radian), margin)
    coarse_field = patch.at_coarse(around, margin)
    rays = place.from_viewpoint(patch.coarse_rays, coarse_field)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    seen = [SeenPatch.of(patch, picture, field.slack(picture.number, rays)) for picture in pictures]
    inside = [_shown(one, coarse_field) for one in seen]
    some = [number for number, shown in enumerate(inside) if shown.mean() > CHOICE.least_share]
    if len(some) < 2:
        return None
    seen, inside = [seen[number] for number in some], [inside[number] for number in some]
    chosen = _chosen(seen, inside)
    seen, inside = [seen[number] for number in chosen], [inside[number] for number in chosen]
    owner = _owner(seen, inside)
    first = _main(owner, len(seen))
    parallax = np.max([_across(one, seen[first]) for one in seen], axis=0)
    nearest = max(float(around.max()), float(field.depth.bounds[1]))
    if parallax.max() * nearest * patch.chart.per_radian < CHOICE.least_parallax_px:
        return None
    per_px = 1 / (patch.chart.per_radian * np.maximum(parallax, CHOICE.least_parallax * parallax.max()))
    at_field = [one.sampled_at(coarse_field, one.picture.levels) for one in seen]
    height, width = patch.shape
    own = repeated(owner, CHART.coarse_step)[CHART.coarse_step :, CHART.coarse_step :][:height, :width]
    count = np.sum([levels[..., 3] == 255 for levels in at_field], axis=0)
    toned = _in_one_tone(first, at_field, [one.picture.levels for one in seen])
    return Compared(
        patch, tuple(seen), tuple(toned), own, (own >= 0) & (count > 1), base, per_px, patch.of_chart(place.d)
    )


def _broad(values: Plane, sigma: float) -> Plane:
    """Values (h, w) smoothed by so many nodes (σ), far more than the coarse ones are apart: by way of these."""
    height, width = values.shape
    small = max(1, width // CHART.coarse_step), max(1, height // CHART.coarse_step)
    shrunk = cv2.resize(values, small, interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(shrunk, (0, 0), sigma * small[0] / width, sigmaY=sigma * small[1] / height)
    broad: Plane = cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR)
    return broad


def _shown(seen: SeenPatch, d: Array) -> NDArray[np.bool_]:
    """Where (m, n) a picture shows the nodes at inverse ranges (m, n), away from its border."""
    pixels = seen.coarse_pixels(d)
    x, y = (seen.picture.placed(k, pixels[..., k]) for k in (0, 1))
    height, width = seen.picture.levels.shape[:2]
    border = CHOICE.border_px
    return falls_inside(x - border, y - border, (width - 2 * border, height - 2 * border))


def _across(one: SeenPatch, other: SeenPatch | None = None) -> Array:
    """The baseline (m, n) between two pictures, or from the viewpoint to one, as it is seen across each ray."""
    baseline = one.picture.place if other is None else one.picture.place - other.picture.place
    rays = one.patch.coarse_rays
    across: Array = np.linalg.norm(baseline - rays * (rays @ baseline)[..., None], axis=-1)
    return across


def _owner(seen: Sequence[SeenPatch], inside: Sequence[NDArray[np.bool_]]) -> NDArray[np.int8]:
    """Which picture (m, n) that shows a ray stands nearest to it, seen from the viewpoint; −1 where none does."""
    off = np.array([np.where(shown, _across(one), np.inf) for one, shown in zip(seen, inside, strict=True)])
    return np.where(np.isfinite(off.min(axis=0)), off.argmin(axis=0), -1).astype(np.int8)


def _main(owner: NDArray[np.int8], count: int) -> int:
    """The picture that shows most rays best."""
    return int(np.argmax(np.bincount(owner[owner >= 0], minlength=count)))


def _chosen(seen: Sequence[SeenPatch], inside: Sequence[NDArray[np.bool_]]) -> list[int]:
    """The pictures to be compared: those that show much best, then those with long baselines to the first of these."""
    owner = _owner(seen, inside)
    first = _main(owner, len(seen))
    beside = np.array([np.where(shown, _across(one, seen[first]), 0).mean()
                       for one, shown in zip(seen, inside, strict=True)])  # fmt: skip
    share = np.array([(owner == number).mean() for number in range(len(seen))])
    worth = CHOICE.most * share + beside / max(float(beside.max()), 1e-300)
    worth[first] = np.inf
    return sorted(np.argsort(-worth, kind="stable")[: CHOICE.most].tolist())


def _in_one_tone(first: int, at_field: Sequence[Levels], levels: Sequence[Levels]) -> list[Levels]:
    """Pictures (h', w', 4) in the tones of the first, or of those that were brought to its tones before; at_field:
    each (h, w, 4) at the nodes."""
    toned, together = list(levels), at_field[first].copy()
    rest = [number for number in range(len(levels)) if number != first]
    while rest:
        shared = [(together[..., 3] == 255) & (at_field[number][..., 3] == 255) for number in rest]
        which = int(np.argmax([mask.sum() for mask in shared]))
        number, both = rest.pop(which), shared[which]
        now = at_field[number]
        if both.sum() > CHOICE.tone_px:
            curves = tone_curves(together[..., :3].copy(), now[..., :3].copy(), both, 256)
            toned[number], now = (
                np.dstack([*(curve[part[..., k]] for k, curve in enumerate(curves)), part[..., 3]])
                for part in (toned[number], now)
            )
        fresh = (together[..., 3] < 255) & (now[..., 3] == 255)
        together[fresh] = now[fresh]
    return toned
