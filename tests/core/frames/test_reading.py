"""Pictures of one panorama, made ready: how many, each once, masked by number and by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.frames.frame import size_of
from edf_stitch.core.frames.reading import MOST_PICTURES, check_count, read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.rig.from_pictures import content_order
from edf_stitch.core.system.errors import BadRequest, NoOverlap, UnreadableImage
from edf_stitch.core.system.threads import at_most

from ...asked import counting
from .exposed_views import HEIGHT, WIDTH, bracket_of, painted_world, view_of

PLAIN = StitchOptions()


def picture(seed: int, name: str, shape: tuple[int, ...] = (30, 40, 3)) -> Picture:
    return picture_from_array(np.random.default_rng(seed).integers(0, 255, shape).astype(np.uint8), name)


def test_whether_to_go_on_is_asked_at_every_picture_that_is_read() -> None:
    """Sixty large ones take seconds."""
    pictures = [picture(seed, f"{seed}.png", (96, 128, 3)) for seed in range(4)]
    with counting() as count, at_most(1):
        content_order(read_frame(pictures, PLAIN).pictures)
    assert count["prepare"] == count["content_order"] == 4 and count["_compared"] >= 4
    assert count["in_order"] >= 8, "they are read, and looked at for brackets"


def test_two_to_sixty_pictures_are_taken() -> None:
    for count in (2, 3, MOST_PICTURES):
        check_count(count, PLAIN)
    with pytest.raises(BadRequest, match="one picture alone"):
        check_count(1, PLAIN)
    with pytest.raises(BadRequest, match="61 pictures given, at most 60"):
        check_count(61, StitchOptions(brackets="off"))


def test_brackets_may_be_many_files_of_few_views() -> None:
    check_count(MOST_PICTURES * 3, PLAIN)
    check_count(MOST_PICTURES * 3, StitchOptions(brackets=3))
    for count, brackets, said in (
        (MOST_PICTURES * 3 + 3, 3, "61 pictures given"), (541, "auto", "541 pictures given"),
        (7, 3, "no brackets of 3"), (3, 3, "one picture alone"),
    ):  # fmt: skip
        with pytest.raises(BadRequest, match=said):
            check_count(count, StitchOptions(brackets=brackets))


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


def test_what_is_to_be_shown_goes_by_number_and_by_name_and_may_be_all_of_a_picture() -> None:
    a, b, c = (picture(seed, f"{seed}.png") for seed in range(3))
    left, everything = np.zeros((30, 40), bool), np.ones((30, 40), bool)
    left[:, :10] = True
    frame = read_frame([a, b, c], StitchOptions(show=((1, left), ("2", everything))))
    wanted = [one.wanted for one in frame.pictures]
    assert wanted[1] is None and wanted[0] is not None and wanted[2] is not None and wanted[2].all()
    np.testing.assert_array_equal(wanted[0], left)
    with pytest.raises(BadRequest, match="--show"):
        read_frame([a, b, c], StitchOptions(show=(("7.png", left),)))


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


def test_exposures_of_one_view_become_one_picture() -> None:
    world = painted_world()
    views = [view_of(world, x) for x in (20.0, 240.0, 460.0)]
    left, middle, right = (bracket_of(light, name) for light, name in zip(views, "abc", strict=True))
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[:, :50] = True
    # the second by one exposure alone, the first masked by the name of its darkest
    frame = read_frame([left[0], middle[0], left[1], *right, left[2]], StitchOptions(
        ignore_in=(("a-2.png", mask),), show=(("c+2.png", mask),)
    ))  # fmt: skip
    assert frame.pictures[0].wanted is None and np.array_equal(frame.pictures[2].wanted, mask)
    assert frame.names == ["a+0.png", "b+0.png", "c+0.png"]
    assert [one.bits for one in frame.pictures] == [32, 8, 32]
    assert frame.shown_by == (0, 1, 0, 2, 2, 2, 0)
    assert frame.pictures[0].alpha is not None and (frame.pictures[0].alpha[:, :50] == 0).all()
    assert frame.warnings[0] == (
        "6 pictures are 2 brackets of 3 exposures and were merged; --brackets off keeps them apart"
    )
    assert [bracket.names for bracket in frame.brackets] == [
        ("a-2.png", "a+0.png", "a+2.png"), ("c-2.png", "c+0.png", "c+2.png")
    ]  # fmt: skip
    assert np.median(np.abs(frame.pictures[2].pixels / views[2] - 1)) < 0.02
    apart = read_frame([*left, *right], StitchOptions(brackets="off"))
    assert len(apart.pictures) == 6 and apart.brackets == ()
    with pytest.raises(BadRequest, match="one picture alone makes no panorama"):
        read_frame(left, PLAIN)
    with pytest.raises(BadRequest, match="no exposures of one view"):
        read_frame([left[0], middle[0], left[1], middle[1]], StitchOptions(brackets=2))


def test_copies_are_left_out_beside_brackets() -> None:
    world = painted_world()
    left, right = (bracket_of(view_of(world, x), name) for x, name in ((20.0, "a"), (240.0, "b")))
    again = replace(right[0], name="again.png")
    frame = read_frame([*left, right[0], again], PLAIN)
    assert frame.names == ["a+0.png", "b+0.png"] and frame.shown_by == (0, 0, 0, 1, 1)
    assert len(frame.warnings) == 2 and "again.png is the same picture as b+0.png" in frame.warnings[1]
