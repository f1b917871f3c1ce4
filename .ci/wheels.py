"""The wheels that the extension carries: kept out of git, fetched by their hashes.

    wheels.py fetch linux-x64 [--python 3.13 ...]   bring that platform's wheels into wheels/; asks the network only for
                                                    what is not there yet
    wheels.py lock                                  after changing PINS or PYTHONS: fetch whatever they name, write
                                                    wheels.lock and the manifest's list anew; read the diff, commit both

wheels.lock has one line a wheel, as pip reads it, with the file's name behind it. It is not one requirements file: each
platform and Python takes its own lines.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / ".ci" / "wheels.lock"
MANIFEST = ROOT / "blender_manifest.toml"
WHEELS = ROOT / "wheels"

# One set for every Blender from 4.2 on. SciPy 1.16 and later fail on the NumPy 1.24 of Blender 4.2; only Python 3.14,
# which has no SciPy 1.15, takes a later one.
PINS = ("opencv-python-headless==4.11.0.86", "OpenEXR==3.5.3", "ExifRead==3.5.1", "pi-heif==1.4.0", "tqdm==4.70.1")
SCIPY = {"3.11": "scipy==1.15.3", "3.13": "scipy==1.15.3", "3.14": "scipy==1.17.1"}
# PoseLib's wheels for Intel Macs ended with 2.0.4, and Blender for them with 4.5, which has Python 3.11.
POSELIB = {"macos-x64": "poselib==2.0.4"}
POSELIB_ELSEWHERE = "poselib==2.0.5"
# rawpy's ended with 0.25.1.
RAWPY = {"macos-x64": "rawpy==0.25.1"}
RAWPY_ELSEWHERE = "rawpy==0.28.0"
# Blender's own builds have 3.11 and 3.13; Linux distributions build Blender on their own Python.
PYTHONS = {
    "linux-x64": ("3.11", "3.13", "3.14"),
    "windows-x64": ("3.11", "3.13"),
    "macos-arm64": ("3.11", "3.13"),
    "macos-x64": ("3.11",),
}
PIP_PLATFORMS = {
    "linux-x64": tuple(f"manylinux_2_{minor}_x86_64" for minor in (28, 27, 17)) + ("manylinux2014_x86_64",),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64",),
    "macos-x64": ("macosx_13_0_x86_64",),
}
PLATFORM_TAG = {
    "linux-x64": re.compile("manylinux.*_x86_64"),
    "windows-x64": re.compile("win_amd64"),
    "macos-arm64": re.compile("macosx_.*_arm64"),
    "macos-x64": re.compile("macosx_.*_x86_64"),
}


@dataclass(frozen=True, order=True)
class Wheel:
    """One file of the lock."""

    filename: str
    sha256: str

    @property
    def requirement(self) -> str:
        name, version = self.filename.split("-")[:2]
        return f"{name}=={version} --hash=sha256:{self.sha256}"

    def serves(self, platform: str, python: str) -> bool:
        """By the file's name, as Blender chooses: the platform's tag, and exactly this Python or a stable ABI."""
        interpreter, abi, tag = self.filename.removesuffix(".whl").split("-")[-3:]
        fits_python = interpreter == f"cp{python.replace('.', '')}" or abi == "abi3" or interpreter.startswith("py")
        return fits_python and (tag == "any" or PLATFORM_TAG[platform].fullmatch(tag) is not None)


def read_lock(path: Path = LOCK) -> list[Wheel]:
    """Every wheel of the lock, in its order."""
    lines = re.findall(r"--hash=sha256:([0-9a-f]{64})\s+#\s+(\S+\.whl)", path.read_text("utf-8"))
    return [Wheel(filename, sha256) for sha256, filename in lines]


def wheels_for(platform: str, pythons: Iterable[str] = ()) -> list[Wheel]:
    """The locked wheels that a zip for this platform carries; without `pythons`, for every Python it serves."""
    chosen = tuple(pythons) or PYTHONS[platform]
    return [wheel for wheel in read_lock() if any(wheel.serves(platform, python) for python in chosen)]


def fetch(platform: str, pythons: Iterable[str] = (), folder: Path = WHEELS) -> list[Path]:
    """Bring the wheels into `folder`, asking the network only for what is not there or is not what the lock says."""
    for python in tuple(pythons) or PYTHONS[platform]:
        absent = [wheel for wheel in wheels_for(platform, (python,)) if not _is_there(wheel, folder)]
        if absent:
            _download(platform, python, [wheel.requirement for wheel in absent], folder, "--require-hashes")
    wheels = wheels_for(platform, pythons)
    wrong = [wheel.filename for wheel in wheels if not _is_there(wheel, folder)]
    if wrong:
        raise SystemExit(f"wheels.py: pip brought other files than the lock names: {', '.join(wrong)}")
    return [folder / wheel.filename for wheel in wheels]


def lock() -> None:
    """Write the lock and the manifest's list from what the pins resolve to today."""
    wheels = set()
    for platform, pythons in PYTHONS.items():
        for python in pythons:
            own = POSELIB.get(platform, POSELIB_ELSEWHERE), RAWPY.get(platform, RAWPY_ELSEWHERE), SCIPY[python]
            for path in _download(platform, python, (*PINS, *own), WHEELS):
                wheels.add(Wheel(path.name, _sha256(path)))
    head = "# Written by `.ci/wheels.py lock`. One line a wheel; `.ci/wheels.py fetch` picks a platform's own.\n"
    LOCK.write_text(head + "".join(f"{wheel.requirement}  # {wheel.filename}\n" for wheel in sorted(wheels)), "utf-8")
    listed = [f"./wheels/{wheel.filename}" for wheel in sorted(wheels)]
    MANIFEST.write_text(with_list(MANIFEST.read_text("utf-8"), "wheels", listed), "utf-8")


def with_list(manifest: str, key: str, values: Sequence[str]) -> str:
    """The manifest's text with one top-level list replaced; the standard library reads TOML but does not write it."""
    lines = "".join(f'  "{value}",\n' for value in values)
    text, count = re.subn(rf"(?ms)^{key} = \[.*?\]$", lambda _: f"{key} = [\n{lines}]", manifest)
    if count != 1:
        raise ValueError(f"the manifest has {count} lists named {key}")
    return text


def _download(platform: str, python: str, requirements: Iterable[str], folder: Path, *options: str) -> list[Path]:
    """pip, told to act for another platform and Python. Files come whole or not at all: two fetches may run at once."""
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".fetch-") as temporary:
        listed = Path(temporary, "requirements.txt")
        listed.write_text("\n".join(requirements), "utf-8")
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", *options]
        command += ["--implementation", "cp", "--python-version", python]
        command += [f"--abi={abi}" for abi in (f"cp{python.replace('.', '')}", "abi3", "none")]
        command += [f"--platform={name}" for name in PIP_PLATFORMS[platform]]
        subprocess.run([*command, "--dest", temporary, "--requirement", str(listed)], check=True)
        brought = []
        for path in sorted(Path(temporary).glob("*.whl")):
            os.replace(path, folder / path.name)
            brought.append(folder / path.name)
    return brought


def _is_there(wheel: Wheel, folder: Path) -> bool:
    path = folder / wheel.filename
    return path.is_file() and _sha256(path) == wheel.sha256


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    fetching = commands.add_parser("fetch")
    fetching.add_argument("platform", choices=PYTHONS)
    fetching.add_argument("--python", action="append", default=[], choices=SCIPY)
    commands.add_parser("lock")
    arguments = parser.parse_args()
    if arguments.command == "lock":
        lock()
    else:
        for path in fetch(arguments.platform, arguments.python):
            print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
