"""Figures that no other module has: canvas values, and folds away from what is occluded; and the judge's own scorer."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.compare.figures import FIGURES, figures_of, figures_of_placed
from edf_stitch.core.compare.tables import shown
from edf_stitch.core.measure.metrics import box_similarity, canvas_quality, overlap_quality, overlap_views, psnr, ssim
from edf_stitch.core.measure.placed.of_result import placed
from edf_stitch.core.measure.published_measures import udis_quality
from edf_stitch.core.output.warp_file import warp_bytes
from edf_stitch.core.pipeline import StitchResult


def test_canvas_values_are_of_both_pictures_black_outside_the_overlap(small_result: StitchResult) -> None:
    """The slow way: the whole canvas built and averaged."""
    result = small_result
    view, fetched, inside = overlap_views((result.pictures[0], result.pictures[1]), result.warp)
    canvas = result.warp.canvas
    whole = np.zeros((2, canvas.height, canvas.width, 3), np.uint8)
    (x, y), (height, width) = canvas.offset, inside.shape
    for layer, part in zip(whole, (view, fetched), strict=True):
        layer[y : y + height, x : x + width] = np.where(inside[..., None], part, 0)
    everywhere = np.ones(whole.shape[1:3], bool)
    found = canvas_quality((result.pictures[0], result.pictures[1]), result.warp)
    assert found["canvas_psnr_db"] == pytest.approx(psnr(*whole, everywhere), abs=1e-4)
    # windows that hang over the canvas's edge are counted by the one and not by the other
    assert found["canvas_ssim"] == pytest.approx(ssim(*whole, everywhere), abs=0.02)
    assert found["canvas_psnr_db"] > overlap_quality(result.pictures, result.warp)["overlap_psnr_db"]


def test_published_measures_count_black_as_their_papers_do(small_result: StitchResult) -> None:
    """The slow way: both pictures black outside the overlap, averaged over the reference's whole frame."""
    view, fetched, inside = overlap_views(small_result.pictures, small_result.warp)
    bare = [np.where(inside[..., None], one, 0).astype(np.uint8) for one in (view, fetched)]
    everywhere = np.ones(inside.shape, bool)
    found = udis_quality(small_result.pictures, small_result.warp)
    assert found["udis_psnr_db"] == pytest.approx(psnr(*bare, everywhere), abs=1e-4)
    alike = [box_similarity(bare[0][..., [c]], bare[1][..., [c]]).mean() for c in range(3)]
    assert found["udis_ssim"] == pytest.approx(float(np.mean(alike)), abs=2e-3)
    assert found["udis_psnr_db"] > overlap_quality(small_result.pictures, small_result.warp)["overlap_psnr_db"]


def test_folds_are_those_of_the_report(small_result: StitchResult) -> None:
    """Before what turns over was taken for hidden: else no field would have any."""
    report = {**small_result.report, "measured": {**small_result.report["measured"], "folds": 0.125}}
    edge = small_result.edges[0]
    found = figures_of(replace(small_result, report=report), edge, edge.two_view.F, 0)
    assert found["folds"] == 0.125


def test_every_figure_has_a_name_and_digits(small_result: StitchResult) -> None:
    edge = small_result.edges[0]
    found = figures_of(small_result, edge, edge.two_view.F, 0)
    others = figures_of_placed(placed(small_result), small_result.pictures, lambda one, other: edge.two_view.F)
    assert found.keys() | others.keys() == {name for name in FIGURES if not name.startswith("truth_")}
    assert others["overlap_psnr_db"] == pytest.approx(found["overlap_psnr_db"], abs=0.5), "measured on the canvas"
    assert all(shown(value, name) for name, value in found.items())
    assert found["projectivity_px"] == found["projectivity_independent_px"], "by the same F the same"


def test_the_judges_scorer_says_the_same_of_the_overlap(
    small_result: StitchResult, folder: Path, tmp_path: Path
) -> None:
    score = Path(__file__).resolve().parents[4] / "shared" / "tools" / "score.py"
    if not score.is_file():
        pytest.skip("no scorer beside the checkout")
    (tmp_path / "warp.npz").write_bytes(warp_bytes(small_result))
    pictures = [str(folder / f"{name}.png") for name in ("reference", "target")]
    said = subprocess.run(
        [sys.executable, str(score), *pictures, str(tmp_path / "warp.npz")], capture_output=True, text=True, check=True
    )
    theirs = json.loads(said.stdout)
    ours = overlap_quality(small_result.pictures, small_result.warp)
    ours |= canvas_quality(small_result.pictures, small_result.warp)
    assert ours["overlap_psnr_db"] == pytest.approx(theirs["ov_psnr_rgb"], abs=0.01)
    assert ours["overlap_ssim"] == pytest.approx(theirs["ov_ssim_g11"], abs=0.002)
    assert ours["canvas_psnr_db"] == pytest.approx(theirs["canvas_psnr_rgb"], abs=0.01)
    assert ours["canvas_ssim"] == pytest.approx(theirs["canvas_ssim_g11"], abs=0.005)
    assert ours["overlap_px"] == theirs["overlap_px"]
