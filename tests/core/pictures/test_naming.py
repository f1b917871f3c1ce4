"""Which picture a name means."""

from __future__ import annotations

import pytest
from edf_stitch.core.pictures.naming import number_of, told_apart
from edf_stitch.core.system.errors import BadRequest

NAMES = ["a.png", "b.png", "b.jpg", "b", "c.png", "c.jpg"]


@pytest.mark.parametrize(("name", "number"), [("a.png", 0), ("a", 0), ("b.jpg", 2), ("b", 3), ("A.PNG", 0), ("A", 0)])
def test_a_name_means_the_picture_that_bears_it_whole_or_without_its_suffix(name: str, number: int) -> None:
    assert number_of(name, NAMES, "--viewpoint") == number


def test_a_name_that_is_not_clear_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"--viewpoint: 2 pictures are called 'c' \(c\.png, c\.jpg\)"):
        number_of("c", NAMES, "--viewpoint")
    with pytest.raises(BadRequest, match="--ignore: no picture is called 'd'; there are: a.png, b.png"):
        number_of("d", NAMES, "--ignore")
    with pytest.raises(BadRequest, match="no picture is called ''"):
        number_of("", NAMES, "--ignore")


PATHS = ["/x/A/1.png", "/x/A/2.png", "/x/B/1.png", "/y/B/1.png", "/x/3.png"]


@pytest.mark.parametrize(("name", "number"), [
    ("2", 1), ("A/1.png", 0), ("A/1", 0), ("x/B/1.png", 2), ("/y/B/1.png", 3), ("3.PNG", 4), ("a/2", 1),
])  # fmt: skip
def test_the_end_of_a_path_means_the_picture_there(name: str, number: int) -> None:
    assert number_of(name, PATHS, "--viewpoint") == number


def test_paths_that_end_alike_are_told_apart() -> None:
    assert told_apart(PATHS) == ["A/1.png", "2.png", "x/B/1.png", "y/B/1.png", "3.png"]
    assert told_apart(["a.png", "a.png"]) == ["a.png", "a.png"]
    with pytest.raises(BadRequest, match=r"2 pictures are called 'B/1' \(x/B/1\.png, y/B/1\.png\); say which"):
        number_of("B/1", PATHS, "--viewpoint")
    with pytest.raises(BadRequest, match=r"there are: A/1\.png, 2\.png, x/B"):
        number_of("C/1.png", PATHS, "--viewpoint")
