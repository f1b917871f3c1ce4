"""The list of a batch: what a line means, frames of patterns, and what is refused with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest
from edf_stitch.core.batch.list import BatchItem, find_frames, read_list, same_name
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.system.errors import BadRequest, UnreadableImage


@pytest.fixture
def listed(tmp_path: Path):
    """Items of a list with this text."""

    def read(text: str | bytes) -> list[BatchItem]:
        path = tmp_path / "list.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_list(path)

    return read


def touch(folder: Path, pattern: str, numbers: range | list[int]) -> None:
    for number in numbers:
        (folder / (pattern % number)).touch()


def simple(items: list[BatchItem], folder: Path) -> list[tuple[str, str, str]]:
    return [(i.name, *(p.relative_to(folder).as_posix() for p in (i.reference, i.target))) for i in items]


@pytest.mark.parametrize("text", [
    "reference,target,name\na/l.jpg,a/r.jpg,one\na/m.jpg,r.jpg,two\n",
    "a/l.jpg,a/r.jpg,one\na/m.jpg,r.jpg,two",  # without a header
    "\ufeffTarget, Name ,REFERENCE\r\na/r.jpg,one,a/l.jpg\r\n\r\n # a comment, with a comma\r\nr.jpg,two,a/m.jpg\r\n",
    "reference;target;name\na/l.jpg;a/r.jpg;one\na/m.jpg;r.jpg;two\n",
    "reference\ttarget\tname\n\"a/l.jpg\"\ta/r.jpg\tone\na/m.jpg\tr.jpg\ttwo\n",
    "reference,target,name,first,last,step,focal35\na/l.jpg,a/r.jpg,one,,,,\na/m.jpg,r.jpg,two\n",
])  # fmt: skip
def test_lists_as_people_and_spreadsheets_write_them(listed, tmp_path: Path, text: str) -> None:
    items = listed(text)
    assert simple(items, tmp_path) == [("one", "a/l.jpg", "a/r.jpg"), ("two", "a/m.jpg", "r.jpg")]
    assert all(item.frames is None and item.camera is None and item.missing == () for item in items)
    assert items[0].files() == (tmp_path / "a/l.jpg", tmp_path / "a/r.jpg")


def test_names_come_from_the_reference_and_paths_may_hold_anything(listed, tmp_path: Path) -> None:
    items = listed('"a,b;c.jpg",r.jpg\n/elsewhere/Größe 写真.tif,r.jpg\n"100%done.jpg",100%done.jpg,x')
    assert items[0].reference == tmp_path / "a,b;c.jpg" and items[0].name == "a,b;c"
    assert items[1].reference == Path("/elsewhere/Größe 写真.tif") and items[1].name == "Größe 写真"


def test_a_file_whose_name_only_looks_like_a_pattern(listed, tmp_path: Path) -> None:
    (tmp_path / "100%done.jpg").touch()
    item = listed("100%done.jpg,r.jpg")[0]
    assert item.frames is None and item.name == "100%done"


def test_a_camera_of_its_own(listed) -> None:
    items = listed('reference,target,name,focal_px,focal35\na,b,1,1200,\na,b,2,"1200.5, 1180",\na,b,3,,28\na,b,4\n')
    assert [item.camera for item in items] == [
        CameraRequest(focal_px=(1200.0,)), CameraRequest(focal_px=(1200.5, 1180.0)), CameraRequest(focal35=(28.0,)),
        None,
    ]  # fmt: skip


# --- frames ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("reference", "target"), [
    ("a_%04d.png", "b_%04d.png"), ("a_####.png", "b_####.png"), ("a_####.png", "b_%04d.png"),
])  # fmt: skip
def test_all_frames_that_both_sides_have(listed, tmp_path: Path, reference: str, target: str) -> None:
    touch(tmp_path, "a_%04d.png", [3, 4, 5, 10, 12345])
    touch(tmp_path, "b_%04d.png", [2, 3, 4, 10, 12345])
    for other in ("a_3.png", "a_00006.png", "b_00006.png", "a_x007.png", "b_x007.png", "a_0008.jpg", "b_0008.jpg",
                  "a_.png", "a_٠٠٠٩.png", "b_٠٠٠٩.png"):  # fmt: skip
        (tmp_path / other).touch()
    item = listed(f"{reference},{target}")[0]
    assert (item.name, item.frames, item.missing) == ("a", (3, 4, 10, 12345), (2, 5))
    assert item.files(4) == (tmp_path / "a_0004.png", tmp_path / "b_0004.png")
    assert item.files(12345)[0] == tmp_path / "a_12345.png"
    assert item.numbered(4) == "a_0004" and item.numbered(12345) == "a_12345"


@pytest.mark.parametrize(("span", "frames", "missing"), [
    ("4,10,", (4, 7), (5, 6, 8, 9, 10)), ("4,10,3", (4, 7), (10,)), ("4,,", (4, 7, 12, 13), (14,)),
    (",7,", (3, 4, 7), ()),
    ("3,,4", (3, 7), ()), (",,", (3, 4, 7, 12, 13), (14,)), (",,5", (3, 13), ()), (",1,", (), ()), ("4,4,", (4,), ()),
    ("20,21,", (), (20, 21)),
])  # fmt: skip
def test_a_range_of_frames(listed, tmp_path: Path, span: str, frames: tuple, missing: tuple) -> None:
    touch(tmp_path, "a%d.png", [3, 4, 7, 12, 13, 14])
    touch(tmp_path, "b%d.png", [3, 4, 7, 12, 13])
    item = listed(f"reference,target,first,last,step\na%d.png,b%d.png,{span}")[0]
    assert (item.frames, item.missing) == (frames, missing)


@pytest.mark.parametrize(("pattern", "name"), [
    ("left_####.png", "left"), ("%04d.png", "shots"), ("take.%04d.exr", "take"),
    ("%04d_left.png", "left"), ("__%d.x", "shots"),
])  # fmt: skip
def test_the_name_of_a_clip(listed, tmp_path: Path, pattern: str, name: str) -> None:
    assert listed(f"shots/{pattern},b_%04d.png")[0].name == name


def test_frames_that_are_not_there_are_not_asked_for_up_front(listed) -> None:
    assert listed("nowhere/a_%04d.png,b_%04d.png")[0].frames == ()


def test_the_frames_an_alignment_is_taken_from() -> None:
    def of(frames: range) -> tuple[int, ...]:
        return BatchItem("x", Path("a_%d"), Path("b_%d"), tuple(frames)).aligned_on

    assert of(range(1, 101)) == (1, 26, 51, 75, 100), "both ends and evenly between"
    assert of(range(7, 12)) == (7, 8, 9, 10, 11) and of(range(3)) == (0, 1, 2) and of(range(5, 6)) == (5,)
    assert of(range(0)) == () and BatchItem("x", Path("a"), Path("b")).aligned_on == ()


def test_frames_for_those_who_have_no_list(tmp_path: Path) -> None:
    touch(tmp_path, "a%d.png", range(9))
    assert find_frames([tmp_path / "a%d.png"] * 2, 2, 8, 3) == ((2, 5, 8), ())
    for span in ((5, 4, 1), (0, 4, 0), (-1, 4, 1), (0, 10**9, 1)):
        with pytest.raises(BadRequest, match="frames"):
            find_frames([tmp_path / "a%d.png"] * 2, *span)
    with pytest.raises(BadRequest, match="one place for the frame's number"):
        find_frames([tmp_path / "a.png", tmp_path / "b%d.png"])


# --- refusals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "line", "words"), [
    ("reference,name\na,b\n", 1, "the header lacks target"),
    ("reference,target,frist\na,b,1\n", 1, "'frist' that is not known"),
    ("reference,target,name,name\na,b,c,d\n", 1, "name twice"),
    ("a.png\n", 1, "the target is missing"), ("a.png,b.png\n\n# x\n,b.png\n", 4, "the reference is missing"),
    ("a,b,c,d\n", 1, "4 cells where there are 3"), ("reference,target\r\na,b\r\na,b,c\r\n", 3, "3 cells"),
    ('a,"b\n', 1, "unexpected end of data"),
    ("a.png,b.png,x\nc.png,d.png,X\n", 2, "like those of line 1"),
    ("d/a.png,b.png\ne/a.jpg,b.png\n", 2, "column called name"),
    (f"a,b,{116 * 'é'}\n", 1, "is too long for a name of outputs: 230 bytes"),
    ("a,b,x/y\n", 1, "no name for outputs"), ("a,b,..\n", 1, "no name"), ("a,b,.edf\n", 1, "no name"),
    ("a,b,c:d\n", 1, "no name"),
    ("a_%04d.png,b.png\n", 1, "one side is a pattern"), ("a_%d_%d.png,b_%d.png\n", 1, "one place"),
    ("shot_%04d/a.png,shot_%04d/b.png\n", 1, "not in a folder's"),
    ("reference,target,first\na,b,3\n", 2, "first given, but the files are no patterns"),
    ("reference,target,first\na%d,b%d,x\n", 2, "first is 'x'"),
    ("reference,target,last\na%d,b%d,-3\n", 2, "last is '-3'"),
    ("reference,target,step\na%d,b%d,0\n", 2, "by 0"),
    ("reference,target,first,last\na%d,b%d,9,3\n", 2, "frames 9 to 3"),
    ("reference,target,first,last\na%d,b%d,0,99999999\n", 2, "more than 1000000"),
    ("reference,target,focal_px\na,b,wide\n", 2, "focal_px is 'wide'"),
    ("reference,target,focal_px\na,b,-3\n", 2, "above 0"),
    ("reference,target,focal_px,focal35\na,b,900,28\n", 2, "one way only"),
])  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(listed, tmp_path: Path, text: str, line: int, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        listed(text)
    assert str(caught.value).startswith(f"{tmp_path / 'list.csv'}, line {line}: ") and words in str(caught.value)


@pytest.mark.parametrize("text", ["", "\n\n", "# a,b\n", "reference,target\n", "\ufeffreference,target\n# a,b"])
def test_an_empty_list_is_refused(listed, text: str) -> None:
    with pytest.raises(BadRequest, match="nothing to stitch"):
        listed(text)


def test_what_is_no_text_and_what_cannot_be_read(listed, tmp_path: Path) -> None:
    for data in ("a,b\n".encode("utf-16"), b"\xff\xd8\xff\xe0", b"a\0,b\n"):
        with pytest.raises(BadRequest, match="not a text in UTF-8"):
            listed(data)
    for path in (tmp_path / "missing.csv", tmp_path):
        with pytest.raises(UnreadableImage, match="the list cannot be read"):
            read_list(path)


def test_names_that_are_one_file_on_some_computers() -> None:
    assert same_name("Größe") == same_name("GRO\u0308SSE")


# --- more than two pictures -------------------------------------------------------------------------------------------


def test_further_columns_are_further_pictures(listed) -> None:
    items = listed("reference,target,picture3,name,picture4\na.jpg,b.jpg,c.jpg,walk,d.jpg\ne.jpg,f.jpg\n")
    assert [path.name for path in items[0].files()] == ["a.jpg", "b.jpg", "c.jpg", "d.jpg"]
    assert items[0].name == "walk" and [path.name for path in items[1].files()] == ["e.jpg", "f.jpg"]


def test_a_folder_or_a_pattern_stands_for_its_pictures(listed, tmp_path: Path) -> None:
    (tmp_path / "yard").mkdir()
    for name in ("p10.png", "p2.png", "p1.jpg", "notes.txt"):
        (tmp_path / "yard" / name).touch()
    folder, pattern, named = listed("yard\nyard/p*.png\nyard,,court\n")
    assert folder.name == "yard" and [path.name for path in folder.files()] == ["p1.jpg", "p2.png", "p10.png"]
    assert pattern.name == "p2" and [path.name for path in pattern.files()] == ["p2.png", "p10.png"]
    assert named.name == "court" and named.frames is None


def test_a_folder_that_does_not_exist_stops_none_of_the_others(listed, tmp_path: Path) -> None:
    touch(tmp_path, "p%d.png", [1, 2])
    gone, here = listed("reference,target,name\nyard/gone,,\np1.png,p2.png,\n")
    assert gone.name == "gone" and here.trouble is None
    assert isinstance(gone.trouble, UnreadableImage)
    assert "list.csv, line 2: " in str(gone.trouble) and f"{tmp_path / 'yard/gone'}: no such file or folder" in str(
        gone.trouble
    )
    with pytest.raises(BadRequest, match="line 1: the target is missing"):
        listed("p1.png\n")
    with pytest.raises(BadRequest, match="line 1: the target is missing"):
        listed("p7.png\n")


def test_a_folder_or_pattern_without_pictures_is_an_item_in_trouble(listed, tmp_path: Path) -> None:
    for name in ("empty", "yard", "one"):
        (tmp_path / name).mkdir()
    for name in ("yard/a.png", "yard/b.png", "one/a.png"):
        (tmp_path / name).touch()
    empty, pattern, everything, one, yard = listed("empty\nnowhere/*.png\nempty/*,,court\none\nyard\n")
    assert [item.name for item in (empty, pattern, everything, one)] == ["empty", "nowhere__.png", "court", "one"]
    assert yard.trouble is None and all(item.trouble for item in (empty, pattern, everything, one))
    assert "no pictures in this folder" in str(empty.trouble) and "only one picture" in str(one.trouble)


def test_a_path_that_no_file_can_have_is_told_with_its_line(listed) -> None:
    with pytest.raises(BadRequest, match="line 2: no name that files can have"):
        listed("a.png,b.png\n" + "x" * 5000 + "\n")


def test_a_clip_of_more_than_two_cameras_has_the_frames_of_all(listed, tmp_path: Path) -> None:
    for side, numbers in (("a", range(1, 9)), ("b", range(2, 9)), ("c", (1, 2, 3, 5, 6, 7, 8))):
        touch(tmp_path, f"{side}_%04d.png", numbers)
    header = "reference,target,picture3,first\n"
    (clip,) = listed(header + "a_%04d.png,b_%04d.png,c_####.png,\n")
    assert clip.frames == (2, 3, 5, 6, 7, 8) and clip.missing == (1, 4)
    assert [path.name for path in clip.files(7)] == ["a_0007.png", "b_0007.png", "c_0007.png"]
    (later,) = listed(header + "a_%04d.png,b_%04d.png,c_####.png,5\n")
    assert later.frames == (5, 6, 7, 8) and later.missing == ()
    with pytest.raises(BadRequest, match="one side is a pattern"):
        listed(header + "a_%04d.png,b_%04d.png,c.png,\n")
