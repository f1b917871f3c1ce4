"""Settings that an earlier release left in files, panoramas and presets, as they have to stand now to mean the same.

Until version 2 of the settings there was one flat projection, the reference's own plane, called PERSPECTIVE; the
viewpoint stayed where the reference was taken, everything was kept, and the field faded to a plane. The target's
exposure was matched to the reference's, or nothing's: `exposure` was yes or no. Imports nothing. (That two pictures
were chosen instead of a list is dealt with in `properties`.)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

VERSION = 2
# What was meant where nothing was said.
THEN = {
    "projection": "REFERENCE", "fade": "PLANE", "holes": "TRANSPARENT", "crop": "FULL", "slide_auto": False,
    "slide": 0.0, "centre": (0.0, 0.0), "fov": 0.0, "light": "REFERENCE",
}  # fmt: skip
# A setting that only came with version 2, and what was meant until one came later.
_NEW = "slide_auto"
_SINCE = {"slide_part": (0.0, 1.0)}


def kept_now(kept: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by name that a panorama or a preset keeps, of whatever version, as they are written now."""
    if _NEW in kept:
        return {**_SINCE, **kept}
    now = {**THEN, **_SINCE, "light": _light(kept.get("exposure", True)), **kept}
    if now["projection"] == "PERSPECTIVE":
        now["projection"] = "REFERENCE"
    return now


def asked_for_exposure(settings: Any, _context: Any = None) -> None:
    """Somebody asks for the exposure as in earlier releases: a script, or a preset of then."""
    settings.light = _light(settings.exposure)


def _light(exposure: bool) -> str:
    return "REFERENCE" if exposure else "NONE"


def mark(settings: Any) -> None:
    """The settings are decided in this version: what nobody set in them means its default of now."""
    if settings.version != VERSION:
        settings.version = VERSION


def bring_up_to_date(settings: Any) -> None:
    """A scene's settings with pictures that an earlier release has chosen: what nobody set there gets the value that
    was its default then. Choices that were set say what they said, by their numbers (see `offered`)."""
    if settings.version == 0 and (settings.reference is not None or settings.target is not None):
        for name, value in THEN.items():
            if not settings.is_property_set(name):
                setattr(settings, name, value if name != "light" else _light(settings.exposure))
        mark(settings)
