"""Modules that the first click would otherwise wait for, loaded in a thread while an artist looks at the panel."""

from __future__ import annotations

import threading
from importlib import import_module

from .. import idnames

# Those that adding pictures and starting a stitch need: a tenth of a second of loading.
MODULES = ("pictures.listing", "pictures.camera_raw", "pictures.containers", "options")
# This extension, whatever it is called.
PACKAGE = idnames.__name__.rsplit(".", 2)[0]


def load() -> threading.Thread:
    """Begin to load them; harmless where they are loaded already."""
    thread = threading.Thread(target=_load, daemon=True)
    thread.start()
    return thread


def _load() -> None:
    for name in MODULES:
        import_module(f"{PACKAGE}.core.{name}")
