"""Progress and cancel for long work: the pipeline reports, whoever called decides how to show it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from .errors import Cancelled

# Called with a stage's name and how much of it is done.
ReportProgress = Callable[[str, float], None]
# Called between the steps of long work that tells no share of it; raises Cancelled where asked to stop.
Tick = Callable[[], None]
# Shares of the total time of each stage, in the order of the data; measured on 3 MP pairs, good enough for a bar.
STAGES: dict[str, float] = {
    "read": 0.05,
    "features": 0.30,
    "geometry": 0.04,
    "field": 0.08,
    "dense": 0.24,
    "warp": 0.09,
    "occlusion": 0.02,
    "exposure": 0.01,
    "seam": 0.05,
    "blend": 0.04,
    "write": 0.08,
}
# The same of more than two pictures. Seams and blends take turns, picture by picture: both are told as seam.
STAGES_OF_MANY: dict[str, float] = {
    "read": 0.02,
    "features": 0.07,
    "matches": 0.13,
    "geometry": 0.16,
    "field": 0.04,
    "dense": 0.34,
    "warp": 0.07,
    "occlusion": 0.03,
    "exposure": 0.02,
    "seam": 0.08,
    "write": 0.04,
}
TOLD_AS = {"blend": "seam"}


def stages_of(pictures: int) -> dict[str, float]:
    """The stages of a stitch of so many pictures, and the share of its time that each takes."""
    return STAGES if pictures == 2 else STAGES_OF_MANY


def unwatched() -> None:
    """The tick of work that nobody waits for."""


@dataclass(frozen=True)
class Progress:
    """Turns (stage, fraction of the stage) into (stage, fraction of everything), and stops the work when asked to.

    `report(stage, total_fraction)` is called from the thread that stitches; `cancelled()` is asked at every step and
    raises `Cancelled` when it says True. stages: shares of the total time of each stage, in their order.
    """

    report: Callable[[str, float], None] | None = None
    cancelled: Callable[[], bool] | None = None
    stages: Mapping[str, float] = field(default_factory=lambda: STAGES)

    def __call__(self, stage: str, fraction: float = 0.0) -> None:
        if self.cancelled is not None and self.cancelled():
            raise Cancelled()
        if self.report is not None:
            names = list(self.stages)
            stage = stage if stage in names else TOLD_AS.get(stage, stage)
            done = sum(self.stages[name] for name in names[: names.index(stage)])
            self.report(stage, min(1.0, round(done + self.stages[stage] * fraction, 6)))


class Stopwatch:
    """A progress callable that also keeps the seconds of each stage (`seconds`), and raises Cancelled where asked."""

    def __init__(self, progress: Progress) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress
        self._stage, self._since = "", time.perf_counter()

    def expect(self, pictures: int) -> None:
        """Tells progress as of a stitch of so many pictures from now on."""
        self._progress = replace(self._progress, stages=stages_of(pictures))

    def untold(self) -> Stopwatch:
        """One for work on the side, which is not told of but stopped all the same."""
        return Stopwatch(replace(self._progress, report=None))

    def __call__(self, stage: str, fraction: float = 0.0) -> None:
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._stage, self._since = stage, now
        self._progress(stage, fraction)
