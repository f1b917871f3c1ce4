"""Exposure over the graph of all overlaps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, ViewOf
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.compose.tone.exposure import Exposure
from edf_stitch.core.compose.tone.graph_exposure import graph_exposures, lenses_of
from edf_stitch.core.compose.tone.picture_blocks import blocks_meet, overlaps_of, picture_blocks
from edf_stitch.core.compose.tone.toned import NO_VIGNETTING, Vignetting
from edf_stitch.core.panorama.layers import Layer
from hypothesis import given, settings
from hypothesis import strategies as st

from .rings import HEIGHT, RING, ROWS, WIDTH, layers_of, maps_of, shown, views_at, wall

NOTHING = np.broadcast_to(np.False_, (HEIGHT, WIDTH))


def exposures(
    layers: list[Layer], wanted: Any = "auto", floats: bool = False, places: Any = RING, hidden: Any = None
) -> tuple[Exposure, ...]:
    cameras = [view.camera for view in views_at([np.zeros(3)] * len(layers), places)]
    return graph_exposures(
        layers, maps_of(places), cameras, hidden or [NOTHING] * len(layers), [floats] * len(layers), wanted,
        lambda share: None,
    )


def lit(gains: np.ndarray) -> list[Layer]:
    """A ring of pictures of one wall, each brighter by its gain per channel."""
    return layers_of([wall() * gain for gain in gains])


def stops_of(found: tuple[Exposure, ...]) -> np.ndarray:
    return np.log2([one.gain for one in found])


@settings(deadline=None, max_examples=15)
@given(st.lists(st.lists(st.floats(-1, 1), min_size=3, max_size=3), min_size=7, max_size=7))
def test_the_exposures_of_a_ring_are_found_and_close(stops: list[list[float]]) -> None:
    known = np.array(stops)
    found = stops_of(exposures(lit(2.0**known)))
    assert np.allclose(found + known, np.median(known, axis=0), atol=0.01), "the last meets the first"


def test_which_picture_is_the_reference_changes_nothing() -> None:
    gains = 2 ** np.random.default_rng(3).uniform(-1, 1, (7, 3))
    layers = lit(gains)
    found = stops_of(exposures(layers))
    turn = [4, 0, 6, 2, 5, 1, 3]
    again = stops_of(exposures([layers[k] for k in turn], places=[RING[k] for k in turn]))
    assert np.allclose(again, found[turn], atol=1e-5)


def test_the_reference_keeps_its_light_where_that_is_asked_for() -> None:
    gains = 2 ** np.random.default_rng(3).uniform(-1, 1, (7, 3))
    found = exposures(lit(gains), "reference")
    assert np.allclose([one.gain for one in found], gains[0] / gains, rtol=0.01)
    assert (found[0].gain == 1).all() and not any(one.keeps_white for one in found)
    assert all(one.keeps_white for one in exposures(lit(gains)))


def test_stops_are_added_and_none_is_none() -> None:
    gains = np.full((7, 3), 1.3) ** np.arange(7)[:, None]
    assert np.allclose(stops_of(exposures(lit(gains), -0.5)), stops_of(exposures(lit(gains))) - 0.5, atol=1e-5)
    assert all((one.gain == 1).all() and not one.blocks for one in exposures(lit(gains), "none"))


def test_what_is_over_exposed_does_not_set_the_exposure() -> None:
    """Four of seven pictures lack a quarter of the wall, which is white there; the other three tell of it."""
    wall_too = wall()
    wall_too[ROWS][:35] += 0.6
    gains = np.float32([[2.4, 2.2, 1.8]] * 4 + [[0.8] * 3, [0.7] * 3, [0.6] * 3])
    order = [0, 4, 1, 5, 2, 6, 3]
    layers = layers_of([np.minimum(wall_too * gain, 1) for gain in gains[order]])
    found = stops_of(exposures(layers))
    assert np.allclose(found + np.log2(gains[order]), np.log2(0.7), atol=0.05)


def test_radiance_is_kept_at_the_references_exposure() -> None:
    gains = 2 ** np.random.default_rng(3).uniform(-2, 2, (7, 3))
    found = exposures(lit(40 * gains), floats=True)
    assert np.allclose([one.gain for one in found], gains[0] / gains, rtol=0.01)
    assert not any(one.keeps_white or one.clipped for one in found)


def test_a_picture_half_in_shadow_does_not_darken_the_others() -> None:
    """A cloud passed while the fourth was taken: in its half that the third shows as well, it is a stop darker."""
    gains = np.ones((7, 3))
    layers = lit(gains)
    first, width = RING[3]
    light = layers[3].pixels.copy()
    light[:, first : first + width // 3] *= 0.5
    layers[3] = Layer(light, layers[3].alpha)
    found = stops_of(exposures(layers))
    others = np.delete(found, 3, axis=0)
    assert np.ptp(others) < 0.8, "a ring cannot close over a shadow, but it is spread over all of it"
    assert np.abs(found[3]).max() < 0.6


def test_an_overlap_that_shows_two_things_counts_for_nothing() -> None:
    """A picture reaches with nonsense into one that it does not meet, as one does where range was continued wrongly."""
    known = np.random.default_rng(1).uniform(-0.5, 0.5, (7, 3))
    layers = lit(2.0**known)
    light, alpha = layers[2].pixels.copy(), layers[2].alpha.copy()
    stray = shown((465, 45))
    alpha |= stray
    light[stray] = wall()[stray] / 4
    layers[2] = Layer(light, alpha)
    found = stops_of(exposures(layers))
    assert np.allclose(found + known, np.median(found + known, axis=0), atol=0.05)
    hidden = [NOTHING] * 7
    hidden[2] = stray
    found = stops_of(exposures(layers, hidden=hidden))
    assert np.allclose(found + known, np.median(known, axis=0), atol=0.01), "what is hidden is not looked at"


def test_groups_that_do_not_meet_come_to_their_own_medians() -> None:
    places = [(0, 100), (60, 100), (120, 100), (400, 100), (460, 100), (520, 100)]
    known = np.array([0, 0.5, 1, -2, -1.75, -1.25])
    found = exposures(layers_of([wall() * 2.0**stop for stop in known], places), places=places)
    assert np.allclose(stops_of(found).mean(axis=1), [0.5, 0, -0.5, 0.25, 0, -0.5], atol=0.02)
    alone = exposures(layers_of([wall()] * 3, [(0, 100), (60, 100), (400, 100)]), places=RING[:3])
    assert [one.blocks > 0 for one in alone] == [True, True, False] and not alone[2].why_not
    assert (alone[2].gain == 1).all() and np.isnan(alone[2].spread).all()


def test_it_is_said_why_a_picture_cannot_be_matched() -> None:
    lights = [wall(), wall(), wall()]
    lights[2] = np.ones_like(lights[0])
    places = [(0, 100), (60, 100), (120, 100)]
    assert "clipped" in exposures(layers_of(lights, places), places=places)[2].why_not
    lights[2] = wall() / 100
    assert "stops" in exposures(layers_of(lights, places), places=places)[2].why_not


def with_lens(lens: Vignetting, gains: np.ndarray) -> list[Layer]:
    return [
        Layer((one.pixels * np.exp(lens.at(at.from_middle(np.s_[:, :])))[..., None]).astype(np.float32), one.alpha)
        for one, at in zip(lit(gains), maps_of(), strict=True)
    ]


def test_vignetting_of_a_lens_is_found_in_all_overlaps_and_none_is_invented() -> None:
    gains = 2 ** np.random.default_rng(5).uniform(-0.7, 0.7, (7, 3))
    known = Vignetting(-0.12, -0.45)
    found = exposures(with_lens(known, gains))
    assert len({one.vignetting for one in found}) == 1
    assert found[0].vignetting.halfway == pytest.approx(known.halfway, abs=0.03)
    assert found[0].vignetting.corner == pytest.approx(known.corner, abs=0.06)
    assert np.allclose(np.log2(gains) + stops_of(found), np.median(np.log2(gains), axis=0), atol=0.02)
    assert all(one.vignetting is NO_VIGNETTING for one in exposures(lit(gains)))
    brighter = with_lens(Vignetting(0.12, 0.45), gains)
    assert all(one.vignetting is NO_VIGNETTING for one in exposures(brighter)), "no lens adds light to the corners"
    assert all(one.vignetting is NO_VIGNETTING for one in exposures(with_lens(known, gains), "reference"))


def test_vignetting_does_not_hang_on_the_order_of_the_pictures() -> None:
    random = np.random.default_rng(6)
    layers = [
        Layer(one.pixels * random.uniform(0.9, 1.1, one.pixels.shape).astype(np.float32), one.alpha)
        for one in with_lens(Vignetting(-0.12, -0.45), 2 ** random.uniform(-1, 1, (7, 3)))
    ]
    turn = [4, 0, 6, 2, 5, 1, 3]
    one = exposures(layers)[0].vignetting
    other = exposures([layers[k] for k in turn], places=[RING[k] for k in turn])[0].vignetting
    assert one is not NO_VIGNETTING
    assert (one.halfway, one.corner) == pytest.approx((other.halfway, other.corner), abs=1e-9)


def test_lenses_are_told_apart_by_their_intrinsics() -> None:
    first = Camera(np.diag([50.0, 50.0, 1.0]), (60, 40), "a", 0.0)
    wider = Camera(np.diag([40.0, 40.0, 1.0]), (60, 40), "b", 0.0)
    bent = Camera(first.K.copy(), (60, 40), "c", 0.0, np.array([0.1, 0, 0, 0, 0]))
    fisheye = replace(first, lens=Lens(LensProjection.EQUIDISTANT))
    assert lenses_of([first, wider, Camera(first.K.copy(), (60, 40), "d", 0.1), bent, fisheye]) == [0, 1, 0, 2, 3]


def test_a_neighbour_tells_what_was_clipped() -> None:
    """A sky that clips in blue alone, in one picture of the ring."""
    light = wall()
    light[ROWS.start : 180] = [0.3, 0.42, 0.6]
    lights = [light * (2 if number == 4 else 1) for number in range(7)]
    layers = [Layer(np.minimum(one.pixels, 1), one.alpha) for one in layers_of(lights)]
    found = exposures(layers)
    assert [one.overexposed > 0.2 for one in found] == [number == 4 for number in range(7)]
    assert found[4].clipped is not None and all(one.clipped is None for k, one in enumerate(found) if k != 4)
    sky = found[4].applied(layers[4], maps_of()[4]).light[120:130, RING[4][0] + 70 : RING[4][0] + 80]
    assert np.allclose(sky, [0.3, 0.42, 0.6], atol=0.03), "also where no other picture shows it"


def test_blocks_hold_what_a_picture_shows() -> None:
    layers, maps = lit(np.ones((7, 3))), maps_of()
    blocks = [picture_blocks(one, at, NOTHING, False) for one, at in zip(layers, maps, strict=True)]
    assert all(one is not None for one in blocks)
    pairs = {(one.i, one.j) for one in overlaps_of(blocks)}
    assert pairs == {(k, k + 1) for k in range(6)} | {(0, 6)}
    assert blocks_meet(blocks[0], blocks[6]) and not blocks_meet(blocks[0], blocks[3])
    one = overlaps_of(blocks)[0]
    assert np.array_equal(*one.blocks.means) and one.blocks.at.min() * 8 >= ROWS.start - 8
    thinned = one.thinned(10)
    assert 5 < len(thinned.blocks) <= 10 and len(thinned.radii[0]) == len(thinned.blocks)
    empty = Layer(layers[0].light, np.zeros((HEIGHT, WIDTH), bool))
    assert picture_blocks(empty, maps[0], NOTHING, False) is None


def of_a_sphere(numbers: Any) -> list[Camera]:
    """The ring's cameras, of which some (numbers) are views of one sphere."""
    cameras = [view.camera for view in views_at([np.zeros(3)] * 7)]
    return [
        replace(one, view_of=ViewOf(9, "drone.jpg", np.eye(3))) if number in numbers else one
        for number, one in enumerate(cameras)
    ]


def test_views_of_one_sphere_have_one_exposure() -> None:
    """Each alone would be matched to the neighbours that it meets, which contradict each other here."""
    gains = np.ones((7, 3))
    gains[[1, 2]], gains[3] = 1.4, 0.6
    cameras = of_a_sphere((0, 4, 5, 6))
    found = graph_exposures(lit(gains), maps_of(), cameras, [NOTHING] * 7, [False] * 7, "auto", lambda share: None)
    stops = stops_of(found)
    assert np.ptp(stops[[0, 4, 5, 6]], axis=0).max() == 0
    assert len({one.blocks for one in found[4:]}) == 1 and found[5].blocks > 0, "known though 5 meets no other picture"
    assert np.allclose(stops[[1, 2]] - stops[0], -np.log2(1.4), atol=0.01)
    # the median is that of four pictures, not of seven: between the sphere and one of the two brighter
    assert np.allclose(stops[0], np.log2(1.4) / 2, atol=0.01)


def test_a_sphere_that_cannot_be_matched_is_one_picture_that_cannot() -> None:
    lights = [wall() / 100 if number in (3, 4) else wall() for number in range(7)]
    cameras = of_a_sphere((3, 4))
    found = graph_exposures(layers_of(lights), maps_of(), cameras, [NOTHING] * 7, [False] * 7, "auto", lambda _: None)
    assert found[3].why_not == found[4].why_not != "" and not any(found[k].why_not for k in (0, 1, 2, 5, 6))


def test_views_of_a_sphere_share_what_is_over_exposed_and_what_is_told() -> None:
    light = wall()
    light[ROWS.start : 180] = [0.3, 0.42, 0.6]
    lights = [light * (2 if number in (4, 5) else 1) for number in range(7)]
    layers = [Layer(np.minimum(one.pixels, 1), one.alpha) for one in layers_of(lights)]
    found = graph_exposures(
        layers, maps_of(), of_a_sphere((4, 5)), [NOTHING] * 7, [False] * 7, "auto", lambda _: None
    )
    assert found[4].overexposed == found[5].overexposed > 0.2 and found[4].clipped is found[5].clipped is not None


def test_views_of_a_sphere_have_no_vignetting() -> None:
    known = Vignetting(-0.12, -0.45)
    layers = with_lens(known, np.ones((7, 3)))
    found = graph_exposures(
        layers, maps_of(), of_a_sphere((6,)), [NOTHING] * 7, [False] * 7, "auto", lambda share: None
    )
    assert found[6].vignetting is NO_VIGNETTING and found[0].vignetting.corner == pytest.approx(known.corner, abs=0.15)
    assert lenses_of(of_a_sphere((0, 6)))[:2] == [None, 0]
    every = graph_exposures(
        lit(np.ones((7, 3))), maps_of(), of_a_sphere(range(7)), [NOTHING] * 7, [False] * 7, "auto", lambda share: None
    )
    assert all((one.gain == 1).all() and not one.why_not for one in every)
