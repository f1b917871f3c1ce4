"""Matches of several pictures that a file gives: whose they are, and what is wrong with a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.pictures.naming import number_of
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pose import match_files
from edf_stitch.core.pose.match_files import read_matches
from edf_stitch.core.rig.given_matches import given_matches
from edf_stitch.core.rig.matching import Matched
from edf_stitch.core.system.errors import BadRequest

SIZES = [(40, 30), (40, 30), (60, 50)]
TABLE = """picture,picture2,x,y,x2,y2,weight
a.png,b.png,1,2,3,4,1
b,a,5,6,7,8,1
c.png,b.png,50,45,5,6,1
a.png,c.png,1,2,9,9,0
a.png,c.png,1,2,10,11,2
"""


@pytest.fixture
def pictures() -> list[Picture]:
    return [
        picture_from_array(np.full((height, width, 3), 9, np.uint8), name)
        for name, (width, height) in zip(("a.png", "b.png", "c.png"), SIZES, strict=True)
    ]


def read(tmp_path: Path, text: str, pictures: list[Picture], **given: list[tuple[int, int]]) -> Matched:
    (tmp_path / "m.csv").write_text(text)
    return given_matches(tmp_path / "m.csv", pictures, SIZES, given.get("worked", SIZES))


def rows_of(found: Matched) -> dict[tuple[int, int], list[list[float]]]:
    return {
        (one.i, one.j): np.hstack(
            [found.points[one.i][one.index[:, 0]], found.points[one.j][one.index[:, 1]]]
        ).tolist()
        for one in found.matches
    }


def test_rows_go_to_their_pictures_whichever_comes_first(tmp_path: Path, pictures: list[Picture]) -> None:
    found = read(tmp_path, TABLE, pictures)
    assert rows_of(found) == {
        (0, 1): [[1, 2, 3, 4], [7, 8, 5, 6]], (0, 2): [[1, 2, 10, 11]], (1, 2): [[5, 6, 50, 45]],
    }  # fmt: skip
    assert found.given
    assert [len(one) for one in found.points] == [2, 2, 2], "one place is one feature, in whatever pair it is"


def test_a_name_is_looked_for_once_however_many_rows_have_it(
    tmp_path: Path, pictures: list[Picture], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(match_files, "number_of", lambda name, *rest: asked.append(name) or number_of(name, *rest))
    read(tmp_path, TABLE + "c,b,5,6,7,8,1\n" * 500, pictures)
    assert sorted(asked) == ["a", "a.png", "b", "b.png", "c", "c.png"], "sixty pictures took minutes"


def test_they_follow_the_size_that_is_worked_at(tmp_path: Path, pictures: list[Picture]) -> None:
    half = read(tmp_path, TABLE, pictures, worked=[(20, 15), (20, 15), (30, 25)])
    assert rows_of(half)[1, 2] == [[2.25, 2.75, 24.75, 22.25]]


def test_what_is_masked_has_no_matches(tmp_path: Path, pictures: list[Picture]) -> None:
    alpha = np.full((30, 40, 1), 255, np.uint8)
    alpha[8, 7] = 0
    pictures[0] = picture_from_array(np.dstack([pictures[0].view, alpha]), "a.png")
    assert rows_of(read(tmp_path, TABLE, pictures))[0, 1] == [[1, 2, 3, 4]]


def test_a_pair_takes_its_own_rows(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(TABLE.replace("b,a", "b.png,a.png"))
    pair = read_matches(tmp_path / "m.csv", SIZES[1], SIZES[0], None, ("b.png", "a.png"))
    assert np.hstack([pair.x, pair.y]).tolist() == [[3, 4, 1, 2], [5, 6, 7, 8]]
    with pytest.raises(BadRequest, match="no matches between these two"):
        read_matches(tmp_path / "m.csv", SIZES[1], SIZES[0], None, ("b.png", "d.png"))


@pytest.mark.parametrize(("text", "words"), [
    ("x,y,x2,y2\n1,2,3,4\n", "of 3 pictures, a header must name the columns picture and picture2"),
    (TABLE + "d.png,a.png,1,2,3,4,1\n", r"line 7: no picture is called 'd\.png'; there are: a\.png"),
    (TABLE + "a.png,a,1,2,3,4,1\n", r"line 7: both points lie in a\.png"),
    (TABLE + "a.png,b.png,1,99,3,4,1\n", r"line 7: the point .* lies outside a\.png, which has 40×30"),
    (TABLE + "c.png,b.png,1,2,41,4,1\n", r"line 7: the point .* lies outside b\.png"),
])  # fmt: skip
def test_a_file_that_does_not_fit_is_refused(
    tmp_path: Path, pictures: list[Picture], text: str, words: str
) -> None:
    with pytest.raises(BadRequest, match=words):
        read(tmp_path, text, pictures)


def test_rows_without_names_are_refused(pictures: list[Picture]) -> None:
    with pytest.raises(BadRequest, match="given as a file"):
        given_matches(np.zeros((4, 4)), pictures, SIZES, SIZES)
