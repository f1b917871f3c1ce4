"""Finding something to render with, and what is said when it does not."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.synthetic_scenes.blender_process import (
    BLENDER_VARIABLE,
    RenderFailed,
    find_blender,
    run_job,
    write_package,
)


def fake_blender(folder: Path, script: str) -> Path:
    """A program that does as a shell script says; $LAST is the folder that it is to write into."""
    path = folder / "blender"
    path.write_text(f'#!/bin/sh\nfor LAST; do :; done\n{script}\n', "utf-8")
    path.chmod(0o755)
    return path


def test_the_blender_that_was_named_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BLENDER_VARIABLE, "/opt/blender")
    assert find_blender() == "/opt/blender"


def test_without_one_bpy_renders_and_without_that_a_blender_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(BLENDER_VARIABLE, raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert not find_blender()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert find_blender() == "/usr/bin/blender"
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(RenderFailed, match=BLENDER_VARIABLE):
        find_blender()


def test_blender_is_told_what_to_run_and_where_the_package_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing of the Python around it: with another NumPy on its path, Blender's own would not be found."""
    script = 'printf "%s\\n" "$@" "PYTHON $PYTHONPATH $PYTHONHOME" > "$LAST/said"; echo "{}" > "$LAST/cameras.json"'
    monkeypatch.setenv(BLENDER_VARIABLE, str(fake_blender(tmp_path, script)))
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    monkeypatch.setenv("PYTHONHOME", "elsewhere")
    run_job({}, tmp_path)
    *command, python = (tmp_path / "said").read_text("utf-8").splitlines()
    assert python.split() == ["PYTHON", str(tmp_path / "package.zip")]
    assert command[-3:] == ["--", str(tmp_path / "job.json"), str(tmp_path)]
    assert {"-b", "--factory-startup", "--python-use-system-env"} <= set(command)
    assert command.index("--python-exit-code") < command.index("--python-expr"), "Blender reads from left to right"


def test_what_renders_needs_no_library_but_numpy(tmp_path: Path) -> None:
    """A whole Blender has neither OpenCV nor SciPy; here Python is kept from finding them."""
    pytest.importorskip("bpy")
    write_package(tmp_path / "package.zip")
    code = (
        "import sys\n"
        "for name in ('cv2', 'scipy', 'poselib', 'OpenEXR', 'tqdm'): sys.modules[name] = None\n"
        "import edf_stitch.synthetic_scenes.render as render\n"
        "print(render.__file__)"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "package.zip")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "package.zip" in done.stdout


def test_a_job_is_handed_over_with_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = fake_blender(tmp_path, 'cp "$LAST/job.json" "$LAST/cameras.json"')
    monkeypatch.setenv(BLENDER_VARIABLE, str(fake))
    run_job({"world": "street"}, tmp_path)
    assert (tmp_path / "cameras.json").read_text("utf-8") == '{"world": "street"}'


@pytest.mark.parametrize(("script", "said"), [("echo 'out of memory' >&2; exit 7", "ended with 7: out of memory"),
                                              ("kill -SEGV $$", "ended with -11"), ("exit 0", "rendered nothing")])
def test_a_render_that_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, said: str) -> None:
    monkeypatch.setenv(BLENDER_VARIABLE, str(fake_blender(tmp_path, script)))
    with pytest.raises(RenderFailed, match=said):
        run_job({}, tmp_path)


def test_a_crash_on_the_way_out_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """bpy as a module may crash when everything has been written."""
    monkeypatch.setenv(BLENDER_VARIABLE, str(fake_blender(tmp_path, 'echo "{}" > "$LAST/cameras.json"; kill -SEGV $$')))
    run_job({}, tmp_path)
