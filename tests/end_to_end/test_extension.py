"""The extension as an artist or a farm has it: a zip, installed in a whole Blender and used there without a window.

BLENDER_RUN says how that Blender is started. Every run has a home of its own, so nothing on the machine is touched.
"""

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
BLENDER = shlex.split(os.environ.get("BLENDER_RUN", ""))
ADD_ON = "bl_ext.user_default.edf_stitch"

pytestmark = [pytest.mark.blender, pytest.mark.skipif(not BLENDER, reason="BLENDER_RUN names no Blender")]


class Home:
    """A Blender with settings and extensions of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder)}

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess:
        command = [*BLENDER, "-b", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=self.environment, timeout=1200)

    def edf(self, *arguments: str | Path) -> subprocess.CompletedProcess:
        return self.run("--command", "edf", *arguments)


def build(output: Path, *options: str) -> Path:
    script = ROOT / ".ci" / "build_extension.py"
    command = [sys.executable, script, "--platform", "linux-x64", "--output-dir", output, *options]
    subprocess.run(command, check=True, cwd=ROOT, timeout=300)
    return output / f"edf_stitch-{MANIFEST['version']}-linux-x64.zip"


@pytest.fixture(scope="module")
def python() -> str:
    """The Python inside that Blender, as wheels name it; a zip for it alone is quickly made."""
    code = "import sys; print('PYTHON %d.%d' % sys.version_info[:2])"
    command = [*BLENDER, "-b", "--python-expr", code]
    said = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    return said.stdout.split("PYTHON ")[1].split()[0]


@pytest.fixture(scope="module")
def archive(python: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built by Blender, and found valid by it."""
    return build(tmp_path_factory.mktemp("zip"), "--python", python, "--blender", shlex.join(BLENDER))


@pytest.fixture(scope="module")
def home(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Home:
    """With the extension installed from its zip and switched on."""
    new = Home(tmp_path_factory.mktemp("home"))
    done = new.run("--command", "extension", "install-file", "-r", "user_default", "--enable", archive)
    assert done.returncode == 0, done.stdout + done.stderr
    return new


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two pictures of a wall with a board in front of it, from two places side by side: 480×360 px."""
    random = np.random.default_rng(5)

    def texture(width: int, height: int) -> np.ndarray:
        noise = random.normal(size=(height, width, 3))
        scales = [cv2.GaussianBlur(noise, None, sigma) * sigma for sigma in (1.5, 4, 12)]
        return np.clip(128 + 90 * sum(scales), 0, 255).astype(np.uint8)

    wall, board = texture(700, 360), texture(150, 170)
    folder = tmp_path_factory.mktemp("pair")
    paths = folder / "left.png", folder / "right.png"
    # The camera goes 1 to the right: the wall moves by 100 px, the board, twice as near, by 200.
    for path, wall_at, board_at in zip(paths, (0, 100), (300, 100), strict=True):
        picture = wall[:, wall_at : wall_at + 480].copy()
        picture[90:260, board_at : board_at + 150] = board
        cv2.imwrite(str(path), picture)
    return paths


def test_python_zips_the_same_files_as_blender(archive, python, tmp_path):
    with zipfile.ZipFile(archive) as blenders, zipfile.ZipFile(build(tmp_path, "--python", python)) as pythons:
        assert sorted(blenders.namelist()) == sorted(pythons.namelist())
        assert all(blenders.read(name) == pythons.read(name) for name in pythons.namelist())


def test_the_command_says_its_version(home):
    done = home.edf("--version")
    assert done.returncode == 0, done.stderr
    assert MANIFEST["version"] in done.stdout


def test_a_farm_without_settings_has_the_command_too(home):
    done = home.run("--factory-startup", "--addons", ADD_ON, "--command", "edf", "--version")
    assert (done.returncode, MANIFEST["version"] in done.stdout) == (0, True), done.stderr


def test_switching_off_and_on_again(home):
    code = (
        "import addon_utils\n"
        "for _ in range(2):\n"
        f"    addon_utils.disable({ADD_ON!r}, default_set=False)\n"
        f"    assert addon_utils.enable({ADD_ON!r}, default_set=False)\n"
    )
    done = home.run("--python-exit-code", "9", "--python-expr", code)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in (done.stdout + done.stderr).lower()


ARTIST = """
import bpy
from pathlib import Path
left, right, folder = map(Path, {paths!r})
bpy.ops.edf.open_pair(directory=str(left.parent), files=[{{"name": left.name}}, {{"name": right.name}}])
bpy.ops.edf.reference_frame()
assert bpy.ops.edf.stitch() == {{"FINISHED"}}
for kind in ("exr", "png"):
    assert bpy.ops.edf.save(filepath=str(folder / f"panorama.{{kind}}")) == {{"FINISHED"}}
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
"""
DEVELOPED = """
import bpy, sys
from pathlib import Path
left, right = map(Path, {paths!r})
bpy.ops.edf.open_pair(directory=str(left.parent), files=[{{"name": left.name}}, {{"name": right.name}}])
settings = bpy.context.scene.edf_stitch
assert [tuple(one.size) for one in (settings.reference, settings.target)] == [(480, 360)] * 2
assert bpy.ops.edf.stitch() == {{"FINISHED"}}
assert settings.result.is_float and not {{"rawpy", "_pi_heif"}} & set(sys.modules)
"""
AGAIN = """
import bpy
panorama = bpy.context.scene.edf_stitch.result
assert panorama.size[0] > 480 and panorama.packed_file, panorama
assert bpy.ops.edf.restitch() == {"FINISHED"}
assert bpy.context.scene.edf_stitch.result != panorama
"""


ARTISTS_SET = """
import bpy
folder, out = {paths!r}
assert bpy.ops.edf.add_folder(directory=folder) == {{"FINISHED"}}
settings, scene = bpy.context.scene.edf_stitch, bpy.context.scene
settings.dense = False
world, scene.world = scene.world, None
assert bpy.ops.edf.stitch_environment() == {{"FINISHED"}}
assert [entry.state for entry in settings.pictures] == ["USED"] * 3
assert scene.world is not None and scene.world != world
before = (scene.camera, scene.render.resolution_x, scene.frame_end)
assert bpy.ops.edf.create_cameras() == {{"FINISHED"}}
behind = [one.data.background_images[0].image.name for one in bpy.context.selected_objects]
assert {{"1.png", "2.png", "3.png"}} <= set(behind)
assert (scene.camera, scene.render.resolution_x, scene.frame_end) == before
bpy.ops.wm.save_as_mainfile(filepath=out)
"""
SET_AGAIN = """
import bpy
settings = bpy.context.scene.edf_stitch
panorama, world = settings.result, bpy.context.scene.world
assert panorama.packed_file and panorama.size[0] == 2 * panorama.size[1], tuple(panorama.size)
assert [entry.image.name for entry in settings.pictures] == ["1.png", "2.png", "3.png"]
bpy.ops.ed.undo_push(message="before")
assert bpy.ops.edf.restitch() == {"FINISHED"}
bpy.ops.ed.undo_push(message="Stitch Again")
again = settings.result.name
bpy.ops.ed.undo()
settings = bpy.context.scene.edf_stitch
assert settings.result.name != again and again not in bpy.data.images
"""


def test_a_set_becomes_an_environment_with_cameras_and_is_stitched_again_tomorrow(home, tmp_path):
    from ..sets import make_set

    (tmp_path / "set").mkdir()
    for picture in make_set(3).pictures:
        cv2.imwrite(str(tmp_path / "set" / picture.name), picture.view[..., ::-1])
    code = ARTISTS_SET.format(paths=(str(tmp_path / "set"), str(tmp_path / "set.blend")))
    done = home.run("--python-exit-code", "9", "--python-expr", code)
    assert done.returncode == 0, done.stdout + done.stderr
    done = home.run(tmp_path / "set.blend", "--python-exit-code", "9", "--python-expr", SET_AGAIN)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "rna" not in done.stderr.lower()


def test_camera_raw_and_heic_are_opened_and_stitched(home, pair, tmp_path):
    from edf_stitch.core.pictures.picture import load_picture

    from ..core.pictures.raw_and_heic import dng, heic, mosaic

    pictures = [load_picture(path) for path in pair]
    paths = [tmp_path / "a.dng", tmp_path / "b.heic"]
    paths[0].write_bytes(dng(mosaic(pictures[0].pixels)))
    paths[1].write_bytes(heic(pictures[1].view))
    done = home.edf("stitch", *paths, "-o", tmp_path / "out.exr")
    assert done.returncode == 0 and load_picture(tmp_path / "out.exr").pixels.shape[1] > 480, done.stderr
    done = home.run("--python-exit-code", "9", "--python-expr", DEVELOPED.format(paths=[*map(str, paths)]))
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_artists_way_from_two_photographs_to_a_file_and_again_tomorrow(home, pair, tmp_path):
    from edf_stitch.core.pictures.picture import load_picture

    code = ARTIST.format(paths=[*map(str, pair), str(tmp_path)])
    done = home.run("--python-exit-code", "9", "--python-expr", code)
    assert done.returncode == 0, done.stdout + done.stderr
    light, shown = (load_picture(tmp_path / f"panorama.{kind}") for kind in ("exr", "png"))
    assert np.abs(light.pixels - shown.pixels).max() < 1e-4
    # the left of the reference, which the target does not see, is there as it was, the right way up
    patch = load_picture(pair[0]).view[100:260, 10:60]
    found = cv2.matchTemplate(shown.view, patch, cv2.TM_SQDIFF)
    assert found.min() == 0 and shown.view.shape[1] > 480
    done = home.run(tmp_path / "scene.blend", "--python-exit-code", "9", "--python-expr", AGAIN)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_add_ons_own_tests_inside_this_blender(home, python, tmp_path):
    """The same tests as those of bpy as a module, against what was installed."""
    tools = tmp_path / "tools"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--target", tools, "--python-version", python]
    command += ["--only-binary=:all:", "--constraint", ROOT / ".ci" / "constraints.txt", "pytest", "hypothesis"]
    subprocess.run(command, check=True, cwd=ROOT, timeout=300)
    script = ROOT / "tests" / "end_to_end" / "inside_blender.py"
    done = home.run("--python-exit-code", "9", "--python", script, "--", tools, "-q", "tests/edf_addon")
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    assert " passed" in done.stdout and " failed" not in done.stdout


def test_a_wrong_option_gives_2(home):
    done = home.edf("stitch", "a.png", "b.png", "-o", "out.png", "--no-such-option")
    assert done.returncode == 2
    assert "no-such-option" in done.stderr


def test_a_pair_without_content_gives_3_and_no_traceback(home, tmp_path):
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), np.full((120, 160, 3), 128, np.uint8))
    done = home.edf("stitch", tmp_path / "a.png", tmp_path / "b.png", "-o", tmp_path / "out.png")
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out.png").exists()


def test_the_demo(home, tmp_path):
    done = home.edf("demo", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stdout + done.stderr
    pictures = {path.stem: cv2.imread(str(path)) for path in (tmp_path / "out").rglob("*.png")}
    assert {"reference", "target", "panorama", "truth"} <= set(pictures)
    assert pictures["panorama"].shape[1] > pictures["reference"].shape[1]
    assert np.isfinite(np.load(tmp_path / "out" / "warp.npz")["map_x_01"]).any()
    rotation = next(line for line in done.stdout.splitlines() if line.startswith("rotation error"))
    assert float(rotation.split()[2]) < 0.1


def test_the_quick_validation_passes_in_blender(home, tmp_path):
    """Door one of three: the installed extension renders with the Blender that it lives in."""
    done = home.edf("validate", "-o", tmp_path / "out")
    assert (tmp_path / "out" / "report.html").exists(), done.stdout + done.stderr
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))
    assert report["passed"] and {scene["blender"] for scene in report["scenes"]} != {""}


def test_a_checkout_validates_with_the_installed_wheels(home, tmp_path):
    """Door two: `blender -b --python` from a checkout."""
    script = ROOT / "synthetic_scenes" / "in_blender.py"
    call = ["validate", "-o", tmp_path / "out", "--scene", "pure_rotation"]
    done = home.run("--python-exit-code", "9", "--python", script, "--", *call)
    assert "PASSED" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_batch_goes_on_after_a_bad_pair(home, pair, tmp_path):
    """A pair, one that is no pair, and a clip of two frames; then the same call again, which makes nothing anew."""
    left, right = pair
    for frame in (1, 2):
        shutil.copy(left, tmp_path / f"l_{frame:04d}.png")
        shutil.copy(right, tmp_path / f"r_{frame:04d}.png")
    rows = ["reference,target,name", f"{left},{right},good", f"{left},{left},bad", "l_####.png,r_####.png,clip"]
    (tmp_path / "list.csv").write_text("\n".join(rows), "utf-8")
    call = ("batch", tmp_path / "list.csv", "-o", tmp_path / "out", "--resume", "--keep-going")
    done = home.edf(*call)
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    made = {str(path.relative_to(tmp_path / "out")): path.stat().st_mtime_ns for path in tmp_path.rglob("out/**/*.png")}
    assert set(made) == {"good.png", "clip/clip_0001.png", "clip/clip_0002.png"}
    assert home.edf(*call).returncode == 1
    assert made == {name: (tmp_path / "out" / name).stat().st_mtime_ns for name in made}


def test_blenders_worker_stitches_as_the_checkout_does(home, pair, tmp_path):
    """Not byte for byte: Blender has another NumPy than the checkout, and other last digits."""
    warps = []
    for name in ("blender", "checkout"):
        call = ["stitch", *map(str, pair), "-o", str(tmp_path / f"{name}.png"), "--warp", str(tmp_path / f"{name}.npz")]
        # at the board's rim last digits decide which of two places a dense search takes
        call += ["--focal-px", "500", "--field", "strict", "--no-dense", "--projection", "reference"]
        if name == "blender":
            done = home.edf(*call)
        else:
            command = [sys.executable, "-m", "edf_stitch", *call]
            done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT.parent, timeout=300)
        assert done.returncode == 0, done.stderr
        warps.append(np.load(tmp_path / f"{name}.npz"))
    ours, theirs = warps
    assert np.abs(ours["offset"] - theirs["offset"]).max() <= 1
    # Where the reference lies, in reference pixels, so that a canvas that begins a pixel earlier does not matter.
    maps = []
    for warp in warps:
        x, y = warp["offset"]
        maps.append(np.stack([warp[key][y : y + 360, x : x + 480] for key in ("map_x_01", "map_y_01")]))
    apart = np.hypot(*(maps[0] - maps[1]))
    assert np.nanmedian(apart) < 0.1
    assert np.nanpercentile(apart, 99) < 1.0


def test_twice_in_blender_gives_the_same_bytes(home, pair, tmp_path):
    for name in ("a", "b"):
        done = home.edf("stitch", *pair, "-o", tmp_path / f"{name}.png", "--warp", tmp_path / f"{name}.npz")
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    first, second = np.load(tmp_path / "a.npz"), np.load(tmp_path / "b.npz")
    assert all(first[key].tobytes() == second[key].tobytes() for key in first)


def test_ctrl_c_gives_130_and_leaves_nothing_behind(home, pair, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    arguments = ["-o", out / "panorama.png", "--warp", out / "warp.npz", "--report", out / "report.json"]
    command = [*BLENDER, "-b", "--command", "edf", "stitch", *map(str, [*pair, *arguments])]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=ROOT, env=home.environment, start_new_session=True, **streams) as process:
        # The first word of progress: from here on there is something to interrupt.
        said = ""
        while "features" not in said and (line := process.stderr.readline()):
            said += line
        # As a terminal does it: to everything that runs in front.
        os.killpg(process.pid, signal.SIGINT)
        said += process.communicate(timeout=60)[1]
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert not list(out.iterdir())
