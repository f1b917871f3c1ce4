"""Bugs found in core/cameras/lens.py and core/cameras/camera.py."""
import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.sources import read_camera_file
from edf_stitch.core.system.errors import BadRequest

SIZE = (1000, 750)


def camera(distortion, focal):
    f = focal * SIZE[0]
    return Camera(np.array([[f, 0, 499.5], [0, f, 374.5], [0, 0, 1]]), SIZE, "test", 0.0, np.array(distortion, float))


def grid(beyond=0.0):
    w, h = SIZE
    return np.stack(np.meshgrid(np.linspace(-beyond * w, (1 + beyond) * w - 1, 61),
                                np.linspace(-beyond * h, (1 + beyond) * h - 1, 47)), axis=-1)


# 1. the trusted radius is 1.2 × the *raw* corner's radius, but it is applied to ideal radii, which under barrel
# distortion are larger: the corner of a wide picture lies beyond it.
@pytest.mark.parametrize("k, focal", [((-0.3, 0.1, 0, 0, 0), 0.7), ((-0.25, 0.08, 0.002, -0.001, 0), 0.7),
                                      ((-0.2, 0.05, 0, 0, 0), 0.5)])
def test_opencv_inside_a_wide_barrel_picture(k, focal):
    cam = camera(k, focal)
    ideal = undistort(grid(), cam).reshape(-1, 2)
    rays = np.column_stack([(ideal - cam.K[:2, 2]) / cam.focal, np.ones(len(ideal))])
    cv = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), cam.K, cam.distortion)[0][:, 0]
    assert np.abs(cv - distort(ideal, cam)).max() < 1e-6


# 2. the fixed-point iteration has no safeguard: it needs |d displacement| < 1, which strong pincushion breaks, inside
# the picture or (undistort is asked for the whole canvas) around it.
@pytest.mark.parametrize("k, focal, beyond", [((0.3, 0, 0, 0, 0), 0.5, 0.0), ((0.5, 0, 0, 0, 0), 0.7, 0.0),
                                              ((0.3, 0, 0, 0, 0), 0.7, 1.5), ((0.2, 0, 0, 0, 0), 0.5, 1.5),
                                              ((0.5, 0, 0, 0, 0), 0.9, 1.5), ((0.2, 0.2, 0, 0, 0.1), 0.9, 1.5)])
def test_the_inverse_converges_for_pincushion(k, focal, beyond):
    cam = camera(k, focal)
    assert np.abs(distort(undistort(grid(beyond), cam), cam) - grid(beyond)).max() < 1e-6


# 3. np.asarray raises bare ValueError / TypeError
@pytest.mark.parametrize("distortion", ["none", ["a"], [[1], [2, 3]], {"k1": 0.1}])
def test_malformed_distortion_is_refused(distortion):
    K = [[1000, 0, 500], [0, 1000, 400], [0, 0, 1]]
    with pytest.raises(BadRequest):
        read_camera_file({"cameras": {"reference": {"K": K, "distortion": distortion}, "target": {"K": K}}},
                         ("a", "b"), (SIZE, SIZE))
