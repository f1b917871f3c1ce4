"""What is kept of the panorama: never a pixel more than was asked for, and the most that can be."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.crop import crop_box, parse_crop
from edf_stitch.core.system.errors import BadRequest

SHOWS = np.zeros((30, 50), bool)
SHOWS[5:25, 10:40] = True
REFERENCE = (12, 6, 20, 15)


def box(kind: str | tuple) -> tuple[int, int, int, int]:
    return crop_box(kind, (0, 0, 50, 30), SHOWS, REFERENCE)


def test_the_four_kinds() -> None:
    assert box("full") == (0, 0, 50, 30)
    assert box("inscribed") == (10, 5, 30, 20)
    assert box("reference") == REFERENCE
    assert box((3, 4, 47, 26)) == (3, 4, 47, 26)
    assert box((49, 29, 1, 1)) == (49, 29, 1, 1) and box((0, 0, 50, 30)) == (0, 0, 50, 30)


@pytest.mark.parametrize("wrong", [
    (-1, 0, 5, 5), (0, -1, 5, 5), (46, 0, 5, 5), (0, 26, 5, 5), (0, 0, 51, 1), (0, 0, 1, 31), (0, 0, 0, 5),
    (0, 0, 5, -1), (50, 30, 1, 1),
])  # fmt: skip
def test_a_box_outside_is_refused_with_the_panoramas_size(wrong: tuple[int, int, int, int]) -> None:
    with pytest.raises(BadRequest, match="50×30 pixels") as caught:
        box(wrong)
    assert ",".join(map(str, wrong)) in str(caught.value) and caught.value.exit_code == 2


@pytest.mark.parametrize("wrong", ["", "everything", "Full", (1, 2, 3)])
def test_other_kinds_are_refused_by_name(wrong: str | tuple) -> None:
    with pytest.raises(BadRequest, match="full, inscribed, reference"):
        box(wrong)


@pytest.mark.parametrize(("pictures", "rows", "kept"), [
    (2, 8, (5, 10, 40, 20)), (2, 9, (5, 10, 40, 29)), (3, 13, (5, 10, 40, 20)), (3, 14, (5, 10, 40, 34)),
])  # fmt: skip
def test_by_itself_it_keeps_what_is_full_where_that_is_most_of_what_is_shown(
    pictures: int, rows: int, kept: tuple[int, int, int, int]
) -> None:
    """Beside 800 pixels of a rectangle rows of 39: of two pictures 70 % are kept with 8 of them, and less with 9; of
    more 60 % with 13, and less with 14."""
    shows = np.zeros((60, 60), bool)
    shows[10:30, 5:45] = True
    for row in range(rows):
        shows[30 + row, 5:45] = np.arange(40) != 3 * row + 1
    assert crop_box("auto", (0, 0, 60, 60), shows, REFERENCE, pictures) == kept
    assert crop_box("inscribed", (0, 0, 60, 60), shows, REFERENCE) == (5, 10, 40, 20)


def test_a_reference_that_is_not_shown_is_no_crop() -> None:
    with pytest.raises(BadRequest, match="outside the frame"):
        crop_box("reference", (0, 0, 50, 30), SHOWS, None)


def test_nothing_shown_leaves_nothing_to_keep() -> None:
    for kind in ("auto", "inscribed"):
        with pytest.raises(BadRequest, match="shows nothing"):
            crop_box(kind, (0, 0, 50, 30), np.zeros((30, 50), bool), REFERENCE)


@pytest.mark.parametrize(("text", "kind"), [
    *((name, name) for name in ("auto", "full", "inscribed", "reference")), ("1,2,3,4", (1, 2, 3, 4)),
    (" 10, 20 ,30, 40 ", (10, 20, 30, 40)), ("-5,0,9,9", (-5, 0, 9, 9)),
])  # fmt: skip
def test_what_the_command_line_says(text: str, kind: str | tuple) -> None:
    assert parse_crop(text) == kind


@pytest.mark.parametrize(
    "text", ["", "ful", "1,2,3", "1,2,3,4,5", "1,2,3,x", "1.5,2,3,4", "1,2,,4", "0,0,0,5", "0,0,5,-5"]
)
def test_nonsense_on_the_command_line_is_refused(text: str) -> None:
    with pytest.raises(BadRequest) as caught:
        parse_crop(text)
    assert text in str(caught.value) and ("inscribed" in str(caught.value) or "1 or more" in str(caught.value))
