"""EDF Stitch: photographs taken from different places, stitched into one picture seen from one place.

Blender requires `register` and `unregister` here; Python users find `stitch` here. Both are reached lazily: importing
this package loads neither Blender nor NumPy, so pip, pytest, Blender's extension manager and the worker can all do it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .core.options import StitchOptions
    from .core.pipeline import stitch
    from .core.system.errors import StitchError

    __version__: str

__all__ = ["StitchError", "StitchOptions", "__version__", "register", "stitch", "unregister"]

_HOMES = {"StitchError": ".core.system.errors", "StitchOptions": ".core.options", "stitch": ".core.pipeline"}


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
