"""Pictures of one panorama, made ready: how many, each once, masked by number and by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.frames.frame import size_of
from edf_stitch.core.frames.reading import MOST_PICTURES, check_count, read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.system.errors import BadRequest, NoOverlap, UnreadableImage

PLAIN = StitchOptions()


def picture(seed: int, name: str, shape: tuple[int, ...] = (30, 40, 3)) -> Picture:
    return picture_from_array(np.random.default_rng(seed).integers(0, 255, shape).astype(np.uint8), name)


def test_two_to_sixty_pictures_are_taken() -> None:
    for count in (2, 3, MOST_PICTURES):
        check_count(count, PLAIN)
    with pytest.raises(BadRequest, match="one picture alone"):
        check_count(1, PLAIN)
    with pytest.raises(BadRequest, match="61 pictures given, at most 60"):
        check_count(61, PLAIN)


def test_options_that_only_a_pair_knows_are_refused_of_more() -> None:
    three = [picture(seed, f"{seed}.png") for seed in range(3)]
    with pytest.raises(BadRequest, match="two pictures only"):
        read_frame(three, StitchOptions(field="apap"))


def test_a_picture_that_is_there_twice_is_used_once_and_said() -> None:
    a, b, c = (picture(seed, f"{seed}.png") for seed in range(3))
    again = picture_from_array(a.view.copy(), "copy.png")
    frame = read_frame([a, b, again, c], PLAIN)
    assert frame.names == ["0.png", "1.png", "2.png"] and len(frame.full_sizes) == 3
    assert frame.shown_by == (0, 1, 0, 2)
    assert frame.warnings == ("copy.png is the same picture as 0.png: it is used once",)


def test_all_files_that_cannot_be_read_are_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.jpg").write_text("no picture", "utf-8")
    good, empty, text = picture(0, "a.png"), tmp_path / "empty.png", tmp_path / "text.jpg"
    with pytest.raises(UnreadableImage, match=r"^2 files cannot be used: .*empty\.png: .*; .*text\.jpg: not a picture"):
        read_frame([empty, good, text], PLAIN)
    with pytest.raises(UnreadableImage, match=r"empty\.png: ") as caught:
        read_frame([good, empty, picture(1, "b.png")], PLAIN)
    assert "files cannot" not in str(caught.value)


def test_what_is_left_is_counted_without_copies() -> None:
    a, b = picture(0, "a.png"), picture(1, "b.png")
    assert read_frame([a, b, a, a, b], PLAIN).names == ["a.png", "b.png"]
    with pytest.raises(NoOverlap, match="the two pictures are the same"):
        read_frame([a, a], PLAIN)
    with pytest.raises(NoOverlap, match="all pictures are the same"):
        read_frame([a, a, a], PLAIN)
    with pytest.raises(BadRequest, match="name the other one first"):
        read_frame([a, b, b], StitchOptions(viewpoint=2))


def test_masks_go_by_number_and_by_name_whatever_is_left_out() -> None:
    a, b, c = (picture(seed, f"{seed}.png") for seed in range(3))
    left, right = np.zeros((30, 40), bool), np.zeros((30, 40), bool)
    left[:, :10], right[:, 30:] = True, True
    frame = read_frame([a, a, b, c], StitchOptions(ignore=(left,), ignore_in=(("2", right),)))
    alphas = [one.alpha for one in frame.pictures]
    assert alphas[0] is not None and alphas[2] is not None and alphas[1] is None
    np.testing.assert_array_equal(alphas[0] == 0, left)
    np.testing.assert_array_equal(alphas[2] == 0, right)
    with pytest.raises(BadRequest, match=r"the mask of 1\.png leaves"):
        read_frame([a, b, c], StitchOptions(ignore_in=(("1.png", np.ones((30, 40), bool)),)))


def test_sizes_and_kinds_may_differ() -> None:
    gray, wide = picture(1, "gray.png", (50, 20, 1)), picture(2, "wide.png", (20, 90, 3))
    floats = picture_from_array(np.random.default_rng(3).random((25, 25, 3), np.float32), "f.exr")
    frame = read_frame([picture(0, "a.png"), gray, wide, floats], StitchOptions(scale=0.5))
    assert frame.full_sizes == ((40, 30), (20, 50), (90, 20), (25, 25))
    assert [size_of(one) for one in frame.pictures[:3]] == [(20, 15), (10, 25), (45, 10)]
    assert len({one.light.shape[2] for one in frame.pictures}) == 1, "one can be blended with the other"


def test_some_of_the_pictures_in_another_order() -> None:
    frame = read_frame([picture(seed, f"{seed}.png", (20 + seed, 40, 3)) for seed in range(4)], PLAIN)
    assert frame.only((0, 1, 2, 3)) is frame
    part = frame.only((2, 0))
    assert part.names == ["2.png", "0.png"] and part.full_sizes == ((40, 22), (40, 20))


def test_pictures_of_the_same_name_in_different_folders_are_told_apart(tmp_path: Path) -> None:
    files = [tmp_path / "east" / "1.png", tmp_path / "west" / "1.png", tmp_path / "2.png"]
    for number, path in enumerate(files):
        path.parent.mkdir(exist_ok=True)
        light = np.random.default_rng(number).random((20, 30, 3), np.float32)
        path.write_bytes(encode_picture(light, np.ones((20, 30), np.float32), 8, ".png")[0])
    frame = read_frame([*files, files[1]], StitchOptions())
    assert frame.names == ["east/1.png", "west/1.png", "2.png"]
    assert frame.warnings == ("west/1.png is given twice: it is used once",)
    assert read_frame(files[:2], StitchOptions()).names == ["1.png", "1.png"], "of two the role says which"
