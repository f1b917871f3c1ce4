"""Tears are jumps of a map after which the picture does not go on; edges of things and foliage are none."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.seams.tears import contrast, tears
from edf_stitch.core.raster.picture_map import PictureMap

SIZE = (80, 60)
EVERYWHERE = np.ones((60, 60), bool)


def scene() -> np.ndarray:
    """Tones of a picture: a dark thing, columns 30 to 49, before a bright wall that is shaded from above."""
    tones = np.linspace(0.7, 0.8, 60, dtype=np.float32)[:, None] * np.ones(80, np.float32)
    tones[:, 30:50] = 0.2
    return tones


def skipping(column: int) -> PictureMap:
    """A panorama that leaves out 20 columns of the picture from a column on."""
    x, y = np.meshgrid(np.arange(60, dtype=np.float32), np.arange(60, dtype=np.float32))
    return PictureMap(np.where(x < column, x, x + 20), y, SIZE)


@pytest.mark.parametrize(("column", "torn"), [(40, True), (35, True), (30, False), (10, False)])
def test_a_thing_is_torn_inside_but_not_at_its_edge(column: int, torn: bool) -> None:
    found = tears(scene(), skipping(column), EVERYWHERE)
    assert found[5:55, column].all() == torn and found.any() == torn


def test_it_is_torn_downwards_as_well() -> None:
    turned = PictureMap(skipping(40).y.T, skipping(40).x.T, SIZE[::-1])
    found = tears(scene().T, turned, EVERYWHERE)
    assert np.array_equal(found, tears(scene(), skipping(40), EVERYWHERE).T)


def test_only_what_is_shown_counts() -> None:
    shown = EVERYWHERE.copy()
    shown[:, 40:] = False
    assert not tears(scene(), skipping(40), shown).any()


def test_foliage_is_torn_unseen() -> None:
    leaves = np.random.default_rng(0).uniform(0.2, 0.8, scene().shape).astype(np.float32)
    assert tears(leaves, skipping(40), EVERYWHERE).mean() < 0.002
    assert contrast(leaves).min() > 0.08 > contrast(scene())[:, :20].max()
