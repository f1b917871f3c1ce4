"""What the extension brings along and what it may do: locked wheels, files only, no connection anywhere."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from .house import statements

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
ROOMS = (".", "core", "core/*", "edf_addon", "edf_addon/*", "synthetic_scenes", "synthetic_scenes/*")
SOURCES = [path for room in ROOMS for path in sorted(ROOT.glob(f"{room}/*.py"))]
NETWORK = re.compile(r"(socket|ssl|http|urllib\.(request|error)|ftplib|smtplib|xmlrpc|requests|urllib3|asyncio)\b")
LOCKED = re.compile(r"([a-z0-9_]+)==([0-9.]+) --hash=sha256:[0-9a-f]{64}  # (\S+)\.whl")


def test_every_wheel_is_locked_by_its_hash_and_every_dependency_is_among_them():
    lines = (ROOT / ".ci" / "wheels.lock").read_text("utf-8").splitlines()
    locked = [LOCKED.fullmatch(line) for line in lines if not line.startswith("#")]
    assert all(locked), "a line without a hash"
    files = [match[3] for match in locked]
    assert len(files) == len(set(files)) and all(f"./wheels/{name}.whl" in MANIFEST["wheels"] for name in files)
    assert all(name.startswith(f"{match[1]}-{match[2]}-") for name, match in zip(files, locked, strict=True))
    needed = {re.match(r"[\w-]+", line)[0].lower().replace("-", "_") for line in PROJECT["dependencies"]}
    assert needed - {"numpy"} == {match[1] for match in locked}, "NumPy is Blender's own"


def test_the_versions_that_are_tested_are_those_that_ship():
    """On Intel Macs poselib and rawpy are older, the last that have a wheel for them."""
    constraints = (ROOT / ".ci" / "constraints.txt").read_text("utf-8").lower()
    for line in (ROOT / ".ci" / "wheels.lock").read_text("utf-8").splitlines()[1:]:
        name, version, wheel = LOCKED.fullmatch(line).groups()
        on_intel_macs = name in ("poselib", "rawpy") and re.search(r"-macosx_\d+_\d+_x86_64$", wheel)
        assert on_intel_macs or f"{name.replace('_', '-')}=={version}" in constraints


def test_the_extension_asks_for_files_and_nothing_else():
    assert set(MANIFEST["permissions"]) == {"files"}


def test_nothing_that_ships_knows_the_network():
    for path in SOURCES:
        nodes = [node for node, _ in statements(ast.parse(path.read_text("utf-8")))]
        named = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        named |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom) and node.level == 0}
        assert not [name for name in named if NETWORK.match(name)], path


WATCHED = """
import sys
seen = []
sys.addaudithook(lambda event, _: seen.append(event) if event.split(".")[0] in ("socket", "urllib", "http", "ftplib")
                 or event in ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn") else None)
if sys.argv[1] == "trial":
    import socket
    socket.socket().close()
else:
    from edf_stitch.core.commands.cli import main
    assert main(sys.argv[1:]) == 0
print(sorted(set(seen)))
"""


def watched(folder: Path, *arguments: str | Path) -> str:
    """What was opened towards the outside, and which processes were started."""
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *map(str, arguments)], cwd=folder, capture_output=True, text=True, check=True,
        timeout=120, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    return done.stdout.splitlines()[-1]


def test_a_stitch_opens_no_socket_and_starts_no_process(folder, tmp_path):
    assert "socket.__new__" in watched(tmp_path, "trial"), "the watch sees sockets"
    pair = [folder / "reference.png", folder / "target.png", "--focal-px", "228", "--quiet"]
    everything = ["--report", "r.json", "--warp", "w.npz", "--layers", "layers"]
    assert watched(tmp_path, "stitch", *pair, "-o", "out.exr", *everything) == "[]"


@pytest.mark.parametrize("arguments", [["--help"], ["stitch", "--help"], ["batch", "--help"], ["--version"]])
def test_help_loads_nothing_heavy(arguments):
    """So that it is there at once: 0.05 s; NumPy alone would triple that."""
    code = "import sys, edf_stitch.core.commands.cli as c; c.main(sys.argv[1:]); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120)
    loaded = {name.split(".")[0] for name in done.stderr.split()}
    assert not loaded & {"numpy", "cv2", "scipy", "poselib", "OpenEXR", "exifread", "tqdm", "bpy", "_pi_heif", "rawpy"}
    assert len(done.stderr.split()) < 150, "no long tail of small modules either"
