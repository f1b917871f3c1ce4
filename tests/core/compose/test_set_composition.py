"""More than two pictures become a panorama."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.compose import composition
from edf_stitch.core.compose.composition import Composition
from edf_stitch.core.compose.pooling import pooled_decision
from edf_stitch.core.compose.wraparound import rolled
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.log_encoding import log_encode
from edf_stitch.core.raster.picture_map import PictureMap

from .rings import CANVAS, HEIGHT, RING, ROWS, WIDTH, compose, layers_of, shown, wall, warp_of

GAINS = 2 ** np.random.default_rng(0).uniform(-0.6, 0.6, (7, 3))
EVERYWHERE = np.s_[ROWS.start : ROWS.stop]


def ring() -> list[Layer]:
    """Seven pictures of a wall all around, each lit otherwise."""
    return layers_of([wall() * gain for gain in GAINS])


def steps(panorama: np.ndarray) -> np.ndarray:
    """Tone steps (W,) from each column to the next, around the sphere, beyond those of the wall itself."""
    tones = [log_encode(light[EVERYWHERE].astype(np.float32)).mean(axis=2) for light in (panorama, wall())]
    differences = [one - np.roll(one, -1, axis=1) for one in tones]
    return np.abs(differences[0] - differences[1]).max(axis=0)


@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"seam": "none"}, {"blend": "linear"}])
def test_a_ring_closes_without_a_step(options: dict[str, Any]) -> None:
    made = compose(ring(), warp_of(), exposure="auto", **options)
    assert (made.panorama.alpha[EVERYWHERE] > 0).all()
    light = made.panorama.pixels
    ratio = np.median(light[EVERYWHERE] / wall()[EVERYWHERE], axis=(0, 1))
    assert np.allclose(light[EVERYWHERE], wall()[EVERYWHERE] * ratio, rtol=0.01), "it is the wall, everywhere"
    assert steps(light).max() < 0.01
    assert (made.labels is None) == (options.get("blend") == "linear")


@pytest.mark.parametrize("turn", [1, 40, 333])
def test_it_looks_the_same_wherever_the_sphere_was_cut_open(turn: int) -> None:
    """Lit unequally and left so: bands even that out, also across ±180°."""
    warp = warp_of()
    turned = replace(
        warp, maps=tuple(PictureMap(rolled(at.x, turn), rolled(at.y, turn), at.size) for at in warp.maps)
    )
    whole = compose(ring(), warp, exposure="none")
    cut = compose([Layer(rolled(one.pixels, turn), rolled(one.alpha, turn)) for one in ring()], turned, exposure="none")
    assert np.array_equal(cut.labels, rolled(whole.labels, turn))
    assert np.allclose(cut.panorama.pixels, rolled(whole.panorama.pixels, turn), atol=1e-6)
    hard = np.choose(np.maximum(whole.labels, 0)[..., None], [one.pixels for one in ring()])
    assert steps(whole.panorama.pixels).max() < 0.25 * steps(hard).max()


def misplaced(centres: list[Any], order: list[int] | None = None, deviation: float | None = 0.02) -> Composition:
    """The ring from these places, given in this order: what is off by so many px is shifted by them."""
    order = order or list(range(7))
    places = [RING[number] for number in order]
    warp = warp_of(places, deviation=deviation)
    lights = [wall()] * 7
    made = compose(
        layers_of([lights[number] for number in order], places), warp, [centres[number] for number in order],
        exposure="none",
    )  # fmt: skip
    return made


def areas(made: Composition, order: list[int] | None = None) -> np.ndarray:
    """How much of the panorama comes from each picture, in the order of the ring."""
    counts = np.bincount(made.labels[made.labels >= 0], minlength=7)
    return counts[np.argsort(order)] if order else counts


@pytest.mark.parametrize("deviation", [None, 0.02])
def test_what_is_placed_worst_gets_least(deviation: float | None) -> None:
    """By the order alone, where nothing knows how far off it is; else by the price as well."""
    centres: list[Any] = [[0, 0.1, 0]] * 7
    for worst in (2, 5):
        apart = [[0, 2.0, 0] if number == worst else c for number, c in enumerate(centres)]
        found = areas(misplaced(apart, deviation=deviation))
        alone = (shown(RING[worst]) & ~shown(RING[worst - 1]) & ~shown(RING[(worst + 1) % 7])).sum()
        assert found[worst] == found.min() and alone <= found[worst] < 1.2 * alone


def test_the_order_of_the_pictures_does_not_matter() -> None:
    rng = np.random.default_rng(4)
    centres = list(rng.uniform(-1, 1, (7, 3)))
    first = misplaced(centres)
    for _ in range(3):
        order = rng.permutation(7).tolist()
        again = misplaced(centres, order)
        assert np.array_equal(areas(again, order), areas(first))
        assert np.array_equal(np.where(again.labels < 0, -1, np.array(order)[again.labels]), first.labels)


def test_a_picture_far_away_touches_nothing_else() -> None:
    """All pixels away from a picture and the margin of its bands keep their bits."""
    layers = ring()
    less = [Layer(one.light, one.alpha & (number != 3)) for number, one in enumerate(layers)]
    whole, without = (compose(some, warp_of(), exposure="none") for some in (layers, less))
    assert without.decided[3].window is None and not (without.labels == 3).any()
    window = whole.decided[3].window or without.decided[2].window
    assert window is not None and window.box[2] < WIDTH // 2
    away = ~window.spread(np.ones(window.shape, bool)) & ~shown(RING[3])
    assert away.sum() > WIDTH * HEIGHT // 2
    assert np.array_equal(whole.panorama.pixels[away], without.panorama.pixels[away])
    assert np.array_equal(whole.labels[away], without.labels[away])


def test_masks_of_other_pictures_stay_small() -> None:
    made = compose(ring(), warp_of(), exposure="none")
    added = [one for one in made.decided if one.window is not None]
    assert len(added) == 6 and all(one.chosen.shape == one.window.shape for one in added)
    assert all(one.hidden.strides == (0, 0) for one in made.decided), "nothing is hidden: no memory for it"


# --- what cannot be seen --------------------------------------------------------------------------------------------


def before_a_wall(confidence: float | None) -> tuple[list[Layer], Warp, list[Any]]:
    """Three pictures that overlap, of a thing before a wall; the map of the second folds behind the thing."""
    places = [(100, 200), (150, 200), (200, 200)]
    warp = warp_of(places)
    depth, x = warp.inverse_depth.copy(), warp.maps[1].x.copy()
    depth[150:200, 240:270] = 0.5
    x[150:200, 240:270] += 40  # so the thing comes to lie on the wall beside it, which it hides
    maps = (warp.maps[0], PictureMap(x, warp.maps[1].y, warp.maps[1].size), warp.maps[2])
    known = None if confidence is None else np.full((HEIGHT, WIDTH), confidence, np.float32)
    return layers_of([wall()] * 3, places), replace(warp, maps=maps, depth=depth, lazy_confidence=known), [
        np.zeros(3), [0.4, 0, 0], np.zeros(3)
    ]  # fmt: skip


def test_the_depth_order_counts_only_where_it_is_known() -> None:
    layers, warp, centres = before_a_wall(0.0)
    found = compose(layers, warp, centres, exposure="none").decided
    assert found[1].hidden[155:195, 285:305].mean() > 0.9
    assert not found[0].hidden.any() and not found[2].hidden.any()
    layers, warp, centres = before_a_wall(None)
    sparse = compose(layers, warp, centres, exposure="none").decided[1]
    assert not sparse.hidden[155:195, 285:305].any(), "a smooth field through points hides what is seen"


def test_the_only_picture_that_shows_a_pixel_shows_it() -> None:
    layers, warp, centres = before_a_wall(0.0)
    gap = np.zeros((HEIGHT, WIDTH), bool)
    gap[160:180, 290:300] = True
    layers = [Layer(one.light, one.alpha & ~gap) if number != 1 else one for number, one in enumerate(layers)]
    made = compose(layers, warp, centres, exposure="none")
    assert not made.decided[1].hidden[gap].any() and (made.labels[gap] == 1).all()
    assert (made.panorama.alpha[gap] > 0).all()


def test_what_is_hidden_from_all_is_shown_all_the_same() -> None:
    places = [(100, 200), (150, 200), (320, 200)]
    warp, spot = warp_of(places), np.s_[150:170, 200:220]
    maps = list(warp.maps)
    for number in (0, 1):
        x = maps[number].x.copy()
        x[spot] = x[spot][:, ::-1]
        maps[number] = PictureMap(x, maps[number].y, maps[number].size)
    made = compose(layers_of([wall()] * 3, places), replace(warp, maps=tuple(maps)), exposure="none")
    assert (made.panorama.alpha[spot] > 0).all() and (made.labels[spot] >= 0).all()
    assert not made.decided[0].hidden.any() and not made.decided[1].hidden.any()


def test_what_a_map_mirrors_comes_from_another_picture() -> None:
    places = [(100, 200), (150, 200), (200, 200)]
    warp = warp_of(places)
    x = warp.maps[0].x.copy()
    spot = np.s_[150:170, 200:220]
    x[spot] = x[spot][:, ::-1]
    warp = replace(warp, maps=(PictureMap(x, warp.maps[0].y, warp.maps[0].size), *warp.maps[1:]))
    made = compose(layers_of([wall()] * 3, places), warp, exposure="none")
    assert made.decided[0].hidden[spot][1:-1, 1:-1].mean() > 0.8
    assert (made.labels[spot][made.decided[0].hidden[spot]] == 1).all()


# --- what is asked for ----------------------------------------------------------------------------------------------


def test_small_closed_holes_are_filled() -> None:
    hole = np.zeros((HEIGHT, WIDTH), bool)
    hole[180:186, 300:306] = True
    layers = [Layer(one.light, one.alpha & ~hole) for one in ring()]
    assert np.array_equal(compose(layers, warp_of(), exposure="none", holes="auto").filled, hole)
    assert not compose(layers, warp_of(), exposure="none").panorama.alpha[hole].any()


@pytest.mark.parametrize("columns", [np.arange(280, 340), np.arange(-25, 25)], ids=["inside", "across the ends"])
def test_what_no_picture_shows_is_inpainted_where_that_is_asked_for(columns: np.ndarray) -> None:
    hole = np.zeros((HEIGHT, WIDTH), bool)
    hole[160:200, columns % WIDTH] = True
    layers = [Layer(one.light, one.alpha & ~hole) for one in ring()]
    made = compose(layers, warp_of(), exposure="none", holes="inpaint")
    assert np.array_equal(made.filled, hole) and (made.panorama.alpha[hole] == 1).all()
    light = made.panorama.pixels
    assert np.array_equal(light[~hole & shown((0, WIDTH))], compose(layers, warp_of(), exposure="none").panorama.pixels[
        ~hole & shown((0, WIDTH))])
    turn, warp = 200, warp_of()
    turned = replace(
        warp, maps=tuple(PictureMap(rolled(at.x, turn), rolled(at.y, turn), at.size) for at in warp.maps)
    )
    layers_turned = [Layer(rolled(one.pixels, turn), rolled(one.alpha, turn)) for one in layers]
    other = compose(layers_turned, turned, exposure="none", holes="inpaint").panorama.pixels
    assert np.allclose(other, rolled(light, turn), atol=1e-5), "it is filled alike wherever the sphere was cut open"
    assert not compose(layers, warp_of(), exposure="none", holes="auto").filled.any(), "it is not small"


def test_paint_decides_between_the_reference_and_all_others() -> None:
    painted = np.zeros((HEIGHT, WIDTH), np.int8)
    with_next = shown(RING[0]) & shown(RING[1])
    painted[with_next] = -1
    with_last = shown(RING[0]) & shown(RING[6])
    painted[with_last] = 1
    # last of all, and first of all
    for centre in ([0, 1.0, 0], [0, 0, 0]):
        centres = [centre, *[[0, 0.1, 0]] * 6]
        made = compose(ring(), warp_of(deviation=0.02), centres, painted=painted, exposure="none")
        assert (made.labels[with_next] == 0).all() and (made.labels[with_last] == 6).all()


def test_frames_of_a_clip_share_what_was_decided() -> None:
    decisions = []
    for number in range(3):
        noise = np.random.default_rng(number).normal(0, 0.01, (7, HEIGHT, WIDTH, 3))
        layers = layers_of([np.clip(one.pixels + part, 0, None) for one, part in zip(ring(), noise, strict=True)])
        decisions.append(compose(layers, warp_of(), exposure="auto", keep=True).decided)
    shared = pooled_decision(decisions)
    gains = np.array([[one.exposure.gain for one in some] for some in decisions])
    assert np.array_equal([one.exposure.gain for one in shared], np.median(gains, axis=0))
    made = compose(ring(), warp_of(), decided=shared, exposure="auto")
    assert made.decided == shared and steps(made.panorama.pixels).max() < 0.02
    again = compose(layers_of([one.pixels / 2 for one in ring()]), warp_of(), decided=shared, exposure="auto")
    assert np.array_equal(again.labels, made.labels)
    assert np.allclose(again.panorama.pixels, made.panorama.pixels / 2, atol=2e-3)


def test_soft_edges_stay_soft_and_the_canvas_keeps_its_kind() -> None:
    layers = ring()
    soft = layers[2].alpha * np.float32(1)
    soft[ROWS.start : ROWS.start + 5] *= np.float32(0.5)
    layers[2] = Layer(layers[2].light, soft)
    alpha = compose(layers, warp_of(), exposure="none").panorama.alpha
    alone = shown(RING[2], slice(ROWS.start, ROWS.start + 5)) & ~shown(RING[1]) & ~shown(RING[3])
    assert alpha.dtype == np.float32 and (alpha[alone] == 0.5).all()
    assert compose(ring(), warp_of(), exposure="none").panorama.alpha.dtype == bool
    assert CANVAS.width == WIDTH


# --- around a pole --------------------------------------------------------------------------------------------------


def capped(turn: int, gain: float) -> Composition:
    """The ring with a picture of all that lies above it, brighter by a gain; cut open `turn` columns further on."""
    cap = np.zeros((HEIGHT, WIDTH), bool)
    cap[: ROWS.start + 40] = True
    layers = [*layers_of([wall()] * 6, RING[:6]), Layer(np.where(cap[..., None], wall() * np.float32(gain), 0), cap)]
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    warp = warp_of()
    maps = [*warp.maps[:6], PictureMap(x, y, (WIDTH, HEIGHT))]
    maps = [PictureMap(rolled(at.x, turn), rolled(at.y, turn), at.size) for at in maps]
    layers = [Layer(rolled(one.pixels, turn), rolled(one.alpha, turn)) for one in layers]
    return compose(layers, replace(warp, maps=tuple(maps)), exposure="none")


@pytest.mark.parametrize("turn", [0, 100, 400])
def test_what_goes_round_a_pole_has_no_step_where_it_closes(turn: int) -> None:
    made = capped(turn, 1.2)
    light = rolled(made.panorama.pixels, -turn)
    rows = np.s_[2 : ROWS.start + 20]
    tones = [log_encode(np.ascontiguousarray(one[rows], np.float32)).mean(axis=2) for one in (light, wall())]
    assert (made.panorama.alpha[: ROWS.start + 40] > 0).all()
    across = [np.abs(one - np.roll(one, -1, axis=1)).max(axis=0) for one in tones]
    assert np.abs(across[0] - across[1]).max() < 0.01
    window = made.decided[6].window
    assert window is not None and window.overhang > 0


@pytest.mark.parametrize("taken_over", [False, True])
def test_what_depth_hides_is_checked_once_exposures_are_known(
    taken_over: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not again where what was decided about other frames is taken over."""
    looked_at: list[Any] = []

    def checked(unseen: Any, layers: Any, windows: Any) -> Any:
        looked_at.append([float(np.median(one.pixels[EVERYWHERE][one.alpha[EVERYWHERE] > 0])) for one in layers])
        return unseen

    first = compose(ring(), warp_of(), exposure="auto")
    monkeypatch.setattr(composition, "without_contradicted", checked)
    compose(ring(), warp_of(), exposure="auto", decided=first.decided if taken_over else None)
    assert len(looked_at) == (0 if taken_over else 1)
    assert all(np.ptp(one) < 0.2 * np.mean(one) for one in looked_at), "of one light"
