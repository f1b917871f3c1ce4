"""A new user's way in a Blender with a window: zip, install, two photographs, panorama, overlays, saved EXR.

BLENDER_SHOT names a command that runs Blender with its window on a virtual screen, takes a picture of the screen and
ends it: `BLENDER_SHOT OUT.png SECONDS ARG…`. Where BLENDER_RUN is `…/real-blender run SUITE`, that is known.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN = shlex.split(os.environ.get("BLENDER_RUN", ""))
SHOT = shlex.split(os.environ.get("BLENDER_SHOT", ""))
if not SHOT and len(RUN) >= 3 and Path(RUN[0]).name == "real-blender":
    SHOT = [RUN[0], "shot", *RUN[2:]]
# The pair that `edf demo --no-render` stitches.
SHIPPED = ROOT / "synthetic_scenes" / "shipped" / "pair"
# How long the way may take on a machine that does other things too.
SECONDS = int(os.environ.get("EDF_WINDOW_SECONDS", "180"))

pytestmark = [pytest.mark.blender, pytest.mark.skipif(not (SHOT and RUN), reason="no Blender with a window is named")]


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """The zip for that Blender alone."""
    script, folder = ROOT / ".ci" / "build_extension.py", tmp_path_factory.mktemp("zip")
    command = [sys.executable, script, "--local", "--blender", shlex.join(RUN), "--output-dir", folder]
    subprocess.run(command, check=True, cwd=ROOT, timeout=300)
    (made,) = folder.glob("*.zip")
    return made


@pytest.fixture(scope="module")
def walked(archive, tmp_path_factory) -> Path:
    """The folder that a walk leaves; EDF_WALK names one to keep."""
    out = Path(os.environ.get("EDF_WALK") or tmp_path_factory.mktemp("walk"))
    home = tmp_path_factory.mktemp("window_home")
    script = ROOT / "tests" / "end_to_end" / "walk_in_window.py"
    command = [*SHOT, str(out / "screen.png"), str(SECONDS), "--python", str(script), "--",
               *map(str, (archive, SHIPPED / "reference.jpg", SHIPPED / "target.jpg", out))]  # fmt: skip
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=SECONDS + 120)
    (out / "output.txt").write_text(done.stdout + done.stderr, "utf-8")
    return out


def test_the_whole_way_was_walked(walked):
    walk = json.loads((walked / "walk.json").read_text("utf-8"))
    assert "error" not in walk, walk["error"]
    assert walk.get("done"), f"got as far as {walk['steps'][-1:]} in {SECONDS} s"
    said = (walked / "output.txt").read_text("utf-8")
    assert "Traceback" not in said and "RNA" not in said, said[-3000:]


def test_the_panorama_and_what_goes_with_it(walked):
    facts = json.loads((walked / "walk.json").read_text("utf-8"))["facts"]
    assert (facts["running"], facts["failed"]) == (False, False), facts["message"]
    assert facts["panorama"][0] > 640 and facts["matches"] > 300 and facts["cameras"] >= 3
    assert (facts["added"], facts["state"]) == (1, "ADDED"), "a click in one picture, then in the other"
    assert facts["exr_bytes"] > 100_000


def test_a_picture_follows_the_frame_and_an_undo_brings_the_panorama_back(walked):
    facts = json.loads((walked / "walk.json").read_text("utf-8"))["facts"]
    assert facts["followed"] == ["reference preview"] * 2, "it was made, and is shown"
    assert facts["undone"] == ["reference panorama"] * 2, "the panorama of before is there, and shown"


@pytest.mark.parametrize(("one", "other", "changed"), [
    ("2_nothing_chosen", "3_pair_opened", 0.1), ("5_panorama", "6_matches_and_lines", 0.01),
    ("5_panorama", "5b_outline_of_the_frame", 0.002), ("5_panorama", "5c_followed", 0.05),
    ("5_panorama", "7_difference", 0.1), ("7_difference", "8_displacement", 0.1),
    ("8_displacement", "11_painted_out", 0.1),
])  # fmt: skip
def test_each_step_shows_on_the_screen(walked, one, other, changed):
    """In the share of the editor's left half, where no panel lies, that looks different."""
    first, second = (cv2.imread(str(walked / f"{name}.png"))[60:800, 90:900] for name in (one, other))
    assert (np.abs(first.astype(int) - second).max(axis=2) > 24).mean() > changed
