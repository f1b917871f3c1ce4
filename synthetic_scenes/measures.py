"""What a stitch of a rendered pair is worth, figure by figure, against the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import distance_to_line
from ..core.compose.blend import averaged
from ..core.compose.composition import composed
from ..core.measure.metrics import appearance, coverage_samples, overlap_quality, psnr, ssim
from ..core.panorama.layers import Layer
from ..core.pipeline import StitchResult
from ..core.raster.arrays import Array
from ..core.raster.colour import encode
from ..core.raster.sampling import fetch
from .ground_truth import TrueGeometry, inverse_depth_at, pose_errors, seen_from, visible
from .rendered import RenderedPair
from .stitches import ON_REFERENCE

# True matches that judge an estimated F.
MATCHES = 5000


@dataclass(frozen=True)
class Truth:
    """Of every pixel of the wide canvas (H, W): where the target camera sees it (…, 2), NaN behind it; whether it
    really does; whether the reference or the target sees it at all; and what it looks like, uint8 RGB."""

    geometry: TrueGeometry
    target: Array
    in_target: NDArray[np.bool_]
    in_reference: NDArray[np.bool_]
    picture: NDArray[np.uint8]
    corner: tuple[int, int]

    @property
    def overlap(self) -> NDArray[np.bool_]:
        """What both cameras see."""
        return self.in_target & self.in_reference


def truth_of(pair: RenderedPair) -> Truth:
    """The truth of a rendered pair, from its cameras and depths alone."""
    pixels, there = seen_from(pair.cameras["wide"], pair.wide_depth, pair.cameras["target"])
    inside = np.zeros(pair.wide_depth.shape, bool)
    inside[pair.frame] = True
    seen = visible(pixels, there, pair.target_depth)
    return Truth(pair.geometry, pixels, seen, inside, encode(pair.wide, 8), pair.corner)


def figures(result: StitchResult, truth: Truth) -> dict[str, float]:
    """All figures of a stitch on the reference's plane; NaN where one has no meaning.

    rotation_deg, focal_percent, epipole_deg (direction of the baseline), h_inf_px and h_inf_p95_px (transfer error,
    median and 95th percentile), f_px (mean distance of true matches from the estimated lines); projectivity_px and
    projectivity_p95_px (what the map shows outside the reference, from the true lines: mean, 95th percentile);
    alignment_px, alignment_p95_px (map against the true map where both cameras see the same: median, 95th percentile),
    beyond_px, beyond_p90_px (the same outside the reference: median, 90th percentile); overlap_psnr_db, overlap_ssim;
    covered (share of what the target alone shows that the panorama holds).
    """
    geometry, view = truth.geometry, result.edges[0].two_view
    width, height = result.cameras[1].size
    known = {"rotation_deg": math.nan, "focal_percent": math.nan, "epipole_deg": math.nan, "h_inf_px": math.nan,
             "h_inf_p95_px": math.nan, "f_px": math.nan}  # fmt: skip
    if np.isfinite(view.R).all():
        pose = pose_errors(view, geometry, (width, height))
        known |= {name: pose[name] for name in known if name in pose}
        known["epipole_deg"] = pose["baseline_deg"]
    if np.isfinite(view.F).all() and geometry.baseline:
        rows, columns = np.nonzero(truth.overlap)
        some = slice(None, None, max(1, len(rows) // MATCHES))
        points = np.column_stack([columns[some], rows[some]]) + np.array(truth.corner, float)
        true_matches = truth.target[rows[some], columns[some]]
        known["f_px"] = float(distance_to_line(view.F, points, true_matches).mean())
    else:
        known["f_px"] = known["epipole_deg"] = math.nan
    shown = coverage_samples(result.warp, result.cameras)
    beyond = ~shown.overlap
    off = np.full(1, np.nan)
    if geometry.baseline and beyond.any():
        off = distance_to_line(geometry.F.T, shown.target[beyond], shown.points[beyond])
    here, there = common_part(result, truth)
    found = result.warp.maps[1].arrays()
    apart = np.hypot(found.x[here] - truth.target[there][..., 0], found.y[here] - truth.target[there][..., 1])
    only = truth.in_target & ~truth.in_reference
    both, alone = (part[there] & np.isfinite(apart) for part in (truth.overlap, only))
    quality = overlap_quality(result.pictures, result.warp)
    return {
        **known,
        "projectivity_px": float(off.mean()), "projectivity_p95_px": _percentile(off, 95),
        "alignment_px": _percentile(apart[both], 50), "alignment_p95_px": _percentile(apart[both], 95),
        "beyond_px": _percentile(apart[alone], 50), "beyond_p90_px": _percentile(apart[alone], 90),
        "overlap_psnr_db": quality["overlap_psnr_db"], "overlap_ssim": quality["overlap_ssim"],
        "covered": float((only[there] & (result.alpha[here] > 0.5)).sum() / only.sum()) if only.any() else math.nan,
    }  # fmt: skip


def meeting(result: StitchResult, pair: RenderedPair, truth: Truth) -> dict[str, float]:
    """meeting_px, meeting_p95_px: how well both pictures' pixels at a canvas point show one point of the scene, on any
    canvas and from any viewpoint (median, 95th percentile over the overlap; NaN without one).

    The distance, in px of the target, of its pixel from where the target camera really sees what the reference's pixel
    shows. Counted where both do show it: neither picture is said to be hidden there, and both cameras see it.
    """
    shown, found = (picture_map.arrays() for picture_map in result.warp.maps)
    both = shown.inside() & found.inside() & ~result.occluded[0] & ~result.occluded[1]
    points = np.stack([shown.x[both], shown.y[both]], axis=-1)
    x, y = (points - np.array(truth.corner)).astype(np.float32).T
    inverse = inverse_depth_at(pair.wide_depth, x, y)
    overlap = truth.overlap.astype(np.float32)[..., None]
    seen = fetch(overlap, x[None], y[None], cv2.INTER_NEAREST)[0, :, 0] > 0
    with np.errstate(divide="ignore"):
        true = truth.geometry.target_pixels(points, 1.0 / inverse.astype(np.float64))
    apart = np.hypot(found.x[both] - true[:, 0], found.y[both] - true[:, 1])[seen]
    return {"meeting_px": _percentile(apart, 50), "meeting_p95_px": _percentile(apart, 95)}


def on_the_wide_canvas(result: StitchResult, truth: Truth) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """The panorama (H, W, 3) as the true panorama lies, uint8, and where (H, W) it shows something that either camera
    really saw: what no picture shows cannot be asked for."""
    here, there = common_part(result, truth)
    picture = np.zeros(truth.picture.shape, np.uint8)
    picture[there] = encode(result.pixels[here], 8)
    shown = np.zeros(truth.in_target.shape, bool)
    shown[there] = result.alpha[here] > 0.5
    return picture, shown & (truth.in_target | truth.in_reference)


def whole_picture(picture: NDArray[np.uint8], shown: NDArray[np.bool_], truth: Truth) -> dict[str, float]:
    """whole_psnr_db and whole_ssim of a panorama on the wide canvas against the true one, over a mask (H, W)."""
    return {
        "whole_psnr_db": psnr(picture, truth.picture, shown), "whole_ssim": ssim(picture, truth.picture, shown),
    }  # fmt: skip


def composition(result: StitchResult, truth: Truth) -> dict[str, float]:
    """What seam, bands and exposure are worth: the panorama that the defaults make of a stitch's two layers, beside the
    plain average of the same two, equally exposed.

    composed_psnr_db, composed_ssim: of the whole picture against the true panorama; over_average_db, over_average_ssim:
    by how much that is better than the average's, over the same pixels; overlap_over_average_db: the same in what both
    layers show alone, for beyond it the two pictures do not differ; source_fidelity_mean, source_fidelity_p5,
    seam_visibility (NaN without a seam): see `metrics.appearance`.
    """
    floats = [picture.bits == 32 for picture in result.pictures]
    options = replace(ON_REFERENCE, exposure="reference")  # the truth's
    made = composed(result.layers, result.warp, result.views, options, floats, None, lambda *_: None)
    panorama, (reference, target) = made.panorama, made.exposed
    average = averaged(reference, target, reference.alpha > 0)
    both = ((reference.alpha > 0.5) & (target.alpha > 0.5) & (panorama.alpha > 0.5)).astype(np.float32)
    ours, shown = on_the_wide_canvas(replace(result, panorama=panorama), truth)
    theirs, shown_too = on_the_wide_canvas(replace(result, panorama=average), truth)
    _, overlap = on_the_wide_canvas(replace(result, panorama=Layer(panorama.light, both)), truth)
    mine, others = (whole_picture(picture, shown & shown_too, truth) for picture in (ours, theirs))
    return {
        "composed_psnr_db": mine["whole_psnr_db"], "composed_ssim": mine["whole_ssim"],
        "over_average_db": mine["whole_psnr_db"] - others["whole_psnr_db"],
        "over_average_ssim": mine["whole_ssim"] - others["whole_ssim"],
        "overlap_over_average_db": psnr(ours, truth.picture, overlap) - psnr(theirs, truth.picture, overlap),
        **appearance(panorama, made.exposed, made.labels, any(floats)),
    }  # fmt: skip


def hidden_quality(result: StitchResult, truth: Truth) -> dict[str, float]:
    """occluded_precision and occluded_recall of what a stitch says is hidden from the target, among what the reference
    sees and what lies within the target's frame; NaN where nothing is said or nothing is hidden."""
    here, there = common_part(result, truth)
    width, height = result.cameras[1].size
    with np.errstate(invalid="ignore"):
        within = ((truth.target[there] >= 0) & (truth.target[there] <= (width - 1, height - 1))).all(axis=-1)
    asked = truth.in_reference[there] & within
    said, hidden = result.occluded[1][here] & asked, asked & ~truth.in_target[there]
    right = float((said & hidden).sum())
    return {
        "occluded_precision": right / said.sum() if said.any() else math.nan,
        "occluded_recall": right / hidden.sum() if hidden.any() else math.nan,
    }  # fmt: skip


def common_part(result: StitchResult, truth: Truth) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Rows and columns of the part that panorama and true panorama share, in either."""
    first = -np.array(result.warp.canvas.offset)
    sizes = np.array(result.alpha.shape[::-1]), np.array(truth.in_target.shape[::-1])
    low = np.maximum(first, truth.corner)
    high = np.minimum(first + sizes[0], np.array(truth.corner) + sizes[1])
    here, there = (
        (slice(low[1] - corner[1], high[1] - corner[1]), slice(low[0] - corner[0], high[0] - corner[0]))
        for corner in (first, np.array(truth.corner))
    )
    return here, there


def _percentile(values: Array, share: float) -> float:
    return float(np.percentile(values, share)) if values.size and np.isfinite(values).all() else math.nan
