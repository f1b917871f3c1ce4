"""EDF Stitch: photographs taken from different places, stitched into one picture seen from one place.

Blender requires `register` and `unregister` here; Python users find `stitch` here. Both are reached lazily: importing
this package loads neither Blender nor NumPy, so pip, pytest, Blender's extension manager and the worker can all do it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .core.cameras.sources import CameraRequest
    from .core.commands.from_python import stitch
    from .core.commands.python_result import Panorama
    from .core.options import StitchOptions
    from .core.system.errors import (
        BadRequest,
        Cancelled,
        DegenerateGeometry,
        NoOverlap,
        NotEnoughMemory,
        OutputTooLarge,
        StitchError,
        TooFewMatches,
        UnreadableImage,
        UnwritableOutput,
    )

    __version__: str

# What is public: it changes only with a version that says so (docs/reference.md). Blender calls register, unregister.
__all__ = [
    "BadRequest", "CameraRequest", "Cancelled", "DegenerateGeometry", "NoOverlap", "NotEnoughMemory", "OutputTooLarge",
    "Panorama", "StitchError", "StitchOptions", "TooFewMatches", "UnreadableImage", "UnwritableOutput", "__version__",
    "register", "stitch", "unregister",
]  # fmt: skip

_HOMES = {
    "CameraRequest": ".core.cameras.sources", "Panorama": ".core.commands.python_result",
    "StitchOptions": ".core.options", "stitch": ".core.commands.from_python",
} | dict.fromkeys(
    (
        "BadRequest", "Cancelled", "DegenerateGeometry", "NoOverlap", "NotEnoughMemory", "OutputTooLarge",
        "StitchError", "TooFewMatches", "UnreadableImage", "UnwritableOutput",
    ), ".core.system.errors",
)  # fmt: skip


def register() -> None:
    """Blender switches the extension on."""
    from . import edf_addon

    edf_addon.register()


def unregister() -> None:
    """Blender switches the extension off."""
    from . import edf_addon

    edf_addon.unregister()


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name], __name__), name)
    globals()[name] = value
    return value


def _version() -> str:
    """The manifest is the one place where the version stands; it ships with the wheel and with the extension."""
    import tomllib
    from pathlib import Path

    with open(Path(__file__).with_name("blender_manifest.toml"), "rb") as manifest:
        return str(tomllib.load(manifest)["version"])
