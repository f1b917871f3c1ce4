"""One stitch as a process: what it reads, says and leaves behind."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.raster.colour import decode
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import ON_REFERENCE
from ...sets import make_set


def start(folder: Path, job: dict) -> subprocess.Popen:
    folder.mkdir(exist_ok=True)
    (folder / "job.json").write_text(json.dumps(job))
    command = [sys.executable, "-P", "-m", "edf_stitch.core.commands.worker", str(folder)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, cwd=folder, start_new_session=True, **pipes)


def run(folder: Path, job: dict) -> tuple[int, list[dict], dict]:
    """Exit status, what was said, and result.json ({} where there is none)."""
    with start(folder, job) as worker:
        said = [json.loads(line) for line in worker.stdout]  # stdin stays open, as a parent holds it
        errors = worker.stderr.read().decode()
        worker.stdin.close()
    assert not errors, errors
    index = folder / "result.json"
    return worker.returncode, said, json.loads(index.read_text("utf-8")) if index.exists() else {}


ON_PLANE = {name: getattr(ON_REFERENCE, name) for name in ("projection", "slide", "fade", "crop", "holes", "exposure")}


@pytest.fixture
def job(small_pair: Pair, tmp_path: Path) -> dict:
    """The small pair as arrays, with its true focal length."""
    for side in ("reference", "target"):
        np.save(tmp_path / f"{side}.npy", getattr(small_pair, side))
    focal = float(small_pair.reference_camera.K[0, 0])
    return {
        "pictures": [{"name": side, "array": str(tmp_path / f"{side}.npy")} for side in ("reference", "target")],
        "options": {"camera": {"focal_px": [focal]}, **ON_PLANE},
    }


def test_a_job_gives_the_panorama_that_the_pipeline_gives(job, tmp_path, small_result: StitchResult):
    status, said, index = run(tmp_path / "job", {**job, "take": ["layers", "masks", "depth"]})
    assert status == 0 and said[-1] == {"done": True}
    stages = list(dict.fromkeys(line["stage"] for line in said[:-1]))
    assert stages == ["read", "features", "geometry", "field", "dense", "warp", *stages[6:-2], "blend", "write"]
    shares = [line["share"] for line in said[:-1]]
    assert shares == sorted(shares) and 0.9 < shares[-1] < 1
    assert set(index["files"]) == {
        "panorama", "reference layer", "target layer", "reference mask", "target mask", "inverse depth", "heat",
        "difference", "occluded", "seam", "confidence",
    }  # fmt: skip
    made = load_picture(tmp_path / "job" / index["files"]["panorama"])
    assert made.bits == 8 and np.abs(made.pixels - small_result.pixels).max() < 5e-3
    depth = load_picture(tmp_path / "job" / index["files"]["inverse depth"]).pixels[..., 0]
    assert np.allclose(depth, small_result.warp.inverse_depth)
    assert index["report"] == json.loads(json.dumps(index["report"])) and index["report"]["two_view"]["model"]


@pytest.mark.slow
def test_more_than_two_pictures_give_a_panorama_with_the_cameras_of_all(tmp_path):
    """One of them has nothing to do with the others, and the third is where all is seen from."""
    taken = make_set(3)
    noise = np.random.default_rng(2).integers(0, 256, (240, 320, 3), np.uint8)
    pictures = {**{picture.name: picture.view for picture in taken.pictures}, "other.png": noise}
    entries = []
    for name, pixels in pictures.items():
        np.save(tmp_path / f"{name}.npy", pixels)
        entries.append({"name": name, "array": str(tmp_path / f"{name}.npy")})
    options = {"viewpoint": 3, "dense": False, "projection": "equirectangular"}
    take = ["layers", "masks", "depth"]
    status, said, index = run(tmp_path / "job", {"pictures": entries, "options": options, "take": take})
    assert status == 0, said
    names = ["3.png", "1.png", "2.png"]
    cameras, size = index["geometry"]["cameras"], index["geometry"]["canvas"]
    assert [camera["name"] for camera in cameras] == names
    places = [-np.array(camera["R"]).T @ camera["t"] for camera in cameras]
    apart = [np.linalg.norm(place) for place in places]
    assert apart[0] == 0 and np.isclose(apart[1], 1) and 0.4 < apart[2] < 0.6, "evenly in a row, the first the farthest"
    assert [one["name"] for one in index["report"]["left_out"]] == ["other.png"]
    files = {name: load_picture(tmp_path / "job" / file) for name, file in index["files"].items()}
    assert set(files) == {
        "panorama", "labels", "confidence", "inverse depth",
        *(f"{name} {what}" for name in names for what in ("layer", "mask")),
    }  # fmt: skip
    assert {picture.light.shape[1::-1] for picture in files.values()} == {tuple(size)}
    depth = index["depth"]
    d = np.array(depth["inverse_depth"], float).reshape(depth["rows"], depth["columns"])
    full = files["inverse depth"].pixels[..., 0]
    shows = np.array(depth["shows"], bool).reshape(d.shape)
    at = np.ix_(*(np.rint(np.linspace(0, n - 1, k)).astype(int) for n, k in zip(full.shape, d.shape, strict=True)))
    assert shows.any() and np.allclose(d[shows], full[at][shows], rtol=1e-3)


def test_float_panoramas_are_written_as_the_panel_asks(job, tmp_path, small_pair: Pair):
    OpenEXR = pytest.importorskip("OpenEXR")
    for side in ("reference", "target"):
        np.save(tmp_path / f"{side}.npy", decode(getattr(small_pair, side)))
    status, _, index = run(tmp_path / "job", {**job, "exr": {"depth": "half", "compression": "dwab"}})
    assert status == 0
    with OpenEXR.File(str(tmp_path / "job" / index["files"]["panorama"]), separate_channels=True) as file:
        assert file.channels()["R"].pixels.dtype == np.float16
        assert file.header()["compression"] == OpenEXR.DWAB_COMPRESSION


def test_matches_that_are_left_out_are_measured_and_not_used(job, tmp_path, small_result: StitchResult):
    used = small_result.used_matches
    rows = np.column_stack([used.x, used.y, np.ones(len(used))])
    rows[3, 4] = 0
    np.save(tmp_path / "matches.npy", rows)
    status, said, index = run(tmp_path / "job", {**job, "matches": str(tmp_path / "matches.npy")})
    assert status == 0, said
    matches = index["matches"]
    assert "features" not in {line.get("stage") for line in said}
    assert len(matches["rows"]) == len(matches["errors"]) == len(rows)
    assert np.allclose(matches["rows"], rows[:, :4])
    assert matches["states"][3] == "LEFT_OUT" and matches["weights"][3] == 0
    assert matches["states"].count("USED") == len(rows) - 1
    assert matches["errors"][3] < 3


def test_masks_are_turned_with_the_picture_that_they_lie_on(tmp_path, small_pair: Pair):
    """Stored on its side, as Blender shows it, with EXIF that says so: the mask was painted over that."""
    from edf_stitch.core.commands.worker import _mask

    shown = np.zeros((180, 240), np.uint8)
    shown[:60, :40] = 255  # the top left of what Blender shows, for orientation 6 the top right of the picture
    np.save(tmp_path / "mask.npy", shown)
    turned = _mask(tmp_path, "mask.npy", 6)
    assert turned.shape == (240, 180) and turned[:40, 120:].all() and turned.sum() == shown.sum()


@pytest.mark.parametrize(
    ("change", "kind", "exit_code", "words"),
    [
        ({"pictures": [{"name": name, "path": "none.png"} for name in "rt"]}, "UnreadableImage", 4, "no such file"),
        ({"options": {"field": "magic"}}, "BadRequest", 2, "magic"),
        ({"options": {"no_such_option": 1}}, "Bug", 3, "report it"),
        ({"pictures": None}, "Bug", 3, "report it"),
    ],
)
def test_what_cannot_be_done_is_said_in_words(job, tmp_path, change, kind, exit_code, words):
    status, said, index = run(tmp_path / "job", {**job, **change})
    assert status == said[-1]["exit_code"] == exit_code
    assert said[-1]["kind"] == kind and words in said[-1]["error"] and not index


def until_features(worker: subprocess.Popen) -> None:
    for line in worker.stdout:
        if json.loads(line)["stage"] == "features":
            return
    raise AssertionError("it never came to the features")


# A worker that does as PREPARE says, with its module at hand as `worker`.
PREPARED = "import sys\nfrom pathlib import Path\nfrom edf_stitch.core.commands import worker\n"


def prepared(folder: Path, job: dict, code: str) -> subprocess.Popen:
    folder.mkdir()
    (folder / "job.json").write_text(json.dumps(job))
    line = [sys.executable, "-P", "-c", f"{PREPARED}{code}\nsys.exit(worker.main(Path(sys.argv[1])))", str(folder)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(line, cwd=folder, start_new_session=True, **pipes)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_words(job, tmp_path, number):
    with start(tmp_path / "job", job) as worker:
        until_features(worker)
        worker.send_signal(number)
        said = [json.loads(line) for line in worker.stdout]
        assert worker.wait(timeout=300) == 130
    assert said[-1]["kind"] == "Cancelled"
    assert not (tmp_path / "job" / "result.json").exists()


def test_it_ends_with_whoever_started_it_and_takes_its_folder_along(job, tmp_path):
    with start(tmp_path / "job", job) as worker:
        until_features(worker)
        worker.stdin.close()  # what happens when Blender dies
        assert worker.wait(timeout=300) != 0
    assert not (tmp_path / "job").exists()


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_only_the_first_interruption_breaks_in(job, tmp_path):
    """Two more come while it tells of the first and while the folder goes."""
    code = (
        "import os, signal, shutil\n"
        "def again(call):\n"
        " def disturbed(*args, **options):\n"
        "  os.kill(os.getpid(), signal.SIGINT)\n"
        "  return call(*args, **options)\n"
        " return disturbed\n"
        "worker._fail, shutil.rmtree = again(worker._fail), again(shutil.rmtree)"
    )
    with prepared(tmp_path / "job", job, code) as worker:
        until_features(worker)
        worker.stdin.close()
        said = [json.loads(line) for line in worker.stdout]
        assert worker.wait(timeout=300) == 130 and worker.stderr.read() == b""
    assert said[-1]["kind"] == "Cancelled" and not (tmp_path / "job").exists()


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("swallowed", ["pass", "raise ImportError('half a library')"])
def test_an_interruption_that_gets_lost_on_the_way_stops_it_all_the_same(job, tmp_path, swallowed):
    code = (
        "import os, signal\n"
        "say = worker._say\n"
        "def lossy(line):\n"
        " say(line)\n"
        " if line.get('stage') == 'features':\n"
        "  try: os.kill(os.getpid(), signal.SIGINT)\n"
        f"  except KeyboardInterrupt: {swallowed}\n"
        "worker._say = lossy"
    )
    with prepared(tmp_path / "job", job, code) as worker:
        said = [json.loads(line) for line in worker.stdout]
        assert worker.wait(timeout=300) == 130
    assert said[-1]["kind"] == "Cancelled"


def test_one_that_waits_in_vain_ends_by_itself(job, tmp_path):
    code = (
        "import dataclasses\n"
        "worker.WORKER = dataclasses.replace(worker.WORKER, longest_wait=0.1)\n"
        "(Path(sys.argv[1]) / 'job.json').unlink()\n"
        "sys.exit(worker.main(Path(sys.argv[1]), True))"
    )
    with prepared(tmp_path / "job", job, code) as worker:
        said = [json.loads(line) for line in worker.stdout]
        assert worker.wait(timeout=300) == 130 and said[-1]["kind"] == "Cancelled"


def test_where_nobody_listens_any_more_its_folder_goes_too(job, tmp_path):
    """Of a parent that dies stdout may be gone a moment before stdin is."""
    with prepared(tmp_path / "job", job, "") as worker:
        worker.stdout.close()
        assert worker.wait(timeout=300) != 0
        worker.stdin.close()
    assert not (tmp_path / "job").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="limits files as Linux does")
def test_a_full_disk_is_said_in_words(job, tmp_path):
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))"
    with prepared(tmp_path / "job", job, full) as worker:
        said = [json.loads(line) for line in worker.stdout]
        assert worker.wait(timeout=300) == 4
        worker.stdin.close()
    assert said[-1]["kind"] == "UnwritableOutput"
    assert "File too large; free some space on its disk" in said[-1]["error"]


def test_a_picture_that_is_gone_is_said_in_words(job, tmp_path):
    gone = {"name": "a.png", "path": str(tmp_path / "a.png"), "digest": True}
    status, said, index = run(tmp_path / "job", {**job, "pictures": [gone, job["pictures"][1]]})
    assert status == 4 and index == {}
    assert said[-1]["kind"] == "UnreadableImage" and "no such file; check the name" in said[-1]["error"]
