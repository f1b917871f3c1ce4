"""From baselines to metres: by a distance that was measured, or by cameras that are in metres."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.cameras.scale import Places, Scale, scale_for
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.system.errors import BadRequest, DegenerateGeometry, NoOverlap

NAMES = ("a.jpg", "b.jpg", "c.jpg", "d.jpg")
CENTRES = np.array([[0.0, 0, 0], [0.6, 0, 0.8], [0.3, 0, 0]])
# b.jpg is left out, and the fifth picture given is a copy of the third
PLACES = Places(NAMES, (0, 1, 2, 3, 2), (0, 2, 3), CENTRES)
UNKNOWN = [Camera(np.eye(3), (10, 10), "test", 0.0)] * 4


def file_of(centres: dict[str, np.ndarray], **more: str) -> dict:
    """A camera file with cameras at places, all turned somehow."""
    R = rotation_from_vector(np.array([0.1, 0.5, -0.2]))
    K = [[100.0, 0, 5], [0, 100, 5], [0, 0, 1]]
    cameras = {name: {"K": K, "R": R.tolist(), "t": (-R @ place).tolist()} for name, place in centres.items()}
    return {"cameras": cameras, **more}


def given(content: dict) -> list[Camera]:
    return cameras_for(CameraRequest(cameras=content), NAMES, [(10, 10)] * 4, [Exif()] * 4)[0]


@pytest.mark.parametrize("pair", [(1, 3), ("a.jpg", "c"), (1, 5), ("C.JPG", 1)])
def test_two_pictures_and_their_distance_tell_it(pair: tuple) -> None:
    scale = scale_for((*pair, 2.5), UNKNOWN, PLACES)
    assert scale.metres == pytest.approx(2.5) and scale.unit == "metres" and scale.factor == scale.metres
    assert "2.5 m" in scale.source


def test_without_anything_it_is_not_known() -> None:
    scale = scale_for(None, UNKNOWN, PLACES)
    assert scale == Scale() and scale.unit == "baselines" and scale.factor == 1.0


@pytest.mark.parametrize(("asked", "error", "words"), [
    ((1, 6, 2.0), BadRequest, "only 5 are given"), ((0, 1, 2.0), BadRequest, "only 5 are given"),
    (("x.jpg", 1, 2.0), BadRequest, "--scale-metres"), ((1, 2, 2.0), NoOverlap, "b.jpg, which is left out"),
    ((3, 5, 2.0), DegenerateGeometry, "no parallax"),
])  # fmt: skip
def test_what_tells_no_scale_is_refused(asked: tuple, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        scale_for(asked, UNKNOWN, PLACES)


def test_places_that_are_not_known_tell_none() -> None:
    with pytest.raises(DegenerateGeometry, match="no parallax"):
        scale_for((1, 3, 2.0), UNKNOWN, Places(NAMES, (), (0, 2), np.full((2, 3), np.nan)))


def test_cameras_that_are_in_metres_tell_it() -> None:
    """In a world of their own, turned and shifted."""
    turn = rotation_from_vector(np.array([0.3, -0.4, 0.2]))
    places = dict(zip(("a.jpg", "c.jpg", "d.jpg"), 4.0 * CENTRES @ turn.T + [10, 20, 30], strict=True))
    in_metres = scale_for(None, given(file_of(places, unit="metres")), PLACES)
    assert in_metres.metres == pytest.approx(4.0) and "given" in in_metres.source
    assert scale_for(None, given(file_of(places)), PLACES) == Scale(), "a file that says nothing has a unit of its own"
    assert scale_for(None, given(file_of(places, unit="baselines")), PLACES) == Scale()
    one_place = dict.fromkeys(places, np.ones(3))
    assert scale_for(None, given(file_of(one_place, unit="metres")), PLACES) == Scale()
    assert scale_for((1, 3, 9.0), given(file_of(places, unit="metres")), PLACES).metres == pytest.approx(9.0)


def test_a_file_in_another_unit_is_refused() -> None:
    with pytest.raises(BadRequest, match="metres"):
        given(file_of({"a.jpg": np.zeros(3), "c.jpg": np.ones(3)}, unit="feet"))
