"""How alike pictures look where a panorama shows several of them at one place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Part, common, eroded
from ..metrics import box_similarity, psnr, ssim
from .options import PLACED
from .placed import PlacedPicture, PlacedSet


@dataclass(frozen=True)
class Overlap:
    """Two pictures (their numbers) and the part of the canvas that both show: where (h, w) in `part`."""

    i: int
    j: int
    part: Part
    where: NDArray[np.bool_]


def overlaps(panorama: PlacedSet) -> Iterator[Overlap]:
    """The pairs of pictures that share enough to be compared, without the rim of what they share."""
    pictures = panorama.pictures
    for i, one in enumerate(pictures):
        for j in range(i + 1, len(pictures)):
            found = _shared(one, pictures[j])
            if found is not None:
                yield Overlap(i, j, *found)


def _shared(one: PlacedPicture, other: PlacedPicture) -> tuple[Part, NDArray[np.bool_]] | None:
    (x, y), (height, width) = one.corner, one.shows.shape
    (u, v), (down, across) = other.corner, other.shows.shape
    left, top, wide, high = common((x, y, width, height), (u, v, across, down))
    if wide <= 0 or high <= 0:
        return None
    part = slice(top, top + high), slice(left, left + wide)
    both = one.shows[one.part_of(part)] & other.shows[other.part_of(part)]
    smaller = min(int(one.shows.sum()), int(other.shows.sum()))
    if both.sum() < max(PLACED.least_share * smaller, PLACED.least_pixels):
        return None
    inner = eroded(both, PLACED.margin_px)
    return (part, inner) if inner.sum() >= PLACED.least_pixels else None


def gained_figures(panorama: PlacedSet) -> dict[str, float]:
    """gained_psnr_db, gained_ssim: of all overlaps, after one gain for each channel (the ratio of medians), weighted by
    their px; gained_ssim_worst: of the worst of them; used, overlaps: how many pictures and overlaps there are.

    SSIM of gray in plain 7×7 windows. A gain takes exposure out, which programs settle at another stage.
    """
    rows = []
    for overlap in overlaps(panorama):
        one, other = (panorama.pictures[n] for n in (overlap.i, overlap.j))
        first, second = (p.colours[p.part_of(overlap.part)] for p in (one, other))
        where = overlap.where
        ratio = np.median(first[where] + 1.0, axis=0) / np.median(second[where] + 1.0, axis=0)
        second = np.clip(second * ratio, 0, 255).astype(np.uint8)
        alike = float(box_similarity(first, second)[where].mean(dtype=np.float64))
        rows.append((int(where.sum()), psnr(first, second, where), alike))
    figures = {"used": float(len(panorama.pictures)), "overlaps": float(len(rows))}
    if not rows:
        return figures | dict.fromkeys(("gained_psnr_db", "gained_ssim", "gained_ssim_worst"), float("nan"))
    weight, levels, alike_each = np.array(rows).T
    return figures | {
        "gained_psnr_db": float(np.average(np.minimum(levels, 99.0), weights=weight)),
        "gained_ssim": float(np.average(alike_each, weights=weight)), "gained_ssim_worst": float(alike_each.min()),
    }  # fmt: skip


def plain_figures(panorama: PlacedSet) -> dict[str, float]:
    """overlap_psnr_db, overlap_ssim, overlap_px of the first two pictures, as `metrics.overlap_quality` has them for
    ours: exposure differences are in them."""
    found = next(overlaps(panorama), None)
    if found is None or (found.i, found.j) != (0, 1):
        return {"overlap_px": 0.0, "overlap_psnr_db": float("nan"), "overlap_ssim": float("nan")}
    first, second = (p.colours[p.part_of(found.part)] for p in panorama.pictures[:2])
    return {
        "overlap_px": float(found.where.sum()), "overlap_psnr_db": psnr(first, second, found.where),
        "overlap_ssim": ssim(first, second, found.where),
    }  # fmt: skip
