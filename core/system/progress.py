"""Progress and cancel for long work: the pipeline reports, whoever called decides how to show it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .errors import Cancelled

# Called with a stage's name and how much of it is done.
ReportProgress = Callable[[str, float], None]
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


@dataclass(frozen=True)
class Progress:
    """Turns (stage, fraction of the stage) into (stage, fraction of everything), and stops the work when asked to.

    `report(stage, total_fraction)` is called from the thread that stitches; `cancelled()` is asked at every step and
    raises `Cancelled` when it says True.
    """

    report: Callable[[str, float], None] | None = None
    cancelled: Callable[[], bool] | None = None

    def __call__(self, stage: str, fraction: float = 0.0) -> None:
        if self.cancelled is not None and self.cancelled():
            raise Cancelled()
        if self.report is not None:
            names = list(STAGES)
            done = sum(STAGES[name] for name in names[: names.index(stage)])
            self.report(stage, min(1.0, round(done + STAGES[stage] * fraction, 6)))
