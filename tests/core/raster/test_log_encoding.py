"""Tones run like the eye, and back again without loss."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.raster.colour import encode
from edf_stitch.core.raster.log_encoding import log_decode, log_encode


def test_there_and_back_nothing_is_lost() -> None:
    light = np.float32([0, 1e-6, 0.01, 0.05, 0.18, 1, 16, 1000, 1e6, -0.02, -3]).reshape(-1, 1)
    back = log_decode(log_encode(light))
    assert back.dtype == np.float32
    assert np.allclose(back, light, rtol=5e-6, atol=0)


def test_black_and_white_stay_and_order_is_kept() -> None:
    assert log_encode(np.float32([0, 1, -1])).tolist() == [0, 1, -1]
    light = np.sort(np.random.default_rng(0).normal(0, 3, 1000)).astype(np.float32)
    assert (np.diff(log_encode(light)) >= 0).all()


def test_they_run_close_to_what_a_screen_shows() -> None:
    light = np.linspace(0, 1, 200, dtype=np.float32).reshape(-1, 1, 1)
    assert np.abs(log_encode(light) - encode(light, 8) / 255).max() < 0.07
