"""What a stitch of a rendered set is worth, figure by figure, against the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.cameras.projective import rotation_angle
from ...core.cameras.rig import Rig
from ...core.measure.metrics import psnr, ssim
from ...core.pipeline import StitchResult
from ...core.raster.arrays import Array
from ...core.raster.colour import encode
from ...core.raster.sampling import fetch
from ..finished import evened
from ..ground_truth import SAME_PLACE, visible
from ..scene_camera import SceneCamera
from .rendered_set import RenderedSet
from .set_proof import resampled
from .sphere_truth import in_frame, seen_by

# Steps of a map, px a pixel of the sphere, beyond which it jumps to the panorama's other end.
JUMP_PX = 20.0
KINDS = ("overlap", "alone", "hidden")
# Confidence of dense refinement, 0 to 1, above which what it says of ranges is judged by itself.
CONFIDENT = 0.5


@dataclass(frozen=True)
class Seen:
    """What of the sphere lies in a camera's frame: index (N,) into its pixels, row by row; pixels (N, 2) of the
    camera's picture; visible (N,): whether the camera sees it."""

    index: NDArray[np.intp]
    pixels: Array
    visible: NDArray[np.bool_]


@dataclass(frozen=True)
class SetTruth:
    """The truth of a rendered set: directions (H, W, 3) of the sphere's pixels, what it looks like, uint8, and what of
    it each camera sees."""

    rendered: RenderedSet
    directions: Array
    picture: NDArray[np.uint8]
    seen: tuple[Seen, ...]

    @staticmethod
    def of(rendered: RenderedSet) -> SetTruth:
        """From its cameras, its depths and the sphere alone."""
        directions = rendered.sphere.all_directions()
        seen = []
        for camera, depth in zip(rendered.cameras, rendered.depths, strict=True):
            pixels, there = seen_by(camera, rendered.sphere, directions, rendered.distance)
            index = np.flatnonzero(in_frame(pixels, camera))
            shown = visible(pixels, there, depth)
            seen.append(Seen(index, pixels.reshape(-1, 2)[index], shown.ravel()[index]))
        return SetTruth(rendered, directions, encode(rendered.shown, 8), tuple(seen))

    def views_at(self, numbers: Sequence[int]) -> NDArray[np.int16]:
        """How many of these cameras see each pixel of the sphere (H, W)."""
        count = np.zeros(self.picture.shape[:2], np.int16)
        for number in numbers:
            count.ravel()[self.seen[number].index] += self.seen[number].visible
        return count


def numbers_of(result: StitchResult) -> list[int]:
    """Which of the set's pictures a stitch uses, in its own order."""
    return [int(picture.name.partition(".")[0]) for picture in result.pictures]


@dataclass(frozen=True, eq=False)
class Found:
    """A stitch on the whole sphere beside the truth.

    gauge (3, 3): from the world's directions to the stitch's, which agrees best with all rotations: a panorama's own
    turn means nothing.
    """

    result: StitchResult
    rig: Rig
    truth: SetTruth
    numbers: list[int]
    gauge: Array

    @staticmethod
    def of(result: StitchResult, truth: SetTruth) -> Found:
        """By the rotations of all pictures that are used."""
        assert result.rig is not None
        numbers = numbers_of(result)
        gauge = common_rotation(result.rig.R, [truth.rendered.cameras[number].R for number in numbers])
        return Found(result, result.rig, truth, numbers, gauge)

    @property
    def cameras(self) -> list[SceneCamera]:
        """The true cameras of the pictures that are used."""
        return [self.truth.rendered.cameras[number] for number in self.numbers]

    @cached_property
    def places(self) -> tuple[Array, float]:
        """The found places (N, 3) brought onto the true ones, m, and metres to the stitch's unit; 0 for one place."""
        true = np.array([camera.place for camera in self.cameras])
        return onto(self.rig.centres, true)

    @cached_property
    def points(self) -> Array:
        """Where (H, W, 2) the stitch shows the sphere's directions, px of its own plane."""
        projection = self.result.canvas.projection
        assert projection is not None
        return projection.points(self.truth.directions @ self.gauge.T)

    def on_maps(self) -> Array:
        """The same in px of the stitch's maps and masks."""
        return self.points + np.array(self.result.warp.canvas.offset, np.float64)

    @cached_property
    def labels(self) -> NDArray[np.int16]:
        """Which of the stitch's pictures each pixel of its maps comes from, by its own order; −1 for none."""
        labels, canvas = self.result.labels, self.result.warp.canvas
        return np.full((canvas.height, canvas.width), -1, np.int16) if labels is None else labels

    @cached_property
    def labels_on_sphere(self) -> NDArray[np.int16]:
        """The same (H, W) at the sphere's pixels."""
        x, y = np.moveaxis(self.on_maps().astype(np.float32), -1, 0)
        # 0 is what is fetched from beyond the picture
        return fetch((self.labels + 1)[..., None], x, y, cv2.INTER_NEAREST)[..., 0] - np.int16(1)


def common_rotation(found: Array, true: Sequence[Array] | Array) -> Array:
    """The rotation G (3, 3) for which R_j G of found rotations (N, 3, 3) come nearest to the true ones."""
    return nearest_rotation(np.einsum("nji,njk->ik", found, np.array(true)))


def nearest_rotation(matrix: Array) -> Array:
    """The rotation (3, 3) nearest to a matrix."""
    u, _, vt = np.linalg.svd(matrix)
    rotation: Array = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation


def onto(points: Array, true: Array) -> tuple[Array, float]:
    """points (N, 3) brought onto the true ones by the similarity that fits best, and its scale (Umeyama 1991)."""
    middle, true_middle = points.mean(axis=0), true.mean(axis=0)
    spread = float(((points - middle) ** 2).sum())
    if spread < SAME_PLACE**2:
        return np.broadcast_to(true_middle, true.shape), 0.0
    across = (true - true_middle).T @ (points - middle)
    rotation = nearest_rotation(across)
    scale = float(np.trace(rotation.T @ across)) / spread
    return true_middle + scale * (points - middle) @ rotation.T, scale


def pose_figures(found: Found) -> dict[str, float]:
    """rotation_deg, rotation_max_deg (after the common turn that fits best: median, max); position_mm, position_max_mm
    (after the similarity that fits best); focal_percent, k1_error, principal_px (worst); places: at how many the
    pictures are said to be; guessed_lengths: how many pairs are said to have a baseline whose length no third tells."""
    angles, off = np.array([[line["rotation_deg"], line["position_mm"]] for line in poses(found)]).T
    focals = [ours.focal / true.K[0, 0] - 1 for ours, true in zip(found.rig.cameras, found.cameras, strict=True)]
    bends = [float(ours.distortion[0]) - true.k1 for ours, true in zip(found.rig.cameras, found.cameras, strict=True)]
    middles = [np.linalg.norm(ours.K[:2, 2] - true.K[:2, 2])
               for ours, true in zip(found.rig.cameras, found.cameras, strict=True)]  # fmt: skip
    tied = sum(len(station) - 1 for station in found.rig.stations)
    return {
        "rotation_deg": float(np.median(angles)), "rotation_max_deg": float(angles.max()),
        "position_mm": float(np.median(off)), "position_max_mm": float(off.max()),
        "focal_percent": 100 * max(focals, key=abs),
        "k1_error": max(bends, key=abs), "principal_px": float(max(middles)),
        "places": float(len(found.rig) - tied) if found.rig.t.any() else 1.0,
        "guessed_lengths": float(sum(edge.baseline == "continuity" for edge in found.rig.edges)),
    }  # fmt: skip


def poses(found: Found) -> list[dict[str, float]]:
    """The same rotation_deg and position_mm of each picture."""
    placed, _ = found.places
    return [
        {"rotation_deg": rotation_angle(R @ found.gauge, camera.R),
         "position_mm": 1000 * float(np.linalg.norm(place - camera.place))}
        for R, place, camera in zip(found.rig.R, placed, found.cameras, strict=True)
    ]  # fmt: skip


def map_figures(found: Found) -> tuple[dict[str, float], list[dict[str, float]]]:
    """How far the maps are from the true ones, px of each picture: overlap_px, overlap_p90_px (what several cameras
    see: median, 90th percentile), alone_px, alone_p90_px (what one camera alone sees), hidden_px, hidden_p90_px (what a
    picture's frame holds but something nearer hides); mapped: share of what cameras see that their maps show at all.
    Second, the medians of each picture."""
    views, at = found.truth.views_at(found.numbers).ravel(), found.on_maps().reshape(-1, 2)
    errors: dict[str, list[Array]] = {kind: [] for kind in KINDS}
    pictures = []
    mapped = asked = 0
    for order, number in enumerate(found.numbers):
        seen = found.truth.seen[number]
        off = np.linalg.norm(found.result.warp.maps[order].arrays().between(at[seen.index]) - seen.pixels, axis=1)
        shown = np.isfinite(off)
        kinds = {"overlap": seen.visible & (views[seen.index] > 1), "alone": seen.visible & (views[seen.index] == 1),
                 "hidden": ~seen.visible}  # fmt: skip
        for kind, part in kinds.items():
            errors[kind].append(off[part & shown])
        medians = {f"{kind}_px": percentile(parts[-1], 50) for kind, parts in errors.items()}
        pictures.append({"picture": float(number), **medians})
        mapped, asked = mapped + int((seen.visible & shown).sum()), asked + int(seen.visible.sum())
    together = {kind: np.concatenate(parts) for kind, parts in errors.items()}
    figures = {f"{kind}{name}": percentile(together[kind], share) for kind in KINDS
               for name, share in (("_px", 50), ("_p90_px", 90))}  # fmt: skip
    return {**figures, "mapped": mapped / max(asked, 1)}, pictures


def range_figures(found: Found) -> dict[str, float]:
    """range_log, range_log_p90: |ln| of the found range by the true one, where several cameras see something at a
    finite range (median, 90th percentile); range_log_confident: median where the stitch's confidence is above
    CONFIDENT, and confident: at which share that is; range_log_sure: median of the half whose inverse range is surest
    by the stitch's own deviation. NaN where all is said to be at one place."""
    scale, warp = found.places[1], found.result.warp
    true = found.truth.rendered.distance
    where = (found.truth.views_at(found.numbers) > 1) & np.isfinite(true)
    if not scale or not where.any() or warp.deviation is None or warp.confidence is None:
        names = ("range_log", "range_log_p90", "range_log_confident", "confident", "range_log_sure")
        return dict.fromkeys(names, math.nan)
    x, y = found.on_maps()[where].astype(np.float32).T[:, None]
    layers = np.dstack([warp.inverse_depth, warp.deviation[:, :], warp.confidence]).astype(np.float32)
    d, deviation, confidence = fetch(layers, x, y, cv2.INTER_LINEAR)[0].T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        off = np.where(d > 0, np.abs(np.log(scale / np.where(d > 0, d, 1) / true[where])), np.inf)
    sure, confident = deviation <= np.median(deviation), confidence > CONFIDENT
    return {
        "range_log": float(np.median(off)), "range_log_p90": float(np.quantile(off, 0.9, method="lower")),
        "range_log_confident": float(np.median(off[confident])) if confident.any() else math.nan,
        "confident": float(confident.mean()),
        "range_log_sure": float(np.median(off[sure])),
    }  # fmt: skip


def on_the_sphere(found: Found) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The panorama (H, W, 3), scene-linear, as the true sphere lies, and where (H, W) it shows something."""
    at = found.points + np.array(found.result.canvas.offset, np.float64)
    return sampled(found.result.pixels, found.result.alpha, at)


def sampled(
    light: NDArray[np.float32], alpha: NDArray[np.float32], at: Array
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """A panorama and its alpha at places (H, W, 2) px, averaged over what each of these covers; where it shows it."""
    whole = (np.abs(np.gradient(at[..., 0], axis=1)) < JUMP_PX) & (np.abs(np.gradient(at[..., 0], axis=0)) < JUMP_PX)
    layers = np.dstack([light * alpha[..., None], alpha]).astype(np.float32)
    taken = resampled(layers, at, whole)
    shown = whole & (taken[..., 3] > 0.99)
    return taken[..., :3] / np.maximum(taken[..., 3:], 1e-6), shown


def colour_figures(
    light: NDArray[np.float32], where: NDArray[np.bool_], truth: SetTruth
) -> tuple[dict[str, float], NDArray[np.uint8]]:
    """psnr_db, ssim of a panorama (H, W, 3) against the true sphere over a mask; and the panorama, exposed like it."""
    if not where.any():
        return {"psnr_db": math.nan, "ssim": math.nan}, encode(light, 8)
    exposed = evened(light, truth.picture, where)
    return {"psnr_db": psnr(exposed, truth.picture, where), "ssim": ssim(exposed, truth.picture, where)}, exposed


def percentile(values: Array, share: float) -> float:
    """A percentile; NaN of nothing."""
    return float(np.percentile(values, share)) if values.size else math.nan
