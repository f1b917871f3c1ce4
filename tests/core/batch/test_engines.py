"""Batches by engines of farms, as docs/farm.md says: each is run for real, and left out where it is not installed."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.commands.parser import edf_parser

from ...pairs import KNOWN_WORDS
from . import batch_work
from .batch_work import lasting, of_pairs, run, summary

work = batch_work.work

ROOT = Path(__file__).resolve().parents[3]
FARM = ROOT / "docs" / "farm"
# What `author` is to a job type, as far as ours asks: it prints the job's tasks.
AUTHOR = """
const author = {
    Task: (name, type) => ({name, type, commands: [], after: [],
        addCommand(one) { this.commands.push(one); }, addDependency(task) { this.after.push(task.name); }}),
    Command: (name, parameters) => ({name, parameters}),
};
const job = {settings: JSON.parse(process.argv[2]), tasks: [], addTask(task) { this.tasks.push(task); }};
"""


def needs(*programs: str) -> pytest.MarkDecorator:
    missing = [program for program in programs if shutil.which(program) is None]
    return pytest.mark.skipif(bool(missing), reason=f"needs {', '.join(missing)}")


@pytest.fixture
def edf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program called edf, first in the path: the engine of this checkout."""
    program = tmp_path / "bin" / "edf"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m edf_stitch "$@"\n', "utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    return program


# --- Flamenco -------------------------------------------------------------------------------------------------------


def compiled(tmp_path: Path, settings: dict) -> list[dict]:
    """The tasks that the job type makes of settings, by node."""
    script = (FARM / "edf-stitch.js").read_text("utf-8")
    path = tmp_path / "job.js"
    path.write_text(f"{AUTHOR}{script}\ncompileJob(job); console.log(JSON.stringify(job.tasks));", "utf-8")
    done = subprocess.run(["node", path, json.dumps(settings)], capture_output=True, text=True)
    if done.returncode:
        raise ValueError(done.stderr)
    return json.loads(done.stdout)


def job_type(tmp_path: Path) -> dict:
    path = tmp_path / "type.js"
    path.write_text((FARM / "edf-stitch.js").read_text("utf-8") + "\nconsole.log(JSON.stringify(JOB_TYPE));", "utf-8")
    return json.loads(subprocess.run(["node", path], capture_output=True, text=True, check=True).stdout)


def arguments(task: dict) -> list[str]:
    (command,) = task["commands"]
    assert command["name"] == "exec" and command["parameters"]["exe"] == "{edf}"
    return command["parameters"]["args"]


@needs("node")
def test_flamenco_s_settings_are_of_kinds_that_it_draws(tmp_path: Path) -> None:
    found = job_type(tmp_path)
    kinds = {"string": str, "int32": int, "float": float, "bool": bool}
    assert found["label"] and len({one["key"] for one in found["settings"]}) == len(found["settings"]) == 5
    for one in found["settings"]:
        assert one["label"] and one["description"] and re.fullmatch(r"[a-z_]+", one["key"])
        assert one.get("subtype", "file_path") in ("file_path", "dir_path")
        assert one.get("visible", "visible") in ("visible", "hidden", "submission", "web")
        assert "default" not in one or isinstance(one["default"], kinds[one["type"]])
        assert "choices" not in one or one["default"] in one["choices"]
    assert main(["validate", "--help"]) == 0
    for choice in found["settings"][0]["choices"][1:]:
        settings = {"work": choice, "output": "out", "shards": 1, "options": ""}
        assert arguments(compiled(tmp_path, settings)[0])[3:5] == ["--suite", choice.split()[1]]


@needs("node")
def test_flamenco_s_tasks_make_the_batch(tmp_path: Path, work: Path) -> None:
    """Every command is run, in the order that dependencies leave."""
    options = " ".join([*KNOWN_WORDS, '--config "a house.toml"'])
    (work / "a house.toml").write_text("seed = 7\n", "utf-8")
    settings = {
        "work": "stitch a list", "list": str(work / "good.csv"), "output": str(work / "out"), "shards": 2,
        "options": options.replace("a house", f"{work}/a house"),
    }  # fmt: skip
    first, second, last = compiled(tmp_path, settings)
    assert [one["name"] for one in (first, second, last)] == ["shard 1/2", "shard 2/2", "sum up"]
    assert last["after"] == ["shard 1/2", "shard 2/2"] and not first["after"] and first["type"] == "misc"
    for task in (second, first, last):
        assert main(arguments(task)) == 0
    found = summary(work / "out")
    assert (found["total"], found["skipped"]) == (3, 3)
    assert all(json.loads((work / "out" / f"p{n}.report.json").read_text("utf-8"))["options"]["seed"] == 7
               for n in (1, 2, 3))  # fmt: skip


@needs("node")
@pytest.mark.parametrize(("change", "words"), [({"list": ""}, "set List to"), ({"shards": 0}, "at least one")])
def test_flamenco_is_told_what_is_missing(tmp_path: Path, change: dict, words: str) -> None:
    settings = {"work": "stitch a list", "list": "l.csv", "output": "out", "shards": 2, "options": ""} | change
    with pytest.raises(ValueError, match=words):
        compiled(tmp_path, settings)


@needs("node")
@pytest.mark.slow
@pytest.mark.soak
def test_flamenco_s_tasks_validate(tmp_path: Path) -> None:
    """Shards of a scene or two, rendered and measured; the last task writes the report."""
    pytest.importorskip("bpy")
    settings = {
        "work": "validate: quick", "list": "", "output": str(tmp_path / "out"), "shards": 2,
        "options": "--scene two_planes single_plane",
    }  # fmt: skip
    for task in compiled(tmp_path, settings):
        done = subprocess.run([sys.executable, "-m", "edf_stitch", *arguments(task)], check=False)
        assert done.returncode in (0, 1)
    assert (tmp_path / "out" / "report.html").is_file()
    assert len(json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))["scenes"]) == 2


# --- GNU parallel ---------------------------------------------------------------------------------------------------


@needs("parallel")
def test_gnu_parallel_runs_the_shards(work: Path, edf: Path) -> None:
    words = ["edf", "batch", work / "good.csv", "-o", work / "out", *KNOWN_WORDS, "--resume", "--quiet"]
    command = ["parallel", "--will-cite", "--jobs", "2", *words, "--shard", "{}/3", ":::", "1", "2", "3"]
    subprocess.run(list(map(str, command)), check=True)
    assert {name for name in lasting(work / "out")} == {
        name for name in of_pairs("p1", "p2", "p3") if not name.endswith(".timing.json") and name[0] != "."}
    assert run(work, "--resume", "--quiet") == 0 and summary(work / "out")["skipped"] == 3


@needs("parallel", "bash", "python3")
def test_gnu_parallel_runs_the_units_of_a_plan_and_retries_what_was_killed(work: Path, edf: Path) -> None:
    """By the command line of docs/farm.md. The first that is called is killed with -9; parallel calls it again."""
    (edf.parent / "first").touch()
    text = f'#!/bin/sh\nrm "{edf.parent}/first" 2>/dev/null && kill -9 $$\n'
    assert run(work, "--plan", str(work / "plan.json"), "--quiet") == 0
    edf.write_text(text + edf.read_text("utf-8").split("\n", 1)[1], "utf-8")
    page = (ROOT / "docs" / "farm.md").read_text("utf-8")
    (line,) = re.findall(r"^    (python3 -c .*\n.*)$", page, re.MULTILINE)
    done = subprocess.run(
        ["bash", "-c", line.replace("| parallel", "| parallel --will-cite")], cwd=work, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not (edf.parent / "first").exists() and len((work / "jobs.log").read_text("utf-8").splitlines()) == 4
    assert run(work, "--resume", "--quiet") == 0 and summary(work / "out")["skipped"] == 3


# --- Dask -----------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="needs dask and distributed")
def test_the_example_for_dask_makes_a_plan(work: Path, edf: Path) -> None:
    """As docs/farm.md has it, in a process of its own: it starts workers."""
    (example,) = re.findall(r"```python\n([^`]*dask[^`]*)```", (ROOT / "docs" / "farm.md").read_text("utf-8"))
    (work / "example.py").write_text(example, "utf-8")
    assert run(work, "--plan", str(work / "plan.json"), "--quiet") == 0
    done = subprocess.run([sys.executable, "example.py"], cwd=work, capture_output=True, text=True, check=True)
    assert sorted(done.stdout.splitlines()) == ["p1: made", "p2: made", "p3: made"], done.stderr
    assert run(work, "--resume", "--quiet") == 0 and summary(work / "out")["skipped"] == 3


# --- the page's own command lines -----------------------------------------------------------------------------------


def test_the_page_s_commands_are_understood() -> None:
    """Calls of edf within other programs' command lines; those of its own line stand in test_docs."""
    text = (ROOT / "docs" / "farm.md").read_text("utf-8")
    (cue,) = re.findall(r'command=\["edf", (.*)\],', text)
    (deadline,) = re.findall(r'-arguments "(.*)"', text)
    parallel = re.findall(r"parallel .* edf (batch .*) :::", text)
    calls = [json.loads(f"[{cue}]"), shlex.split(deadline), *map(shlex.split, parallel)]
    for call in calls:
        words = [re.sub("#IFRAME#|<STARTFRAME>|{}", "7", word) for word in call]
        args = edf_parser().parse_args(words)
        assert args.resume and (args.unit == (7, 200) or args.shard == (7, 20))
    assert len(calls) == 3
