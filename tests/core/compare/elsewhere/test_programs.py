"""Hugin and OpenCV's Stitcher, run: their layers are what their maps say."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.compare.elsewhere.hugin import HuginFailed, hugin_panorama, installed, run, size_of
from edf_stitch.core.compare.elsewhere.opencv_stitcher import StitcherFailed, stitcher_panorama
from edf_stitch.core.measure.placed.placed import PlacedSet
from edf_stitch.core.pictures.picture import Picture, load_picture, picture_from_array
from edf_stitch.core.raster.sampling import fetch

SIZE = (480, 360)


def view(yaw: float, seed: int = 0) -> np.ndarray:
    """A picture (H, W, 3) of blotches on a sphere, turned by degrees."""
    random = np.random.default_rng(seed)
    sphere = sum(
        cv2.resize(random.normal(0, 40, (height, 2 * height, 3)), (2400, 1200), interpolation=cv2.INTER_CUBIC)
        for height in (75, 150, 300)
    )
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
    rays = np.stack([(x - 239.5) / 420, (y - 179.5) / 420, np.ones_like(x)], axis=-1)
    turn = np.radians(yaw)
    right, ahead = (rays[..., 0] * np.cos(turn) + rays[..., 2] * np.sin(turn),
                    rays[..., 2] * np.cos(turn) - rays[..., 0] * np.sin(turn))  # fmt: skip
    along, down = np.arctan2(right, ahead), np.arctan2(rays[..., 1], np.hypot(right, ahead))
    at = [(value * 2400 / (2 * np.pi) + middle).astype(np.float32) for value, middle in ((along, 1200), (down, 600))]
    return np.clip(fetch((sphere + 128).astype(np.float32), *at, cv2.INTER_LINEAR), 10, 245).astype(np.uint8)


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("views")
    found = [folder / f"{number}.png" for number in range(3)]
    for path, yaw in zip(found, (-25.0, 0.0, 25.0), strict=True):
        cv2.imwrite(str(path), view(yaw))
    return found


def as_the_maps_say(panorama: PlacedSet, pictures: list[Picture]) -> list[float]:
    """How much better each layer correlates with what its map fetches than with what lies 0.7 px beside that."""
    out = []
    for one in panorama.pictures:
        (picture,) = (picture for picture in pictures if picture.name == one.name)
        assert one.map is not None
        alike = []
        for right, down in ((0, 0), (0.7, 0), (-0.7, 0), (0, 0.7), (0, -0.7)):
            x, y = one.map.x + np.float32(right), one.map.y + np.float32(down)
            fetched = fetch(picture.view, x, y, cv2.INTER_LINEAR)
            alike.append(float(np.corrcoef(fetched[one.shows].ravel(), one.colours[one.shows].ravel())[0, 1]))
        assert alike[0] > 0.97
        out.append(alike[0] - max(alike[1:]))
    return out


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="Hugin is not installed")
def test_hugins_layers_are_what_its_cameras_show(paths: list[Path]) -> None:
    pictures = [load_picture(path) for path in paths]
    panorama = hugin_panorama(paths, pictures)
    found = as_the_maps_say(panorama, pictures)
    assert len(panorama.pictures) == 3 and min(found) > 0


def test_the_stitchers_layers_are_what_its_warper_maps(paths: list[Path]) -> None:
    pictures = [load_picture(path) for path in paths]
    panorama = stitcher_panorama(pictures)
    found = as_the_maps_say(panorama, pictures)
    assert len(panorama.pictures) == 3 and min(found) > 0
    # the middles of the pictures lie as many degrees apart as they were turned
    middles = []
    for one in panorama.pictures:
        assert one.map is not None and panorama.rays_at is not None
        nearest = np.unravel_index(np.argmin(np.hypot(one.map.x - 239.5, one.map.y - 179.5)), one.map.x.shape)
        middles.append(panorama.rays_at(np.array([nearest[::-1]]) + one.corner)[0])
    apart = [np.degrees(np.arccos(np.clip(middles[0] @ other, -1, 1))) for other in middles[1:]]
    assert apart == pytest.approx([25, 50], abs=2)


def test_pictures_that_do_not_connect_are_a_failure() -> None:
    with pytest.raises(StitcherFailed, match="too few pictures connect"):
        stitcher_panorama([picture_from_array(view(0.0, seed)) for seed in range(3)])


def test_what_a_program_of_hugins_says_last_is_told(tmp_path: Path) -> None:
    with pytest.raises(HuginFailed, match="install Hugin"):
        run(tmp_path, "no-such-program-of-hugins")
    with pytest.raises(HuginFailed, match="ended with 3: alas"):
        run(tmp_path, "sh", "-c", "echo alas; exit 3")
    assert size_of('p f2 w1600 h800 v360 E1 R0 S0,1600,0,800 n"TIFF_m"') == (1600, 800)
    with pytest.raises(HuginFailed, match="no panorama"):
        size_of("i w3 h4")
