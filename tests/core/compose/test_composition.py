"""From two layers to a panorama: what is decided, in which order, and what frames of a clip share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.composition import Composition, composed
from edf_stitch.core.compose.decided import Decided
from edf_stitch.core.compose.inpaint import closed_holes
from edf_stitch.core.compose.options import INPAINT, OVERLAP
from edf_stitch.core.compose.pooling import pooled_decision
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.reference_map import ReferenceMap
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.arrays import larger_parts, without_specks
from edf_stitch.core.raster.log_encoding import log_encode
from edf_stitch.core.raster.picture_map import PictureMap

from ...pairs import ON_REFERENCE, with_map
from ..field.test_visibility import OFFSET, SHAPE, SIDEWAYS, TARGET, points

FLOATS = (False, False)


def pictures(gain: float = 1.0) -> tuple[Layer, Layer, Warp]:
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
    alpha = warp.maps[1].inside().astype(np.float32)
    return Layer(light * inside[..., None], inside), Layer(seen * alpha[..., None] / np.float32(gain), alpha), warp


def compose(first: Layer, second: Layer, warp: Warp, decided: Decided | None = None, said: list | None = None,
            painted: np.ndarray | None = None, keep: bool = False, **options: Any) -> tuple[Layer, Layer, Decided]:
    """The panorama, the second layer as it was exposed, and what was decided about it."""
    steps = (lambda *step: None) if said is None else (lambda stage, share: said.append(stage))
    both = None if decided is None else (decided, decided)  # about the reference there is nothing to decide
    wanted = replace(ON_REFERENCE, **options)
    made = composed((first, second), warp, SIDEWAYS.views, wanted, FLOATS, painted, steps, both, keep)
    return made.panorama, made.exposed[1], made.decided[1]


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}, {"seam": "none"}])
def test_what_the_target_cannot_see_never_comes_from_it(options: dict) -> None:
    first, second, warp = pictures()
    first.alpha[80:120] = 0
    out, _, found = compose(first, second, warp, **options)
    ours = found.hidden & (first.alpha > 0)
    assert ours.sum() > 300
    assert np.abs(second.pixels - first.pixels)[ours].mean() > 0.05
    away = np.abs(log_encode(out.pixels) - log_encode(first.pixels))[ours]
    assert away.max() <= 2 * OVERLAP.same_tone and np.percentile(away, 95) < 0.03, "specks that look alike apart"
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


def test_small_closed_holes_are_filled_by_themselves_and_larger_ones_are_left() -> None:
    first, second, warp = pictures()
    most = int(first.alpha.size * INPAINT.small_share)
    small, large = np.zeros((2, *SHAPE), bool)
    small[60:63, 100:104] = True
    large[100:120, 40 : 41 + most // 20] = True
    for one in (first, second):
        one.alpha[small | large] = 0
    left, out = (compose(first, second, warp, holes=holes)[0] for holes in ("transparent", "auto"))
    assert not left.alpha[small | large].any() and not out.alpha[large].any()
    assert (out.alpha[small] == 1).all() and (out.pixels[small] > 0).all()
    closed = closed_holes(left.alpha > 0, small=True)[0]
    assert np.array_equal((out.alpha > 0) & (left.alpha == 0), closed) and closed[small].all()
    assert np.array_equal(out.pixels[~closed], left.pixels[~closed])


def test_an_average_hides_nothing() -> None:
    first, second, warp = pictures()
    out, _, found = compose(first, second, warp, blend="linear")
    both = (first.alpha > 0) & (second.alpha > 0)
    exposed = found.exposure.applied(second, warp.maps[1])
    assert np.allclose(out.pixels[both], (first.pixels[both] + exposed.pixels[both]) / 2, atol=1e-6)
    assert found.chosen is None


def test_exposure_is_evened_out_unless_it_is_to_stay() -> None:
    first, second, warp = pictures(gain=1.4)
    out, exposed, found = compose(first, second, warp)
    assert np.allclose(found.exposure.gain, 1.4, rtol=0.01)
    alone = (second.alpha > 0) & (first.alpha == 0) & (out.alpha > 0)
    assert np.allclose(out.pixels[alone], 1.4 * second.pixels[alone], rtol=0.05)
    _, kept, found = compose(first, second, warp, exposure="none")
    assert np.array_equal(kept.pixels, second.pixels) and kept.alpha is second.alpha and found.exposure.blocks == 0


def test_both_pictures_meet_at_one_exposure_and_frames_keep_to_it() -> None:
    first, second, warp = pictures(gain=1.4)
    options = replace(ON_REFERENCE, exposure="auto")

    def made(*layers: Layer, decided: Any = None) -> Composition:
        return composed(layers, warp, SIDEWAYS.views, options, FLOATS, None, lambda *_: None, decided)

    found = made(first, second)
    light, other = (one.exposure for one in found.decided)
    assert light.keeps_white and other.keeps_white
    assert np.allclose(light.gain, 1.4**-0.35, rtol=0.01) and np.allclose(other.gain, 1.4**0.65, rtol=0.01)
    both = (first.alpha > 0) & (second.alpha > 0) & ~found.decided[1].hidden
    apart = np.abs(found.exposed[0].pixels - found.exposed[1].pixels)[both]
    assert np.percentile(apart, 95) < 0.01
    alone = (found.labels == 0) & ~both
    assert np.percentile(np.abs(found.panorama.pixels - found.exposed[0].pixels)[alone], 90) < 0.01
    dim = made(Layer(first.pixels / 2, first.alpha), Layer(second.pixels / 3, second.alpha), decided=found.decided)
    assert np.allclose(dim.exposed[0].pixels, first.pixels / 2 * light.gain, atol=2e-3)
    assert np.allclose(dim.exposed[1].pixels, second.pixels / 3 * other.gain, atol=2e-3)


def test_the_stages_come_in_the_order_of_the_data() -> None:
    said: list[str] = []
    compose(*pictures(), said=said)
    assert said == ["occlusion", "exposure", "seam", "blend"]


def test_paint_decides() -> None:
    first, second, warp = pictures()
    painted = np.zeros(SHAPE, np.int8)
    painted[60:120, 120:200] = 1
    _, _, found = compose(first, second, warp, painted=painted)
    assert found.chosen is not None
    assert found.chosen[(painted > 0) & (second.alpha > 0)].all()


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
    (shared,) = pooled_decision([[decision] for decision in decisions])
    assert shared.chosen is not None and shared.costs is not None
    assert np.allclose(shared.costs.price, np.mean([d.costs.price for d in decisions if d.costs], axis=0))
    assert shared.exposure.gain == pytest.approx(np.median([d.exposure.gain for d in decisions], axis=0))
    dropped = compose(first, second, warp)[2]
    assert dropped.chosen is not None and dropped.costs is dropped.known is None
    (none,) = pooled_decision([[replace(d, known=None, costs=None, chosen=None)] for d in decisions])
    assert none.chosen is None


def test_offsets_are_those_of_the_tests_world() -> None:
    assert pictures()[0].alpha[OFFSET[1], OFFSET[0]] == 1


def test_specks_are_of_no_consequence() -> None:
    hidden = np.zeros(SHAPE, bool)
    hidden[100:103, 200:203] = hidden[20:60, 100:160] = True
    kept = without_specks(hidden)
    assert kept[20:60, 100:160].all() and not kept[100:103, 200:203].any()


def test_what_turns_over_comes_from_the_reference_and_still_counts_as_a_fold() -> None:
    first, second, warp = pictures()
    row, column = np.argwhere((first.alpha > 0) & (second.alpha > 0) & warp.maps[1].inside()).mean(axis=0).astype(int)
    spot = np.s_[row - 3 : row + 3, column - 3 : column + 3]
    map_x = warp.maps[1].x.copy()
    map_x[spot] = map_x[spot][:, ::-1]
    _, _, plain = compose(first, second, warp)
    _, _, found = compose(first, second, with_map(warp, map_x))
    assert found.folds > plain.folds and found.hidden[spot][1:-1, 1:-1].mean() > 0.8


# --- three pictures -------------------------------------------------------------------------------------------------

HEIGHT, WIDTH = 100, 420
SIDE_BY_SIDE = (slice(0, 140), slice(100, 300), slice(260, 420))  # 40 columns are shared by two, none by all


def shown_in(columns: slice) -> np.ndarray:
    """Where a picture of these columns shows something: all but the uppermost rows, which none shows."""
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[10:, columns] = True
    return shown


def three(lights: Any, columns: tuple[slice, ...] = SIDE_BY_SIDE, **options: Any) -> Composition:
    """Three pictures of what has no depth, seen from one place: each a part of the canvas, pixel for pixel."""
    shown = [shown_in(one) for one in columns]
    layers = [Layer((light * one[..., None]).astype(np.float32), one) for light, one in zip(lights, shown, strict=True)]
    canvas, camera = Canvas(WIDTH, HEIGHT, (0, 0)), Camera(np.eye(3), (WIDTH, HEIGHT), "test", 0.0)
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    same = PictureMap(x, y, camera.size)
    warp = Warp(canvas, (ReferenceMap(canvas, camera), same, same), np.full((HEIGHT, WIDTH), np.nan, np.float32))
    view = View(camera, np.eye(3), np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    return composed(layers, warp, (view,) * 3, replace(ON_REFERENCE, **options), (True,) * 3, None, lambda *_: None)


def wall() -> np.ndarray:
    return 0.3 + 0.1 * np.random.default_rng(1).random((HEIGHT, WIDTH, 3))


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"seam": "none"}])
def test_three_pictures_side_by_side_show_all_that_any_of_them_shows(options: dict) -> None:
    tones = np.float32([0.2, 0.35, 0.5])
    made = three(tones[:, None, None, None] * np.ones((3, HEIGHT, WIDTH, 3)), exposure="none", **options)
    shown = np.stack([shown_in(columns) for columns in SIDE_BY_SIDE])
    assert np.array_equal(made.panorama.alpha > 0, shown.any(axis=0)) and len(made.decided) == len(made.exposed) == 3
    labels = made.labels
    assert labels is not None and (labels[~shown.any(axis=0)] == -1).all()
    for number in range(3):
        assert (labels[shown[number] & (shown.sum(axis=0) == 1)] == number).all()
        assert shown[number][labels == number].all()
    first, second = (one.window.spread(one.chosen) for one in made.decided[1:])
    assert made.decided[0].chosen is None and made.decided[0].window is None
    assert np.array_equal(labels == 2, second) and np.array_equal(labels == 1, first & ~second)
    assert np.array_equal(labels == 0, shown.any(axis=0) & ~first & ~second)
    for columns, tone in zip((slice(0, 60), slice(180, 220), slice(340, WIDTH)), tones, strict=True):
        assert (made.panorama.pixels[10:, columns] == tone).all(), "away from the seams all stays as it is"


def test_the_third_pictures_exposure_follows_through_the_second() -> None:
    """It does not meet the reference: what it is matched to is the second as that was matched."""
    made = three([wall(), wall() / 2, wall() / 4])
    for number, gain in ((1, 2.0), (2, 4.0)):
        assert made.decided[number].exposure.blocks > 0
        assert np.allclose(made.decided[number].exposure.gain, gain, rtol=1e-4)
        shown = shown_in(SIDE_BY_SIDE[number])
        assert np.allclose(made.exposed[number].pixels[shown], wall()[shown], rtol=1e-4)
    shown = made.panorama.alpha > 0
    assert np.allclose(made.panorama.pixels[shown], wall()[shown], rtol=1e-3)


def test_an_average_of_three_counts_each_alike() -> None:
    lights = np.random.default_rng(2).random((3, HEIGHT, WIDTH, 3)).astype(np.float32)
    columns = (slice(0, 300), slice(60, 360), slice(120, WIDTH))
    made = three(lights, columns, blend="linear", exposure="none")
    shown = np.stack([shown_in(one) for one in columns])
    count = shown.sum(axis=0)
    assert made.labels is None and (count == 3).sum() > 10_000
    mean = (lights.astype(float) * shown[..., None]).sum(axis=0)[count > 0] / count[count > 0, None]
    assert np.allclose(made.panorama.pixels[count > 0], mean, atol=1e-6)


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"seam": "none"}])
def test_pictures_that_do_not_meet_are_shown_side_by_side(options: dict) -> None:
    first, second, warp = pictures()
    first.alpha[:, 180:] = second.alpha[:, :200] = 0
    out, _, found = compose(first, second, warp, exposure="none", **options)
    shown = second.alpha > 0
    shown &= ~found.hidden
    assert np.array_equal(found.chosen, shown) and shown.sum() > 5000
    assert np.array_equal(out.alpha > 0, shown | (first.alpha > 0))
    assert np.array_equal(out.pixels[shown], second.pixels[shown])
    assert np.array_equal(out.pixels[first.alpha > 0], first.pixels[first.alpha > 0])


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}, {"seam": "none"}])
def test_what_a_sliding_viewpoint_sees_behind_the_references_things_comes_from_the_target(options: dict) -> None:
    """What neither sees is a hole, even where the reference's map falls inside it."""
    first, second, warp = pictures()
    behind = np.zeros(SHAPE, bool)
    behind[60:90, 150:180] = True
    ghost = first.pixels.copy()
    ghost[behind] = [0.9, 0.1, 0.9]
    slides = replace(warp, behind=behind)
    out, _, found = compose(Layer(ghost, first.alpha), second, slides, **options)
    seen = behind & ~found.hidden & (second.alpha > 0) & (first.alpha > 0)
    assert seen.sum() > 400
    away = np.abs(log_encode(out.pixels) - log_encode(second.pixels))[seen]
    assert np.percentile(away, 95) < 0.05, "the ghost is nowhere to be seen"
    nobody = behind & (first.alpha > 0) & (found.hidden | (second.alpha == 0))
    assert not out.alpha[nobody].any()


def test_narrow_strips_that_the_reference_cannot_see_come_from_the_target() -> None:
    """A pole's rim that would show twice is a strip of a few px; what is smaller than that may be rounding."""
    first, second, warp = pictures()
    behind = np.zeros(SHAPE, bool)
    behind[50:90, 158:162] = True
    rim = first.pixels.copy()
    rim[behind] = 0.9
    found = compose(Layer(rim, first.alpha), second, replace(warp, behind=behind))[2]
    seen = behind & ~found.hidden & (second.alpha > 0) & (first.alpha > 0)
    assert seen.sum() > 100 and found.chosen is not None and found.chosen[seen].all()
    assert not larger_parts(behind & (np.arange(SHAPE[0]) < 60)[:, None]).any()
