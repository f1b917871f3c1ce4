"""What every operator with long work is: modal from a window, which stays free; blocking from a script and in `-b`."""

from __future__ import annotations

import time
import traceback
from pathlib import Path
from typing import Any

import bpy

from .. import explain, status
from ..bridge.images import Unusable
from . import health, job

# Seconds between two looks at the worker.
TICK = 0.1

_current: job.Job | None = None
# Whether that is a picture which follows the frame: nobody waits for it, and it makes way for any other work.
_is_following = False
# A worker that was started before there was something to do, so that this takes less time then.
_ahead: job.Job | None = None


def is_working() -> bool:
    """Whether a worker is at what an artist asked for; there is one at a time."""
    return _current is not None and not _is_following


def start_ahead(first: dict[str, Any] | None = None) -> None:
    """Have a worker ready for the picture that follows the frame, if none is. first: see `job.start_ahead`."""
    global _ahead
    if _ahead is not None and _ahead.poll() is not None:
        end_ahead()  # it has waited long enough
    if _ahead is None:
        _ahead = job.start_ahead(job.new_folder(bpy.app.tempdir), first)


def end_ahead() -> None:
    """End the worker that waits, if one does."""
    global _ahead
    if _ahead is not None:
        _ahead.close()
        _ahead = None


def _take_ahead() -> job.Job | None:
    """The worker that waits, if it still does: whoever takes it ends it."""
    global _ahead
    if _ahead is not None and _ahead.poll() is not None:
        end_ahead()
    taken, _ahead = _ahead, None
    return taken


def make_way() -> bool:
    """End the picture that follows the frame, without a word; returns whether one was being made."""
    was_made = _is_following
    if was_made:
        _end()
    return was_made


def cancel() -> None:
    """Ask the worker to stop, whoever started it."""
    if _current is not None:
        _current.cancel()
        status.now.cancelling = True


def stop(words: str) -> None:
    """End the work at once, without a result: a file is loaded, the extension is switched off, Blender quits."""
    if is_working():
        status.end(words)
    _end()
    end_ahead()


def _end() -> None:
    global _current, _is_following
    if _current is not None:
        _current.close()
    _current, _is_following = None, False


class LongWork:
    """A mix-in for operators: `prepare` makes the job, `finish` takes its result into the file."""

    # Of a picture that follows the frame: its progress is not shown.
    follows = False
    # What is taken into the file in the end, in messages.
    makes = "the panorama"
    when_cancelled = "Cancelled. Nothing was changed."
    _job: job.Job
    _request: dict[str, Any]
    _timer: Any = None
    # What was said last of how far the work is.
    _said = ""

    def prepare(self, context: bpy.types.Context, folder: Path) -> dict[str, Any]:
        """The job (core/commands/worker.py), with all its files in `folder`. Raises Unusable."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, folder: Path, result: dict[str, Any]) -> str:
        """Takes the files of a finished job; returns words for the status."""
        raise NotImplementedError

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return not is_working()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Blocks until it is done, failed, or interrupted by Ctrl-C."""
        if not self._start(context):
            return {"CANCELLED"}
        while (outcome := self._look()) is None:
            try:
                time.sleep(TICK / 4)
            except KeyboardInterrupt:
                cancel()
        return self._take(context, outcome)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Returns at once; `modal` looks after the worker."""
        if context.window is None or bpy.app.background:
            return self.execute(context)
        if not self._start(context):
            return {"CANCELLED"}
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Everything but the timer and ESC goes on to the editors."""
        if _current is not self._job:  # stopped by somebody else
            self._forget_timer(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS" and not self.follows and _is_over_editor(context, event):
            cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        outcome = self._look()
        if outcome is None:
            self._say_how_far(context)
            return {"PASS_THROUGH"}
        self._forget_timer(context)
        return self._take(context, outcome)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: another file is loaded, or the window closes."""
        if _current is self._job:
            stop("Cancelled. Nothing was changed.")
        self._forget_timer(context)

    def _say_how_far(self, context: bpy.types.Context) -> None:
        """In the status bar and the panels, where that is not what they say already: drawing takes time of the work."""
        now = status.now
        far = "Cancelling…" if now.cancelling else explain.how_far(now.stage, now.share, status.seconds_left())
        if not self.follows and far != self._said:
            self._said = far
            _say_in_status_bar(f"EDF Stitch: {far}")
            redraw(context)

    def _look(self) -> job.Outcome | None:
        outcome = self._job.poll()
        if not self.follows:
            status.now.stage, status.now.share = self._job.stage, self._job.share
        return outcome

    def _start(self, context: bpy.types.Context) -> bool:
        global _current, _is_following
        if is_working():
            self.report({"ERROR"}, "EDF Stitch is still at work: wait for it, or cancel it.")  # type: ignore[attr-defined]
            return False
        make_way()
        ahead, folder = _take_ahead() if self.follows else None, None
        end_ahead()  # what it does ahead is of the panorama before
        try:
            folder = job.new_folder(bpy.app.tempdir) if ahead is None else ahead.folder
            self._request = self.prepare(context, folder)
            if ahead is None:
                self._job = _current = job.start(self._request, folder)
            else:
                job.hand_over(self._request, folder)
                self._job = _current = ahead
        except Exception as error:
            if ahead is not None:
                ahead.close()
            elif folder is not None:
                job.remove(folder)
            return self._refuse(_in_words(error))
        _is_following = self.follows
        if not self.follows:
            status.begin()
        return True

    def _refuse(self, words: str) -> bool:
        words = job.sentence(words)
        status.end(words, failed=True)
        self.report({"ERROR"}, words)  # type: ignore[attr-defined]
        return False

    def _take(self, context: bpy.types.Context, outcome: job.Outcome) -> set[str]:
        """The end of a job, whatever it was; its folder goes in any case."""
        words, failed = outcome.words, outcome.kind not in (job.DONE, job.CANCELLED)
        if outcome.kind == job.CANCELLED:
            words = self.when_cancelled
        before = there()
        try:
            if outcome.kind == job.DONE:
                health.forget()
                words = self.finish(context, self._job.folder, outcome.result)
        except Exception as error:
            words, failed = job.sentence(f"{self.makes} cannot be taken over: {_in_words(error)}"), True
        finally:
            _end()
        if outcome.kind == health.BROKEN:
            health.remember(words)
        status.end(words, failed, there() - before)
        redraw(context)
        self.report({"ERROR" if failed else "INFO"}, words)  # type: ignore[attr-defined]
        return {"FINISHED"} if outcome.kind == job.DONE and not failed else {"CANCELLED"}

    def _forget_timer(self, context: bpy.types.Context) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        if not self.follows:
            _say_in_status_bar(None)


def hand_on(operator: Any, call: Any, how: str, **given: Any) -> set[str]:
    """Leaves the work of an operator to another one; what that one refuses, this one reports, and Blender shows no
    traceback. how: see `opening.Browsing.how`."""
    try:
        done: set[str] = call(how, **given)
    except RuntimeError as error:
        operator.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
        return {"CANCELLED"}
    return {"FINISHED"} if done == {"RUNNING_MODAL"} else done


def there() -> frozenset[int]:
    """The session_uid of every image and movie clip of the file."""
    return frozenset(one.session_uid for kind in (bpy.data.images, bpy.data.movieclips) for one in kind)


def _is_over_editor(context: bpy.types.Context, event: bpy.types.Event) -> bool:
    """Whether the pointer is over an Image Editor, or there is no window that it could be in."""
    if context.window is None:
        return True
    return any(
        area.type == "IMAGE_EDITOR"
        and 0 <= event.mouse_x - area.x < area.width and 0 <= event.mouse_y - area.y < area.height
        for area in context.window.screen.areas
    )


def _say_in_status_bar(words: str | None) -> None:
    """In every workspace, so that a job is seen wherever the artist goes; None: what Blender says there."""
    for workspace in bpy.data.workspaces:
        workspace.status_text_set(words)


def _in_words(error: Exception) -> str:
    """What went wrong on Blender's side; a traceback is for the console only."""
    if isinstance(error, (Unusable, OSError)):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory for pictures of this size"
    traceback.print_exception(error)
    return f"internal error, please report it: {type(error).__name__}: {error}"


def redraw(context: bpy.types.Context) -> None:
    """The panels that show what goes on, in every window."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


@bpy.app.handlers.persistent
def _before_loading(*_: Any) -> None:
    stop("Cancelled, because another file was opened.")


def register() -> None:
    """Watch for files being opened."""
    bpy.app.handlers.load_pre.append(_before_loading)


def unregister() -> None:
    """End whatever is at work."""
    stop("Cancelled. Nothing was changed.")
    health.stop()
    if _before_loading in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(_before_loading)
