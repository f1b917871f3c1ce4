"""Picture files as the engine writes and reads them, from a test that runs inside Blender.

A whole Blender may have another OpenEXR loaded than the engine's, and one process does not survive two: there the work
is done where the extension does it too, in a process of its own.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.edf_addon.jobs import command

_WRITE = """
import sys, numpy as np
from pathlib import Path
from edf_stitch.core.pictures.encoding import encode_picture
given = np.load(sys.argv[2])
alpha = given["alpha"] if given["alpha"].size else None
Path(sys.argv[1]).write_bytes(encode_picture(given["pixels"], alpha, 32, ".exr")[0])
"""
_READ = """
import sys, numpy as np
from edf_stitch.core.pictures.picture import load_picture
p = load_picture(sys.argv[1])
np.savez(sys.argv[2], pixels=p.pixels, alpha=np.empty(0) if p.alpha is None else p.alpha, view=p.view, bits=p.bits)
"""


def write(path: Path, pixels: np.ndarray, alpha: np.ndarray | None = None) -> str:
    """.png with 8 bits or .exr, of scene-linear straight pixels; returns the path for bpy."""
    if path.suffix == ".exr" and bpy.app.binary_path:
        beside = path.with_suffix(".npz")
        np.savez(beside, pixels=pixels, alpha=np.empty(0) if alpha is None else alpha)
        _outside(_WRITE, path, beside)
    else:
        path.write_bytes(encode_picture(pixels, alpha, 8 if path.suffix == ".png" else 32, path.suffix)[0])
    return str(path)


def read(path: Path) -> SimpleNamespace:
    """A picture: pixels, alpha, view, bits as core's Picture has them."""
    if path.suffix != ".exr" or not bpy.app.binary_path:
        return load_picture(path)
    beside = path.with_suffix(".npz")
    _outside(_READ, path, beside)
    with np.load(beside) as found:
        alpha = found["alpha"] if found["alpha"].size else None
        picture = SimpleNamespace(
            pixels=found["pixels"], alpha=alpha, view=found["view"], bits=int(found["bits"])
        )
    beside.unlink()
    return picture


def _outside(code: str, *arguments: Path) -> None:
    line, environment = command.worker_command([])
    python = line[: line.index("-m")]
    subprocess.run([*python, "-c", code, *map(str, arguments)], env=environment, check=True, timeout=120)
