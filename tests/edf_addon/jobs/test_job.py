"""The parent's side of the worker, against workers that misbehave."""

import json
import os
import signal
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("bpy")

from edf_stitch.edf_addon.jobs import job  # noqa: E402


def start(folder: Path, code: str) -> job.Job:
    """A worker that does what `code` says, with `say(x)` for a line on stdout; stdin is open as for a real one."""
    head = "import json, os, signal, sys, time\ndef say(x): print(json.dumps(x), flush=True)\n"
    return job.Job(folder, [sys.executable, "-c", head + code], os.environ)


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "job"
    made.mkdir()
    return made


# Seconds after which a job counts as one that never ends: no verdict on a slow machine.
NEVER = 300


def wait(one: job.Job) -> job.Outcome:
    end = time.monotonic() + NEVER
    while (outcome := one.poll()) is None:
        assert time.monotonic() < end, "the job does not end"
        time.sleep(0.01)
    return outcome


def wait_for_stage(one: job.Job, stage: str) -> None:
    end = time.monotonic() + NEVER
    while one.stage != stage:
        assert one.poll() is None and time.monotonic() < end
        time.sleep(0.005)


def test_a_good_job_gives_its_result(folder):
    (folder / "result.json").write_text(json.dumps({"files": {}}))
    one = start(folder, "say({'stage': 'field', 'share': 0.5}); say({'done': True})")
    outcome = wait(one)
    assert (outcome.kind, outcome.result, one.stage, one.share) == (job.DONE, {"files": {}}, "field", 0.5)
    one.close()
    assert not folder.exists()


def test_garbage_half_lines_and_shares_that_are_none_are_passed_over(folder):
    (folder / "result.json").write_text("{}")
    one = start(
        folder,
        "say({'stage': 'field', 'share': 0.4})\n"
        "sys.stdout.buffer.write(b'\\xff\\xfe\\0garbage\\n[1, 2]\\n3\\nnull\\n{\"stage\": 1, \"share\": 2}\\n')\n"
        "sys.stdout.buffer.write(b'{\"stage\": \"x\", \"share\": NaN}\\n{\"stage\": \"x\", \"share\": -1}\\n')\n"
        "sys.stdout.buffer.write(b'[' * 60000 + b'\\n{\"sta'); sys.stdout.flush(); time.sleep(0.1)\n"
        "sys.stdout.buffer.write(b'ge\": \"blend\", \"share\": 0.8}\\n'); sys.stdout.flush()\n"
        "say({'done': True}); sys.stdout.write('{\"error\": \"half a li')",
    )
    assert wait(one).kind == job.DONE
    assert (one.stage, one.share) == ("blend", 0.8)
    one.close()


def test_a_flood_neither_blocks_the_worker_nor_fills_the_memory(folder):
    """Far more than a pipe holds, on both pipes, without and with line ends, and nobody polls meanwhile."""
    (folder / "result.json").write_text("{}")
    one = start(
        folder,
        "for _ in range(300): sys.stdout.write('x' * 100000); sys.stderr.write('y' * 10000)\n"
        "sys.stdout.write('\\n' * 100000)\n"
        "say({'stage': 'warp', 'share': 0.6}); say({'done': True})",
    )
    one._process.wait(timeout=NEVER)
    assert wait(one).kind == job.DONE and one.stage == "warp"
    assert len(one._tail) <= job.LONGEST_TAIL
    one.close()


def test_progress_never_goes_back(folder):
    one = start(folder, "say({'stage': 'b', 'share': 0.7}); say({'stage': 'c', 'share': 0.2}); sys.stdin.read()")
    wait_for_stage(one, "c")
    assert one.share == 0.7
    one.close()


def test_an_error_is_told_in_its_words(folder):
    one = start(folder, "say({'error': 'only 3 matches; choose others', 'kind': 'TooFewMatches', 'exit_code': 3})")
    outcome = wait(one)
    assert (outcome.kind, outcome.words) == ("TooFewMatches", "Only 3 matches; choose others.")
    one.close()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", "want of memory"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
        ("raise ValueError('no such thing')", "ValueError: no such thing"),
        ("say({'stage': 'read', 'share': 0.1})", "exit status"),
        ("say({'done': True})", "result"),
    ],
    ids=["killed", "crashed", "raised", "silent", "no result"],
)
def test_a_worker_that_breaks_down_gives_a_message(folder, code, words):
    one = start(folder, code)
    outcome = wait(one)
    assert outcome.kind == job.CRASHED and words in outcome.words
    one.close()
    assert not folder.exists()


def test_a_worker_that_is_asked_to_stop_does(folder, monkeypatch):
    monkeypatch.setattr(job, "GRACE", NEVER)
    one = start(
        folder,
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "try: say({'stage': 'features', 'share': 0.1}); time.sleep(600)\n"
        "except KeyboardInterrupt: say({'error': 'cancelled', 'kind': 'Cancelled', 'exit_code': 130}); sys.exit(130)",
    )
    wait_for_stage(one, "features")
    one.cancel()
    one.cancel()
    assert wait(one).kind == job.CANCELLED
    assert one._process.returncode == 130, "by itself"
    one.close()


def test_a_worker_that_will_not_stop_is_killed(folder, monkeypatch):
    monkeypatch.setattr(job, "GRACE", 0.3)
    one = start(
        folder,
        "signal.signal(signal.SIGINT, signal.SIG_IGN); say({'stage': 'x', 'share': 0}); time.sleep(600)",
    )
    wait_for_stage(one, "x")
    one.cancel()
    assert wait(one).kind == job.CANCELLED
    assert one._process.returncode == -signal.SIGKILL
    one.close()


def test_what_was_finished_after_cancel_is_not_wanted(folder):
    (folder / "result.json").write_text("{}")
    one = start(folder, "signal.signal(signal.SIGINT, signal.SIG_IGN); say({'done': True})")
    one._process.wait(timeout=NEVER)
    one.cancel()
    assert wait(one).kind == job.CANCELLED
    one.close()


def test_closing_ends_a_worker_that_works(folder):
    one = start(folder, "say({'stage': 'x', 'share': 0}); time.sleep(600)")
    wait_for_stage(one, "x")
    one.close()
    assert one._process.returncode is not None and not folder.exists()
