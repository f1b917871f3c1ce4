"""What the panel shows of the work that is going on, or of how the last one ended. Written by the job, never saved."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Status:
    """stage: the engine's name of it; share: of everything, 0..1; message: how it went, in words; failed: whether that
    is an error."""

    running: bool = False
    cancelling: bool = False
    stage: str = ""
    share: float = 0.0
    message: str = ""
    failed: bool = False


now = Status()


def begin() -> None:
    """Work starts; what was said of the last one is forgotten."""
    now.__dict__.update(Status(running=True, stage="read").__dict__)


def say(message: str) -> None:
    """Something happened that is no work; what goes on is not talked over."""
    if not now.running:
        end(message)


def end(message: str, failed: bool = False) -> None:
    """Work is over."""
    now.__dict__.update(Status(message=message, failed=failed).__dict__)
