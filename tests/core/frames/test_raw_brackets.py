"""Brackets of camera RAW, which was developed to one scale: all exposures of a view look alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.frames.brackets import brackets_in
from edf_stitch.core.frames.merging import merged
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.pictures.raw_development import exposure_of_first

from ..pictures.raw_and_heic import NEUTRAL, dng, mosaic
from .exposed_views import HEIGHT, WIDTH, painted_world, view_of
from .test_brackets import moved_apart

WORLD = painted_world(10.0)
VIEW, BESIDE = view_of(WORLD, 20.0), view_of(WORLD, 420.0)


def taken(folder: Path, name: str, light: np.ndarray, stops: float, noise: float = 0.0, says: bool = True) -> Path:
    """The DNG of a view, exposed by so many stops more than 1/64 s; noise: standard deviation, as a share of white;
    says: whether it says how it was exposed."""
    random = np.random.default_rng([7, int(1000 * (stops + 20))])
    sensor = mosaic(light * 2.0**stops, NEUTRAL) + 65535 * noise * random.standard_normal(light.shape[:2])
    seconds = (1000, round(64000 / 2.0**stops)) if says else None
    path = folder / name
    path.write_bytes(dng(np.clip(np.rint(sensor), 0, 65535).astype(np.uint16), NEUTRAL, seconds))
    return path


def developed(files: Sequence[Path]) -> list[Picture]:
    """As the pictures of one panorama are."""
    exposure = exposure_of_first(files)
    return [load_picture(path, exposure=exposure) for path in files]


def off(light: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """By which share each pixel's channels are off, their mean."""
    return np.abs(light / truth - 1).mean(axis=2)


@pytest.mark.parametrize("says", [True, False])
def test_three_exposures_become_one_radiance(tmp_path: Path, says: bool) -> None:
    """Light up to 3.5 times the middle exposure's white, over ten stops."""
    files = [taken(tmp_path, f"{stops}.dng", VIEW, stops, says=says) for stops in (0, -2, 2)]
    pictures = developed([*files, taken(tmp_path, "beside.dng", BESIDE, 0, says=says)])
    (bracket,) = brackets_in(pictures, "auto")
    assert bracket.numbers == (1, 0, 2) and np.allclose(bracket.stops, (-2, 0, 2), atol=0.02)
    made, about = merged(pictures, bracket)
    assert np.median(off(made.pixels, VIEW)) < 0.02 and about.moved < 1e-3
    white = VIEW.max(axis=2) > 1.2
    assert white.mean() > 0.02 and np.median(off(made.pixels, VIEW)[white]) < 0.02, "clipped in the middle one"
    assert (made.bits, made.clips_at) == (32, pytest.approx(4, rel=0.01))


def test_they_are_found_among_files_and_nothing_is_said_of_light_that_another_shows(tmp_path: Path) -> None:
    files = [taken(tmp_path, f"{name}{stops}.dng", light, stops)
             for name, light in (("a", VIEW), ("b", BESIDE)) for stops in (0, -2, 2)]  # fmt: skip
    frame = read_frame(files, StitchOptions())
    assert [about.names for about in frame.brackets] == [(f"{n}-2.dng", f"{n}0.dng", f"{n}2.dng") for n in "ab"]
    assert not any(picture.warnings for picture in frame.pictures)
    for picture, light in zip(frame.pictures, (VIEW, BESIDE), strict=True):
        assert np.median(off(picture.pixels, light)) < 0.02, "both views have one scale"
    apart = read_frame(files, StitchOptions(brackets="off"))
    assert len(apart.pictures) == 6 and "is over-exposed" in " ".join(apart.pictures[2].warnings)


def test_the_scale_stays_that_of_the_first_picture(tmp_path: Path) -> None:
    """Named darkest first, of three the third is the longest; the light of all is that of the first."""
    pictures = developed([taken(tmp_path, f"{stops}.dng", VIEW, stops) for stops in (-2, 0, 2)])
    (bracket,) = brackets_in(pictures, 3)
    made, _ = merged(pictures, bracket)
    assert np.median(made.pixels / (VIEW / 4)) == pytest.approx(1, abs=0.02) and made.clips_at == pytest.approx(1, 0.01)


def test_the_longest_exposure_counts_most_in_the_dark(tmp_path: Path) -> None:
    """Noise of the sensor falls by the time: one fourth where two stops more were let in."""
    files = [taken(tmp_path, f"{stops}.dng", VIEW, stops, noise=0.004) for stops in (0, -2, 2)]
    pictures = developed(files)
    (bracket,) = brackets_in(pictures, 3)
    made, about = merged(pictures, bracket)
    dark = VIEW.max(axis=2) < 0.05
    noise = [np.std((picture.pixels - VIEW)[dark]) for picture in (made, *pictures)]
    assert noise[0] < 0.4 * noise[1] and about.moved < 0.01


def test_pictures_of_different_places_are_none_however_they_were_exposed(tmp_path: Path) -> None:
    lights = [VIEW, moved_apart(VIEW, 8.0), view_of(WORLD, 140.0)]
    pictures = developed([taken(tmp_path, f"{k}.dng", light, stops)
                          for k, (light, stops) in enumerate(zip(lights, (0, 1.5, -1.5), strict=True))])  # fmt: skip
    assert brackets_in(pictures, "auto") == []


def test_the_same_exposure_twice_is_none(tmp_path: Path) -> None:
    pictures = developed([taken(tmp_path, f"{k}.dng", VIEW, 0, noise=0.001 * k) for k in range(3)])
    assert brackets_in(pictures, "auto") == []
    assert pictures[0].view.shape == (HEIGHT, WIDTH, 3)
