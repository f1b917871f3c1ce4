"""The parent's side of a stitch: starts the worker process, listens without ever waiting for it, ends it, tidies up.

Nothing that comes out of the pipe is believed: lines that are no JSON, half lines, floods and silence hurt nobody.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from ..explain import sentence
from . import command

# Seconds that a worker gets to end by itself when asked to; nothing is lost when it is killed.
GRACE = 2.0
# Seconds that what was said last may take on its way after the worker has ended.
LATE = 10.0
# Bytes: a longer line is none of ours; and what is kept of stderr for a message.
LONGEST_LINE, LONGEST_TAIL = 1 << 16, 4096
WORKER = "core.commands.worker"


@dataclass(frozen=True)
class Outcome:
    """How a job ended. kind: DONE, CANCELLED, or the name of an error; words: for the artist, "" when done; result:
    what result.json holds."""

    kind: str
    words: str = ""
    result: dict[str, Any] = field(default_factory=dict)


DONE, CANCELLED, CRASHED = "done", "Cancelled", "Crashed"


class Job:
    """A worker process on a folder that belongs to it alone. `poll` from time to time; `close` in the end, always."""

    def __init__(self, folder: Path, line: Sequence[str], environment: Mapping[str, str]) -> None:
        self.folder = folder
        self.stage, self.share = "read", 0.0
        self.cancelled = False
        self._deadline = self._ended = float("inf")
        self._last: dict[str, Any] = {}
        self._tail = b""
        self._process: subprocess.Popen[bytes] = subprocess.Popen(
            list(line), env=dict(environment), cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, **command.own_group(hidden=True),
        )  # fmt: skip
        self._listeners = [
            threading.Thread(target=listen, args=(pipe,), daemon=True)
            for listen, pipe in ((self._listen, self._process.stdout), (self._keep_tail, self._process.stderr))
        ]
        for listener in self._listeners:
            listener.start()

    def poll(self) -> Outcome | None:
        """How it ended; None while it works. Never waits."""
        status = self._process.poll()
        if status is None:
            if time.monotonic() > self._deadline:
                self._process.kill()
            return None
        self._ended = min(self._ended, time.monotonic())
        is_heard = not any(listener.is_alive() for listener in self._listeners)
        return self._outcome(status) if is_heard or time.monotonic() > self._ended + LATE else None

    def cancel(self) -> None:
        """Ask the worker to stop; a later `poll` kills one that does not. Whatever it still makes is not wanted."""
        if not self.cancelled:
            self.cancelled, self._deadline = True, time.monotonic() + GRACE
            try:
                command.ask_to_stop(self._process)
            except OSError:  # Windows: a program without a console cannot send CTRL_BREAK; this says the same
                if self._process.stdin is not None:
                    self._process.stdin.close()

    def close(self) -> None:
        """End the worker if it still works, and remove its folder with all that is in it."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for listener in self._listeners:
            listener.join(timeout=5)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        remove(self.folder)

    def _outcome(self, status: int) -> Outcome:
        if self.cancelled:
            return Outcome(CANCELLED, "Cancelled. Nothing was changed.")
        if "error" in self._last:
            return Outcome(str(self._last.get("kind", CRASHED)), sentence(str(self._last["error"])))
        if status == 0 and self._last.get("done") is True:
            try:
                return Outcome(DONE, "", json.loads((self.folder / "result.json").read_text("utf-8")))
            except (OSError, ValueError) as error:
                return Outcome(CRASHED, f"The worker's result cannot be read ({error}). Please report it.")
        return Outcome(CRASHED, _crash(status, self._tail.decode("utf-8", "replace")))

    def _listen(self, pipe: IO[bytes]) -> None:
        rest = b""
        is_too_long = False
        while chunk := os.read(pipe.fileno(), 1 << 16):
            first, *others = chunk.split(b"\n")
            rest, is_too_long = rest + first, is_too_long or len(rest) + len(first) > LONGEST_LINE
            if is_too_long:
                rest = b""
            for following in others:
                self._hear(rest)
                rest, is_too_long = following, False

    def _keep_tail(self, pipe: IO[bytes]) -> None:
        while chunk := os.read(pipe.fileno(), 1 << 16):
            self._tail = (self._tail + chunk)[-LONGEST_TAIL:]

    def _hear(self, line: bytes) -> None:
        if not line.startswith(b"{"):
            return
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            return
        if "error" in said or "done" in said:
            self._last = said
        stage, share = said.get("stage"), said.get("share")
        if isinstance(stage, str) and isinstance(share, (int, float)) and 0 <= share <= 1:
            self.stage, self.share = stage[:40], max(self.share, float(share))


def start(job: dict[str, Any], folder: Path) -> Job:
    """A worker on a folder (see `new_folder`) that holds the job's pictures."""
    hand_over(job, folder)
    return Job(folder, *command.worker_command([str(folder)], WORKER))


def start_ahead(folder: Path, first: Mapping[str, Any] | None = None) -> Job:
    """A worker that loads what it takes, and waits for a job in a folder (see `hand_over`). first: the job of a set,
    of which it composes a small panorama meanwhile."""
    if first is not None:
        (folder / "ahead.json").write_text(json.dumps(first), "utf-8")
    return Job(folder, *command.worker_command([str(folder), "wait"], WORKER))


def hand_over(job: dict[str, Any], folder: Path) -> None:
    """Leave a job in its folder, whole at once."""
    beside = folder / "job.json.part"
    beside.write_text(json.dumps(job), "utf-8")
    os.replace(beside, folder / "job.json")


def new_folder(parent: str | None = None) -> Path:
    """An empty folder for one job, in Blender's own temporary one, which goes when Blender does."""
    return Path(tempfile.mkdtemp(prefix="edf_stitch_", dir=parent or None))


def remove(folder: Path) -> None:
    """Take a job's folder away with all that is in it."""
    shutil.rmtree(folder, ignore_errors=True)


def _crash(status: int, tail: str) -> str:
    if status == -getattr(signal, "SIGKILL", 9):
        return (
            "The worker was ended by the system, most likely for want of memory: stitch at a smaller scale, or close "
            "other programs. Nothing in Blender was changed."
        )
    try:
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status & 0xFFFFFFFF:#x}"
    except ValueError:
        how = f"exit status {status}"
    last = next((line.strip() for line in reversed(tail.splitlines()) if line.strip()), "")
    said = f" Its last words: {last[:200]}" if last else ""
    return f"The worker broke down ({how}). Nothing in Blender was changed. Please report it.{said}"
