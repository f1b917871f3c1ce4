"""Is everything here that `make setup` cannot install itself? Standard library only, and readable by any Python 3.

Prints nothing and exits 0 when all is there. Otherwise prints one line on stdout, the apt command that brings exactly
what is missing, and exits 1; where no apt command would help (an old Python) it says so on stderr and exits 2.
"""

from __future__ import annotations

import ctypes
import importlib.util
import sys
from typing import Any, Callable, List  # noqa: UP035  (an old Python must get as far as the message about its age)

# What bpy's shared library links to and a machine without a desktop lacks -> the Debian or Ubuntu package it is in.
LIBRARIES = {
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libGL.so.1": "libgl1",
}


def missing_packages(
    load: Callable[[str], Any] = ctypes.CDLL,
    find: Callable[[str], Any] = importlib.util.find_spec,
    wants_bpy: bool = sys.platform.startswith("linux") and sys.version_info < (3, 12),
) -> List[str]:  # noqa: UP006
    """Names of the packages to install; `load` raises OSError for a library that is not there, as ctypes does."""
    packages = []
    # Debian's Python has `venv` without `ensurepip`, which makes environments without pip.
    if find("venv") is None or find("ensurepip") is None:
        packages.append("python3-venv")
    for library, package in LIBRARIES.items() if wants_bpy else ():
        try:
            load(library)
        except OSError:
            packages.append(package)
    return packages


def main() -> int:
    if sys.version_info < (3, 11):  # noqa: UP036  (this is where an older one is told)
        have = ".".join(map(str, sys.version_info[:2]))
        print(f"Python 3.11 or newer is needed, this is {have}: make setup PYTHON=python3.11", file=sys.stderr)
        return 2
    packages = missing_packages()
    if packages:
        print("Some system packages are missing; as root, or with sudo, run:", file=sys.stderr)
        print("apt-get install -y " + " ".join(packages))
    return 1 if packages else 0


if __name__ == "__main__":
    sys.exit(main())
