"""From two layers to a panorama: what is decided, in which order, and what frames of a clip share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.composition import Decided, composed, pooled_decision
from edf_stitch.core.compose.overlap import SAME_TONE
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.arrays import without_specks
from edf_stitch.core.raster.log_encoding import log_encode

from ..panorama.test_visibility import OFFSET, SHAPE, SIDEWAYS, TARGET, points

FLOATS = (False, False)


def pictures(gain: float = 1.0) -> tuple[Layer, Layer, Any]:
    """What the canvas shows of cards before a wall, pasted and fetched by the true warp."""
    warp, hidden = SIDEWAYS.truth()
    rough = cv2.resize(np.random.default_rng(0).random((60, 90, 3)), SHAPE[::-1], interpolation=cv2.INTER_CUBIC)
    light = (0.1 + 0.4 * np.clip(rough, 0, 1)).astype(np.float32)
    near = warp.inverse_depth > 0.11
    light[near] = light[near] * [0.2, 0.9, 0.3]
    x, y = np.moveaxis(points(), -1, 0)
    inside = ((x >= 0) & (y >= 0) & (x < TARGET[0]) & (y < TARGET[1])).astype(np.float32)
    seen = light.copy()
    seen[hidden] = [0.05, 0.4, 0.1]  # of what hides it
    alpha = warp.inside(TARGET).astype(np.float32)
    return Layer(light * inside[..., None], inside), Layer(seen * alpha[..., None] / np.float32(gain), alpha), warp


def compose(first: Layer, second: Layer, warp: Any, decided: Decided | None = None, said: list | None = None,
            painted: np.ndarray | None = None, keep: bool = False, **options: Any) -> tuple[Layer, Layer, Decided]:
    steps = (lambda *step: None) if said is None else (lambda stage, share: said.append(stage))
    return composed(first, second, warp, SIDEWAYS.view, TARGET, StitchOptions(**options), FLOATS, painted, steps,
                    decided, keep)  # fmt: skip


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}, {"seam": "none"}])
def test_what_the_target_cannot_see_never_comes_from_it(options: dict) -> None:
    first, second, warp = pictures()
    first.alpha[80:120] = 0
    out, _, found = compose(first, second, warp, **options)
    ours = found.hidden & (first.alpha > 0)
    assert ours.sum() > 300
    assert np.abs(second.pixels - first.pixels)[ours].mean() > 0.05
    away = np.abs(log_encode(out.pixels) - log_encode(first.pixels))[ours]
    assert away.max() <= 2 * SAME_TONE and np.percentile(away, 95) < 0.03, "specks that look alike apart"
    holes = found.hidden & (first.alpha == 0)
    assert holes.any() and not out.alpha[holes].any(), "nobody sees it: transparent, not filled"
    assert not out.pixels[holes].any(), "a file would keep its colour under the alpha"
    assert found.holes == (holes & (second.alpha > 0)).sum() > 0


def test_holes_are_filled_where_that_is_asked_for_and_nothing_else_changes() -> None:
    first, second, warp = pictures()
    first.alpha[80:120] = 0
    for blend in ({}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}):
        left, _, found = compose(first, second, warp, **blend)
        out, _, found_too = compose(first, second, warp, holes="inpaint", **blend)
        holes = found.hidden & (first.alpha == 0) & (second.alpha > 0)
        assert found_too.holes == found.holes == holes.sum() > 0
        assert np.array_equal(out.alpha > 0, (left.alpha > 0) | holes) and (out.alpha[holes] == 1).all()
        assert np.array_equal(out.pixels[~holes], left.pixels[~holes]) and (out.pixels[holes] > 0).all()
    average, _, _ = compose(first, second, warp, blend="linear", holes="inpaint")
    assert np.array_equal(average.pixels, compose(first, second, warp, blend="linear")[0].pixels), "it has no holes"


def test_an_average_hides_nothing() -> None:
    first, second, warp = pictures()
    out, _, found = compose(first, second, warp, blend="linear")
    both = (first.alpha > 0) & (second.alpha > 0)
    exposed = found.exposure.applied(second)
    assert np.allclose(out.pixels[both], (first.pixels[both] + exposed.pixels[both]) / 2, atol=1e-6)
    assert found.from_target is None


def test_exposure_is_evened_out_unless_it_is_to_stay() -> None:
    first, second, warp = pictures(gain=1.4)
    out, exposed, found = compose(first, second, warp)
    assert np.allclose(found.exposure.gain, 1.4, rtol=0.01)
    alone = (second.alpha > 0) & (first.alpha == 0) & (out.alpha > 0)
    assert np.allclose(out.pixels[alone], 1.4 * second.pixels[alone], rtol=0.05)
    _, kept, found = compose(first, second, warp, exposure=False)
    assert np.array_equal(kept.pixels, second.pixels) and kept.alpha is second.alpha and found.exposure.blocks == 0


def test_the_stages_come_in_the_order_of_the_data() -> None:
    said: list[str] = []
    compose(*pictures(), said=said)
    assert said == ["occlusion", "exposure", "seam", "blend"]


def test_paint_decides() -> None:
    first, second, warp = pictures()
    painted = np.zeros(SHAPE, np.int8)
    painted[60:120, 120:200] = 1
    _, _, found = compose(first, second, warp, painted=painted)
    assert found.from_target is not None
    assert found.from_target[(painted > 0) & (second.alpha > 0)].all()


def test_frames_keep_to_what_was_decided_for_the_clip() -> None:
    first, second, warp = pictures()
    *_, found = compose(first, second, warp)
    dim = Layer(second.pixels / 2, second.alpha.copy())
    dim.alpha[:, -40:] = 0
    out, exposed, kept = compose(first, dim, warp, decided=found)
    assert kept is found and np.allclose(exposed.pixels, dim.pixels * found.exposure.gain)
    assert not out.alpha[(dim.alpha == 0) & (first.alpha == 0)].any()
    again, _, _ = compose(first, second, warp, decided=found)
    fresh, _, _ = compose(first, second, warp)
    assert np.array_equal(again.pixels, fresh.pixels)


def test_a_clips_seam_is_cheap_over_all_its_frames() -> None:
    """Each frame has something else in the way; the common seam avoids all of it."""
    first, second, warp = pictures()
    decisions = []
    for top in (40, 90, 140):
        walker = first.pixels.copy()
        walker[top : top + 40, 230:300] = 0.9
        decisions.append(compose(Layer(walker, first.alpha), second, warp, keep=True)[2])
    shared = pooled_decision(decisions)
    assert shared.from_target is not None and shared.cost is not None
    for name in ("cost", "price"):
        assert np.allclose(getattr(shared, name), np.mean([getattr(d, name) for d in decisions], axis=0))
    assert shared.exposure.gain == pytest.approx(np.median([d.exposure.gain for d in decisions], axis=0))
    dropped = compose(first, second, warp)[2]
    assert dropped.from_target is not None and dropped.cost is dropped.price is dropped.known is None
    none = pooled_decision([replace(d, known=None, cost=None, box=None, from_target=None) for d in decisions])
    assert none.from_target is None


def test_offsets_are_those_of_the_tests_world() -> None:
    assert pictures()[0].alpha[OFFSET[1], OFFSET[0]] == 1


def test_specks_are_of_no_consequence() -> None:
    hidden = np.zeros(SHAPE, bool)
    hidden[100:103, 200:203] = hidden[20:60, 100:160] = True
    kept = without_specks(hidden)
    assert kept[20:60, 100:160].all() and not kept[100:103, 200:203].any()


def test_what_turns_over_comes_from_the_reference_and_still_counts_as_a_fold() -> None:
    first, second, warp = pictures()
    row, column = np.argwhere((first.alpha > 0) & (second.alpha > 0) & warp.inside(TARGET)).mean(axis=0).astype(int)
    spot = np.s_[row - 3 : row + 3, column - 3 : column + 3]
    map_x = warp.map_x.copy()
    map_x[spot] = map_x[spot][:, ::-1]
    _, _, plain = compose(first, second, warp)
    _, _, found = compose(first, second, replace(warp, map_x=map_x))
    assert found.folds > plain.folds and found.hidden[spot][1:-1, 1:-1].mean() > 0.8
