"""A set in a Blender with a window: what holds it up for how long, and what is drawn by hand. See `test_window`."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from ..sets import make_set
from .test_window import ROOT, RUN, SHOT, archive  # noqa: F401 (a fixture)

# How long the way may take on a machine that does other things too, and ms that nothing may hold the window up for.
SECONDS = int(os.environ.get("EDF_WINDOW_SECONDS", "240"))
MOST_MS = 50.0

pytestmark = [pytest.mark.blender, pytest.mark.skipif(not (SHOT and RUN), reason="no Blender with a window is named")]


@pytest.fixture(scope="module")
def walk(archive, tmp_path_factory) -> dict:  # noqa: F811
    """What a walk has measured; EDF_WALK names a folder to keep it in, with pictures of the screen."""
    out = Path(os.environ.get("EDF_WALK") or tmp_path_factory.mktemp("walk"))
    many, some, home = (tmp_path_factory.mktemp(name) for name in ("many", "some", "home"))
    noise = np.random.default_rng(1).integers(0, 255, (3000, 4000, 3), np.uint8)
    for number in range(30):
        cv2.imwrite(str(many / f"{number}.jpg"), np.roll(noise, number, axis=0))
    for picture in make_set(3).pictures:
        cv2.imwrite(str(some / picture.name), np.rint(picture.pixels[..., ::-1] * 255).astype(np.uint8))
    script = ROOT / "tests" / "end_to_end" / "set_in_window.py"
    command = [*SHOT, str(out / "screen.png"), str(SECONDS), "--python", str(script), "--",
               *map(str, (archive, many, some, out))]  # fmt: skip
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home), "EDF_CACHE": str(home / "cache")}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=SECONDS + 120)
    said = done.stdout + done.stderr
    assert "Traceback" not in said and "RNA" not in said, said[-3000:]
    found = json.loads((out / "walk.json").read_text("utf-8"))
    assert "error" not in found, found["error"]
    return found


def test_nothing_holds_the_window_up(walk):
    slow = {name: ms for name, ms in {**walk["operators"], **walk["drawing"]}.items() if ms > MOST_MS}
    assert walk["drawing"] and not slow


def test_a_small_panorama_follows_and_frame_and_places_are_drawn_and_undone(walk):
    facts = walk["facts"]
    crop, share = facts["cropped"]
    assert crop == "BOX" and 0.8 < share < 0.95, "the right edge, from beneath the sidebar"
    assert facts["crop_after_one_undo"] == "AUTO"
    assert facts["worker_waits"] and all(name.endswith("preview") for name in facts["followed"])
    assert facts["places"] == ["1.png"] and facts["places_after_one_undo"] == 0
