"""Finding something that can render, and having it render a job in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from ..core.system.errors import StitchError

# Set by the extension for its workers: the Blender that they were started from.
BLENDER_VARIABLE = "EDF_BLENDER"
IN_BLENDER = Path(__file__).absolute().parent / "in_blender.py"
# What a crash leaves on stderr is long; its end tells most.
LAST_LINES = 12


class RenderFailed(StitchError):
    """No picture came out of Blender."""


def render_command() -> list[str]:
    """The beginning of a command line that renders; a job's file and a folder follow. Raises RenderFailed."""
    blender = os.environ.get(BLENDER_VARIABLE)
    if not blender and importlib.util.find_spec("bpy"):
        return [sys.executable, str(IN_BLENDER), "--", "render"]
    blender = blender or shutil.which("blender")
    if not blender:
        raise RenderFailed(
            "there is no Blender to render the scenes with: install the package with its extra `blender`, put blender "
            f"on the PATH, or name it in the environment variable {BLENDER_VARIABLE}"
        )
    return [blender, "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(IN_BLENDER), "--", "render"]


def run_job(job: dict[str, Any], folder: Path) -> None:
    """Renders a job (see `render`) into a folder. Raises RenderFailed with the end of what Blender said."""
    path = folder / "job.json"
    path.write_text(json.dumps(job), "utf-8")
    command = [*render_command(), str(path), str(folder)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace")
    # bpy as a module may crash on its way out, when everything has been written
    if done.returncode and not (folder / "cameras.json").exists():
        said = "\n".join((done.stdout + done.stderr).strip().splitlines()[-LAST_LINES:])
        raise RenderFailed(f"rendering ended with {done.returncode}: {said}")
    if not (folder / "cameras.json").exists():
        raise RenderFailed(f"{command[0]} rendered nothing, and said so nowhere")
