"""How the items of a batch ended, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from ..system.errors import StitchError

SCHEMA = 1
# Exit codes, the most important first: cannot be stitched, a file, the request.
_EXIT_CODES = (3, 4, 2)
# The figures of the report in the line about an item.
_FIGURES = {
    "alignment_median_px": "alignment {:.2f} px", "overlap_psnr_db": "PSNR {:.2f} dB", "overlap_ssim": "SSIM {:.3f}",
}  # fmt: skip


@dataclass(frozen=True)
class FrameTrouble:
    """Why there is no panorama of a frame."""

    frame: int
    message: str
    exit_code: int


@dataclass(frozen=True)
class Frames:
    """The frames of a clip in this shard, by how they ended; missing: numbers that one side or both lack."""

    done: int = 0
    skipped: int = 0
    failed: tuple[FrameTrouble, ...] = ()
    missing: tuple[int, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How an item ended.

    status: "done", "skipped" (it existed) or "failed" (of a clip: any frame); message, exit_code: why, empty and 0
    if nothing failed; panorama: path relative to the folder, of a clip that of its first frame; size: (W, H) px;
    measured, verdict: the report's, empty without a report.
    """

    name: str
    status: str
    message: str = ""
    exit_code: int = 0
    warnings: tuple[str, ...] = ()
    panorama: str = ""
    size: tuple[int, int] | None = None
    measured: dict[str, Any] = field(default_factory=dict)
    verdict: dict[str, Any] = field(default_factory=dict)
    frames: Frames | None = None

    def in_words(self, figures: bool = False) -> str:
        """A line for the user, with the most important figures if asked for."""
        words = [self.status if self.status == "skipped" else "×".join(map(str, self.size or ())) or self.status]
        if self.frames is not None:
            words.append(f"{self.frames.done} frames done, {self.frames.skipped} skipped")
        if self.verdict.get("is", "good") != "good":
            places = f" at {len(self.verdict['places'])} places" if self.verdict["is"] == "look" else ""
            words.append(self.verdict["is"] + places)
        for name, form in _FIGURES.items():
            if figures and self.measured.get(name) is not None:
                words.append(form.format(self.measured[name]))
        return f"failed: {self.message}" if self.exit_code else ", ".join(words)


@dataclass(frozen=True)
class BatchSummary:
    """The outcomes so far, in order, of a batch of `total` items; keep_going: whether failures were to be expected."""

    outcomes: tuple[Outcome, ...]
    total: int
    interrupted: bool = False
    keep_going: bool = False

    @property
    def exit_code(self) -> int:
        """0, or that of the most important failure: 3 before 4 before 2; where it went on after failures, 1."""
        if self.keep_going:
            return int(bool(self.count("failed")))
        return worst(outcome.exit_code for outcome in self.outcomes)

    def count(self, status: str) -> int:
        """How many items ended with this status."""
        return sum(outcome.status == status for outcome in self.outcomes)

    def failures(self) -> list[str]:
        """A table of what failed, line by line; empty if nothing did."""
        failed = [one for one in self.outcomes if one.exit_code]
        width = max(len(name) for name in ("name", *(one.name for one in failed)))
        head = [f"{len(failed)} of {self.total} failed:", f"{'name':<{width}}  code  why"] if failed else []
        return [*head, *(f"{one.name:<{width}}  {one.exit_code:<4}  {one.message}" for one in failed)]

    def as_dict(self) -> dict[str, Any]:
        """The content of batch.json; no times and no dates."""
        counts = {status: self.count(status) for status in ("done", "skipped", "failed")}
        return {
            "schema": SCHEMA, "total": self.total, **counts, "interrupted": self.interrupted,
            "exit_code": self.exit_code, "items": [asdict(outcome) for outcome in self.outcomes],
        }  # fmt: skip


def trouble_of(error: Exception) -> tuple[int, str]:
    """Exit code and message of what kept an item from being made."""
    if isinstance(error, StitchError):
        return error.exit_code, str(error)
    if isinstance(error, MemoryError):
        return StitchError.exit_code, "not enough memory for pictures of this size; use smaller ones"
    return StitchError.exit_code, f"internal error, please report it: {type(error).__name__}: {error}"


def worst(codes: Iterable[int]) -> int:
    """The most important of exit codes, 0 if there is none."""
    found = set(codes)
    return next((code for code in _EXIT_CODES if code in found), 0)
