"""`--command edf`: registered once, gone when asked, and the worker's exit status is Blender's."""

import os
import signal
import subprocess
import sys
import time
import tomllib
from itertools import takewhile
from pathlib import Path
from types import SimpleNamespace

import pytest
from edf_stitch.synthetic_scenes import blender_process

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import _commands, register, unregister  # noqa: E402
from edf_stitch.edf_addon.jobs import command  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.skipif(bool(bpy.app.binary_path), reason="inside a whole Blender: test_extension.py's part")


def test_the_command_is_offered_once_and_withdrawn():
    unregister()
    for _ in range(2):
        register()
        register()
        assert len(_commands) == 1
        unregister()
        unregister()
        assert not _commands


# 4.2's module crashes on its way out after any property with a Python callback, registered or not; its program does not
@pytest.mark.skipif(bpy.app.version < (4, 3), reason="bpy 4.2 as a module crashes when it ends, whoever used callbacks")
def test_bpy_as_a_module_ends_well_when_nobody_switched_the_extension_off():
    code = "import edf_stitch; edf_stitch.register()"
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0


def test_the_version_comes_from_the_worker(capfd):
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    assert command.run(["--version"]) == 0
    assert version in capfd.readouterr().out


def test_the_package_is_found_by_its_name_and_by_its_folder():
    assert command.PACKAGE.endswith("edf_stitch")
    assert (command.FOLDER / "blender_manifest.toml").is_file()


def test_a_wrong_option_gives_2_and_says_so(capfd):
    assert command.run(["stitch", "a.png", "b.png", "-o", "out.png", "--no-such-option"]) == 2
    assert "no-such-option" in capfd.readouterr().err


def test_inside_blender_the_worker_finds_the_folder_and_the_wheels(monkeypatch, tmp_path):
    extensions = tmp_path / "extensions"
    site_packages = extensions / ".local" / "lib" / "python3.13" / "site-packages"
    folder = extensions / "user_default" / "edf_stitch"
    monkeypatch.setattr(command, "PACKAGE", "bl_ext.user_default.edf_stitch")
    monkeypatch.setattr(command, "FOLDER", folder)
    monkeypatch.setattr(sys, "path", [*sys.path, str(site_packages)])
    monkeypatch.setenv("PYTHONHOME", "/elsewhere")
    line, environment = command.worker_command(["stitch", "a b.png"])
    assert line == [sys.executable, "-s", "-P", "-m", "edf_stitch", "stitch", "a b.png"]
    assert environment["PYTHONPATH"].split(os.pathsep) == [str(folder.parent), str(site_packages)]
    assert environment["OPENBLAS_NUM_THREADS"] == "1"
    assert "PYTHONHOME" not in environment


def test_the_worker_learns_which_blender_started_it(monkeypatch):
    assert command.BLENDER_VARIABLE == blender_process.BLENDER_VARIABLE
    monkeypatch.delenv(command.BLENDER_VARIABLE, raising=False)
    assert command.BLENDER_VARIABLE not in command.worker_command(["validate"])[1], "bpy as a module is no program"
    app = SimpleNamespace(binary_path="/opt/blender/blender")
    monkeypatch.setattr(command, "bpy", SimpleNamespace(app=app, utils=command.bpy.utils))
    assert command.worker_command(["validate"])[1][command.BLENDER_VARIABLE] == app.binary_path


def test_a_worker_that_dies_of_a_signal_has_a_shells_exit_status():
    code = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    assert command.run_worker([sys.executable, "-c", code], os.environ) == 128 + signal.SIGKILL


def test_the_signal_handlers_are_put_back():
    before = [signal.getsignal(number) for number in command.STOPPING]
    command.run_worker([sys.executable, "-c", ""], os.environ)
    assert [signal.getsignal(number) for number in command.STOPPING] == before


WORKER = """
import sys, time
try:
    print("at work", flush=True)
    time.sleep(600)
except KeyboardInterrupt:
    time.sleep(0.5)
    print("tidied", flush=True)
    sys.exit(130)
"""
PARENT = """
import os, sys
from edf_stitch.edf_addon.jobs import command
sys.exit(command.run_worker([sys.executable, "-c", sys.argv[1]], os.environ))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["to the parent", "to the terminal's group"])
def test_a_signal_to_stop_reaches_the_worker_once_and_gives_130(send, number):
    started = [sys.executable, "-c", PARENT, WORKER]
    with subprocess.Popen(started, stdout=subprocess.PIPE, text=True, start_new_session=True) as parent:
        # as a module, Blender 5.2 says first which colours it uses
        before = list(takewhile(bool, iter(parent.stdout.readline, "at work\n")))
        assert all("color_management" in line for line in before)
        time.sleep(0.1)
        send(parent.pid, number)
        out, _ = parent.communicate(timeout=300)
    assert (out, parent.returncode) == ("tidied\n", 130)
