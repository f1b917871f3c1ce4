"""Whether the libraries that the engine needs can be found, asked without loading any of them into Blender.

They are loaded in the worker process only. Whether one that is there works, shows when the first worker starts: its
words about a broken one are remembered here for the panel.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec

LIBRARIES = {"numpy": "NumPy", "cv2": "OpenCV", "scipy": "SciPy", "poselib": "PoseLib", "OpenEXR": "OpenEXR",
             "exifread": "ExifRead"}  # fmt: skip
ADVICE = "reinstall EDF Stitch from its zip, and switch off other add-ons that bring their own copies"
# Kind of the worker's message about a library that cannot be loaded.
BROKEN = "Broken"

_said: list[str] = []


def problem() -> str:
    """What is wrong, in words for the panel; "" where nothing is known to be."""
    return _said[-1] if _said else _absent()


def remember(message: str) -> None:
    """A worker could not load a library."""
    _said.append(message)


def forget() -> None:
    """A worker ran to its end: the libraries work."""
    _said.clear()


@cache
def _absent() -> str:
    missing = [words for name, words in LIBRARIES.items() if find_spec(name) is None]
    return f"{', '.join(missing)} cannot be found: {ADVICE}" if missing else ""
