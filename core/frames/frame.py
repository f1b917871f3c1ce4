"""The pictures of one panorama, made ready."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..cameras.bodies import Bodies, bodies_of, called_of_bodies
from ..pictures.picture import Picture
from ..pictures.resized import resized

if TYPE_CHECKING:
    from ..cameras.camera import Camera
    from ..pictures.metadata import Exif
    from .merging import MergedBracket


@dataclass(frozen=True)
class Frame:
    """The pictures of one panorama, made ready.

    Attributes
    ----------
    pictures : tuple of Picture
        Scaled, and without what is masked; of two the reference first.
    full_sizes : tuple of (W, H)
        px of the pictures as they came.
    painted : ndarray (H, W) int8 or None
        What was painted over the panorama (see `masks.read_painted`).
    warnings : tuple of str
        About what was given, in plain words.
    shown_by : tuple of int
        Of each picture that was given the number of the one here that is used for it: copies are used once, and
        exposures of one view together.
    brackets : tuple of MergedBracket
        What became of exposures of one view.
    known : tuple of (Camera or None)
        Of each picture the camera of its full px that follows from what the picture is (a view of a sphere, a
        fisheye's circle); empty where all are flat photographs.
    """

    pictures: tuple[Picture, ...]
    full_sizes: tuple[tuple[int, int], ...]
    painted: NDArray[np.int8] | None = None
    warnings: tuple[str, ...] = ()
    shown_by: tuple[int, ...] = ()
    brackets: tuple[MergedBracket, ...] = ()
    known: tuple[Camera | None, ...] = ()

    @property
    def names(self) -> list[str]:
        """What the pictures are called."""
        return [picture.name for picture in self.pictures]

    @property
    def called(self) -> list[str]:
        """The same as a user names them: the first view of a sphere stands for it."""
        names = self.names
        called = called_of_bodies(names, self.known or [None] * len(names))
        return [called.get(number, name) for number, name in enumerate(names)]

    @property
    def exifs(self) -> list[Exif]:
        """What their files' EXIF says."""
        return [picture.exif for picture in self.pictures]

    @property
    def bodies(self) -> Bodies:
        """Which of them are views of one sphere."""
        return bodies_of(self.known or [None] * len(self.pictures))

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """(W, H) px of the pictures as they are worked on."""
        return [size_of(picture) for picture in self.pictures]

    def only(self, numbers: Sequence[int]) -> Frame:
        """The same with some of the pictures, in the order of these numbers."""
        if list(numbers) == list(range(len(self.pictures))):
            return self
        pictures = tuple(self.pictures[number] for number in numbers)
        known = tuple(self.known[number] for number in numbers) if self.known else ()
        sizes = tuple(self.full_sizes[number] for number in numbers)
        return replace(self, pictures=pictures, full_sizes=sizes, known=known)

    def resized(self, share: float) -> Frame:
        """The same with its pictures shrunk to a share of their sides."""
        return self if share == 1 else replace(self, pictures=tuple(resized(one, share) for one in self.pictures))


def size_of(picture: Picture) -> tuple[int, int]:
    """(W, H) px of a picture."""
    height, width = picture.light.shape[:2]
    return width, height
