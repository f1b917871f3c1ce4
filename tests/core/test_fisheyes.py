"""stitch() of pictures that fisheyes took, against the cameras that took them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import undistort
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.camera_file import camera_table
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pipeline import stitch
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.two_planes import Textures, render

from ..sets import make_set

SIZE, WIDE = (320, 240), (800, 640)
# half of the diagonal is at 84°
FOCAL = 136.0
LENS = Lens(LensProjection.EQUIDISTANT)


@pytest.fixture(scope="module")
def fisheyes() -> tuple[list[Picture], tuple[SceneCamera, ...]]:
    """Three pictures of a fisheye, made of wide ones of pinholes, and their cameras."""
    cameras = make_set(count=3, turn=30.0).cameras
    K = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
    lens = Camera(K, SIZE, "", 0.0, lens=LENS)
    raw = np.stack(np.meshgrid(*(np.arange(float(side)) for side in SIZE)), axis=-1)
    at = (undistort(raw, lens) + (np.array(WIDE) - SIZE) / 2).astype(np.float32)
    wide, textures = K.copy(), Textures(0)
    wide[:2, 2] = (np.array(WIDE) - 1) / 2
    pictures = []
    for number, camera in enumerate(cameras, 1):
        with np.errstate(invalid="ignore"):  # beside wall and floor there is nothing
            seen = render(SceneCamera(wide, camera.R, camera.t, WIDE), textures)
        shown = cv2.remap(seen, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        pictures.append(picture_from_array(shown, f"{number}.png"))
    return pictures, cameras


def known(pictures: list[Picture]) -> StitchOptions:
    entry = {
        "K": [[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1]],
        "lens": {"projection": "equidistant"},
    }  # fmt: skip
    cameras = {"cameras": {picture.name: entry for picture in pictures}}
    return StitchOptions(camera=CameraRequest(cameras=cameras), dense=False, blend="feather", slide=0.0)


@pytest.mark.parametrize("count", [2, 3])
def test_fisheyes_with_a_given_lens_are_stitched(
    count: int, fisheyes: tuple[list[Picture], tuple[SceneCamera, ...]]
) -> None:
    pictures, cameras = (some[:count] for some in fisheyes)
    result = stitch(pictures, known(pictures))
    for view, camera in zip(result.views, cameras, strict=True):
        assert rotation_angle(view.R, camera.R @ cameras[0].R.T) < 0.15
    noise = result.edges[0].two_view.sigma if result.rig is None else result.rig.noise_px
    assert noise < 0.5
    assert any("80° from the lens's axis is left out of 1.png, 2.png" in line for line in result.warnings)
    # what is further off is shown nowhere
    maps = result.warp.maps[1]
    inside, x, y = maps.inside(), maps.arrays().x, maps.arrays().y
    shown = np.hypot(x - 159.5, y - 119.5)[inside & (result.layers[1].alpha > 0)]
    assert shown.max() < FOCAL * np.radians(80) + 3
    assert camera_table(result)["cameras"]["1.png"]["lens"]["projection"] == "equidistant"
    assert result.report["pictures"][0]["camera"]["lens_model"]["projection"] == "equidistant"


def test_without_the_lens_they_are_placed_wrongly(fisheyes: tuple[list[Picture], tuple[SceneCamera, ...]]) -> None:
    """What the lens is for: a pinhole of the same focal length turns the second picture by degrees too much or less."""
    pictures, cameras = (some[:2] for some in fisheyes)
    result = stitch(pictures, replace(known(pictures), camera=CameraRequest(focal_px=(FOCAL,))))
    assert rotation_angle(result.views[1].R, cameras[1].R @ cameras[0].R.T) > 1.0
