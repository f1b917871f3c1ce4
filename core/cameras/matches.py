"""Points that two pictures have in common."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Matches:
    """Matched points of two pictures.

    Attributes
    ----------
    x, y : (N, 2) float64
        Points of the reference and of the target, px; pixel centres are integers.
    scale : float
        px by which thresholds are multiplied: full pixels per pixel of the picture they were found in.
    weight : (N,), optional
        How much each counts; None if all count alike.
    given : bool
        By the user, hence all used.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    scale: float = 1.0
    weight: NDArray[np.float64] | None = None
    given: bool = False

    def __len__(self) -> int:
        return len(self.x)

    @property
    def weights(self) -> NDArray[np.float64]:
        """How much each match counts (N,); ones where nothing was said."""
        return np.ones(len(self.x)) if self.weight is None else self.weight

    def subset(self, keep: NDArray[Any]) -> Matches:
        """The matches that a mask or index array selects."""
        weight = None if self.weight is None else self.weight[keep]
        return replace(self, x=self.x[keep], y=self.y[keep], weight=weight)

    def thinned(self, most: int) -> Matches:
        """At most so many of the matches, evenly through the list."""
        return self if len(self) <= most else self.subset(np.linspace(0, len(self) - 1, most).astype(int))
