"""Two pictures that show the same, with all that was found between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from .matches import Matches
from .two_view import TwoView

Item = TypeVar("Item")


@dataclass(frozen=True)
class Edge:
    """Pictures number i and j: all their matches, before any was left out, in px of the raw pictures and in ideal
    (undistorted) px; and their geometry, x those of i and y those of j."""

    i: int
    j: int
    matches: Matches
    ideal: Matches
    two_view: TwoView

    @property
    def inliers(self) -> Matches:
        """The matches that the geometry explains, ideal px."""
        return self.ideal.subset(self.two_view.inliers)

    def pair(self, items: Sequence[Item]) -> tuple[Item, Item]:
        """What belongs to its two pictures, of what belongs to all."""
        return items[self.i], items[self.j]
