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
from edf_stitch.core.pipeline import stitch
from edf_stitch.core.system.errors import NoOverlap

from .textured_room import circle, flat, seen, sphere, sphere_rays, turned

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


def off_degrees(frame: Frame, geometry: Geometry, name: str, R: np.ndarray) -> float:
    """By how much a picture's rotation is off: R is the true one from the world, seen from the sphere."""
    rig = geometry.rig
    front = of("drone (front).jpg", frame, geometry)
    return rotation_angle(rig.R[of(name, frame, geometry)] @ rig.R[front].T, R @ TILTED.T)


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
    assert not any({edge.i, edge.j} <= set(views) for edge in rig.edges), "views of one sphere are not compared"
    places, true = [], []
    for number, (place, R) in enumerate(STILLS):
        j = of(f"{number}.png", frame, geometry)
        assert off_degrees(frame, geometry, f"{number}.png", R) < 0.2
        places.append(rig.centres[j])
        true.append(TILTED @ (place - AT_SPHERE))
    found, places = np.array(places), np.array(true)
    found *= (found * places).sum() / (found**2).sum()
    assert np.linalg.norm(found - places, axis=1).max() < 0.02
    assert rig.cameras[of("0.png", frame, geometry)].focal == pytest.approx(FOCAL, rel=0.01)


@pytest.mark.slow
def test_a_sphere_and_one_still_are_stitched_as_seen_from_either(whole: Picture) -> None:
    still = taken(0)
    frame, geometry = aligned([*still, whole])
    assert len(geometry.rig) == 9 and frame.names[geometry.numbers[0]] == "0.png"
    assert off_degrees(frame, geometry, "0.png", STILLS[0][1]) < 0.2
    frame, geometry = aligned([*still, whole], StitchOptions(viewpoint="drone"))
    assert frame.names[geometry.numbers[0]] == "drone (front).jpg"
    assert np.allclose(geometry.rig.R[0], np.eye(3)) and not geometry.rig.t[0].any()


@pytest.mark.slow
def test_two_spheres_from_different_places(whole: Picture) -> None:
    place, R = np.array([0.5, 0.2, 0.2]), turned(-70, -6, 5)
    other = picture_from_array(np.rint(sphere(place, R, HEIGHT)).astype(np.uint8), "other.jpg")
    frame, geometry = aligned([whole, other])
    rig = geometry.rig
    assert len(rig) == 16 and sorted(map(len, rig.stations)) == [8, 8]
    assert off_degrees(frame, geometry, "other (front).jpg", R) < 0.1
    true = TILTED @ (place - AT_SPHERE)
    found = rig.centres[of("other (back).jpg", frame, geometry)]
    assert np.linalg.norm(found - true / np.linalg.norm(true)) < 0.01, "the only length is the unit"


@pytest.mark.slow
def test_a_sphere_of_another_room_is_left_out_and_named_once(whole: Picture) -> None:
    elsewhere = picture_from_array(flat(*STILLS[0], FOCAL, SIZE, seed=1), "elsewhere.png")
    with pytest.raises(NoOverlap, match="no two of these|no two pictures connect"):
        aligned([whole, elsewhere])
    frame, geometry = aligned([whole, *(
        picture_from_array(flat(*still, FOCAL, SIZE, seed=1), f"{number}.png") for number, still in enumerate(STILLS)
    )])  # fmt: skip
    assert [name for name, _ in geometry.left_out] == ["drone.jpg"], "three stills outweigh eight views of one sphere"
    assert len(geometry.rig) == 3 and sum("drone" in line for line in geometry.warnings) == 1


def test_the_panorama_from_its_place_is_the_sphere(whole: Picture) -> None:
    """No border between views is to be seen: they are what they were cut out of, resampled twice."""
    options = StitchOptions(projection="equirectangular", level="none", dense=False, blend="feather")
    result = stitch([whole, *taken(0, 1)], options)
    found = result.panorama.light[:, :]
    height = result.canvas.height
    true = seen(AT_SPHERE, sphere_rays(height) @ TILTED) / 255
    levels = np.where(found <= 0.0031308, 12.92 * found, 1.055 * np.maximum(found, 0) ** (1 / 2.4) - 0.055)
    off = np.abs(levels - true).max(axis=2)
    assert result.panorama.alpha.min() > 0.99
    assert np.median(off) < 0.012 and np.percentile(off, 99.9) < 0.1
    assert [picture.name for picture in result.pictures][:2] == ["drone (front).jpg", "drone (front right).jpg"]


def test_a_fisheyes_circle_and_stills_are_placed() -> None:
    """No lens is given: the circle's middle and radius and 180° are one."""
    fisheye = picture_from_array(circle(AT_SPHERE, TILTED, 290, (620, 600)), "eye.jpg")
    frame, geometry = aligned([fisheye, *taken(0, 2)])
    rig = geometry.rig
    assert sum("eye.jpg is the circle of a fisheye" in line for line in geometry.warnings) == 1
    assert any("80° from the lens's axis is left out of eye.jpg" in line for line in frame.warnings)
    assert len(rig) == 3 and rig.cameras[0].focal == pytest.approx(290 / (np.pi / 2), rel=0.01)
    for number in (0, 2):  # which share a corner: a wall alone leaves two poses
        R = rig.R[of(f"{number}.png", frame, geometry)]
        assert rotation_angle(R, STILLS[number][1] @ TILTED.T) < 0.3


@pytest.mark.slow
def test_progress_of_a_sphere_and_a_still_is_that_of_many(whole: Picture) -> None:
    """Two are given, and nine pictures are stitched."""
    told: list[tuple[str, float]] = []
    options = StitchOptions(dense=False, blend="feather")
    stitch([whole, *taken(0)], options, lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares) and 0.9 < shares[-1] <= 1
    assert "matches" in {stage for stage, _ in told}
