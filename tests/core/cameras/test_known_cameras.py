"""Cameras that follow from what a picture is, beside those that are told."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.cameras.camera import Camera, ViewOf
from edf_stitch.core.cameras.from_circle import camera_of_circle
from edf_stitch.core.cameras.lens_models import Lens
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.metadata import Exif

NAMES, SIZES = ("s (front).jpg", "eye.jpg", "still.jpg"), [(200, 300), (500, 400), (640, 480)]
VIEW = Camera(np.array([[120.0, 0, 99.5], [0, 120, 149.5], [0, 0, 1]]), SIZES[0], "its sphere", 0.0, lens=Lens(),
              view_of=ViewOf(0, "s.jpg", np.eye(3)))  # fmt: skip
CIRCLE = camera_of_circle((250.0, 199.0, 180.0), SIZES[1])


def known(request: CameraRequest, exif: Exif | None = None) -> tuple[list[Camera], list[str]]:
    return cameras_for(request, NAMES, SIZES, [exif or Exif()] * 3, (VIEW, CIRCLE, None))


def test_what_is_told_of_all_pictures_is_not_about_them() -> None:
    (view, circle, still), warnings = known(CameraRequest(focal_px=(500.0,), principal=(320.0, 240.0)))
    assert view is VIEW and circle is CIRCLE and still.focal == 500
    assert warnings == [
        "eye.jpg is the circle of a fisheye: it is taken for that of an equidistant lens which shows 180°; if it is "
        "another one, give it by --cameras"
    ]
    assert np.allclose(CIRCLE.lens.project(np.array([1.0, 0, 0])) * CIRCLE.focal, (180, 0))


def test_they_lend_no_other_picture_their_focal_length() -> None:
    (view, circle, still), _ = known(CameraRequest())
    assert view is VIEW and circle is CIRCLE and still.assumed and not still.lens_of
    assert known(CameraRequest(), Exif(focal35_mm=28.0))[0][0] is VIEW, "nor have they one by EXIF"


def test_a_camera_file_knows_better_and_a_view_stays_one() -> None:
    table = {
        "s (front).jpg": {"K": VIEW.K.tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 0]},
        "eye.jpg": {"K": [[130, 0, 250], [0, 130, 199], [0, 0, 1]], "lens": {"projection": "equisolid"},
                    "R": np.eye(3).tolist(), "t": [1, 0, 0]},
    }  # fmt: skip
    (view, circle, still), warnings = known(CameraRequest(cameras={"cameras": table}))
    assert view.pose is not None and view.view_of is VIEW.view_of
    assert circle.focal == 130 and circle.lens.projection == "equisolid" and not warnings
    del table["eye.jpg"], table["s (front).jpg"]["R"], table["s (front).jpg"]["t"]
    assert known(CameraRequest(cameras={"cameras": table}))[0][1] is CIRCLE, "of what the file does not name"
