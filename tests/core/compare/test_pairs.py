"""Which pairs a call means."""

from __future__ import annotations

from pathlib import Path

import pytest
from edf_stitch.core.compare.pairs import find_pairs
from edf_stitch.core.system.errors import BadRequest


def touch(folder: Path, *names: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def test_two_files_are_a_pair_the_reference_first(tmp_path: Path) -> None:
    touch(tmp_path, "z.png", "a.jpg")
    (pair,) = find_pairs([tmp_path / "z.png", tmp_path / "a.jpg"])
    assert (pair.name, pair.reference.name, pair.target.name, pair.folder) == ("z-a", "z.png", "a.jpg", None)


def test_a_folder_of_two_pictures_is_a_pair_in_order_of_their_names(tmp_path: Path) -> None:
    folder = touch(tmp_path / "desk", "2.JPG", "1.png", "notes.txt")
    (pair,) = find_pairs([folder])
    assert (pair.name, pair.reference.name, pair.target.name, pair.folder) == ("desk", "1.png", "2.JPG", folder)
    assert not pair.trouble


def test_a_folder_of_folders_holds_pairs_and_passes_over_what_has_no_pictures(tmp_path: Path) -> None:
    for name in ("street", "desk"):
        touch(tmp_path / name, "a.png", "b.png")
    touch(tmp_path / "notes", "readme.txt")
    assert [pair.name for pair in find_pairs([tmp_path])] == ["desk", "street"]


def test_a_folder_that_names_its_two_may_hold_more(tmp_path: Path) -> None:
    """As `edf validate` keeps its pictures: the true panorama lies beside them."""
    (pair,) = find_pairs([touch(tmp_path / "street-0123", "reference.png", "target.png", "wide.exr", "cameras.json")])
    assert (pair.reference.name, pair.target.name, pair.trouble) == ("reference.png", "target.png", "")


def test_a_folder_that_is_no_pair_is_a_row_that_says_why(tmp_path: Path) -> None:
    touch(tmp_path / "one", "a.png")
    touch(tmp_path / "desk", "a.png", "b.png")
    desk, other = find_pairs([tmp_path])
    assert not desk.trouble and "holds one picture" in other.trouble


def test_a_folder_of_more_pictures_is_a_set(tmp_path: Path) -> None:
    (found,) = find_pairs([touch(tmp_path / "street", "c.png", "a.png", "b.png")])
    assert [path.name for path in found.all_pictures] == ["a.png", "b.png", "c.png"] and not found.trouble
    assert [path.name for path in found.more] == ["c.png"]


def test_no_two_have_the_same_name(tmp_path: Path) -> None:
    for place in ("one", "two", "three"):
        touch(tmp_path / place / "Desk", "a.png", "b.png")
    pairs = find_pairs([tmp_path / place for place in ("one", "two", "three")])
    assert [pair.name for pair in pairs] == ["Desk", "Desk-2", "Desk-3"]


@pytest.mark.parametrize("words", [["a.png"], ["a.png", "folder"], ["folder", "a.png"], ["a.png", "b.png", "a.png"]])
def test_a_picture_alone_is_refused(tmp_path: Path, words: list[str]) -> None:
    touch(tmp_path, "a.png", "b.png")
    touch(tmp_path / "folder", "a.png", "b.png")
    with pytest.raises(BadRequest, match="a.png stands alone"):
        find_pairs([tmp_path / word for word in words])


def test_a_folder_without_pictures_is_refused(tmp_path: Path) -> None:
    touch(tmp_path / "notes", "readme.txt")
    with pytest.raises(BadRequest, match="holds no pictures"):
        find_pairs([tmp_path])
