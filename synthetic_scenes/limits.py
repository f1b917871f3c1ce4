"""What a validation may ask for, and what came of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

Result = dict[str, Any]


@dataclass(frozen=True)
class Limit:
    """A bound on a figure of a run ("proof": of the ground truth). Infinity: any number will do, but there must be one.

    absolute: the sign does not count; determined: only of scenes in which two pictures determine the focal length;
    always: also of scenes without parallax.
    """

    run: str
    measure: str
    unit: str
    at_most: float | None = None
    at_least: float | None = None
    absolute: bool = False
    determined: bool = False
    always: bool = False

    @property
    def text(self) -> str:
        """As people read it."""
        if self.at_most is not None:
            return "a number" if math.isinf(self.at_most) else f"≤ {self.at_most:g}"
        return f"≥ {self.at_least:g}"

    def holds(self, value: float | None) -> bool:
        """Whether a value keeps it; where there is none, it does not."""
        if value is None:
            return False
        if self.at_most is not None:
            return value <= self.at_most
        return self.at_least is not None and value >= self.at_least

    @property
    def worst(self) -> float:
        """What a value that is missing counts as in a median."""
        return math.inf if self.at_most is not None else -math.inf


@dataclass(frozen=True)
class Check:
    """One thing that was asked for. scene: None for the whole suite's."""

    scene: str | None
    run: str
    measure: str
    value: float | str | bool | None
    limit: str
    unit: str
    passed: bool


def number(value: object) -> float | None:
    """A figure as a number; None where it is none."""
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None
