"""What the default costs, counted: seconds differ from run to run, what is worked out for a made-up pair does not.

A count that grows says that something is done twice, or at a size that nobody asked for. Where a change is meant, write
the new counts down: `python -m pytest tests/core/test_operations.py` prints them.
"""

from __future__ import annotations

import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.compose.seams import seam
from edf_stitch.core.compose.seams.min_cut import FREE, min_cut
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pipeline import stitch
from edf_stitch.synthetic_scenes.two_planes import Pair

# Thousands of pixels that each works out; of features px looked through, of matching px times disparities, of cuts px
# that are decided.
THOUSANDS = {
    "remap": 2647, "resize": 3553, "blur": 6226, "GaussianBlur": 955, "dilate": 5814, "medianBlur": 555,
    "features": 480, "matching": 10986, "cuts": 25,
}  # fmt: skip
# The most that NumPy's arrays take at once with one thread.
PEAK_BYTES = 107_400_000
TOLERANCE = 0.05


class _Counted:
    """An OpenCV object each call of which is counted first."""

    def __init__(self, real: Any, count: Callable[..., None]) -> None:
        self._real, self._count = real, count

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            self._count(*args)
            return getattr(self._real, name)(*args)

        return call


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Counter[str]]:
    """What is worked out from now on, by one thread."""
    found: Counter[str] = Counter()

    def count_pixels(name: str) -> None:
        real = getattr(cv2, name)

        def counted(*args: Any, **named: Any) -> Any:
            out = real(*args, **named)
            found[name] += out.shape[0] * out.shape[1]
            return out

        monkeypatch.setattr(cv2, name, counted)

    def sift(*args: Any, real: Any = cv2.SIFT_create, **named: Any) -> _Counted:
        return _Counted(real(*args, **named), lambda gray, *_: found.update(features=gray.size))

    def matcher(real: Any = cv2.StereoSGBM_create, **named: Any) -> _Counted:
        costs = named["numDisparities"]
        return _Counted(
            real(**named), lambda first, _: found.update(matching=costs * first.shape[0] * first.shape[1])
        )

    def cut(cost: Any, known: Any, *price: Any) -> Any:
        found["cuts"] += int(np.count_nonzero(known == FREE))
        return min_cut(cost, known, *price)

    for name in ("remap", "resize", "blur", "GaussianBlur", "dilate", "medianBlur"):
        count_pixels(name)
    monkeypatch.setattr(cv2, "SIFT_create", sift)
    monkeypatch.setattr(cv2, "StereoSGBM_create", matcher)
    monkeypatch.setattr(seam, "min_cut", cut)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield found
    cv2.setNumThreads(threads)


def test_the_default_does_no_more_than_it_did(pair: Pair, counts: Counter[str]) -> None:
    known = CameraRequest(focal_px=(pair.reference_camera.K[0, 0],))
    tracemalloc.start()
    try:
        result = stitch([pair.reference, pair.target], StitchOptions(camera=known, measure=False))
        result.panorama.light[:, :]
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    found = {name: round(counts[name] / 1000) for name in THOUSANDS}
    print(found, peak)
    assert found == {name: pytest.approx(count, rel=TOLERANCE, abs=1) for name, count in THOUSANDS.items()}
    assert peak == pytest.approx(PEAK_BYTES, rel=TOLERANCE)
