"""Rigs as no photographer takes them: points on a line, cameras of no lens, poses that contradict each other.

Every rig follows from its number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.raster.arrays import Array

from .rigs import KINDS, make_rig


class HostileRig:
    """What a registration is given: cameras, points of each picture (n, 2) raw px, and matches."""

    def __init__(self, number: int) -> None:
        self.chance = np.random.default_rng(number)
        kind = str(self.chance.choice(sorted(KINDS)))
        self.true = make_rig(
            kind, number, points=self._one_of(2500, 4000, 7000), noise_px=self._one_of(0.0, 0.5, 0.5, 4.0),
            outliers=self._one_of(0.0, 0.2, 0.7), pictures=int(self.chance.integers(2, 7)),
        )  # fmt: skip
        count = min(len(self.true.points), int(self.chance.integers(3, 8)))
        self.points: list[Array] = [np.array(one) for one in self.true.points[:count]]
        self.cameras: list[Camera] = list(self.true.cameras[:count])
        self.matches = [one for one in self.true.matches if one.i < count and one.j < count]
        for change in self.chance.choice(sorted(CHANGES), int(self.chance.choice((0, 1, 1, 2, 3)))):
            CHANGES[change](self)

    def _one_of(self, *values: float) -> float:
        return values[int(self.chance.integers(len(values)))]

    def _any(self) -> int:
        return int(self.chance.integers(len(self.points)))

    def twins(self) -> None:
        """Two pictures have the same points."""
        of, to = self._any(), self._any()
        count = min(len(self.points[of]), len(self.points[to]))
        self.points[to][:count] = self.points[of][:count]

    def line(self) -> None:
        """All points of a picture lie on a line."""
        self.points[self._any()][:, 1] = 300

    def one_point(self) -> None:
        """All points of a picture are one."""
        self.points[self._any()][:] = 17.0

    def scaled(self) -> None:
        """A picture's points lie far outside it, or all in its corner."""
        self.points[self._any()] *= self._one_of(1e-3, 1e3, 1e6)

    def shifted(self) -> None:
        """A picture's points are those of one that was cut out elsewhere."""
        self.points[self._any()] += self.chance.normal(0, 400, 2)

    def no_lens(self) -> None:
        """A focal length that no lens has."""
        k, focal = self._any(), self._one_of(1.0, 50.0, 1e5)
        K = np.array([[focal, 0, 400], [0, focal, 300], [0, 0, 1]])
        self.cameras[k] = replace(self.cameras[k], K=K)

    def bent(self) -> None:
        """Distortion of any strength, another one for each picture."""
        bends = self.chance.normal(0, 0.3, (len(self.cameras), 2))
        self.cameras = [
            replace(one, distortion=np.array([*bend, 0, 0, 0])) for one, bend in zip(self.cameras, bends, strict=True)
        ]

    def given(self) -> None:
        """Focal lengths are given, though they are some per cent off."""
        self.cameras = [replace(one, log_sigma=0.0, knowledge=Knowledge.GIVEN) for one in self.cameras]

    def posed(self) -> None:
        """Poses are given of some pictures: true ones, another picture's, or all at one place."""
        off, far = int(self.chance.integers(2)), self._one_of(0.0, 1.0, 1e6)
        self.given()
        for k in range(len(self.cameras)):
            if self.chance.random() < 0.8:
                pose = self.true.R[(k + off) % len(self.true.R)], self.true.t[k] * far
                self.cameras[k] = replace(self.cameras[k], pose=pose)

    def few(self) -> None:
        """Next to no matches."""
        most = int(self.chance.integers(0, 12))
        self.matches = [PictureMatches(one.i, one.j, one.index[:most]) for one in self.matches]

    def some_pairs(self) -> None:
        """Most pairs have no matches."""
        self.matches = self.matches[: int(self.chance.integers(0, len(self.matches) + 1))]

    def one_match(self) -> None:
        """A pair has one match, many times."""
        if self.matches:
            k = int(self.chance.integers(len(self.matches)))
            self.matches[k] = replace(self.matches[k], index=np.zeros_like(self.matches[k].index))


CHANGES: dict[str, Callable[[HostileRig], None]] = {
    name: one for name, one in vars(HostileRig).items() if callable(one) and not name.startswith("_")
}
