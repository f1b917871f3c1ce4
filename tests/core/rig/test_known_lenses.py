"""Lenses that are known before pictures are registered: the bundle holds them, whatever focal length it finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.lens_models import Lens
from edf_stitch.core.rig.averaging.matched_rays import SharedLens
from edf_stitch.core.rig.bundling.solution import lenses_of, with_lens

K = np.array([[500.0, 0, 319.5], [0, 500.0, 239.5], [0, 0, 1]])
# By EXIF: the focal length is free.
FREE = Camera(K, (640, 480), "test", 0.05, principal_sigma=0.01)
KNOWN = {
    "k1": replace(FREE, distortion=np.array([-0.1, 0.02, 0.001, 0, 0])),
    "a b c": replace(FREE, lens=Lens(ptlens=(0.01, -0.03, 0.02), radius=0.48)),
    "none": replace(FREE, lens=Lens()),
}  # fmt: skip
every_known = pytest.mark.parametrize("camera", KNOWN.values(), ids=KNOWN.keys())


@every_known
def test_k1_is_sought_only_where_no_lens_is_known(camera: Camera) -> None:
    found = lenses_of([camera.without_lens(), FREE.without_lens()])
    assert found.of.tolist() == [0, 1]
    assert found.free[:, 1].tolist() == [False, True] and found.free[:, 0].all()


@every_known
def test_the_same_pixels_move_at_another_focal_length(camera: Camera) -> None:
    points = np.array([[20.0, 30.0], [600.0, 400.0]])
    for other in (with_lens(camera, np.array([0.1, 0.3, 0.0, 0.0])), SharedLens(1.1, 0.3).of(camera)):
        assert other.focal > 540
        assert np.allclose(distort(points, other), distort(points, camera), atol=1e-9)
    assert with_lens(FREE, np.array([0.1, 0.3, 0, 0])).distortion[0] == 0.3
