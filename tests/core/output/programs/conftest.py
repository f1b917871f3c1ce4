"""A stitch of four pictures, whose cameras are written."""

from __future__ import annotations

import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pipeline import StitchResult, stitch

from ....sets import FOCAL, make_set


@pytest.fixture(scope="session")
def of_four() -> StitchResult:
    """Pictures with a barrel lens that is given."""
    pictures = make_set().pictures
    entry = {"K": [[FOCAL, 0, 161.5], [0, FOCAL, 118.25], [0, 0, 1]], "distortion": [-0.02]}
    known = CameraRequest(cameras={"cameras": {picture.name: entry for picture in pictures}})
    return stitch(pictures, StitchOptions(camera=known, dense=False, blend="feather"))
