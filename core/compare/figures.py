"""Figures of a field on a pair, measured alike for all fields."""

from __future__ import annotations

from ..cameras.edge import Edge
from ..measure.held_out import held_out
from ..measure.metrics import canvas_quality, coverage_samples, off_line_mean, overlap_quality
from ..measure.projectivity import projectivity
from ..pipeline import StitchResult
from ..raster.arrays import Array

# Name, unit, digits, and whether more is better (None: neither) of each figure, by its key.
FIGURES: dict[str, tuple[str, str, int, bool | None]] = {
    "overlap_psnr_db": ("overlap PSNR", "dB", 2, True), "overlap_ssim": ("overlap SSIM", "", 3, True),
    "projectivity_px": ("projectivity", "px", 2, False),
    "projectivity_independent_px": ("projectivity, independent F", "px", 2, False),
    "off_line_mean_px": ("off its lines in the overlap", "px", 2, False),
    # each field over the matches that it is fitted to: one that drops more of them has an easier time
    "held_out_rms_px": ("held out, RMS over the matches it keeps", "px", 2, False),
    "held_out_towards_rms_px": ("held out, towards what only the target shows", "px", 2, False),
    "alignment_median_px": ("matches, median", "px", 2, False), "alignment_p95_px": ("matches, 95th", "px", 2, False),
    "folds": ("folds", "%", 3, False), "occluded": ("occluded, of the overlap", "%", 1, None),
    "overlap_px": ("overlap", "px", 0, None), "canvas_psnr_db": ("canvas PSNR", "dB", 2, None),
    "canvas_ssim": ("canvas SSIM", "", 3, None),
    "truth_alignment_px": ("off the true map, median", "px", 2, False),
    "truth_alignment_p95_px": ("off the true map, 95th", "px", 2, False),
    "truth_projectivity_px": ("off the true lines beyond the overlap", "px", 2, False),
    "truth_whole_psnr_db": ("whole picture PSNR", "dB", 2, True),
    "truth_whole_ssim": ("whole picture SSIM", "", 3, True),
    "truth_occluded_precision": ("occluded: precision", "", 2, True),
    "truth_occluded_recall": ("occluded: recall", "", 2, True),
}  # fmt: skip
SHARES = ("folds", "occluded")


def figures_of(result: StitchResult, edge: Edge, independent: Array, seed: int) -> dict[str, float]:
    """The figures of a stitch on its whole flat canvas, by the keys of FIGURES; NaN where undefined.

    Projectivity is by the edge's own F and by `independent`, whatever the field knows of them, so that all fields are
    measured alike; folds are counted outside occlusions and their rims.
    """
    warp = result.warp
    shown = coverage_samples(warp, result.cameras, edge.j)
    F = edge.two_view.F
    unseen = held_out(result.pair_field, edge.inliers, shown, seed)
    measured = result.report["measured"]
    inside = (result.layers[edge.i].alpha > 0) & warp.maps[edge.j].inside()
    hidden = result.occluded[edge.j] & inside
    return {
        **overlap_quality(result.pictures, warp, edge.j), **canvas_quality(result.pictures, warp, edge.j),
        "projectivity_px": projectivity(F, shown), "projectivity_independent_px": projectivity(independent, shown),
        "off_line_mean_px": off_line_mean(F, shown),
        "held_out_rms_px": unseen.rms_px, "held_out_towards_rms_px": unseen.towards_rms_px,
        "alignment_median_px": _number(measured["alignment_median_px"]),
        "alignment_p95_px": _number(measured["alignment_p95_px"]),
        "folds": _number(measured["folds"]), "occluded": float(hidden.sum() / max(1, inside.sum())),
    }  # fmt: skip


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
