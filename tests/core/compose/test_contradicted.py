"""What depth says is hidden is believed only where the picture does not show otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.contradicted import without_contradicted
from edf_stitch.core.compose.unseen import Unseen
from edf_stitch.core.compose.window import Window
from edf_stitch.core.panorama.layers import Layer

SIZE = (60, 40)
LEG = np.zeros(SIZE[::-1], bool)
LEG[10:30, 20:26] = True
NOTHING = np.zeros(SIZE[::-1], bool)


def layer(*dark: np.ndarray, alpha: np.ndarray | None = None) -> Layer:
    """A pavement, dark in some places."""
    light = np.full((*SIZE[::-1], 3), 0.5, np.float32)
    light += np.random.default_rng(0).uniform(-0.01, 0.01, light.shape).astype(np.float32)
    for place in dark:
        light[place] = 0.05
    return Layer(light, np.ones(SIZE[::-1], np.float32) if alpha is None else alpha)


def windows(round_: bool = False) -> list[Window]:
    return [Window((0, 0, *SIZE), SIZE, round_)] * 3


def hidden_in_first(*layers: Layer, hidden: np.ndarray = LEG, round_: bool = False) -> Unseen:
    """What is left of that after it was looked at."""
    unseen = [Unseen(hidden, hidden, 0.25), Unseen(NOTHING, NOTHING), Unseen(NOTHING, NOTHING)]
    found = without_contradicted(unseen, layers, windows(round_))
    assert not any(one.hidden.any() for one in found[1:])
    assert found[0].folds == 0.25 and np.array_equal(found[0].by_depth, found[0].hidden)
    return found[0]


def test_a_walker_hides_nothing_that_a_picture_shows_on() -> None:
    assert not hidden_in_first(layer(), layer(LEG), layer(LEG)).hidden.any()


def test_a_copy_of_what_hides_the_place_is_no_view_of_it() -> None:
    """The picture shows the post twice there, the others what is behind it."""
    assert np.array_equal(hidden_in_first(layer(LEG), layer(), layer()).hidden, LEG)


def test_where_all_go_on_depth_is_believed() -> None:
    assert np.array_equal(hidden_in_first(layer(), layer(), layer()).hidden, LEG)


def test_each_place_is_looked_at_by_itself() -> None:
    other = np.roll(LEG, 25, axis=1)
    found = hidden_in_first(layer(other), layer(LEG), layer(LEG), hidden=LEG | other)
    assert np.array_equal(found.hidden, other)


def test_what_nobody_else_shows_stays_as_it_is() -> None:
    beside = np.where(LEG, np.float32(0), np.float32(1))
    found = hidden_in_first(layer(), layer(alpha=beside), layer(alpha=beside))
    assert np.array_equal(found.hidden, LEG)


def test_what_others_cannot_see_is_not_what_they_show() -> None:
    """Of two others the one that sees the place counts."""
    unseen = [Unseen(LEG, LEG), Unseen(LEG, LEG), Unseen(NOTHING, NOTHING)]
    found = without_contradicted(unseen, [layer(), layer(LEG), layer()], windows())
    assert found[0].hidden.any(), "as smooth as its own"


@pytest.mark.parametrize("round_", [False, True])
def test_a_place_across_the_canvas_s_end(round_: bool) -> None:
    leg = np.roll(LEG, SIZE[0] - 23, axis=1)
    unseen = [Unseen(leg, leg), Unseen(NOTHING, NOTHING), Unseen(NOTHING, NOTHING)]
    box = (30, 0, *SIZE) if round_ else (0, 0, *SIZE)
    layers = [layer(), layer(leg), layer(leg)]
    assert not without_contradicted(unseen, layers, [Window(box, SIZE, round_)] * 3)[0].hidden.any()


def test_where_nothing_is_hidden_nothing_is_looked_at() -> None:
    unseen = [Unseen(NOTHING, NOTHING)] * 3
    assert without_contradicted(unseen, [layer()] * 3, [None] * 3) == unseen
