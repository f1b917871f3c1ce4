"""What turns and moves as one: views that were cut out of one sphere, and every other picture for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .camera import Camera


@dataclass(frozen=True, eq=False)
class Bodies:
    """Which of N pictures are views of one body, taken at one place with rotations between them that are known exactly.

    of (N,): the number of the first picture of each one's body; R (N, 3, 3): from the body's axes to the picture's.
    """

    of: NDArray[np.intp]
    R: NDArray[np.float64]

    @staticmethod
    def alone(count: int) -> Bodies:
        """So many pictures, each a body of its own."""
        return Bodies(np.arange(count), np.tile(np.eye(3), (count, 1, 1)))

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """All pairs (i, j), i < j, of views of one body."""
        same = np.triu(self.of[:, None] == self.of, 1)
        return [(int(i), int(j)) for i, j in np.argwhere(same)]

    def between(self, i: int, j: int) -> NDArray[np.float64]:
        """The rotation (3, 3) from the axes of view i to those of view j of one body."""
        turn: NDArray[np.float64] = self.R[j] @ self.R[i].T
        return turn

    def members(self, picture: int) -> list[int]:
        """The pictures of a picture's body, ascending."""
        return [int(k) for k in np.flatnonzero(self.of == self.of[picture])]

    def made_rigid(self, R: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rotations (N, 3, 3) of the pictures with those of each body in the middle of what its views say."""
        out = R.copy()
        for first in np.flatnonzero(np.bincount(self.of) > 1):
            views = np.flatnonzero(self.of == first)
            turned = Rotation.from_matrix(np.swapaxes(self.R[views], 1, 2) @ R[views]).mean().as_matrix()
            out[views] = self.R[views] @ turned
        return out


def bodies_of(cameras: Sequence[Camera | None]) -> Bodies:
    """The bodies of pictures with these cameras, None where nothing is known of one."""
    views = [None if camera is None else camera.view_of for camera in cameras]
    first: dict[int, int] = {}
    of = [
        number if view is None else first.setdefault(view.sphere, number) for number, view in enumerate(views)
    ]
    R = [np.eye(3) if view is None else view.R for view in views]
    return Bodies(np.array(of, np.intp), np.array(R).reshape(-1, 3, 3))


def called_of_bodies(names: Sequence[str], cameras: Sequence[Camera | None]) -> dict[int, str]:
    """By the number of the first picture of each body what a user calls it: a sphere by its own name, not its view's;
    names: of all pictures, cameras: as for `bodies_of`."""
    called = {}
    for number in sorted(set(bodies_of(cameras).of.tolist())):
        camera = cameras[number]
        called[number] = names[number] if camera is None or camera.view_of is None else camera.view_of.name
    return called
