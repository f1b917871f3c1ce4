"""Which files a folder or a pattern stands for."""

from __future__ import annotations

from pathlib import Path

import pytest
from edf_stitch.core.pictures.listing import listed, natural
from edf_stitch.core.system.errors import BadRequest, UnreadableImage
from hypothesis import given
from hypothesis import strategies as st


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b10.jpg", "b2.JPG", "a.png", "notes.txt", ".hidden.png", "c.exr"):
        (tmp_path / name).touch()
    (tmp_path / "inner.png").mkdir()
    return tmp_path


def names(paths: list[Path]) -> list[str]:
    return [path.name for path in paths]


def test_a_folder_stands_for_its_pictures_as_people_count_them(folder: Path) -> None:
    assert names(listed([folder])) == ["a.png", "b2.JPG", "b10.jpg", "c.exr"]


def test_a_pattern_stands_for_the_pictures_it_matches(folder: Path) -> None:
    assert names(listed([folder / "b*"])) == ["b2.JPG", "b10.jpg"]
    assert names(listed([folder / "[ac].*"])) == ["a.png", "c.exr"]


def test_of_raw_and_jpeg_of_one_picture_raw_is_meant(tmp_path: Path) -> None:
    for name in ("a.NEF", "a.JPG", "a.png", "b.jpg", "c.heic", "c.dng", "d.HEIC"):
        (tmp_path / name).touch()
    assert names(listed([tmp_path])) == ["a.NEF", "a.png", "b.jpg", "c.dng", "d.HEIC"]
    assert names(listed([tmp_path / "a.*"])) == ["a.NEF", "a.png"]
    assert names(listed([tmp_path / "*.JPG"])) == ["a.JPG"], "there is nothing beside it that is meant"
    assert names(listed([tmp_path / "a.JPG", tmp_path / "a.NEF"])) == ["a.JPG", "a.NEF"], "named by themselves"


def test_files_are_taken_as_they_are_named_and_in_that_order(folder: Path) -> None:
    odd = [folder / "notes.txt", folder / "c.exr", folder / "a.png"]
    assert listed(odd) == odd
    assert names(listed([folder / "c.exr", folder / "b*"])) == ["c.exr", "b2.JPG", "b10.jpg"]


def test_a_file_whose_name_looks_like_a_pattern_is_that_file(folder: Path) -> None:
    (folder / "a[1].png").touch()
    (folder / "a1.png").touch()
    assert names(listed([folder / "a[1].png"])) == ["a[1].png"]


def test_what_does_not_exist_is_refused_and_all_of_it_named(folder: Path) -> None:
    with pytest.raises(UnreadableImage, match=r"nodir, .*b3\.jpg: no such file or folder"):
        listed([folder / "nodir", folder / "a.png", folder / "b3.jpg"])


@pytest.mark.parametrize("named", ["empty", "z*.png", "*.txt"])
def test_what_stands_for_no_picture_is_refused(folder: Path, named: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(BadRequest, match="no pictures"):
        listed([folder / named])


@given(st.lists(st.integers(0, 10**6), min_size=1, unique=True))
def test_numbers_in_names_sort_by_their_value(numbers: list[int]) -> None:
    files = sorted((Path(f"IMG_{number}.jpg") for number in numbers), key=natural)
    assert files == [Path(f"IMG_{number}.jpg") for number in sorted(numbers)]
