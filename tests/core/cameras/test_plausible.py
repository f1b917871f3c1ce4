"""What is given of a camera and no camera has is refused, and a lens that folds is told."""

from __future__ import annotations

import math

import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.system.errors import BadRequest

from .test_camera import K_LEFT, K_RIGHT, cameras, entry


@pytest.mark.parametrize(
    ("size", "focal", "passes"),
    [
        ((4000, 3000), 6.0 / 36 * 4000, True),  # a fisheye lens on full frame
        ((4000, 3000), 1200 / 6.17 * 4000, True),  # the longest lens on a phone's sensor
        ((3000, 4000), 0.1 * 4000, True),
        ((4000, 3000), 1.0, False),
        ((4000, 3000), 399.0, False),
        ((4000, 3000), 500.1 * 4000, False),
        ((4000, 3000), 1e300, False),
    ],
)
def test_a_focal_length_that_no_lens_has_is_refused(size: tuple[int, int], focal: float, passes: bool) -> None:
    for request in (
        CameraRequest(focal_px=(3000, focal)),
        CameraRequest(cameras={"left.jpg": entry(K_LEFT), "right.jpg": entry([[focal, 0, 1], [0, focal, 1]])}),
    ):
        if passes:
            assert cameras(request, size=size)[1].focal == focal
        else:
            with pytest.raises(BadRequest, match=f"the target: a focal length of .* {max(size) // 10} to 2000000 px"):
                cameras(request, size=size)


@pytest.mark.parametrize(
    ("K", "words"),
    [
        ([[3000, 0, 2000], [0, 200000, 1500]], "the two focal lengths of K"),
        ([[3000, 5000, 2000], [0, 3000, 1500]], "the skew of K is 5000 px"),
        ([[3000, 0, 1e7], [0, 3000, 1500]], r"the principal point \(1e\+07, 1500\) lies more than 80000 px"),
        ([[3000, 0, 2000], [0, 3000, -1e300]], "the principal point"),
    ],
)
def test_intrinsics_that_no_camera_has_are_refused(K: list[list[float]], words: str) -> None:
    with pytest.raises(BadRequest, match=f"the reference: {words}"):
        cameras(CameraRequest(cameras={"left.jpg": entry(K), "right.jpg": entry(K_RIGHT)}))


def test_a_principal_point_far_outside_is_refused_and_that_of_a_cut_out_corner_is_not() -> None:
    assert cameras(CameraRequest(principal=(30000, -20000)))[0].K[0, 2] == 30000
    with pytest.raises(BadRequest, match="the principal point"):
        cameras(CameraRequest(principal=(1e300, 0)))


@pytest.mark.parametrize(
    ("distortion", "folds"),
    [([-0.1], False), ([0.3], False), ([-0.3, 0.1], False), ([-2.0], True), ([-1e10], True), ([-1.5, 2.0], False)],
)
def test_a_distortion_that_folds_within_the_picture_is_told(distortion: list[float], folds: bool) -> None:
    file = {"left.jpg": entry(K_LEFT, distortion=distortion), "right.jpg": entry(K_RIGHT)}
    first, _, warnings = cameras(CameraRequest(cameras=file))
    assert len(warnings) == folds
    if folds:
        # k1 alone folds at r = 1 / sqrt(3 |k1|), which the lens puts at two thirds of that
        fold = 2 / 3 / math.sqrt(3 * abs(distortion[0])) * first.focal
        assert warnings[0].startswith("the reference: its distortion folds back")
        assert float(warnings[0].split("back ")[1].split(" px")[0]) == pytest.approx(fold, abs=5)
