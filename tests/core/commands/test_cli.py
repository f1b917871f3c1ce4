"""The `edf` command: its exit codes, what it says where, and that it leaves nothing half done."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from edf_stitch.core import pipeline
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.commands import cli
from edf_stitch.core.commands.cli import main
from edf_stitch.core.commands.messages import shortened
from edf_stitch.core.output.camera_file import camera_table
from edf_stitch.core.output.json_file import json_bytes
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture, picture_from_array
from edf_stitch.core.pipeline import StitchOptions, StitchResult
from edf_stitch.core.system.errors import Cancelled
from edf_stitch.core.system.progress import STAGES
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import KNOWN_WORDS


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def pictures(folder: Path) -> list[str]:
    return [str(folder / "reference.png"), str(folder / "target.png")]


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str]) -> Callable[[], tuple[str, str]]:
    """What went to stdout and stderr since the last time; never a traceback."""

    def read() -> tuple[str, str]:
        out, err = capfd.readouterr()
        assert "Traceback" not in err and "Error(" not in err
        return out, err

    return read


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, small_result: StitchResult) -> list[tuple]:
    """Stitches nothing: gives the small pair's result, and keeps what it was called with."""
    calls: list[tuple] = []

    def stitch(pictures: Sequence[Path], options: StitchOptions, progress: Callable) -> StitchResult:
        calls.append((*pictures, options))
        for number, stage in enumerate(STAGES):
            progress(stage, number / 10)
        return small_result

    monkeypatch.setattr(pipeline, "stitch", stitch)
    return calls


# --- what it does ---------------------------------------------------------------------------------------------------


def test_a_stitch_from_files_to_files(
    pictures: list[str], tmp_path: Path, said: Callable, small_result: StitchResult
) -> None:
    wanted = ["--report", "report.json", "--layers", "layers", "--warp", "warp.npz"]
    wanted = [str(tmp_path / one) if "." in one or one == "layers" else one for one in wanted]
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *KNOWN_WORDS, *wanted]) == 0
    out, err = said()
    assert out == ""
    height, width = small_result.alpha.shape
    assert err.splitlines()[-2:] == ["edf: verdict: good", f"edf: {tmp_path / 'out.png'}: {width}×{height}"]
    assert set(files(tmp_path)) == {
        "out.png", "report.json", "report.timing.json", "report.matches.csv", "warp.npz", "layers/00_reference.png",
        "layers/01_target.png", "layers/occluded_01.png", "layers/confidence.png", "layers/labels.png",
        "layers/seam.png", "layers/canvas.json"}
    # the same as stitch() from Python gives
    expected, _ = encode_picture(small_result.pixels, small_result.alpha, 8, ".png")
    assert (tmp_path / "out.png").read_bytes() == expected
    report = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert report["measured"] == small_result.report["measured"] and report["pictures"][0]["name"] == "reference.png"
    with np.load(tmp_path / "warp.npz") as warp:
        assert np.array_equal(warp["map_x_01"], small_result.warp.maps[1].x)


def test_depth_and_mesh_are_written(pictures: list[str], tmp_path: Path, said: Callable, quick: list) -> None:
    wanted = ["--depth", str(tmp_path / "d.exr"), "--mesh", str(tmp_path / "m.glb"), "--scale-metres", "1,target,0.5"]
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--quiet", *wanted]) == 0
    assert set(files(tmp_path)) == {"out.png", "d.exr", "m.glb"}
    assert quick[0][-1].scale_metres == (1, 2, 0.5)
    ranges = OpenEXR.File(str(tmp_path / "d.exr"), separate_channels=True).channels()["Z"].pixels
    assert ranges.shape == load_picture(tmp_path / "out.png").light.shape[:2]
    assert (tmp_path / "m.glb").read_bytes()[:4] == b"glTF"


def test_a_folder_stands_for_its_pictures_which_are_counted(
    folder: Path, tmp_path: Path, said: Callable, quick: list
) -> None:
    assert main(["stitch", str(folder), "-o", str(tmp_path / "out.png")]) == 0
    assert [path.name for path in quick[0][:-1]] == ["reference.png", "target.png"]
    assert said()[1].splitlines()[0] == "edf: 2 pictures: reference.png, target.png"
    assert main(["stitch", str(folder / "*e*.png"), "-o", str(tmp_path / "other.png"), "--quiet"]) == 0
    assert [path.name for path in quick[1][:-1]] == ["reference.png", "target.png"] and said() == ("", "")
    assert main(["stitch", str(folder / "z*.png"), "-o", str(tmp_path / "none.png")]) == 2
    assert "no pictures of that name" in said()[1]


def test_many_names_are_shortened() -> None:
    names = [f"{number}.png" for number in range(1, 19)]
    assert shortened(names[:6]) == "1.png, 2.png, 3.png, 4.png, 5.png, 6.png"
    assert shortened(names) == "1.png, 2.png, 3.png, 4.png, 5.png, …, 18.png"


def test_the_cameras_that_were_found_are_written(
    pictures: list[str], tmp_path: Path, quick: list, small_result: StitchResult
) -> None:
    file = tmp_path / "cameras.json"
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--cameras-out", str(file)]) == 0
    assert json.loads(file.read_text("utf-8")) == json.loads(json_bytes(camera_table(small_result)))


def test_progress_is_plain_lines_where_there_is_no_terminal(
    pictures: list[str], tmp_path: Path, said: Callable
) -> None:
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *KNOWN_WORDS]) == 0
    lines = said()[1].splitlines()[:-2]
    assert [line.split()[1] for line in lines] == list(STAGES), "one for each stage"
    shares = [int(line.split("(")[1].rstrip("%)")) for line in lines]
    assert shares[0] == 0 and shares == sorted(shares) and shares[-1] == round(100 - 100 * STAGES["write"])


def test_quiet_and_verbose(pictures: list[str], tmp_path: Path, said: Callable, quick: list) -> None:
    assert main(["stitch", *pictures, "-o", str(tmp_path / "quiet.png"), "--quiet"]) == 0
    assert said() == ("", "")
    assert main(["stitch", *pictures, "-o", str(tmp_path / "loud.png"), "--verbose"]) == 0
    out, err = said()
    assert out == "" and all(line.startswith("edf: ") for line in err.splitlines())
    for word in ("general:", "focal length 228.0", "given in px", "field slack:", "alignment", "PSNR", "SSIM",
                 "seconds: read"):  # fmt: skip
        assert word in err, word
    assert quick[0][2].measure is False and quick[1][2].measure is True, "PSNR takes time: on request"


def test_warnings_are_told_even_when_quiet(
    pictures: list[str], tmp_path: Path, said: Callable, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult
) -> None:
    doubtful = replace(small_result, warnings=("the sky is falling",))
    monkeypatch.setattr(pipeline, "stitch", lambda *_, **__: doubtful)
    report = tmp_path / "report.json"
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--quiet", "--report", str(report)]) == 0
    assert said() == ("", "edf: warning: the sky is falling\n")
    assert json.loads(report.read_text("utf-8"))["warnings"] == ["the sky is falling"]


@pytest.mark.parametrize("rating, told, code", [
    ("good", None, 0),
    ("look", "edf: verdict: look at these places: a seam (3,4 5×6, 7,8 9×10); a fold (1,2 3×4); it is mirrored; "
             "mend it", 0),
    ("not usable", "edf: verdict: not usable: it is mirrored; mend it", 1),
])  # fmt: skip
def test_the_verdict_comes_first_and_may_be_the_exit_code(
    rating: str, told: str | None, code: int, pictures: list[str], tmp_path: Path, said: Callable,
    monkeypatch: pytest.MonkeyPatch, small_result: StitchResult,
) -> None:  # fmt: skip
    places = [([3, 4, 5, 6], "a seam"), ([1, 2, 3, 4], "a fold"), ([7, 8, 9, 10], "a seam")]
    verdict = {
        "is": rating, "because": "it is mirrored", "what_to_do": "mend it",
        "places": [{"box": box, "what": what} for box, what in places],
    }  # fmt: skip
    result = replace(small_result, report={**small_result.report, "verdict": verdict}, warnings=("rain",))
    monkeypatch.setattr(pipeline, "stitch", lambda *_, **__: result)
    given = ["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--overwrite"]
    assert main(given) == 0
    lines = [line for line in said()[1].splitlines() if "write (" not in line]
    assert lines[0] == (told or "edf: verdict: good") and lines[-1] == "edf: warning: rain"
    assert main([*given, "--quiet", "--strict-verdict"]) == code
    assert said()[1].splitlines() == [*([told] if told else []), "edf: warning: rain"]


def test_json_is_a_document_on_stdout(pictures: list[str], tmp_path: Path, said: Callable, quick: list) -> None:
    out, report = str(tmp_path / "out.png"), str(tmp_path / "r.json")
    assert main(["stitch", *pictures, "-o", out, "--report", report, "--json", "--quiet"]) == 0
    document, err = said()
    found = json.loads(document)
    assert err == "" and found["files"] == {"panorama": out, "report": report} and found["schema"] == 1
    assert found["verdict"]["is"] == "good" and found["warnings"] == []
    assert load_picture(Path(out)).light.shape[:2] == (found["height"], found["width"])


def test_pictures_and_options_reach_the_stitch(pictures: list[str], tmp_path: Path, quick: list) -> None:
    """What each option becomes is test_arguments' business."""
    given = ["--focal-px", "1200", "--field", "paper", "--fade", "infinity", "--matches", "m.csv", "--seed", "7"]
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *given]) == 0
    expected = StitchOptions(
        "paper", "infinity", CameraRequest(focal_px=(1200.0,)), matches=Path("m.csv"), seed=7, measure=False
    )
    assert quick == [(Path(pictures[0]), Path(pictures[1]), expected)]


def test_a_focal_length_in_mm_is_along_the_longer_side(pictures: list[str], tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    given = ["--focal-mm", "34.2", "--sensor-mm", "36", "--report", str(report), "--quiet"]
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *given]) == 0
    view = json.loads(report.read_text("utf-8"))["two_view"]
    assert view["focal_px"] == pytest.approx([228, 228]) and view["focal_source"] == "given in mm"


def test_a_camera_file_with_the_pictures_names(
    pictures: list[str], tmp_path: Path, small_pair: Pair, said: Callable
) -> None:
    table = {
        name: {"K": c.K.tolist(), "R": c.R.tolist(), "t": c.t.tolist(), "distortion": [0, 0]}
        for name, c in (("target.png", small_pair.target_camera), ("reference.png", small_pair.reference_camera))
    }
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": table}), "utf-8")
    arguments = ["--cameras", str(tmp_path / "cameras.json"), "--warp", str(tmp_path / "warp.npz"), "--quiet"]
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *arguments]) == 0
    assert said() == ("", "")
    first, second = small_pair.reference_camera, small_pair.target_camera
    with np.load(tmp_path / "warp.npz") as warp:
        assert np.allclose(warp["R"][1], second.R @ first.R.T) and np.allclose(warp["K"][0], first.K)
    del table["target.png"]
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": table}), "utf-8")
    assert main(["stitch", *pictures, "-o", str(tmp_path / "other.png"), *arguments, "--overwrite"]) == 2
    assert "no camera named 'target.png'" in said()[1] and not (tmp_path / "other.png").exists()


def test_names_in_any_script(pictures: list[str], tmp_path: Path, said: Callable, quick: list) -> None:
    there = tmp_path / "Größe ☃ 写真"
    there.mkdir()
    assert main(["stitch", *pictures, "-o", str(there / "näher.png"), "--report", str(there / "é.json")]) == 0
    assert "näher.png" in said()[1]
    assert set(files(there)) == {"näher.png", "é.json", "é.timing.json", "é.matches.csv"}


def test_pictures_with_names_in_any_script(folder: Path, tmp_path: Path, said: Callable) -> None:
    there = tmp_path / "Größe ☃ 写真"
    shutil.copytree(folder, there)
    for name in ("reference", "target"):
        (there / f"{name}.png").rename(there / f"{name} ä.png")
    names = [str(there / f"{name} ä.png") for name in ("reference", "target")]
    assert main(["stitch", *names, "-o", str(there / "ö.jpg"), *KNOWN_WORDS, "--quiet"]) == 0
    assert said() == ("", "") and load_picture(there / "ö.jpg").view.shape[1] > 300


def test_the_version_goes_to_stdout(said: Callable) -> None:
    import tomllib

    manifest = Path(cli.__file__).parents[2] / "blender_manifest.toml"
    version = tomllib.loads(manifest.read_text("utf-8"))["version"]
    assert main(["--version"]) == 0 and said() == (f"{version}\n", "")


@pytest.mark.parametrize("arguments", [["--help"], ["stitch", "--help"], ["demo", "--help"]])
def test_help_goes_to_stdout(said: Callable, arguments: list[str]) -> None:
    assert main(arguments) == 0
    out, err = said()
    assert out.startswith("usage: edf") and err == ""


def test_the_demo_prints_its_figures_and_says_where_its_files_are(
    tmp_path: Path, said: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    from edf_stitch.synthetic_scenes import demo

    asked: list[tuple] = []
    monkeypatch.setattr(demo, "run_demo", lambda folder, overwrite, _: asked.append((folder, overwrite)) or ["a", "b"])
    assert main(["demo", "-o", str(tmp_path / "x"), "--overwrite"]) == 0 and main(["demo"]) == 0
    assert said() == ("a\nb\na\nb\n", "") and asked == [(tmp_path / "x", True), (Path("edf_demo"), False)]


# --- refusals -------------------------------------------------------------------------------------------------------

WRONG = [
    ["--field", "nonsense"], ["--fade", "slowly"], ["--nonsense"], ["--seed", "x"], ["--seed", "-1"], ["--scale", "0"],
    ["--quiet", "--verbose"], ["--principal", "1"], ["--focal-px", "abc"], ["--focal-px", "0"], ["--focal-px"],
    ["--focal-mm", "35"], ["--crop", "tight"], ["--focal35", "28", "--cameras", "c.json"],
    ["--projection", "fisheye"], ["--projection", "cylindrical", "--field", "paper"],
    ["--projection", "reference", "--level=1,2,3"],
    ["--projection", "equirectangular", "--level", "north"],
]  # fmt: skip


@pytest.mark.parametrize("arguments", WRONG, ids=" ".join)
def test_a_wrong_call_gives_2(
    pictures: list[str], tmp_path: Path, said: Callable, arguments: list[str]
) -> None:
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *arguments]) == 2
    out, err = said()
    assert out == "" and len(err.splitlines()[-1]) > 20 and files(tmp_path) == {}


def test_a_wrong_choice_is_one_line_that_names_the_choices(pictures: list[str], tmp_path: Path, said: Callable) -> None:
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--projection", "fisheye"]) == 2
    (line,) = said()[1].splitlines()
    assert line.startswith("edf stitch: argument --projection: 'fisheye' is not known")
    assert all(kind in line for kind in ("auto", "reference", "pannini", "cylindrical", "equirectangular"))


@pytest.mark.parametrize("arguments", [
    [], ["nonsense"], ["stitch"], ["batch"], ["compare"], ["demo", "what"], ["--quiet"], ["info"],
])  # fmt: skip
def test_a_call_without_what_it_needs_gives_2(said: Callable, arguments: list[str]) -> None:
    assert main(arguments) == 2
    out, err = said()
    assert out == "" and err.startswith("usage: edf")


@pytest.mark.parametrize("name", ["out.gif", "out", "out.npz"])
def test_a_kind_of_file_that_is_not_written_gives_2(
    pictures: list[str], tmp_path: Path, said: Callable, quick: list, name: str
) -> None:
    assert main(["stitch", *pictures, "-o", str(tmp_path / name)]) == 2
    assert ".png" in said()[1] and quick == []
    for file in ("--warp", "warp.exr"), ("--depth", "depth.png"), ("--mesh", "mesh.obj"):
        assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), file[0], str(tmp_path / file[1])]) == 2
    assert ".npz" in said()[1] and quick == []


def test_what_only_two_pictures_know_is_refused_of_more(pictures: list[str], tmp_path: Path, said: Callable) -> None:
    three = ["stitch", *pictures, pictures[0], "-o", str(tmp_path / "out.png")]
    for words, told in (
        (["--field", "apap"], "3 are given: choose from: slack, strict"), (["--focal-px", "9,8"], "--cameras FILE"),
        (["--ignore-ref", pictures[0]], "--ignore NAME=MASK"), (["--mask", pictures[0]], "--ignore NAME=MASK"),
    ):  # fmt: skip
        assert main([*three, *words]) == 2
        assert told in said()[1]


def test_dense_is_for_two_pictures_and_for_more(
    pictures: list[str], tmp_path: Path, said: Callable, quick: list
) -> None:
    for number, given in enumerate((pictures, [*pictures, pictures[0]])):
        for words, dense in (([], True), (["--dense"], True), (["--no-dense"], False)):
            out = str(tmp_path / f"{number}{len(words)}{dense}.png")
            assert main(["stitch", *given, "-o", out, "--quiet", *words]) == 0
            assert said()[1] == "" and quick[-1][-1].dense == dense


def test_what_cannot_be_stitched_gives_3(pictures: list[str], tmp_path: Path, said: Callable) -> None:
    random = np.random.default_rng(0).integers(0, 256, (90, 120, 3), dtype=np.uint8)
    data, _ = encode_picture(picture_from_array(random).pixels, None, 8, ".png")
    (tmp_path / "noise.png").write_bytes(data)
    assert main(["stitch", pictures[0], str(tmp_path / "noise.png"), "-o", str(tmp_path / "out.png")]) == 3
    out, err = said()
    assert out == "" and "at least 16 needed" in err.splitlines()[-1] and err.splitlines()[-1].startswith("edf: ")
    assert main(["stitch", pictures[0], pictures[0], "-o", str(tmp_path / "out.png"), "--quiet"]) == 3
    assert "same picture" in said()[1] and set(files(tmp_path)) == {"noise.png"}


def test_a_wrong_name_is_told_before_the_work(pictures: list[str], tmp_path: Path, said: Callable, quick: list) -> None:
    for option in (["--viewpoint", "nobody"], ["--ignore", f"nobody={pictures[0]}"]):
        assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *option]) == 2
        assert "no picture is called 'nobody'; there are: reference.png, target.png" in said()[1]
    assert not quick


def test_what_cannot_be_read_gives_4(pictures: list[str], tmp_path: Path, said: Callable) -> None:
    (tmp_path / "no.png").write_bytes(b"not a picture")
    (tmp_path / "c.json").write_text("{", "utf-8")
    out = str(tmp_path / "out.png")
    for arguments, code, word in (
        ([pictures[0], str(tmp_path / "missing.png")], 4, "missing.png: no such file"),
        ([str(tmp_path / "no.png"), pictures[1]], 4, "no.png: not a picture"),
        ([*pictures, "--cameras", str(tmp_path / "missing.json")], 4, "missing.json"),
        ([*pictures, "--cameras", str(tmp_path / "c.json")], 2, "not JSON"),
    ):
        assert main(["stitch", *arguments, "-o", out, "--quiet"]) == code, arguments
        printed, err = said()
        assert printed == "" and word in err and len(err.splitlines()) == 1
    assert set(files(tmp_path)) == {"no.png", "c.json"}


def test_what_cannot_be_written_gives_4_before_the_work(
    pictures: list[str], tmp_path: Path, said: Callable, quick: list
) -> None:
    (tmp_path / "there.png").write_bytes(b"mine")
    out, missing = str(tmp_path / "out.png"), str(tmp_path / "missing" / "x")
    for arguments, word in (
        (["-o", missing + ".png"], "no folder"), (["-o", out, "--report", missing + ".json"], "no folder"),
        (["-o", out, "--warp", missing + ".npz"], "no folder"),
        (["-o", str(tmp_path / "there.png")], "there.png exists: use --overwrite"),
        (["-o", out, "--layers", str(tmp_path / "there.png")], "is a file, not a folder"),
    ):  # fmt: skip
        assert main(["stitch", *pictures, *arguments]) == 4
        assert word in said()[1]
    assert files(tmp_path) == {"there.png": b"mine"} and quick == []
    assert main(["stitch", *pictures, "-o", str(tmp_path / "there.png"), "--overwrite", "--quiet"]) == 0
    assert (tmp_path / "there.png").read_bytes() != b"mine"


@pytest.mark.parametrize(("trouble", "code", "word"), [
    (KeyboardInterrupt(), 130, "interrupted, nothing was written"), (Cancelled(), 130, "cancelled"),
    (MemoryError(), 3, "not enough memory"), (RuntimeError("(-215:Assertion failed)"), None, "Assertion failed"),
])  # fmt: skip
def test_trouble_in_the_middle_is_told_in_a_line(
    pictures: list[str], tmp_path: Path, said: Callable, monkeypatch: pytest.MonkeyPatch, trouble: BaseException,
    code: int | None, word: str,
) -> None:
    """No bare traceback reaches a user, not even for a mistake of ours."""

    def stitch(*_: object, **__: object) -> None:
        raise trouble

    monkeypatch.setattr(pipeline, "stitch", stitch)
    found = main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--layers", str(tmp_path / "new")])
    assert found == code if code else found not in (0, 1, 2, 130)
    out, err = said()
    assert out == "" and word in err and len(err.splitlines()) == 1 and list(tmp_path.iterdir()) == []


# --- the process ----------------------------------------------------------------------------------------------------


def edf(*arguments: str | Path, **environment: str | None) -> list:
    """The command line and environment of a process of its own."""
    env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment}
    env = {name: value for name, value in env.items() if value is not None}
    return [[sys.executable, "-m", "edf_stitch", *map(str, arguments)], env]


def run(*arguments: str | Path, cwd: Path, **environment: str | None) -> subprocess.CompletedProcess[str]:
    line, env = edf(*arguments, **environment)
    return subprocess.run(line, env=env, cwd=cwd, capture_output=True, text=True, encoding="utf-8", timeout=120)


def test_importing_the_command_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys, edf_stitch.core.commands.cli as c\n"
        "c.main(['stitch', 'a.png', 'c.png', '-o', 'b.png', '--field', 'nonsense'])\n"
        "print(sorted({'numpy', 'cv2', 'scipy', 'poselib', 'tqdm', 'bpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == "[]\n" and "is not known" in done.stderr


def test_a_stitch_loads_no_optimiser_before_it_needs_one(tmp_path: Path) -> None:
    code = "import sys, edf_stitch.core.pipeline\nprint('scipy.linalg' in sys.modules, 'scipy.optimize' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == "True False\n", done.stderr


@pytest.mark.slow
def test_the_same_bytes_whatever_blas_was_told(folder: Path, tmp_path: Path) -> None:
    """BLAS gives other bytes with other thread counts; the command sees to it that there is one."""
    found = []
    for number, threads in enumerate(("1", None, "2")):
        out = tmp_path / str(number)
        out.mkdir()
        done = run("stitch", folder / "reference.png", folder / "target.png", "-o", "out.png", "--warp", "warp.npz",
                   "--report", "report.json", cwd=out, OPENBLAS_NUM_THREADS=threads)  # fmt: skip
        assert done.returncode == 0 and done.stdout == "", done.stderr
        found.append({name: data for name, data in files(out).items() if "timing" not in name})
        assert set(found[-1]) == {"out.png", "warp.npz", "report.json", "report.matches.csv"}
    assert found[0] == found[1] == found[2]


def test_one_thread_is_set_before_numpy_loads(tmp_path: Path) -> None:
    code = (
        "import sys, os, edf_stitch.core.commands.cli as c\n"
        "assert 'numpy' not in sys.modules\n"
        "c.main(['stitch', 'a.png', 'b.png', '-o', 'out.png'])\n"
        "print('numpy' in sys.modules, os.environ['OPENBLAS_NUM_THREADS'])"
    )
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True,
                          timeout=120)  # fmt: skip
    assert done.stdout == "True 1\n" and "a.png, b.png: no such file" in done.stderr


# `edf` that stops to think where a stage begins, or with all its files written and none in place yet ("written"): so it
# is there when the signal comes, however quick or busy the machine.
THINKING = """
import sys, time
from edf_stitch.core.commands import cli
from edf_stitch.core import pipeline
stage = sys.argv.pop(1)
class Thinking(pipeline.Stopwatch):
    def __call__(self, name, fraction=0.0):
        super().__call__(name, fraction)
        if name == stage:
            time.sleep(600)
pipeline.Stopwatch = Thinking
def written():
    print("edf: written", file=sys.stderr, flush=True)
    time.sleep(600)
if stage == "written":
    cli._too_late_to_interrupt = written
sys.exit(cli.main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
@pytest.mark.parametrize("stage", ["read", "features", "geometry", "write", "written"])
def test_a_signal_in_the_middle_leaves_nothing(
    folder: Path, tmp_path: Path, found_before: Path, number: signal.Signals, stage: str
) -> None:
    (python, *_), env = edf(**({"EDF_CACHE": str(found_before)} if stage.startswith("writ") else {}))
    line = [python, "-c", THINKING, stage, "stitch", folder / "reference.png", folder / "target.png",
            "-o", tmp_path / "out.png", "--report", tmp_path / "report.json", "--layers", tmp_path / "new" / "layers"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(list(map(str, line)), env=env, cwd=tmp_path, **pipes) as job:
        while not (said := job.stderr.readline()).startswith(f"edf: {stage}"):
            assert said, "it ended before"
        job.send_signal(number)
        out, err = job.communicate(timeout=300)
    assert job.returncode == 130 and out == ""
    assert err.splitlines()[-1] == "edf: interrupted, nothing was written" and "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_a_signal_that_comes_while_an_object_goes_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Python ignores what is raised there, and says so."""

    class Thing:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)
            time.sleep(0)

    def work(_: object) -> int:
        Thing()
        time.sleep(0.2)
        for _ in range(200):
            time.sleep(0.02)
        return 0

    monkeypatch.setitem(cli._COMMANDS, "demo", work)
    before = sys.unraisablehook
    assert main(["demo"]) == 130 and sys.unraisablehook is before
    assert capfd.readouterr().err == "edf: interrupted, nothing was written\n"


def test_the_handler_of_the_terminating_signal_is_put_back(said: Callable) -> None:
    def mine(*_: object) -> None:
        pass

    before = signal.signal(signal.SIGTERM, mine)
    try:
        assert main(["--version"]) == 0 and main(["nonsense"]) == 2
        assert signal.getsignal(signal.SIGTERM) is mine
    finally:
        signal.signal(signal.SIGTERM, before)


def test_it_also_runs_outside_the_main_thread(pictures: list[str], tmp_path: Path, quick: list) -> None:
    found: list[int] = []
    arguments = ["stitch", *pictures, "-o", str(tmp_path / "out.png"), "--quiet"]
    thread = threading.Thread(target=lambda: found.append(main(arguments)))
    thread.start()
    thread.join()
    assert found == [0] and set(files(tmp_path)) == {"out.png"}


def test_progress_never_goes_back(
    pictures: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    totals: list[float] = []

    @contextmanager
    def shown(_quiet: bool) -> Iterator[Callable[[str, float], None]]:
        yield lambda _stage, total: totals.append(total)

    monkeypatch.setattr(cli, "progress_shown", shown)
    assert main(["stitch", *pictures, "-o", str(tmp_path / "out.png"), *KNOWN_WORDS]) == 0
    assert totals == sorted(totals) and totals[0] == 0 and totals[-1] <= 1


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_on_a_terminal_there_is_a_bar(folder: Path, tmp_path: Path) -> None:
    import fcntl
    import pty
    import struct
    import termios

    try:
        ours, theirs = pty.openpty()
    except OSError:
        pytest.skip("no pseudo-terminals here")
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    line, env = edf("stitch", folder / "reference.png", folder / "target.png", "-o", tmp_path / "out.png", TERM="xterm")
    with subprocess.Popen(line, env=env, cwd=tmp_path, stdout=subprocess.PIPE, stderr=theirs) as job:
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(ours, 4096):
                shown += part
        except OSError:  # Linux says so when the other side has gone
            pass
        assert job.wait(300) == 0 and job.stdout.read() == b""
    os.close(ours)
    text = shown.decode("utf-8")
    assert "features" in text and " %" in text and "\r" in text and "edf: features" not in text
    assert re.search(r"edf: verdict: good\s+edf: .*out\.png: \d+×\d+\s+edf: warning", text), "and then what came out"
