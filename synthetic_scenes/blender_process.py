"""Finding something that can render, and having it render a job in a process of its own.

Where bpy is a module, this Python renders. A whole Blender cannot import this package by its name: it lies in no folder
that Blender knows, or in one with a NumPy that is not Blender's. So Blender gets the package's own files alone, in an
archive named by PYTHONPATH; what renders needs no other library than Blender's NumPy.
"""
from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

from ..core.system.errors import StitchError

# Set by the extension for its workers: the Blender that they were started from.
BLENDER_VARIABLE = "EDF_BLENDER"
FOLDER = Path(__file__).absolute().parent.parent
# The package's name in the archive, and what of it renders.
NAME = "edf_stitch"
RENDERING = ("core", "synthetic_scenes")
RENDER = f"from {NAME}.synthetic_scenes.render import main; main()"
# What a crash leaves on stderr is long; its end tells most.
LAST_LINES = 12


class RenderFailed(StitchError):
    """No picture came out of Blender."""


def find_blender() -> str:
    """The Blender that renders; empty where bpy is a module and this Python can. Raises RenderFailed."""
    blender = os.environ.get(BLENDER_VARIABLE)
    if not blender and importlib.util.find_spec("bpy"):
        return ""
    blender = blender or shutil.which("blender")
    if not blender:
        raise RenderFailed(
            "there is no Blender to render the scenes with: install the package with its extra `blender`, put blender "
            f"on the PATH, or name it in the environment variable {BLENDER_VARIABLE}"
        )
    return blender


def run_job(job: dict[str, Any], folder: Path) -> None:
    """Renders a job (see `render`) into a folder. Raises RenderFailed with the end of what Blender said."""
    path = folder / "job.json"
    path.write_text(json.dumps(job), "utf-8")
    command, environment = _render_command(folder / "package.zip")
    command += ["--", str(path), str(folder)]
    done = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace"
    )
    # bpy as a module may crash on its way out, when everything has been written
    if done.returncode and not (folder / "cameras.json").exists():
        said = "\n".join((done.stdout + done.stderr).strip().splitlines()[-LAST_LINES:])
        raise RenderFailed(f"rendering ended with {done.returncode}: {said}")
    if not (folder / "cameras.json").exists():
        raise RenderFailed(f"{command[0]} rendered nothing, and said so nowhere")


def _render_command(archive: Path) -> tuple[list[str], dict[str, str]]:
    """The beginning of a command line that renders, and its environment; a job's file and a folder follow behind `--`.
    For a whole Blender, the package is written to the archive. Raises RenderFailed."""
    blender = find_blender()
    if not blender:
        return [sys.executable, "-s", "-P", "-m", f"{__name__.rpartition('.')[0]}.render"], dict(os.environ)
    write_package(archive)
    # Blender reads its options from left to right.
    options = ["-b", "--factory-startup", "--python-exit-code", "1", "--python-use-system-env", "--python-expr", RENDER]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return [blender, *options], {**environment, "PYTHONPATH": str(archive), "PYTHONNOUSERSITE": "1"}


def write_package(archive: Path) -> None:
    """A zip file that Python imports: the sources of what renders, as the package NAME."""
    sources = [FOLDER / "__init__.py", *(path for name in RENDERING for path in (FOLDER / name).rglob("*.py"))]
    with zipfile.ZipFile(archive, "w") as package:
        for path in sources:
            package.write(path, Path(NAME, path.relative_to(FOLDER)))
