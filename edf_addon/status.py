"""What the panel shows of the work that is going on, or of how the last one ended. Written by the job, never saved."""

from __future__ import annotations

import time
from dataclasses import dataclass

# Share of the work below which what is left of it cannot be told from what was done: reading goes its own way.
FIRST_SHARE = 0.1


@dataclass
class Status:
    """stage: the engine's name of it; share: of everything, 0..1; began: when, by `time.monotonic`; message: how it
    went, in words; failed: whether that is an error; made: session_uid of the images and clips that it tells of."""

    running: bool = False
    cancelling: bool = False
    stage: str = ""
    share: float = 0.0
    began: float = 0.0
    message: str = ""
    failed: bool = False
    made: frozenset[int] = frozenset()


now = Status()


def begin() -> None:
    """Work starts; what was said of the last one is forgotten."""
    now.__dict__.update(Status(running=True, stage="read", began=time.monotonic()).__dict__)


def seconds_left() -> float | None:
    """How long what goes on will still take, as fast as it went so far; None while nobody can tell."""
    if now.share < FIRST_SHARE:
        return None
    return (time.monotonic() - now.began) * (1 - now.share) / now.share


def say(message: str) -> None:
    """Something happened that is no work; what goes on is not talked over."""
    if not now.running:
        end(message)


def end(message: str, failed: bool = False, made: frozenset[int] = frozenset()) -> None:
    """Work is over."""
    now.__dict__.update(Status(message=message, failed=failed, made=made).__dict__)


def forget_unless(there: frozenset[int]) -> None:
    """An undo or a redo left these images and clips: what is told of others only is no longer so."""
    if now.made and not now.made & there:
        end("")
