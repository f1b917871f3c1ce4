"""What was chosen in making pictures ready: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PreviewOptions:
    """A panorama that is only looked at (`preview`)."""

    pixels: float = 1.4e6
    """px of the panorama: as many as a window shows, and a second or two of work."""

    least_pixels: float = 1.0e6
    """px below which it is made again, larger: how large it becomes is only guessed before it is framed and cropped."""

    most_pixels: float = 2.0e6
    """The same above which it is made again, smaller."""

    tries: int = 2
    """Times that it is made at most: the crop may take another part of it at another size."""

    border_points: int = 16
    """Points along each side of a picture that its outline is guessed by."""


PREVIEW = PreviewOptions()
