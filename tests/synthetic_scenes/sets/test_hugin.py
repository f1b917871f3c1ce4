"""Hugin as a rival: its project files are read, and what fails is said."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.compare.elsewhere.hugin import HuginFailed
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.sets.hugin import rotations_of, with_lenses
from edf_stitch.synthetic_scenes.sets.set_stitches import equivalent_mm, told_lens

# Of a set whose true views these are, as it wrote them (shortened).
PROJECT = """p f2 w1600 h800 v360  k0 E-0.01 R0 n"TIFF_m c:LZW r:CROP"
i w640 h480 f0 v73.41 Ra-1.5 Rb-0.05 Eev0 Er1 Eb1 r0 p-10 y30 TrX0 TrY0 TrZ0 j0 a0 b0 c0
i w640 h480 f0 v=0 Ra=0 Rb=0 Eev-0.015 Er0.99 Eb1.0 r4.5e0 p+2.5 y-26.25 TrX0 j0 a=0 b=0 c=0
v Ra0
"""


def test_angles_of_a_project_are_views() -> None:
    views = View(yaw=30.0, pitch=10.0), View(yaw=-26.25, pitch=-2.5, roll=4.5)
    found = rotations_of(PROJECT)
    for R, view in zip(found, views, strict=True):
        assert rotation_angle(R, view.camera((640, 480)).R) < 1e-6
    with pytest.raises(HuginFailed, match="no r"):
        rotations_of("i w640 h480 y3 p4")


def test_each_lens_is_told_its_own_field_of_view() -> None:
    wide, tele = (View(lens=lens).camera((640, 480)) for lens in (24.0, 48.0))
    project = PROJECT + PROJECT.split("\n")[1] + "\n"
    project = project.replace("\ni w640 h480 f0 v73.41", "\ni w640 h480 f0 v50", 1)
    lines = with_lenses(project, (wide, wide, tele)).split("\n")
    first, second, third = (line.split(" v")[1].split()[0] for line in lines if line.startswith("i "))
    assert second == "=0", "as the first"
    assert [float(first), float(third)] == pytest.approx([73.7, 41.1], abs=1.5)


def test_a_camera_tells_its_focal_length_in_whole_millimetres() -> None:
    camera = View(lens=24.0).camera((640, 480))
    assert equivalent_mm(camera) == 23 and told_lens(camera) == pytest.approx(426.67, rel=0.01)
    assert told_lens(camera) != pytest.approx(426.67, rel=1e-3), "it does not tell all"
    assert np.isclose(told_lens(View(lens=24.0).camera((480, 640))), told_lens(camera)), "upright it is the same lens"
