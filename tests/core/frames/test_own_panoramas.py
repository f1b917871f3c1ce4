"""A panorama of ours among the pictures that it was made of is told of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.frames.own_panoramas import own_panorama_warnings
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import save_picture
from edf_stitch.core.pictures.metadata import SOFTWARE, Exif
from edf_stitch.core.pictures.picture import Picture, load_picture, picture_from_array

NOISE = np.random.default_rng(4).integers(0, 256, (40, 60, 3), dtype=np.uint8)


def taken(name: str, second: int = 0, software: str = "", model: str = "Phone") -> Picture:
    kept = (271, "Maker"), (272, model), *([(36867, f"2024:05:06 07:08:{second:02}")] if second else [])
    picture = picture_from_array(np.roll(NOISE, len(name) + second, axis=1), name)
    return replace(picture, exif=Exif(make="Maker", model=model, software=software, kept=kept))


def test_a_panorama_of_a_picture_beside_it_is_named() -> None:
    pictures = [taken("a.jpg", 1), taken("b.jpg", 2), taken("pano.jpg", 2, SOFTWARE)]
    (said,) = own_panorama_warnings(pictures)
    assert said.startswith("pano.jpg is a panorama that EDF Stitch made of b.jpg") and said.endswith("leave it out")
    assert any(said in line for line in read_frame(pictures, StitchOptions()).warnings)


def test_one_of_other_pictures_is_as_good_as_any() -> None:
    a, b = taken("a.jpg", 1), taken("b.jpg", 2)
    assert own_panorama_warnings([a, b, taken("pano.jpg", 3, SOFTWARE)]) == []
    assert own_panorama_warnings([a, b, taken("pano.jpg", 2, SOFTWARE, "Drone")]) == [], "another camera at that time"
    assert own_panorama_warnings([a, b, taken("c.jpg", 2)]) == [], "two photographs of one second"
    assert own_panorama_warnings([taken("p.jpg", 1, SOFTWARE), taken("q.jpg", 1, SOFTWARE)]) == []


def test_where_no_time_is_known_it_is_left_to_the_user() -> None:
    a, b, panorama = taken("a.png"), taken("b.png"), taken("pano.png", software=SOFTWARE)
    (said,) = own_panorama_warnings([a, b, panorama])
    assert "pano.png is a panorama that EDF Stitch made; if that was of pictures given beside it" in said
    assert own_panorama_warnings([a, panorama]) == []


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_what_is_written_is_known_again(suffix: str, tmp_path: Path) -> None:
    source = taken("a.jpg", 1)
    path = tmp_path / f"pano{suffix}"
    save_picture(path, source.pixels, None, 8, exif=source.exif)
    (said,) = own_panorama_warnings([source, load_picture(path)])
    assert "made of a.jpg" in said
