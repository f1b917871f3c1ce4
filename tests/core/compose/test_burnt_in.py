"""What is burnt in is left out where another picture shows the place, and shown where none does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from edf_stitch.core.compose.burnt_in import shown_where_alone
from edf_stitch.core.pictures.masks import without
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pictures.resized import resized
from edf_stitch.core.raster.picture_map import PictureMap

SIZE, SHIFT = (60, 40), 30  # W, H px; px by which the second picture lies to the right


def marked(*boxes: tuple[slice, slice]) -> Picture:
    """A picture that is left out in boxes (rows, columns)."""
    burnt_in = np.zeros(SIZE[::-1], bool)
    for box in boxes:
        burnt_in[box] = True
    return replace(without(picture_from_array(np.full((*SIZE[::-1], 3), 99, np.uint8)), burnt_in), burnt_in=burnt_in)


def maps(scale: float = 1.0) -> list[PictureMap]:
    """A canvas of both, as many px as `scale` of theirs."""
    y, x = np.mgrid[: round(SIZE[1] * scale), : round((SIZE[0] + SHIFT) * scale)].astype(np.float32) / scale
    return [PictureMap(x, y, SIZE), PictureMap(x - SHIFT, y, SIZE)]


def test_only_where_no_other_picture_shows_the_place() -> None:
    """Both have a date from column 12 to 50, the second one's lies at 42 to 80 of the first: what the first's hides is
    shown by the second from column 30 to 42, and by nobody beside that."""
    date = np.s_[30:36, 12:50]
    for scale in (1.0, 0.6, 1.5):
        first, second = shown_where_alone([marked(date), marked(date)], maps(scale))
        assert first.alpha is not None and second.alpha is not None
        assert first.alpha[31:35, 13:28].all(), "only the first reaches there"
        assert not first.alpha[31:35, 33:39].any(), "the second shows it"
        assert first.alpha[31:35, 44:49].all(), "hidden in both"
        assert second.alpha[31:35, 13:19].all(), "the same place, of the second"
        assert second.alpha[31:35, 32:49].all(), "only the second reaches there"
        assert first.alpha[:28].all() and second.alpha[:28].all()
    beside = np.s_[30:36, 2:20]
    _, second = shown_where_alone([marked(np.s_[30:36, 2:9]), marked(beside)], maps())
    assert second.alpha is not None and not second.alpha[31:35, 3:19].any(), "the first shows it"


def test_pictures_without_any_are_as_they_were() -> None:
    plain = picture_from_array(np.full((*SIZE[::-1], 3), 99, np.uint8))
    assert shown_where_alone([plain, plain], maps()) == (plain, plain)
    first, second = shown_where_alone([plain, marked(np.s_[30:36, 2:20])], maps())
    assert first is plain and second.alpha is not None and not second.alpha[31:35, 3:19].any()


def test_a_smaller_copy_knows_where_it_was() -> None:
    small = resized(marked(np.s_[30:36, 4:20]), 0.5)
    assert small.burnt_in is not None and small.burnt_in.shape == (20, 30)
    assert small.burnt_in[15:18, 2:10].all() and small.burnt_in.sum() == 24
