"""Errors that end a stitch: each says what was found, what was needed and what to do.

Every error carries the exit code of the command line (2 the call is wrong, 3 the input cannot be stitched,
4 a file cannot be read or written, 130 interrupted), so that no caller has to keep a table of its own.
"""

from __future__ import annotations


class StitchError(Exception):
    """A reason, in the user's words, why there is no panorama; `exit_code` is what the command line returns."""

    exit_code = 3


class BadRequest(StitchError):
    """The call itself is wrong: an option, a camera file, an array of the wrong shape."""

    exit_code = 2


class UnreadableImage(StitchError):
    """A file cannot be read as a picture, or is damaged."""

    exit_code = 4


class UnwritableOutput(StitchError):
    """A result cannot be written where it was asked for."""

    exit_code = 4


class TooFewMatches(StitchError):
    """The two pictures share too few points to say how the cameras stood."""


class NoOverlap(StitchError):
    """The pictures have no content in common, or the warp brings them nowhere near each other."""


class DegenerateGeometry(StitchError):
    """There are matches, but no pair of cameras explains them."""


class OutputTooLarge(StitchError):
    """The panorama would be larger than what can be held or written."""


class NotEnoughMemory(StitchError):
    """The pictures take more memory than may be used."""


class Cancelled(StitchError):
    """The caller asked to stop; nothing was written."""

    exit_code = 130

    def __init__(self, message: str = "cancelled") -> None:
        super().__init__(message)
