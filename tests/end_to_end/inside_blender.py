"""pytest inside a whole Blender, against the extension that is installed there.

    blender -b --python-exit-code 9 --python inside_blender.py -- TOOLS ARGUMENT...

TOOLS: a folder with pytest and what the tests need besides, made with `pip install --target`. Tests import
`edf_stitch`; here that is `bl_ext.user_default.edf_stitch`, each module of it once and under both names.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

INSTALLED = "bl_ext.user_default."


class SameModule(MetaPathFinder, Loader):
    """Finds the installed extension's modules under the name that tests know."""

    def __init__(self) -> None:
        self.specs: dict[str, ModuleSpec | None] = {}

    def find_spec(self, name: str, _path: Any = None, _target: Any = None) -> ModuleSpec | None:
        return ModuleSpec(name, self) if name.split(".")[0] == "edf_stitch" else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(INSTALLED + spec.name)
        self.specs[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """It ran under its own name already; it gets back what the import system has written over."""
        name = module.__spec__.name if module.__spec__ else ""
        if (own := self.specs.get(name)) is not None:
            module.__spec__ = own


def main() -> int:
    tools, *arguments = sys.argv[sys.argv.index("--") + 1 :]
    sys.path.append(tools)  # after Blender's own and the extension's: NumPy is theirs
    sys.meta_path.insert(0, SameModule())
    import pytest

    return int(pytest.main(["-p", "no:cacheprovider", *arguments]))


if __name__ == "__main__":
    sys.exit(main())
