"""The same photographs as PNG, HEIC, EXR and camera RAW give the same panorama."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.raster.colour import decode, encode
from edf_stitch.core.raster.lazy import whole
from edf_stitch.synthetic_scenes.two_planes import Pair

from ..pairs import ON_REFERENCE
from .pictures.raw_and_heic import dng, heic, mosaic

OPTIONS = StitchOptions(
    **{**vars(ON_REFERENCE), "camera": CameraRequest(focal_px=(456.0,)), "dense": False, "measure": False}
)


@pytest.fixture(scope="module")
def levels(small_pair: Pair) -> list[np.ndarray]:
    """Twice as large, and as soft as a lens makes them: a sensor sees one colour at each pixel."""
    large = [cv2.resize(one, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
             for one in (small_pair.reference, small_pair.target)]  # fmt: skip
    return [cv2.GaussianBlur(one, (0, 0), 1.5) for one in large]


def stitched(folder: Path, suffix: str, files: list[bytes]) -> StitchResult:
    paths = [folder / f"{name}{suffix}" for name in ("first", "second")]
    for path, data in zip(paths, files, strict=True):
        path.write_bytes(data)
    return stitch(paths, OPTIONS)


def shown_by_both(*results: StitchResult) -> list[np.ndarray]:
    """Light (N, 3) of the pixels that both panoramas show; the reference lies at their offsets."""
    left, top = np.min([one.canvas.offset for one in results], axis=0)
    parts = []
    for one in results:
        rows, columns = (slice(own - least, None)
                         for own, least in zip(one.canvas.offset[::-1], (top, left), strict=True))
        parts.append((whole(one.panorama.light)[rows, columns], one.panorama.alpha[rows, columns]))
    height, width = np.min([alpha.shape for _, alpha in parts], axis=0)
    shown = np.logical_and.reduce([alpha[:height, :width] > 0.99 for _, alpha in parts])
    return [light[:height, :width][shown] for light, _ in parts]


def test_heic_makes_what_png_makes(tmp_path: Path, levels: list[np.ndarray]) -> None:
    png = stitched(tmp_path, ".png", [cv2.imencode(".png", one[..., ::-1])[1].tobytes() for one in levels])
    from_heic = stitched(tmp_path, ".heic", [heic(one) for one in levels])
    assert from_heic.bits == 8
    one, other = (encode(light[None], 8).astype(int) for light in shown_by_both(png, from_heic))
    assert one.size > 3 * 480 * 360 and np.percentile(np.abs(one - other), 98) <= 1


def test_raw_makes_what_linear_light_makes(tmp_path: Path, levels: list[np.ndarray]) -> None:
    """The second one was exposed for twice as long and balanced otherwise by its camera."""
    light = [0.4 * decode(one) for one in levels]
    exr = stitched(tmp_path, ".exr", [encode_picture(one, None, 32, ".exr")[0] for one in light])
    raw = stitched(tmp_path, ".dng", [
        dng(mosaic(light[0])), dng(mosaic(2 * light[1]), (0.4, 1.0, 0.8), seconds=(1, 50)),
    ])  # fmt: skip
    assert raw.bits == 32
    one, other = shown_by_both(raw, exr)
    ratio = one / np.maximum(other, 0.01)
    assert one.size > 3 * 480 * 360 and np.median(np.abs(ratio - 1)) < 0.02
    assert np.median(ratio) == pytest.approx(1, abs=0.005)
    assert raw.pictures[0].exif.text(271) == "Maker", "which goes along to the panorama"


def test_raw_of_one_panorama_shares_white_and_exposure(tmp_path: Path, levels: list[np.ndarray]) -> None:
    light = [0.4 * decode(one) for one in levels]
    paths = [tmp_path / name for name in ("a.dng", "b.dng", "c.png")]
    paths[0].write_bytes(dng(mosaic(light[0])))
    paths[1].write_bytes(dng(mosaic(2 * light[1]), (0.4, 1.0, 0.8), seconds=(1, 50)))
    frame = read_frame(paths[:2], StitchOptions())
    for picture, true in zip(frame.pictures, light, strict=True):
        assert np.median(picture.pixels / np.maximum(true, 0.01)) == pytest.approx(1, abs=0.005)
    assert not frame.warnings
    paths[2].write_bytes(cv2.imencode(".png", levels[1][..., ::-1])[1].tobytes())
    mixed = read_frame(paths[::2], StitchOptions())
    assert "camera RAW stands beside c.png" in mixed.warnings[0]
