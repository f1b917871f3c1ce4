"""Libraries that do not work are told in words, before anybody stitches and without loading them into Blender."""

import time
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.jobs import command, health, job  # noqa: E402


@pytest.fixture
def trial(blender):
    """Runs the trial to its end, as Blender's timers would."""

    def run() -> str:
        health.begin_trial()
        end = time.monotonic() + 600
        while health.listen() is not None:
            assert time.monotonic() < end
            time.sleep(0.02)
        return health.problem()

    health.forget()
    yield run
    health.stop()
    health.forget()


def worker_without(monkeypatch, library: str) -> None:
    line, environment = command.worker_command([], job.WORKER)
    code = f"import runpy, sys\nsys.modules[{library!r}] = None\nrunpy.run_module({line[-1]!r}, run_name='__main__')"
    python = line[: line.index("-m")]
    monkeypatch.setattr(command, "worker_command", lambda argv, _: ([*python, "-c", code, *argv], environment))


def test_libraries_that_work_are_no_problem(trial):
    assert trial() == ""


@pytest.mark.parametrize("library", ["cv2", "poselib", "OpenEXR"])
def test_one_that_does_not_load_is_named(trial, monkeypatch, library):
    worker_without(monkeypatch, library)
    said = trial()
    assert library in said and "reinstall" in said and said.endswith(".")


def test_a_worker_that_crashes_over_them_is_told_too(trial, monkeypatch):
    """As libraries made for another processor do."""
    line, environment = command.worker_command([], job.WORKER)
    code = "import os, signal; os.kill(os.getpid(), signal.SIGILL)"
    python = line[: line.index("-m")]
    monkeypatch.setattr(command, "worker_command", lambda argv, _: ([*python, "-c", code, *argv], environment))
    assert "SIGILL" in trial()


def test_the_panel_starts_it_once_and_never_waits(trial, monkeypatch):
    started = []
    monkeypatch.setattr(health, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    monkeypatch.setattr(health, "begin_trial", lambda: started.append(1) or setattr(health, "_asked", True))
    for _ in range(3):
        assert health.problem() == ""
    assert started == [1]


def test_switching_off_ends_it(blender):
    import edf_stitch

    health.begin_trial()
    one = health._trials[-1]
    edf_stitch.unregister()
    assert one._process.poll() is not None and not one.folder.exists() and not health._trials
    edf_stitch.register()
