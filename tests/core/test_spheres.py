"""stitch() of spheres among flat pictures, against the room that they were taken in."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.alignment import Geometry, estimate_geometry
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.frames.frame import Frame
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import Picture, picture_from_array

from .textured_room import flat, sphere, turned

HEIGHT, SIZE, FOCAL = 400, (320, 240), 190.0
# Places (m) and rotations, world to camera.
AT_SPHERE, TILTED = np.array([0.1, 0.0, -0.2]), turned(20, 4, -3)
STILLS = (
    (np.array([0.4, 0.1, 0.1]), turned(25, 3)), (np.array([-0.3, -0.1, -0.1]), turned(-20, -5)),
    (np.array([0.0, 0.15, -0.5]), turned(70, 2)),
)  # fmt: skip


def taken(*numbers: int) -> list[Picture]:
    return [picture_from_array(flat(*STILLS[number], FOCAL, SIZE), f"{number}.png") for number in numbers]


@pytest.fixture(scope="module")
def whole() -> Picture:
    return picture_from_array(np.rint(sphere(AT_SPHERE, TILTED, HEIGHT)).astype(np.uint8), "drone.jpg")


def aligned(pictures: list[Picture], options: StitchOptions | None = None) -> tuple[Frame, Geometry]:
    options = options or StitchOptions()
    frame = read_frame(pictures, options)
    return frame, estimate_geometry([frame], options, lambda stage, share: None)


def of(name: str, frame: Frame, geometry: Geometry) -> int:
    """Which of the geometry's pictures has a name."""
    return geometry.numbers.index(frame.names.index(name))


def test_a_sphere_and_stills_are_placed(whole: Picture) -> None:
    frame, geometry = aligned([whole, *taken(0, 1, 2)])
    rig = geometry.rig
    assert rig is not None and len(rig) == 11 and not geometry.left_out
    views = [number for number, camera in enumerate(rig.cameras) if camera.view_of]
    assert len(views) == 8 and tuple(views) in rig.stations
    for number in views:
        assert np.allclose(rig.R[number], rig.cameras[number].view_of.R, atol=1e-9), "the first view is the frame"
    assert not rig.t[views].any()
    places, true = [], []
    for number, (place, R) in enumerate(STILLS):
        j = of(f"{number}.png", frame, geometry)
        assert rotation_angle(rig.R[j], R @ TILTED.T) < 0.2
        places.append(rig.centres[j])
        true.append(TILTED @ (place - AT_SPHERE))
    found, places = np.array(places), np.array(true)
    found *= (found * places).sum() / (found**2).sum()
    assert np.linalg.norm(found - places, axis=1).max() < 0.02
    assert rig.cameras[of("0.png", frame, geometry)].focal == pytest.approx(FOCAL, rel=0.01)
