"""Which picture a name means."""

from __future__ import annotations

import pytest
from edf_stitch.core.pictures.naming import number_of
from edf_stitch.core.system.errors import BadRequest

NAMES = ["a.png", "b.png", "b.jpg", "b", "c.png", "c.jpg"]


@pytest.mark.parametrize(("name", "number"), [("a.png", 0), ("a", 0), ("b.jpg", 2), ("b", 3)])
def test_a_name_means_the_picture_that_bears_it_whole_or_without_its_suffix(name: str, number: int) -> None:
    assert number_of(name, NAMES, "--viewpoint") == number


def test_a_name_that_is_not_clear_is_refused() -> None:
    with pytest.raises(BadRequest, match="--viewpoint: 2 pictures are called 'c'"):
        number_of("c", NAMES, "--viewpoint")
    with pytest.raises(BadRequest, match="--ignore: no picture is called 'd'; there are: a.png, b.png"):
        number_of("d", NAMES, "--ignore")
