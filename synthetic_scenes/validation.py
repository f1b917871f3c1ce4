"""`edf validate`: every scene in a process of its own, resumable, in shards; then the report.

A scene is finished when FOLDER/scenes/NAME.json is there and was made from the same program: what it was made from is
kept with its figures. Shards share a folder, or their `scenes` folders are put together afterwards; whoever finds all
scenes of a suite finished writes the report, and finds the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from ..core.batch.pieces import read_json
from ..core.output.json_file import json_bytes
from ..core.system.errors import BadRequest, UnwritableOutput
from ..core.system.output_files import OutputFiles
from .blender_process import LAST_LINES, find_blender
from .scene_process import SCHEMA, file_name
from .suites import SIZES, SUITES, heading
from .thresholds import Verdict, judge
from .validation_report import report_files

PACKAGE = __package__
# What a scene's figures depend on; judging and showing them anew needs no new measuring.
PARTS = ("core", "synthetic_scenes")
ONLY_SHOWING = {
    "thresholds.py", "set_thresholds.py", "pair_bars.py", "limits.py", "validation_report.py", "report_page.py",
    "set_page.py", "set_names.py", "slider.py", "validation.py", "demo.py",
}  # fmt: skip
# A scene of the full suite takes up to 2 GB, and its renders take all cores anyway.
MOST_AT_ONCE = 4
Tell = Callable[[str], None]


@dataclass(frozen=True)
class ValidationRequest:
    """What is to be validated, and where it goes.

    suite: one of SUITES; scenes: instead of the suite's own, each the name of a scene or set, or
    `name:baseline=2,…`; shard: (I, N), the
    I-th (from 1) of N runs that share the work; resume: keep finished scenes; overwrite: replace a report that is
    there. Raises BadRequest.
    """

    folder: Path
    suite: str = "quick"
    scenes: tuple[str, ...] = ()
    shard: tuple[int, int] = (1, 1)
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.suite not in SUITES:
            raise BadRequest(f"no suite {self.suite!r}; there are: {', '.join(SUITES)}")
        for scene in self.scenes:
            heading(scene, self.size)
        if not 1 <= self.shard[0] <= self.shard[1]:
            raise BadRequest(f"shard {self.shard[0]}/{self.shard[1]}: it is I/N with I from 1 to N")
        names = [file_name(scene) for scene in self.all_scenes]
        if len(set(names)) < len(names):
            raise BadRequest("a scene is named twice")

    @property
    def all_scenes(self) -> tuple[str, ...]:
        """All, in order, whoever measures them."""
        return self.scenes or SUITES[self.suite]

    @property
    def own_scenes(self) -> tuple[str, ...]:
        """Those of this shard."""
        index, count = self.shard
        return self.all_scenes[index - 1 :: count]

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of landscape pictures."""
        return SIZES[self.suite]


@dataclass(frozen=True)
class Validation:
    """How a validation ended: verdict, or None where other shards have scenes still to do; results of all that are
    finished; files written."""

    verdict: Verdict | None
    results: list[dict[str, Any]]
    missing: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    @property
    def exit_code(self) -> int:
        """0, or 1 below the thresholds. An unfinished suite is judged by its finished scenes."""
        verdict = self.verdict or judge(self.results, complete=False)
        return 0 if verdict.passed else 1


def run_validation(request: ValidationRequest, tell: Tell) -> Validation:
    """Measures this shard's scenes and, where with them all are there, writes report.json, .csv, .html and timing.json.

    tell: is told what happens, a line each. Raises BadRequest, UnwritableOutput, RenderFailed (nothing can render).
    """
    folder, mark = request.folder, made_from()
    report_names = ("report.json", "report.csv", "report.html", "timing.json")
    if not (request.resume or request.overwrite) and _found(request, ""):
        raise UnwritableOutput(
            f"{folder} holds scenes of an earlier validation: use --resume to go on with it, --overwrite to measure "
            "everything again, or choose another folder"
        )
    OutputFiles(overwrite=True).check_folder(folder, report_names)
    find_blender()
    done = _found(request, mark) if request.resume else {}
    # what failed may do better now
    todo = [scene for scene in request.own_scenes if done.get(scene, {}).get("status") != "done"]
    if done:
        tell(f"{len(done)} of {len(request.all_scenes)} scenes are there already")
    folder.mkdir(parents=True, exist_ok=True)
    if not request.resume:
        for scene in todo:  # else what an earlier run left would pass for this one's, should its process crash
            _entry(folder, scene).unlink(missing_ok=True)
    _measure_all(request, todo, mark, tell)
    found = _found(request, mark)
    results = [found[scene] for scene in request.all_scenes if scene in found]
    missing = tuple(scene for scene in request.all_scenes if scene not in found)
    if missing:
        return Validation(None, results, missing)
    complete = not request.scenes
    version = str(import_module(PACKAGE.rpartition(".")[0]).__version__)
    files = report_files(results, request.suite, complete, version)
    files["timing.json"] = json_bytes({
        scene: read_json(_entry(folder, scene).with_suffix(".timing.json")) for scene in request.all_scenes
    })  # fmt: skip
    with OutputFiles(overwrite=True) as out:
        for name, data in files.items():
            out.add_to_folder(folder, name, data)
    return Validation(judge(results, complete), results, (), tuple(folder / name for name in files))


def made_from() -> str:
    """A mark of the program as it is: another one's figures are not this one's."""
    root = Path(__file__).absolute().parent.parent
    content = hashlib.sha256()
    for part in PARTS:
        for path in sorted(path for path in (root / part).rglob("*.py") if path.name not in ONLY_SHOWING):
            content.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return content.hexdigest()[:16]


def _entry(folder: Path, scene: str) -> Path:
    return folder / "scenes" / f"{file_name(scene)}.json"


def _found(request: ValidationRequest, mark: str) -> dict[str, dict[str, Any]]:
    """The finished scenes among all of the request's, whoever measured them; without a mark: of any program."""
    found = {}
    for scene in request.all_scenes:
        entry = read_json(_entry(request.folder, scene))
        size = heading(scene, request.size)["size"]
        if entry.get("scene") == scene and (not mark or (entry.get("made_from"), entry.get("size")) == (mark, size)):
            found[scene] = entry
    return found


def _measure_all(request: ValidationRequest, todo: Sequence[str], mark: str, tell: Tell) -> None:
    """All scenes, as many at a time as there are cores; those whose process ends badly are written down as failed."""
    running = _Running()
    with ThreadPoolExecutor(max_workers=min(os.cpu_count() or 1, MOST_AT_ONCE)) as pool:
        try:
            jobs = {pool.submit(running.scene, scene, request, mark): scene for scene in todo}
            for number, job in enumerate(as_completed(jobs), 1):
                scene, trouble = jobs[job], job.result()
                if trouble:
                    _write_failure(request, scene, mark, trouble)
                tell(f"{number}/{len(todo)} {scene}: {trouble.splitlines()[-1] if trouble else 'measured'}")
        except BaseException:
            running.stop()
            raise


@dataclass
class _Running:
    """The processes that are at work, so that all can be stopped."""

    processes: set[subprocess.Popen] = field(default_factory=set)
    stopped: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def scene(self, scene: str, request: ValidationRequest, mark: str) -> str:
        """Measures a scene; returns why it has no figures, or nothing."""
        width, height = request.size
        command = [sys.executable, "-s", "-P", "-m", f"{PACKAGE}.scene_process", scene, str(width), str(height),
                   str(request.folder), mark]  # fmt: skip
        with self.lock:
            if self.stopped:
                return "stopped"
            # a group of its own (where there are such): its Blender goes with it
            group: dict[str, Any] = {} if sys.platform == "win32" else {"process_group": 0}
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **group
            )
            self.processes.add(process)
        said = process.communicate()[1].decode("utf-8", "replace")
        with self.lock:
            self.processes.discard(process)
        if process.returncode == 0:
            return ""
        last = "\n".join(said.strip().splitlines()[-LAST_LINES:])
        return last or f"its process ended with {process.returncode}"

    def stop(self) -> None:
        """Ends all of them."""
        with self.lock:
            self.stopped = True
            for process in self.processes:
                if sys.platform == "win32":
                    process.terminate()
                else:
                    os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C does: it tidies up


def _write_failure(request: ValidationRequest, scene: str, mark: str, message: str) -> None:
    entry = {
        "schema": SCHEMA, **heading(scene, request.size), "status": "failed", "message": message, "blender": "",
        "made_from": mark, "proof": {}, "runs": {}, "pictures": {},
    }  # fmt: skip
    with OutputFiles(overwrite=True) as files:
        files.add_to_folder(request.folder / "scenes", f"{file_name(scene)}.json", json.dumps(entry, indent=1).encode())
