"""The figures of merged exposures: what is off, and over how many stops it is right."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.synthetic_scenes.sets.set_radiance import radiance_error


def test_the_median_is_over_twelve_stops_and_stops_that_are_wrong_are_not_held() -> None:
    stops = np.arange(-9, 7)  # 16 of them
    true = np.repeat(np.float32(2.0) ** stops * np.float32(1.4), 200)
    ours = true * np.float32(1.01)
    ours[: 3 * 200] *= np.float32(1.5)  # the three darkest, below the twelve
    figures = radiance_error(ours, true)
    assert figures["radiance_percent"] == pytest.approx(1.0, abs=0.01) and figures["radiance_stops"] == 13
    ours[-200:] *= np.float32(0.5)  # the brightest is clipped
    assert radiance_error(ours, true)["radiance_stops"] == 12
    assert radiance_error(np.append(ours, [0.0]), np.append(true, [0.0])) == radiance_error(ours, true)
    assert radiance_error(3 * true, true) == {"radiance_percent": pytest.approx(200), "radiance_stops": 0}
