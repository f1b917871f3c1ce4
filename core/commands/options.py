"""What was chosen in telling how the work goes on: each value with its unit, and why it is what it is.

Imports nothing heavy: the command line reads it before NumPy loads.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MessageOptions:
    """What the commands say while they work (`cli`, `messages`)."""

    max_warnings: int = 5
    """Warnings shown of one item of a batch: every frame of a clip may have its own. All stand in its report."""

    max_names: int = 6
    """Names of files that a message lists; of more, the first ones and the last."""

    written_share: float = 0.98
    """Share of a stitch that is done when its files are to be written."""


@dataclass(frozen=True)
class StoppingOptions:
    """How the command stops when it is asked to (`cli`)."""

    again_seconds: float = 0.02
    """Seconds after which a signal is raised once more that Python could not act on."""


@dataclass(frozen=True)
class WorkerOptions:
    """What the worker tells the window (`worker`)."""

    stitch_share: float = 0.9
    """Share of its work that the stitch is; the rest is encoding what the window wants to have."""

    file_share: float = 0.01
    """Share that each encoded file adds."""

    max_share: float = 0.99
    """The share told at most before everything is done."""

    longest_wait: float = 180.0
    """Seconds that one which was started ahead waits for a job: it holds 230 MB, and starting another takes 1.5 s."""


@dataclass(frozen=True)
class RecomposingOptions:
    """The small panorama of a set that follows what is changed in the window (`recomposing`)."""

    pixels: float = 1.5e5
    """px of the panorama: 18 pictures take 2.2 s of one processor's time, 5 take 1.3 s."""

    threads: int = 1
    """That work on it: so little is to be done that handing it out takes more time than doing it."""


@dataclass(frozen=True)
class DrawnOptions:
    """Places that were drawn in the window (`drawn_places`)."""

    side: int = 2048
    """Longest side of what is drawn on, px: finer than a hand draws, and a quarter of a second for 60 pictures."""


@dataclass(frozen=True)
class NotebookOptions:
    """What a notebook shows of a panorama (`python_result`)."""

    side: int = 800
    """Longest side of the small copy, px: about the width of a notebook's cell."""


MESSAGES = MessageOptions()
DRAWN = DrawnOptions()
NOTEBOOK = NotebookOptions()
RECOMPOSING = RecomposingOptions()
STOPPING = StoppingOptions()
WORKER = WorkerOptions()
