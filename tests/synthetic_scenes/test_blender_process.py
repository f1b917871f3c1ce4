"""Finding something to render with, and what is said when it does not."""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

import pytest
from edf_stitch.synthetic_scenes.blender_process import (
    BLENDER_VARIABLE,
    IN_BLENDER,
    RenderFailed,
    render_command,
    run_job,
)


def fake_blender(folder: Path, script: str) -> Path:
    """A program that does as a shell script says; $LAST is the folder that it is to write into."""
    path = folder / "blender"
    path.write_text(f'#!/bin/sh\nfor LAST; do :; done\n{script}\n', "utf-8")
    path.chmod(0o755)
    return path


def test_the_blender_that_was_named_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BLENDER_VARIABLE, "/opt/blender")
    command = render_command()
    assert command[0] == "/opt/blender" and "--factory-startup" in command and str(IN_BLENDER) in command
    assert command[-2:] == ["--", "render"]
    assert command.index("--python-exit-code") < command.index("--python"), "Blender reads from left to right"


def test_without_one_bpy_renders_and_without_that_a_blender_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(BLENDER_VARIABLE, raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert "python" in render_command()[0]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert render_command()[0] == "/usr/bin/blender"
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(RenderFailed, match=BLENDER_VARIABLE):
        render_command()


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
