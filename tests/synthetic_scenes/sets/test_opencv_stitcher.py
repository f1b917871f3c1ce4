"""OpenCV's Stitcher as a rival: its panorama of pictures from one place is brought onto the sphere they are of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, rotation_angle
from edf_stitch.core.compare.elsewhere.opencv_stitcher import StitcherFailed
from edf_stitch.core.raster.colour import decode
from edf_stitch.core.raster.sampling import fetch
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.sets.opencv_stitcher import stitcher_panorama
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet
from edf_stitch.synthetic_scenes.sets.rival_panorama import RivalPanorama
from edf_stitch.synthetic_scenes.sets.set_measures import SetTruth, colour_figures
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera

SIZE = (320, 240)
VIEWS = tuple(View((0.0, 0.0, 1.6), yaw, pitch, roll, 28.0) for yaw, pitch, roll in
              ((0, 4, 0), (24, 2, 2), (-24, 6, -1), (47, 3, 1)))  # fmt: skip


def painted(seed: int) -> np.ndarray:
    """Blotches (H, W, 3) uint8 on a sphere, dark and bright, of several sizes."""
    random = np.random.default_rng(seed)
    light = sum(
        cv2.resize(random.normal(0, 30, (height, 2 * height, 3)), (1600, 800), interpolation=cv2.INTER_CUBIC)
        for height in (50, 100, 200)
    )
    return np.clip(light + 128, 20, 235).astype(np.uint8)


def rendered(folder: Path, seeds: tuple[int, ...] = (0, 0, 0, 0)) -> RenderedSet:
    """Pictures from one place of what is painted on a sphere around it; each of that by its seed."""
    cameras = tuple(view.camera(SIZE) for view in VIEWS)
    sphere = SphereCamera(cameras[0].place, (1600, 800))
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), axis=-1).astype(float)
    paths = []
    for number, (camera, seed) in enumerate(zip(cameras, seeds, strict=True)):
        x, y = sphere.pixels(homogeneous(pixels) @ np.linalg.inv(camera.K).T @ camera.R)
        paths.append(folder / f"{number:02d}.png")
        cv2.imwrite(str(paths[-1]), fetch(painted(seed), x.astype(np.float32), y.astype(np.float32))[..., ::-1])
    depths = tuple(np.full(SIZE[::-1], np.inf, np.float32) for _ in cameras)
    distance = np.full((800, 1600), np.inf, np.float32)
    return RenderedSet(tuple(paths), cameras, depths, sphere, decode(painted(0)), distance, {}, "")


@pytest.fixture(scope="module")
def a_set(tmp_path_factory: pytest.TempPathFactory) -> RenderedSet:
    return rendered(tmp_path_factory.mktemp("pictures"))


@pytest.fixture(scope="module")
def truth(a_set: RenderedSet) -> SetTruth:
    return SetTruth.of(a_set)


@pytest.fixture(scope="module")
def panorama(a_set: RenderedSet) -> RivalPanorama:
    return stitcher_panorama(a_set, range(4))


def test_it_lies_on_the_sphere_as_the_truth_does(panorama: RivalPanorama, truth: SetTruth) -> None:
    light, shown = panorama.on_sphere(truth)
    seen = truth.views_at(range(4)) > 0
    assert (shown & seen).sum() > 0.9 * seen.sum() and (shown & ~seen).sum() < 0.02 * seen.sum()
    right = colour_figures(light, shown & seen, truth)[0]["psnr_db"]
    off = colour_figures(np.roll(light, 2, axis=1), shown & seen, truth)[0]["psnr_db"]
    assert right > 25 and right > off + 3


def test_its_rotations_are_the_pictures_own(panorama: RivalPanorama, truth: SetTruth) -> None:
    assert list(panorama.rotations) == [0, 1, 2, 3]
    for first in (0, 2):
        found = panorama.rotations[1] @ panorama.rotations[first].T
        true = truth.rendered.cameras[1].R @ truth.rendered.cameras[first].R.T
        assert rotation_angle(found, true) < 0.5


def test_it_is_turned_by_the_pictures_that_are_asked_for(panorama: RivalPanorama, truth: SetTruth) -> None:
    wrong = {number: R if number else np.eye(3)[[1, 2, 0]] for number, R in panorama.rotations.items()}
    light, shown = replace(panorama, rotations=wrong).on_sphere(truth)
    assert colour_figures(light, shown, truth)[0]["psnr_db"] > 25, "one of the others turns it right"


def test_what_it_leaves_out_is_a_failure_only_where_it_must_be_in(tmp_path: Path) -> None:
    stranger = rendered(tmp_path, (0, 0, 0, 1))
    with pytest.raises(StitcherFailed, match="leaves out 1 of 4"):
        stitcher_panorama(stranger, range(4))
    assert list(stitcher_panorama(stranger, range(3)).rotations) == [0, 1, 2]


def test_pictures_that_do_not_connect_are_a_failure(tmp_path: Path) -> None:
    with pytest.raises(StitcherFailed, match="too few pictures connect"):
        stitcher_panorama(rendered(tmp_path, (0, 1, 2, 3)), range(4))
