"""Matches from the user: every way to write them gives the same, and what is wrong is told with its line."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.pose.match_files import matches_csv, read_matches, resized_points
from edf_stitch.core.system.errors import BadRequest, UnreadableImage
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE, SIZE_PRIME = (640, 480), (320, 200)
ROWS = [[1.5, 2.0, 3.25, 4.0], [10.0, 20.0, 30.0, 40.0], [639.5, -0.5, 319.5, 199.5]]
PLAIN = "1.5,2,3.25,4\n10,20,30,40\n639.5,-0.5,319.5,199.5\n"


def read(tmp_path: Path, text: str | bytes) -> Matches:
    path = tmp_path / "matches.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_matches(path, SIZE, SIZE_PRIME)


def rows_of(matches: Matches) -> list[list[float]]:
    return np.hstack([matches.x, matches.y]).tolist()


@pytest.mark.parametrize("text", [
    PLAIN, "x,y,x2,y2\n" + PLAIN, PLAIN.replace(",", ";"), PLAIN.replace(",", " "), PLAIN.replace(",", "\t"),
    PLAIN.replace(",", " ,  "), PLAIN.replace("\n", "\r\n"), PLAIN.replace("\n", "\r"), PLAIN.rstrip(),
    "# by hand\n\n  # twice\n" + PLAIN + "\n\n", b"\xef\xbb\xbf" + PLAIN.encode(),
    b"\xef\xbb\xbfx,y,x2,y2\n" + PLAIN.encode(),
    '"X", "Y", "X2", "Y2"\n' + PLAIN, "y2;x2;name;y;x\n" + "\n".join(
        f"{y2};{x2};pillar, left;{y};{x}" for x, y, x2, y2 in ROWS),
    "1.5e0,+2,.325E1,4\n" + PLAIN.split("\n", 1)[1], "# größer\n" + PLAIN,
])  # fmt: skip
def test_every_way_to_write_them_gives_the_same(tmp_path: Path, text: str | bytes) -> None:
    matches = read(tmp_path, text)
    assert rows_of(matches) == ROWS
    assert matches.weight is not None and matches.weight.tolist() == [1, 1, 1] and matches.given
    assert all(array.dtype == np.float64 for array in (matches.x, matches.y, matches.weight))


@pytest.mark.parametrize("header", ["", "x,y,x2,y2,weight\n", "x,y,x2,y2,Weight\n"])
def test_a_weight_counts_and_zero_leaves_a_match_out(tmp_path: Path, header: str) -> None:
    matches = read(tmp_path, header + "1,2,3,4,0.25\n5,6,7,8,0\n9,10,11,12,1e3\n")
    assert rows_of(matches) == [[1, 2, 3, 4], [9, 10, 11, 12]]
    assert matches.weight is not None and matches.weight.tolist() == [0.25, 1000]


def test_a_header_may_put_the_weight_anywhere(tmp_path: Path) -> None:
    matches = read(tmp_path, "weight x y x2 y2 id\n2 1 2 3 4 99\n")
    assert rows_of(matches) == [[1, 2, 3, 4]] and matches.weights.tolist() == [2]
    assert rows_of(read(tmp_path, "2024,X,Y,X2,Y2\n9,1,2,3,4\n")) == [[1, 2, 3, 4]]


def test_the_same_match_twice_counts_once_in_the_files_order(tmp_path: Path) -> None:
    matches = read(tmp_path, "9,2,3,4,5\n1,2,3,4,0\n1,2,3,4,6\n9,2,3,4,7\n1,2,3,5,8\n")
    assert rows_of(matches) == [[9, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 5]]
    assert matches.weights.tolist() == [5, 6, 8]


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int16, np.uint8])
def test_arrays_are_read_like_files(dtype: type) -> None:
    array = np.array([[1, 2, 3, 4], [5, 6, 7, 8]], dtype)
    matches = read_matches(array, SIZE, SIZE_PRIME)
    assert rows_of(matches) == array.tolist() and matches.weights.tolist() == [1, 1] and matches.given
    weighted = read_matches(np.column_stack([array, [0, 3]]), SIZE, SIZE_PRIME)
    assert rows_of(weighted) == [[5, 6, 7, 8]] and weighted.weights.tolist() == [3]
    array[:] = 0
    assert matches.x[0].tolist() == [1, 2], "they do not hang on the caller's array"


# --- refusals -------------------------------------------------------------------------------------------------------

BEYOND = "lies outside the target, which has 320×200 pixels"


@pytest.mark.parametrize(("text", "words"), [
    ("1,2,3,4\n1,2,three,4\n", ("line 2", "x2 is 'three'", "a number is needed")),
    ("x,y,x2,y2\n\n# here\n1,2,3,\n", ("line 4", "y2 is empty")),
    ("1;2;3;4,5\n", ("line 1", "y2 is '4,5'", "a point for decimals")),
    ("1,2,3,4\n1,nan,3,4\n", ("line 2", "y is nan", "leave the line out")),
    ("1,2,3,4\n1,2,-inf,4\n5,6,inf,8\n", ("line 2", "x2 is -inf", "(and 1 more line)")),
    ("1,2,3,4,inf\n", ("line 1", "weight is inf")),
    ("1,2,3,4,1\n1,2,3,4,-0.5\n", ("line 2", "the weight is -0.5", "0 leaves a match out")),
    ("1,2,3\n", ("line 1", "3 columns ('1', '2', '3')", "x,y,x2,y2")),
    ("1,2,3,4,5,6\n", ("line 1", "6 columns")),
    ("1,2,3,4\n1,2,3,4,5\n", ("line 2", "5 columns", "the lines before have 4")),
    ("x,y,x2,y2,weight\n1,2,3,4\n", ("line 2", "4 columns", "have 5")),
    ("42\n", ("line 1", "1 column ('42')")),
    ("x,y,x2\n1,2,3\n", ("line 1", "lacks y2", "be left out")),
    ("this is a letter\nand no matches\n", ("line 1", "'letter'", "lacks x, y, x2, y2")),
    ("x,y,x2,y2,X\n1,2,3,4,5\n", ("line 1", "the column x 2 times")),
    ("", ("no matches in it", "x,y,x2,y2")), ("x,y,x2,y2\n# nothing\n", ("no matches in it",)),
    ("1,2,3,4,0\n5,6,7,8,0\n", ("every match has weight 0", "above 0")),
    ("1,2,3,4\n-0.51,2,3,4\n", ("line 2", "(-0.51, 2)", "outside the reference, which has 640×480 pixels")),
    ("639.51,2,3,4\n", ("line 1", "(639.51, 2)", "outside the reference")),
    ("1,479.51,3,4\n", ("line 1", "outside the reference")), ("1,-0.51,3,4\n", ("line 1", "outside the reference")),
    ("1,2,319.51,4\n", ("line 1", "(319.51, 4)", BEYOND)), ("1,2,-0.51,4\n", ("line 1", BEYOND)),
    ("1,2,3,199.51\n1,2,3,4\n1,2,3,300\n1,2,3,301\n", ("line 1", BEYOND, "(and 2 more lines)", "at full size")),
    ("1,2,3,-0.51\n", ("line 1", BEYOND)), ("1,2,3,900,0\n", ("line 1", BEYOND)),
    (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), ("not a text in UTF-8", "CSV")),
    ("1,2,3,4\n".encode("utf-16"), ("not a text in UTF-8",)),
    ("1,2,3,4\n".encode("utf-16-le"), ("not a text in UTF-8",)),
    ("# größer\n1,2,3,4\n".encode("latin-1"), ("not a text in UTF-8",)),
])  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, text: str | bytes, words: tuple[str, ...]) -> None:
    with pytest.raises(BadRequest) as caught:
        read(tmp_path, text)
    assert caught.value.exit_code == 2
    for word in ("matches.csv", *words):
        assert word in str(caught.value), caught.value
    assert len(str(caught.value)) < 400 + len(str(tmp_path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize("length", [1000, 200_000])
def test_a_long_line_of_nonsense_is_quoted_in_part(tmp_path: Path, length: int) -> None:
    with pytest.raises(BadRequest) as caught:
        read(tmp_path, "1,2,3," + "z" * length)
    assert "line 1" in str(caught.value) and len(str(caught.value)) < 300 + len(str(tmp_path))


@pytest.mark.parametrize(("array", "words"), [
    (np.zeros((0, 4)), "(0, 4)"), (np.zeros((3, 3)), "(3, 3)"), (np.zeros((3, 6)), "(3, 6)"), (np.zeros(4), "(4,)"),
    (np.zeros((2, 4), complex), "complex"), (np.array([["1", "2", "3", "4"]]), "<U1"),
    (np.zeros((2, 4), object), "object"), (np.array([[1, 2, 3, 4], [1, 2, 3, math.nan]]), "row 1 (the first is 0): y2"),
    (np.array([[1, 2, 3, 4, -1]]), "row 0 (the first is 0): the weight is -1"),
    (np.array([[1, 2, 3, 4], [1, 2, 400, 4]]), "row 1 (the first is 0): the point (400, 4)"),
    (np.array([[1, 2, 3, 4, 0]]), "the array of matches: every match has weight 0"),
])  # fmt: skip
def test_arrays_of_another_kind_are_refused(array: np.ndarray, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        read_matches(array, SIZE, SIZE_PRIME)
    assert words in str(caught.value) and "array of matches" in str(caught.value)


def test_a_file_that_cannot_be_read_is_not_a_wrong_call(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.csv", tmp_path):
        with pytest.raises(UnreadableImage, match="the file of matches cannot be read") as caught:
            read_matches(str(path), SIZE, SIZE_PRIME)
        assert caught.value.exit_code == 4 and str(path) in str(caught.value)


# --- there and back -------------------------------------------------------------------------------------------------


def test_the_file_says_what_its_columns_are(tmp_path: Path) -> None:
    matches = Matches(np.array([[0.1, 2.0]]), np.array([[3.0, 1 / 3]]))
    assert matches_csv(matches) == b"x,y,x2,y2,weight\n0.1,2.0,3.0,0.3333333333333333,1.0\n"


def inside(size: tuple[int, int]) -> st.SearchStrategy[tuple[float, float]]:
    return st.tuples(*(st.floats(-0.5, side - 0.5) for side in size))


@settings(
    max_examples=100
)  # fmt: skip
@given(st.lists(
    st.tuples(inside(SIZE), inside(SIZE_PRIME), st.floats(0, exclude_min=True, allow_infinity=False)), min_size=1,
    max_size=20, unique_by=lambda row: row[:2]))  # fmt: skip
def test_what_is_written_is_read_to_the_same_floats(tmp_path: Path, rows: list[tuple]) -> None:
    x, y, weight = (np.array(column) for column in zip(*rows, strict=True))
    written = matches_csv(Matches(x, y, weight=weight))
    back = read(tmp_path, written)
    assert back.weight is not None
    for ours, theirs in ((x, back.x), (y, back.y), (weight, back.weight)):
        assert np.array_equal(ours, theirs)
    assert matches_csv(back) == written


def test_a_name_that_a_spreadsheet_would_calculate_is_none_and_comes_back(tmp_path: Path) -> None:
    names = '=HYPERLINK("x";1).png', "+1,#.png"
    matches = Matches(np.array([[0.1, 2.0]]), np.array([[3.0, 1.5]]))
    written = matches_csv(matches, pictures=[names]).decode()
    assert written.splitlines()[1] == '"./=HYPERLINK(""x"";1).png","./+1,#.png",0.1,2.0,3.0,1.5,1.0'
    (tmp_path / "m.csv").write_text(written)
    back = read_matches(tmp_path / "m.csv", SIZE, SIZE_PRIME, names=names)
    assert np.array_equal(back.x, matches.x) and np.array_equal(back.y, matches.y)


# --- matches that were found ----------------------------------------------------------------------------------------

HEADER = "x,y,x2,y2,weight,state,noise_px\n"


def test_found_matches_come_back_as_found(tmp_path: Path) -> None:
    """All of them, doubles too, and none of them given; what was left out has a weight of 0 for other programs."""
    x, y = np.array([[0.1, 2.0], [0.1, 2.0], [7.0, 8.0]]), np.array([[3.0, 1 / 3], [3.0, 1 / 3], [9.0, 10.0]])
    written = matches_csv(Matches(x, y, 1.25), ["used", "left out by the field", "left out by the geometry"])
    assert written.decode().splitlines()[:3] == [
        HEADER.strip(), "0.1,2.0,3.0,0.3333333333333333,1.0,used,1.25",
        "0.1,2.0,3.0,0.3333333333333333,0.0,left out by the field,1.25",
    ]  # fmt: skip
    back = read(tmp_path, written)
    assert np.array_equal(back.x, x) and np.array_equal(back.y, y)
    assert (back.scale, back.weight, back.given) == (1.25, None, False)


def test_what_was_used_can_be_switched_off_or_made_to_count_more(tmp_path: Path) -> None:
    rows = "1,2,3,4,0,used,1\n5,6,7,8,2.5,used,1\n9,10,11,12,0,left out by the field,1\n"
    matches = read(tmp_path, HEADER + rows)
    assert matches.x.tolist() == [[5, 6], [9, 10]] and matches.weights.tolist() == [2.5, 1] and not matches.given


@pytest.mark.parametrize(("row", "said"), [
    ("1,2,3,4,1,good,1", "line 2: the state is 'good'; .*used, left out by the geometry or left out by the field"),
    ("1,2,3,4,1,used,0", "line 2: noise_px is 0"), ("1,2,3,4,1,used,nan", "line 2: noise_px is nan"),
    ("1,2,3,4,0,used,1", "every match has weight 0"),
])  # fmt: skip
def test_a_wrong_state_is_told(tmp_path: Path, row: str, said: str) -> None:
    with pytest.raises(BadRequest, match=said):
        read(tmp_path, HEADER + row)


@given(st.lists(st.tuples(*[st.floats(0, 190)] * 4), min_size=1, max_size=20), st.sampled_from([0.6, 0.37, 0.99]))
@settings(max_examples=50, deadline=None)
def test_at_another_scale_the_same_floats_come_back(rows: list[tuple[float, ...]], scale: float) -> None:
    """Read in px of the pictures that were worked on, wherever rounding there and back would have led."""
    sizes = [(round(scale * width), round(scale * height)) for width, height in (SIZE, SIZE_PRIME)]
    small = scale * np.array(rows)
    x, y = (resized_points(one, now, full)
            for one, now, full in zip((small[:, :2], small[:, 2:]), sizes, (SIZE, SIZE_PRIME), strict=True))
    worked = Matches(np.ascontiguousarray(small[:, :2]), np.ascontiguousarray(small[:, 2:]))
    written = matches_csv(Matches(x, y), ["used"] * len(small), worked)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "matches.csv")
        path.write_bytes(written)
        back = read_matches(path, SIZE, SIZE_PRIME, (sizes[0], sizes[1]))
        full = read_matches(path, SIZE, SIZE_PRIME)
    assert np.array_equal(np.hstack([back.x, back.y]), small)
    assert np.array_equal(full.x, x) and np.array_equal(full.y, y)


def test_a_match_that_was_moved_since_lies_where_it_was_moved_to(tmp_path: Path) -> None:
    """And so do all where the pictures are worked on at another size than then."""
    header = HEADER.strip() + ",worked_x,worked_y,worked_x2,worked_y2\n"
    path = tmp_path / "matches.csv"
    path.write_text(header + "1.5,2.5,3.5,4.5,1,used,1,0.5,1,1.5,2\n7.5,2.5,3.5,4.5,1,used,1,0.5,1,1.5,2\n", "utf-8")
    half = read_matches(path, SIZE, SIZE_PRIME, ((320, 240), (160, 100)))
    assert half.x.tolist() == [[0.5, 1], [3.5, 1]]
    assert read_matches(path, SIZE, SIZE_PRIME, (SIZE, SIZE_PRIME)).x.tolist() == [[1.5, 2.5], [7.5, 2.5]]
