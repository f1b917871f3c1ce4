"""When too few pictures connect."""

from __future__ import annotations

from dataclasses import replace

import pytest
from edf_stitch.core.cameras.rig import Registration
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.rig.left_out import check_connected, left_out_warnings
from edf_stitch.core.rig.reframing import seen_from
from edf_stitch.core.system.errors import BadRequest, NoOverlap

from .known_rigs import known_rig

NAMES = ["a.png", "b.png", "c.png", "d.png", "e.png"]


def found(*numbers: int) -> Registration:
    rig = known_rig(len(numbers))[0] if numbers else known_rig(3)[0]
    left_out = {number: f"at most {number} matches" for number in range(5) if number not in numbers}
    return Registration(rig, numbers, left_out)


def test_a_picture_may_be_left_out_unless_all_are_required() -> None:
    check_connected(found(0, 1, 2, 4), NAMES, False)
    check_connected(found(0, 1, 2, 3, 4), NAMES, True)
    with pytest.raises(NoOverlap, match=r"1 of 5 pictures do not connect .*d\.png: at most 3 matches.*--require-all"):
        check_connected(found(0, 1, 2, 4), NAMES, True)


def test_fewer_than_two_make_no_panorama() -> None:
    with pytest.raises(NoOverlap, match="no two of these 5 pictures connect.*take pictures between them"):
        check_connected(found(), NAMES, False)


def test_it_is_told_when_the_focal_length_came_from_a_picture_that_is_left_out() -> None:
    for lender, told in ((3, 1), (2, 0)):  # d.png is left out, c.png is not
        exifs = [Exif(focal35_mm=28.0 if number == lender else None) for number in range(5)]
        cameras, _ = cameras_for(CameraRequest(), NAMES, [(400, 300)] * 5, exifs)
        first, *rest = left_out_warnings(found(0, 1, 2, 4), cameras, NAMES)
        assert first == "d.png is left out: at most 3 matches"
        assert len(rest) == told
        assert not rest or ("first taken from it" in rest[0] and "EXIF 35 mm" in rest[0])


@pytest.mark.parametrize(("viewpoint", "first"), [
    (None, 1), (2, 1), (3, 2), (5, 4), ("c", 2), ("e.png", 4),
])  # fmt: skip
def test_the_viewpoints_picture_comes_first(viewpoint: int | str | None, first: int) -> None:
    one = seen_from(found(1, 2, 4), viewpoint, NAMES, range(5))
    assert one.numbers == (first, *(number for number in (1, 2, 4) if number != first))
    assert not one.rig.t[0].any()


def test_the_centre_is_the_best_connected_one() -> None:
    here = found(1, 2, 4)
    strong = tuple(replace(edge, inliers=900 if 2 in (edge.i, edge.j) else 30) for edge in here.rig.edges)
    here = replace(here, rig=replace(here.rig, edges=strong))
    assert seen_from(here, "centre", NAMES, range(5)).numbers[0] == 4


def test_a_copy_stands_for_the_picture_that_is_used() -> None:
    assert seen_from(found(1, 2, 4), 6, NAMES, (0, 1, 2, 3, 4, 2)).numbers[0] == 2


def test_a_viewpoint_that_is_not_there_is_refused() -> None:
    with pytest.raises(NoOverlap, match=r"d\.png cannot be the viewpoint.*at most 3 matches"):
        seen_from(found(1, 2, 4), "d", NAMES, range(5))
    with pytest.raises(BadRequest, match="picture 6, and only 5"):
        seen_from(found(1, 2, 4), 6, NAMES, range(5))
    with pytest.raises(BadRequest, match="no picture is called 'z'"):
        seen_from(found(1, 2, 4), "z", NAMES, range(5))
