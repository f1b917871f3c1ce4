"""Thin things that are blurred or bent are found in panoramas, and only those."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.synthetic_scenes.sets.set_measures import Found, SetTruth
from edf_stitch.synthetic_scenes.sets.set_names import SET_MEASURES
from edf_stitch.synthetic_scenes.sets.set_thin import bend_px, is_thin, thin_figures

from .perfect_stitch import analytic_truth, perfect


@pytest.fixture(scope="module")
def truth() -> SetTruth:
    return analytic_truth()


def post(shift: np.ndarray) -> np.ndarray:
    """A post of 120 rows, 8 px wide, whose middle lies so far aside (120,)."""
    x = np.arange(100)[None]
    mask: np.ndarray = np.abs(x - 50.5 - shift[:, None]) <= 4
    return mask


def test_a_post_that_stands_beside_its_place_or_leans_is_straight_and_a_bent_one_is_not() -> None:
    y = np.arange(120.0)
    true = post(0 * y)
    assert bend_px(true, true) == 0
    assert bend_px(post(0 * y + 3), true) < 1e-6, "all of it is beside"
    assert bend_px(post(0.03 * y), true) < 0.5, "it leans, by whole pixels"
    bent = bend_px(post(4 * np.sin(np.pi * y / 120)), true)
    assert 1.2 < bent < 3.0
    assert np.isnan(bend_px(true, np.zeros_like(true))) and np.isnan(bend_px(true[:30], true[:30]))
    assert np.isnan(bend_px(true.T, true.T)), "it lies"


def test_thin_is_what_no_large_circle_fits_into() -> None:
    square = np.zeros((80, 80), bool)
    square[20:60, 20:60] = True
    assert is_thin(post(np.zeros(120))) and not is_thin(square)


def test_what_is_blurred_beside_thin_things_costs_likeness_there_and_nowhere_else(truth: SetTruth) -> None:
    found, picture = Found.of(perfect(truth), truth), truth.picture
    where = truth.views_at(found.numbers) > 0
    assert np.isnan(thin_figures(found, picture, where)["thin_ssim"]), "a ball is not thin"
    middle = int(np.flatnonzero((truth.rendered.things[-1] == 1).any(axis=0)).mean())
    bars = truth.rendered.things[-1] * 0
    bars[60:160, middle - 3 : middle + 4] = 1
    thin = replace(truth, rendered=replace(truth.rendered, things=(*truth.rendered.things[:-1], bars)))
    found = replace(found, truth=thin)
    assert thin_figures(found, picture, where)["thin_ssim"] == pytest.approx(1)
    near, far = picture.copy(), picture.copy()
    near[:, middle + 5] = 0
    far[:, middle + 60] = 0
    assert thin_figures(found, near, where)["thin_ssim"] < 0.95
    assert thin_figures(found, far, where)["thin_ssim"] == pytest.approx(1)
    assert set(thin_figures(found, near, where)) <= set(SET_MEASURES), "each has its name on the page"
