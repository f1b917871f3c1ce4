"""`blender -b --command edf …`: hands everything over to a worker process and returns its exit status.

The work is not done inside Blender: NumPy is already loaded here, with as many BLAS threads as there are cores, and the
results' bytes would depend on that. A worker also ends cleanly on Ctrl-C, which Blender swallows.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import bpy

PACKAGE = __name__.rsplit(".", 3)[0]
# Not resolved: developers link a checkout into the extensions folder, and the wheels lie beside the link.
FOLDER = Path(__file__).absolute().parents[2]
# Tells the worker with which Blender to render; synthetic_scenes reads it.
BLENDER_VARIABLE = "EDF_BLENDER"
# The signals that ask to stop, as far as this system has them.
STOPPING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


def run(argv: list[str]) -> int:
    """What Blender calls, with everything that stands behind `--command edf`."""
    return run_worker(*worker_command(argv))


def worker_command(argv: list[str], module: str = "") -> tuple[list[str], dict[str, str]]:
    """The command line and the environment of a process that does what `edf ARGV…` does, or what a module of ours
    (its name within the package) does with ARGV."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    name = PACKAGE
    if PACKAGE.startswith("bl_ext.") or bpy.app.binary_path:
        # Inside Blender the package has a name that only Blender can import: name its folder instead. Blender ignores
        # the user's Python variables, so they must not reach its Python here either.
        name = FOLDER.name
        environment = {key: value for key, value in environment.items() if not key.startswith("PYTHON")}
        environment["PYTHONPATH"] = os.pathsep.join([str(FOLDER.parent), *_wheels_folders()])
    if bpy.app.binary_path:  # empty where bpy is a module
        environment[BLENDER_VARIABLE] = bpy.app.binary_path
    return [sys.executable, "-s", "-P", "-m", f"{name}.{module}" if module else name, *argv], environment


def run_worker(command: list[str], environment: Mapping[str, str]) -> int:
    """Run it to its end, pass on what asks it to stop, return its exit status (130 where Ctrl-C ended it)."""
    sys.stdout.flush()
    with _signals_held() as forward_to:
        worker = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, **own_group())
        forward_to(worker)
        status = worker.wait()
    return 128 - status if status < 0 else status


def own_group(hidden: bool = False) -> dict[str, Any]:
    """What Popen needs to know so that a worker gets a Ctrl-C from here, once, and not from the terminal as well: a
    second one would break into its tidying up. hidden: Windows opens no console for it."""
    if sys.platform == "win32":
        no_window = subprocess.CREATE_NO_WINDOW if hidden else 0
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | no_window}
    return {"process_group": 0}


def ask_to_stop(worker: subprocess.Popen) -> None:
    """As Ctrl-C does, whatever came: that is what the worker tidies up after."""
    if sys.platform == "win32":
        worker.send_signal(signal.CTRL_BREAK_EVENT)
    else:
        worker.send_signal(signal.SIGINT)


@contextmanager
def _signals_held() -> Iterator[Callable[[subprocess.Popen], None]]:
    """Signals that ask to stop go to the worker, also those that come before it is known."""
    workers: list[subprocess.Popen] = []
    asked: list[int] = []

    def handle(number: int, _frame: FrameType | None) -> None:
        if not workers:
            asked.append(number)
        for worker in workers:
            ask_to_stop(worker)

    def forward_to(worker: subprocess.Popen) -> None:
        workers.append(worker)
        if asked:  # before it was known; what comes from now on it has got already
            ask_to_stop(worker)

    previous = {number: signal.signal(number, handle) for number in STOPPING}
    try:
        yield forward_to
    finally:
        for number, handler in previous.items():
            # None stands for Blender's own handler, which Python cannot put back.
            signal.signal(number, signal.default_int_handler if handler is None else handler)


def _wheels_folders() -> list[str]:
    """Where Blender has unpacked the wheels: beside the repository that this extension lies in, or, where this is a
    checkout, beside the user's, which holds the installed one."""
    places = FOLDER.parent.parent / ".local", Path(bpy.utils.user_resource("EXTENSIONS"), ".local")
    return [entry for entry in sys.path if any(Path(entry).is_relative_to(place) for place in places)]
