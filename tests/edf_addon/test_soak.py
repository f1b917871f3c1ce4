"""Long sessions and bad company: `make soak`."""

import gc
import json
import os
import random
import re
import sys
import time
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import status  # noqa: E402
from edf_stitch.edf_addon.jobs import job, modal  # noqa: E402

from .conftest import leftovers  # noqa: E402
from .jobs.test_stitching import Modal, event  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.soak, pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")]

STITCHES = int(os.environ.get("EDF_SOAK_SESSION", 50))
CANCELS = int(os.environ.get("EDF_SOAK_CANCELS", 40))
BABBLE = int(os.environ.get("EDF_SOAK_BABBLE", 200))
# MB that a session may grow by after its first stitches, all 50 panoramas aside
GROWTH_MB = 40


def children() -> set[str]:
    """Processes started by this one that are still there."""
    return {name for task in Path("/proc/self/task").iterdir() for name in (task / "children").read_text().split()}


def resident_mb() -> float:
    gc.collect()
    return int(re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024


def files_open() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_fifty_stitches_in_one_session(chosen, tmp_path, monkeypatch):
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    before, begun = children(), {}
    for number in range(STITCHES):
        chosen.settings.seed = number % 5
        assert bpy.ops.edf.stitch() == {"FINISHED"} and not modal.is_working() and not status.now.failed
        assert children() == before and not leftovers()
        for image in [one for one in bpy.data.images if one.name not in ("reference.png", "target.png")]:
            bpy.data.images.remove(image)
        if number == 9:
            begun = {"memory": resident_mb(), "files": files_open()}
    assert resident_mb() - begun["memory"] < GROWTH_MB and files_open() <= begun["files"] + 1
    assert sum(path.stat().st_size for path in (tmp_path / "cache").iterdir()) < 50e6


def test_a_storm_of_cancels(chosen, tmp_path, monkeypatch):
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(modal, "_is_over_editor", lambda *_: True)
    before, images, files = children(), len(bpy.data.images), 0
    chance = random.Random(8)
    for number in range(CANCELS):
        one = Modal()
        assert one._start(bpy.context)
        moment = time.monotonic() + chance.choice((0, chance.uniform(0, 0.3), chance.uniform(0, 2)))
        goes_on = True
        while time.monotonic() < moment and goes_on:
            goes_on = one.modal(bpy.context, event()) == {"PASS_THROUGH"}
            time.sleep(0.01)
        for _ in range(chance.randrange(1, 6)):
            goes_on = goes_on and one.modal(bpy.context, event("ESC", "PRESS")) == {"RUNNING_MODAL"}
        if goes_on:
            one.until(lambda: False)
        assert not modal.is_working() and children() == before and not leftovers(), number
        files = files or files_open()
    assert files_open() <= files + 1
    assert len(bpy.data.images) <= images + 2 * CANCELS
    assert not list((tmp_path / "cache").glob(".*")) if (tmp_path / "cache").exists() else True
    assert bpy.ops.edf.stitch() == {"FINISHED"}, "it works as before"


PIECES = (
    *(b"{", b"}", b"[", b"\n", b"\xff", b"\0", b'"stage"', b'"share"', b":", b"0.5", b"1e999", b"null", b","),
    *(b'"done"', b"true", b'"error"', b"[" * 5000, b"x" * 100_000, b'{"stage": "field", "share": 0.5}\n'),
    *(b'{"done": 1}\n', b'{"error": ["x"], "kind": 3}\n', b'{"error": null}\n', b'{"done": true}\n'),
)


@pytest.mark.parametrize("quarter", range(4))
def test_babble(tmp_path, quarter):
    """Whatever comes out of the pipe, the job ends in an outcome with words and its folder goes."""
    for seed in range(quarter * BABBLE // 4, (quarter + 1) * BABBLE // 4):
        chance = random.Random(seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        said = b"".join(chance.choice(PIECES) for _ in range(chance.randrange(30)))
        (folder / "said").write_bytes(said)
        if chance.random() < 0.5:
            (folder / "result.json").write_bytes(chance.choice((b"{}", b"{", b"\xff", json.dumps([1]).encode())))
        code = "import sys; sys.stdout.buffer.write(open('said', 'rb').read()); sys.exit("
        code += f"{chance.choice((0, 0, 1, 3))})"
        one = job.Job(folder, ["/usr/bin/env", sys.executable, "-S", "-c", code], os.environ)
        end = time.monotonic() + 60
        while (outcome := one.poll()) is None:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert outcome.kind == job.DONE or outcome.words, (seed, outcome)
        one.close()
        assert not folder.exists()
