"""What stands in .ci: the check of the system before set-up, the lock of the wheels, the extension's zip."""

import importlib.util
import json
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))


def load(name: str):
    """A script of .ci, which is no package."""
    spec = importlib.util.spec_from_file_location(f"ci_{name}", ROOT / ".ci" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


check_system = load("check_system")
build_extension = load("build_extension")
wheels = build_extension.wheels


def without(*absent: str):
    def load_library(name: str) -> None:
        if name in absent:
            raise OSError(f"{name}: cannot open shared object file")

    return load_library


def test_a_complete_system_misses_nothing():
    assert check_system.missing_packages(without(), lambda name: name, wants_bpy=True) == []


def test_exactly_what_is_missing_is_named():
    found = check_system.missing_packages(without("libGL.so.1", "libX11.so.6"), lambda name: name, wants_bpy=True)
    assert found == ["libx11-6", "libgl1"]


def test_debians_venv_without_ensurepip_is_recognised():
    absent = {"ensurepip"}
    find = lambda name: None if name in absent else name  # noqa: E731
    assert check_system.missing_packages(without(), find, wants_bpy=True) == ["python3-venv"]


def test_where_bpy_is_not_installed_its_libraries_are_not_asked_for():
    assert check_system.missing_packages(without(*check_system.LIBRARIES), lambda name: name, wants_bpy=False) == []


def test_one_apt_line_and_a_failing_exit_status(monkeypatch, capsys):
    monkeypatch.setattr(check_system, "missing_packages", lambda: ["python3-venv", "libgl1"])
    assert check_system.main() == 1
    assert capsys.readouterr().out == "apt-get install -y python3-venv libgl1\n"
    monkeypatch.setattr(check_system, "missing_packages", lambda: [])
    assert check_system.main() == 0
    assert capsys.readouterr().out == ""


def test_the_manifest_lists_the_locks_wheels_and_no_numpy():
    locked = [wheel.filename for wheel in wheels.read_lock()]
    assert MANIFEST["wheels"] == [f"./wheels/{name}" for name in locked]
    assert locked and not any(name.startswith("numpy") for name in locked)


@pytest.mark.parametrize(("platform", "python"), [(p, v) for p, versions in wheels.PYTHONS.items() for v in versions])
def test_every_platform_and_python_has_one_wheel_of_each_kind(platform, python):
    names = [wheel.filename.split("-")[0] for wheel in wheels.wheels_for(platform, [python])]
    assert sorted(names) == [
        "exifread", "opencv_python_headless", "openexr", "pi_heif", "poselib", "rawpy", "scipy", "tqdm",
    ]  # fmt: skip


def test_a_wheel_that_is_there_needs_no_network(tmp_path, monkeypatch):
    content = b"a wheel"
    wheel = wheels.Wheel("tool-1.0-py3-none-any.whl", __import__("hashlib").sha256(content).hexdigest())
    monkeypatch.setattr(wheels, "read_lock", lambda: [wheel])
    asked = []

    def download(platform, python, requirements, folder, *options):
        asked.append((requirements, options))
        (folder / wheel.filename).write_bytes(content)
        return []

    monkeypatch.setattr(wheels, "_download", download)
    (tmp_path / wheel.filename).write_bytes(b"half a wh")
    assert wheels.fetch("linux-x64", ["3.13"], tmp_path) == [tmp_path / wheel.filename]
    assert wheels.fetch("linux-x64", ["3.13"], tmp_path) == [tmp_path / wheel.filename]
    assert asked == [([wheel.requirement], ("--require-hashes",))]


def test_a_wheel_with_another_content_than_locked_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(wheels, "read_lock", lambda: [wheels.Wheel("tool-1.0-py3-none-any.whl", "0" * 64)])
    monkeypatch.setattr(wheels, "_download", lambda *_: (tmp_path / "tool-1.0-py3-none-any.whl").write_bytes(b"x"))
    with pytest.raises(SystemExit, match="tool-1.0"):
        wheels.fetch("linux-x64", ["3.13"], tmp_path)


@pytest.mark.parametrize(
    ("name", "excluded"),
    [
        ("core/commands/cli.py", False),
        ("README.md", False),
        ("synthetic_scenes/tests/scene.py", False),
        ("tests/core/test_warp.py", True),
        (".ci/run", True),
        ("core/.cache/x", True),
        ("core/__pycache__/cli.pyc", True),
        ("edf_stitch.egg-info/PKG-INFO", True),
        ("old.zip", True),
        ("synthetic_scenes/old.zip", False),
        ("wheels/x.whl", True),
        ("setup.py", True),
        ("core/setup.py", False),
        ("build", False),
    ],
)
def test_what_ships(name, excluded):
    assert build_extension.is_excluded(name, MANIFEST["build"]["paths_exclude_pattern"]) is excluded


def test_a_pattern_that_only_blender_understands_is_refused():
    with pytest.raises(ValueError, match="a/b"):
        build_extension.is_excluded("x", ["/a/b"])


def test_a_zip_is_of_one_platform_and_twice_the_same(tmp_path, monkeypatch):
    try:
        build_extension.tree()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout, or git is not here, or will not read somebody else's")
    carried = [tmp_path / wheel.filename for wheel in wheels.wheels_for("windows-x64", ["3.11"])]
    for path in carried:
        path.write_bytes(b"stands for a wheel")
    monkeypatch.setattr(wheels, "fetch", lambda *_: carried)
    first = build_extension.build("windows-x64", ["3.11"], [], tmp_path / "a")
    second = build_extension.build("windows-x64", ["3.11"], [], tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    bill = first.with_name(f"{first.name}.cdx.json")
    assert set(first.parent.iterdir()) == {first, bill}, "nothing else stays behind"
    assert bill.read_bytes() == second.with_name(bill.name).read_bytes()
    listed = json.loads(bill.read_text("utf-8"))
    assert listed["metadata"]["component"]["version"] == MANIFEST["version"]
    locked = {(wheel.filename, wheel.sha256) for wheel in wheels.wheels_for("windows-x64", ["3.11"])}
    assert {(one["bom-ref"], one["hashes"][0]["content"]) for one in listed["components"]} == locked
    assert {"name": "scipy", "version": "1.15.3"}.items() <= next(
        one for one in listed["components"] if one["name"] == "scipy").items()  # fmt: skip
    with zipfile.ZipFile(first) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["platforms"] == ["windows-x64"]
    assert {f"./{name}" for name in names if name.endswith(".whl")} == set(manifest["wheels"])
    assert {"LICENSE", "__init__.py", "__main__.py", "core/system/errors.py", "edf_addon/jobs/command.py"} <= names
    assert not [name for name in names if name.startswith((".", "tests/")) or name in ("setup.py", "pyproject.toml")]


def test_the_extension_s_page_says_what_the_manifest_says():
    """Its tagline is short enough for Blender, and its permission is the one that the manifest asks for."""
    text = " ".join((ROOT / "docs" / "listing.md").read_text("utf-8").split())
    assert len(MANIFEST["tagline"]) <= 64 and list(MANIFEST["permissions"]) == ["files"]
    asked = MANIFEST["permissions"]["files"]
    assert asked[0].lower() + asked[1:] == "read photographs, write panoramas and reports" and "one permission" in text


def test_the_pictures_of_the_extension_s_page_have_its_sizes_and_none_is_cut(tmp_path):
    """An icon of 256 px with round corners; the others 16:9, with all of a picture on the ground."""
    listing = load("listing_pictures")
    listing.write_all(tmp_path)
    found = {path.name: cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in tmp_path.iterdir()}
    icon = found.pop("icon.png")
    assert icon.shape == (256, 256, 4) and icon[0, 0, 3] == 0 and icon[128, 128].tolist() == [245, 245, 245, 255]
    assert {"featured.jpg", "preview_blender.jpg"} <= set(found)
    assert {picture.shape for picture in found.values()} == {(1080, 1920, 3)}
    for shape in ((300, 100, 3), (100, 300, 3)):
        page = listing.on_a_page(np.full(shape, 255, np.uint8)) == 255
        height, width = page.all(axis=2).any(axis=1).sum(), page.all(axis=2).any(axis=0).sum()
        assert height / width == pytest.approx(shape[0] / shape[1], rel=0.01) and (height == 1080 or width == 1920)


def test_what_lies_about_in_a_checkout_does_not_go_into_a_zip(tmp_path):
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@x"]
    try:
        subprocess.run([*git, "init", "-q"], check=True)
    except OSError:
        pytest.skip("git is not here")
    for name in ("kept.py", "gone.py", "notes.txt", ".gitignore"):
        (tmp_path / name).write_text("secret.txt\n", "utf-8")
    subprocess.run([*git, "add", "kept.py", "gone.py", ".gitignore"], check=True)
    (tmp_path / "secret.txt").touch()
    (tmp_path / "gone.py").unlink()
    assert build_extension.tree(tmp_path) == [".gitignore", "kept.py"]


def test_a_local_build_takes_no_more_than_this_machines_blender_needs(monkeypatch, tmp_path):
    built = []
    monkeypatch.setattr(build_extension, "build", lambda *call: built.append(call) or tmp_path)
    monkeypatch.setattr(build_extension, "python_of", lambda blender: "3.13")
    monkeypatch.setattr(build_extension.machine, "system", lambda: "Darwin")
    monkeypatch.setattr(build_extension.machine, "machine", lambda: "x86_64")
    monkeypatch.setattr(sys, "argv", ["build", "--local", "--blender", "run it", "-o", str(tmp_path)])
    build_extension.main()
    assert built == [("macos-x64", ["3.13"], ["run", "it"], tmp_path)]


def test_without_a_platform_every_one_gets_its_zip(monkeypatch, tmp_path):
    built = []
    monkeypatch.setattr(build_extension, "build", lambda platform, *_: built.append(platform) or tmp_path)
    monkeypatch.setattr(sys, "argv", ["build", "-o", str(tmp_path)])
    build_extension.main()
    assert built == MANIFEST["platforms"] == ["linux-x64", "windows-x64", "macos-arm64", "macos-x64"]


def test_a_machine_or_a_python_without_wheels_is_told_so(monkeypatch):
    monkeypatch.setattr(build_extension.machine, "machine", lambda: "riscv64")
    with pytest.raises(SystemExit, match="no wheels for this machine"):
        build_extension.this_platform()
    said = "import sys; print('PYTHON 3.12')"
    with pytest.raises(SystemExit, match="3.12; wheels are locked for 3.11, 3.13, 3.14"):
        build_extension.python_of([sys.executable, "-c", said])
