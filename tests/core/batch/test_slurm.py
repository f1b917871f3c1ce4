"""The array script for SLURM, by a SLURM of its own that takes this machine for two nodes."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ...pairs import KNOWN_WORDS
from . import batch_work
from .batch_work import lasting, run, summary
from .test_engines import FARM

work = batch_work.work

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "srun", "scontrol", "squeue", "munged")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(any(shutil.which(program) is None for program in PROGRAMS), reason="needs slurm-wlm and munge"),
    pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="needs root, as SLURM's daemons do"),
]
CONFIGURATION = """
ClusterName=test
SlurmctldHost=localhost
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
SlurmctldPort={port}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/%n
SlurmctldPidFile={folder}/control.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/control.log
SlurmdLogFile={folder}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
NodeName=one NodeHostname=localhost NodeAddr=127.0.0.1 Port={one} CPUs=1 RealMemory=4000
NodeName=two NodeHostname=localhost NodeAddr=127.0.0.1 Port={two} CPUs=1 RealMemory=4000
PartitionName=all Nodes=one,two Default=YES State=UP
"""


def free_ports(count: int) -> list[int]:
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


def wait_for(what: Callable[[], bool], seconds: float = 120) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.2)


def said_by(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def slurm(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Two idle nodes on this machine; the folder with their logs."""
    folder = tmp_path_factory.mktemp("slurm")
    folder.parent.chmod(0o755)
    for name in ("munge", "state", "one", "two"):
        (folder / name).mkdir()
    (folder / "munge").chmod(0o700)
    (folder / "munge" / "key").write_bytes(os.urandom(1024))
    (folder / "munge" / "key").chmod(0o400)
    control, one, two = free_ports(3)
    text = CONFIGURATION.format(folder=folder, port=control, one=one, two=two)
    (folder / "slurm.conf").write_text(text, "utf-8")
    monkeypatch.setenv("SLURM_CONF", str(folder / "slurm.conf"))
    files = [f"--{what}-file={folder}/munge/{what}" for what in ("key", "pid", "log", "seed")]
    commands = [
        ["munged", "--force", "--foreground", *files, f"--socket={folder}/munge/socket"], ["slurmctld", "-D", "-c"],
        ["slurmd", "-D", "-N", "one"], ["slurmd", "-D", "-N", "two"],
    ]  # fmt: skip
    daemons = []
    try:
        for command in commands:
            with (folder / "daemons.log").open("ab") as log:
                daemons.append(subprocess.Popen(command, stdout=log, stderr=log))
            if command[0] == "munged":
                wait_for((folder / "munge" / "socket").exists)
        wait_for(lambda: said_by("sinfo", "-h", "-o", "%T").split() == ["idle"])
        yield folder
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            daemon.wait()


def test_an_array_makes_the_batch_and_a_killed_worker_is_queued_again(
    work: Path, slurm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker of the second shard is killed with -9 as soon as it runs."""
    assert run(work, "--quiet", out="whole") == 0
    program = tmp_path / "edf"
    log = f'echo "$$ $*" >> {tmp_path}/calls\n'
    program.write_text(f'#!/bin/sh\n{log}exec "{sys.executable}" -m edf_stitch "$@"\n', "utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("EDF", str(program))
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    command = ["sbatch", "--parsable", "--array=1-2", FARM / "array.sbatch", "good.csv", "out", *KNOWN_WORDS]
    job = subprocess.run(command, cwd=work, capture_output=True, text=True, check=True).stdout.strip()

    def calls(of: str) -> list[int]:
        lines = (tmp_path / "calls").read_text("utf-8").splitlines() if (tmp_path / "calls").exists() else []
        return [int(line.split()[0]) for line in lines if f"--shard {of} " in line]

    wait_for(lambda: bool(calls("2/2")))
    os.kill(calls("2/2")[0], signal.SIGKILL)
    wait_for(lambda: f"{job}_2 PENDING" in said_by("squeue", "-h", "-o", "%i %T"))
    said_by("scontrol", "update", f"JobId={job}_2", "StartTime=now")  # SLURM would wait for two minutes
    wait_for(lambda: not said_by("squeue", "-h"), 300)
    assert "worker of shard 2 killed (exit code 137): queued again" in (work / f"edf-{job}_2.log").read_text("utf-8")
    assert (len(calls("1/2")), len(calls("2/2"))) == (1, 2)
    assert lasting(work / "out") == lasting(work / "whole")
    assert [summary(work / "out", f"batch.shard-{n}-of-2.json")["failed"] for n in (1, 2)] == [0, 0]
    states = {line.split()[0] for line in said_by("scontrol", "show", "job", job).splitlines() if "JobState" in line}
    assert states == {"JobState=COMPLETED"}
