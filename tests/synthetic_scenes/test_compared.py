"""What `edf compare` is told of a rendered pair: its cameras, and figures against the truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.synthetic_scenes.compared import RenderedTruth, truth_beside
from edf_stitch.synthetic_scenes.measures import figures, hidden_quality, truth_of
from edf_stitch.synthetic_scenes.rendered import RenderedPair

from ..pairs import ON_REFERENCE


@pytest.fixture(scope="module")
def truth(rendered: RenderedPair) -> RenderedTruth:
    return RenderedTruth(rendered, truth_of(rendered))


@pytest.fixture(scope="module")
def stitched(rendered: RenderedPair, truth: RenderedTruth) -> StitchResult:
    return stitch((rendered.reference, rendered.target), replace(ON_REFERENCE, camera=truth.camera, measure=False))


def test_it_tells_the_true_focal_lengths(rendered: RenderedPair, truth: RenderedTruth) -> None:
    assert truth.camera.focal_px == (rendered.cameras["reference"].K[0, 0], rendered.cameras["target"].K[0, 0])


def test_its_figures_are_the_validations(truth: RenderedTruth, stitched: StitchResult) -> None:
    found = truth.figures({"slack": stitched})["slack"]
    theirs = figures(stitched, truth.truth)
    assert found["truth_alignment_px"] == theirs["alignment_px"] < 3
    assert found["truth_projectivity_px"] == theirs["projectivity_px"] and found["truth_whole_psnr_db"] > 15


def test_whole_pictures_are_compared_over_what_all_show(truth: RenderedTruth, stitched: StitchResult) -> None:
    less = stitched.alpha.copy()
    less[:, : less.shape[1] // 2] = 0
    alone = truth.figures({"a": stitched})["a"]["truth_whole_psnr_db"]
    both = truth.figures({"a": stitched, "b": replace(stitched, panorama=Layer(stitched.pixels, less))})
    assert both["a"]["truth_whole_psnr_db"] == both["b"]["truth_whole_psnr_db"] != alone


def test_what_is_hidden_is_counted_both_ways(truth: RenderedTruth, stitched: StitchResult) -> None:
    """The truth itself is perfect; nothing said has no precision; everything said finds all."""
    canvas, (left, top) = stitched.warp.canvas, truth.truth.corner
    hidden = ~truth.truth.in_target
    rows, columns = np.indices((canvas.height, canvas.width))
    y, x = rows - canvas.offset[1] - top, columns - canvas.offset[0] - left
    there = (y >= 0) & (x >= 0) & (y < hidden.shape[0]) & (x < hidden.shape[1])
    true = np.where(there, hidden[np.where(there, y, 0), np.where(there, x, 0)], False)
    right = hidden_quality(replace(stitched, occluded=(true, true)), truth.truth)
    assert right == {"occluded_precision": 1.0, "occluded_recall": 1.0}
    everything = hidden_quality(replace(stitched, occluded=(true, np.ones_like(true))), truth.truth)
    assert everything["occluded_recall"] == 1.0 and 0 < everything["occluded_precision"] < 0.5
    nothing = hidden_quality(replace(stitched, occluded=(true, np.zeros_like(true))), truth.truth)
    assert nothing["occluded_recall"] == 0.0 and np.isnan(nothing["occluded_precision"])


def test_a_folder_without_truth_has_none(tmp_path: Path) -> None:
    assert truth_beside(tmp_path) is None
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": {}}))
    assert truth_beside(tmp_path) is None, "a user's camera file is no rendered truth"
