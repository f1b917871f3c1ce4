"""Whether the libraries that the engine needs work, asked without loading any of them into Blender.

They are loaded in worker processes only. One of these tries them all, once, when the tab is first drawn; the panel
shows its words about a library that is missing, broken, or made for another processor.
"""

from __future__ import annotations

import bpy

from . import ahead, job

# Kind of the worker's message about a library that cannot be loaded.
BROKEN = "Broken"
# Seconds between two looks at the worker that tries them.
TICK = 0.3

_said: list[str] = []
_trials: list[job.Job] = []
_asked = False


def problem() -> str:
    """What is wrong, in words for the panel; "" where nothing is known to be. Starts the trial, and loads what
    the first click needs; never waits."""
    if not _asked and not bpy.app.background:
        ahead.load()
        begin_trial()
    return _said[-1] if _said else ""


def begin_trial() -> None:
    """Let a worker load the libraries; a timer listens for how that ends."""
    global _asked
    _asked = True
    try:
        folder = job.new_folder(bpy.app.tempdir)
        _trials.append(job.start({"try": True}, folder))
    except OSError as error:
        remember(job.sentence(f"no worker process can be started: {error}"))
        return
    bpy.app.timers.register(listen, first_interval=TICK, persistent=True)


def listen() -> float | None:
    """Seconds until the next look at the trial, as Blender's timers want it; None when it is over."""
    if not _trials:
        return None
    outcome = _trials[-1].poll()
    if outcome is None:
        return TICK
    _trials.pop().close()
    if outcome.kind != job.DONE:
        remember(outcome.words)
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()
    return None


def remember(message: str) -> None:
    """A worker could not load a library."""
    _said.append(message)


def forget() -> None:
    """A worker ran to its end: the libraries work."""
    _said.clear()


def stop() -> None:
    """End a trial that is going on; the next time that the tab is drawn there is another one."""
    global _asked
    _asked = False
    while _trials:
        _trials.pop().close()
    if bpy.app.timers.is_registered(listen):
        bpy.app.timers.unregister(listen)
