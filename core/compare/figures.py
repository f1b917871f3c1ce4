"""Figures of a field on a pair, and of any program's panorama, measured alike for all."""

from __future__ import annotations

from collections.abc import Sequence

from ..cameras.edge import Edge
from ..measure.held_out import held_out
from ..measure.metrics import canvas_quality, coverage_samples, off_line_mean, overlap_quality
from ..measure.placed.keep import keep_figures
from ..measure.placed.of_result import placed
from ..measure.placed.off_lines import Fundamental, off_line_figures
from ..measure.placed.overlaps import gained_figures, plain_figures
from ..measure.placed.placed import PlacedSet
from ..measure.placed.straightness import line_figures
from ..measure.projectivity import projectivity
from ..measure.published_measures import udis_quality
from ..pictures.picture import Picture
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
    "udis_psnr_db": ("mPSNR as of UDIS, black counts", "dB", 2, None),
    "udis_ssim": ("mSSIM as of UDIS, black counts", "", 3, None),
    "gained_psnr_db": ("overlaps after one gain, PSNR", "dB", 2, True),
    "gained_ssim": ("overlaps after one gain, SSIM", "", 3, True),
    "gained_ssim_worst": ("SSIM of the worst overlap", "", 3, True),
    "used": ("pictures used", "", 0, None), "overlaps": ("overlaps", "", 0, None),
    "off_lines_px": ("off independent epipolar lines, median", "px", 2, False),
    "bent_px": ("long straight lines: bent by", "px", 2, False),
    "bent_alone_px": ("the same of what one picture alone shows", "px", 2, False),
    "lines": ("long straight lines", "", 0, None), "lines_alone": ("of them seen by one picture alone", "", 0, None),
    "fill": ("shown, of the smallest box", "%", 1, None),
    "inscribed": ("largest full rectangle, of the smallest box", "%", 1, None),
    "holes": ("closed holes", "%", 3, False),
    "far_enlarged": ("enlarged beyond the overlap, 99th", "×", 2, None),
    "turned_over": ("turned over, all pictures", "%", 3, False),
}  # fmt: skip
SHARES = ("folds", "occluded", "fill", "inscribed", "holes", "turned_over")
# What may be asked for with --measure: what it is about.
MEASURES = ("keep", "overlap", "projectivity", "lines")


def figures_of(
    result: StitchResult, edge: Edge, independent: Array, seed: int, measures: Sequence[str] = MEASURES
) -> dict[str, float]:
    """The figures of a stitch on its whole flat canvas, by the keys of FIGURES; NaN where undefined.

    Projectivity is by the edge's own F and by `independent`, whatever the field knows of them, so that all fields are
    measured alike; folds are counted outside occlusions and their rims.
    """
    warp = result.warp
    measured = result.report["measured"]
    figures = {
        "alignment_median_px": _number(measured["alignment_median_px"]),
        "alignment_p95_px": _number(measured["alignment_p95_px"]),
    }  # fmt: skip
    if "overlap" in measures:
        inside = (result.layers[edge.i].alpha > 0) & warp.maps[edge.j].inside()
        hidden = result.occluded[edge.j] & inside
        figures |= {
            **overlap_quality(result.pictures, warp, edge.j), **canvas_quality(result.pictures, warp, edge.j),
            **udis_quality(result.pictures, warp, edge.j), "folds": _number(measured["folds"]),
            "occluded": float(hidden.sum() / max(1, inside.sum())),
        }  # fmt: skip
    if "projectivity" in measures:
        shown = coverage_samples(warp, result.cameras, edge.j)
        F = edge.two_view.F
        unseen = held_out(result.pair_field, edge.inliers, shown, seed)
        figures |= {
            "projectivity_px": projectivity(F, shown), "projectivity_independent_px": projectivity(independent, shown),
            "off_line_mean_px": off_line_mean(F, shown), "held_out_rms_px": unseen.rms_px,
            "held_out_towards_rms_px": unseen.towards_rms_px,
        }  # fmt: skip
    if "lines" in measures or "keep" in measures:
        panorama = placed(result)
        figures |= line_figures(panorama, result.pictures) if "lines" in measures else {}
        figures |= keep_figures(panorama) if "keep" in measures else {}
    return figures


def figures_of_placed(
    panorama: PlacedSet, pictures: Sequence[Picture], fundamental: Fundamental, measures: Sequence[str] = MEASURES
) -> dict[str, float]:
    """The figures of any program's panorama; pictures: those that it uses, in its order."""
    figures: dict[str, float] = {}
    if "overlap" in measures:
        figures |= gained_figures(panorama) | (plain_figures(panorama) if len(pictures) == 2 else {})
    if "projectivity" in measures:
        figures |= off_line_figures(panorama, pictures, fundamental)
    figures |= line_figures(panorama, pictures) if "lines" in measures else {}
    return figures | (keep_figures(panorama) if "keep" in measures else {})


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
