"""A rendered set, stitched every way and measured, with the pictures of its page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.compare.elsewhere.hugin import installed
from ...core.raster.arrays import bounds, dilated
from ...core.raster.colour import encode
from ...core.system.errors import StitchError
from ..scene_pictures import error_colours, jpeg
from .hugin import hugin_panorama
from .opencv_stitcher import stitcher_panorama
from .rendered_set import RenderedSet
from .set_hidden import hidden_figures
from .set_lines import line_figures
from .set_measures import (
    Found,
    SetTruth,
    colour_figures,
    map_figures,
    on_the_sphere,
    pose_figures,
    poses,
    range_figures,
)
from .set_radiance import radiance_figures
from .set_seams import seam_figures
from .set_sliding import sliding_figures
from .set_stitches import SLID, WAYS, Shared, stitched
from .set_thin import thin_figures
from .set_things import thing_figures
from .set_thresholds import HUGIN, OPENCV, OURS
from .top_view import top_view

# Pixels of the sphere that are shown beside what pictures see.
MARGIN = 40


@dataclass(frozen=True)
class MeasuredSet:
    """runs: by way, {refused, warnings, used, left_out, figures, by_picture}; pictures: JPEG files by name; seconds: by
    way and stage."""

    runs: dict[str, dict[str, Any]]
    pictures: dict[str, bytes]
    seconds: dict[str, float]


@dataclass(frozen=True)
class _Shown:
    """A panorama as the true sphere lies: light (H, W, 3), where (H, W) it shows something; found: how it came to be,
    unless by another program."""

    light: NDArray[np.float32]
    where: NDArray[np.bool_]
    found: Found | None = None


def measured_set(rendered: RenderedSet) -> MeasuredSet:
    """Stitches a set every way, and measures all against the truth: colours over what each shows of what any camera
    sees (psnr_db, ssim; covered: that share), and over what all of them show (common_psnr_db, common_ssim), for whoever
    shows less must not gain by it."""
    truth, shared = SetTruth.of(rendered), Shared()
    runs: dict[str, dict[str, Any]] = {}
    panoramas: dict[str, _Shown] = {}
    pictures: dict[str, bytes] = {}
    seconds: dict[str, float] = {}
    used: list[int] = []
    seen: NDArray[np.bool_] = np.zeros(truth.picture.shape[:2], bool)
    for way in WAYS:
        try:
            result = stitched(rendered, way, shared)
        except StitchError as refusal:
            runs[way] = _run(refused=str(refusal))
            continue
        if result.rig is None:
            runs[way] = _run(refused="only two pictures connect")
            continue
        found = Found.of(result, truth)
        maps, by_picture = map_figures(found)
        by_picture = [line | pose for line, pose in zip(by_picture, poses(found), strict=True)]
        figures = pose_figures(found) | maps | range_figures(found) | line_figures(found) | thing_figures(found)
        figures |= radiance_figures(found) | hidden_figures(found)
        left = [path.stem for number, path in enumerate(rendered.pictures) if number not in found.numbers]
        runs[way] = _run("", result.warnings, len(found.numbers), left, figures, by_picture)
        panoramas[way] = _Shown(*on_the_sphere(found), found)
        seconds |= {f"{way} {stage}": value for stage, value in result.seconds.items()}
        if way == OURS:
            used, seen = found.numbers, truth.views_at(found.numbers) > 0
            sliding = Found.of(stitched(rendered, SLID, shared), truth)
            runs[way]["figures"] |= sliding_figures(found, sliding)
            pictures["map_error"] = jpeg(_map_error(found, truth)[_part_of(seen)])
            pictures["from_above"] = jpeg(top_view(found))
    rivals = {OPENCV: stitcher_panorama} | ({HUGIN: hugin_panorama} if installed() else {})
    for rival, panorama_of in rivals.items() if used else ():
        try:
            panoramas[rival] = _Shown(*panorama_of(rendered, used).on_sphere(truth))
            runs[rival] = _run(used=len(used))
        except StitchError as refusal:
            runs[rival] = _run(refused=str(refusal))
    part = _part_of(seen)
    common = np.logical_and.reduce([seen, *(panorama.where for panorama in panoramas.values())])
    for way, panorama in panoramas.items():
        own = panorama.where & seen
        figures, exposed = colour_figures(panorama.light, own, truth)
        beside, _ = colour_figures(panorama.light, common, truth)
        runs[way]["figures"] |= {
            **figures, "covered": float(own.sum() / max(int(seen.sum()), 1)),
            **{f"common_{name}": value for name, value in beside.items()},
            **(seam_figures(panorama.found, exposed, own) if panorama.found else {}),
            **(thin_figures(panorama.found, exposed, own) if panorama.found else {}),
        }  # fmt: skip
        pictures[f"panorama {way}".replace(" ", "_")] = jpeg(np.where(panorama.where[..., None], exposed, 0)[part])
        if way == OURS:
            apart = np.abs(exposed.astype(int) - truth.picture) * own[..., None]
            pictures["difference"] = jpeg(np.minimum(4 * apart, 255).astype(np.uint8)[part])
    dim = encode(rendered.shown, 8) // 4
    pictures["sphere"] = jpeg(np.where(seen[..., None], truth.picture, dim).astype(np.uint8)[part])
    return MeasuredSet(runs, pictures, seconds)


def _part_of(seen: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns of the sphere (H, W) that are worth showing: what is seen, and a margin."""
    rows, columns = bounds(dilated(seen, MARGIN)) or (slice(None), slice(None))
    return rows, columns


def _map_error(found: Found, truth: SetTruth) -> NDArray[np.uint8]:
    """How far the maps are off on the sphere, the worst of the pictures that see a place."""
    worst = np.full(truth.picture.shape[:2], np.nan)
    at = found.on_maps().reshape(-1, 2)
    for order, number in enumerate(found.numbers):
        seen = truth.seen[number]
        index = seen.index[seen.visible]
        mapped = found.result.warp.maps[order].arrays().between(at[index])
        off = np.linalg.norm(mapped - seen.pixels[seen.visible], axis=1)
        worst.ravel()[index] = np.fmax(worst.ravel()[index], off)
    return error_colours(worst, np.isfinite(worst))


def _run(
    refused: str = "", warnings: tuple[str, ...] = (), used: int = 0, left_out: list[str] | None = None,
    figures: dict[str, float] | None = None, by_picture: list[dict[str, float]] | None = None,
) -> dict[str, Any]:  # fmt: skip
    return {
        "refused": refused, "warnings": list(warnings), "used": used, "left_out": left_out or [],
        "figures": figures or {}, "by_picture": by_picture or [],
    }  # fmt: skip
