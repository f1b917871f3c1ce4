"""Build the extension's zips: one for each platform, with that platform's wheels.

    build_extension.py [--platform linux-x64 ...] [--python 3.13 ...] [--local] [--blender "COMMAND"] -o DIR

Without --platform, one zip for each. --local: for this machine only, with the wheels of its Blender's Python only (or
of every Python, where no Blender is named). With a Blender command, Blender builds and validates the zips. Without one,
Python writes the same files. What goes in is what git tracks, as it stands in the checkout, less the manifest's
paths_exclude_pattern; the same files give the same bytes. Beside each zip stands its bill of materials, ZIP.cdx.json
(CycloneDX 1.5): the libraries in it, with their versions and hashes.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import os
import platform as machine
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

sys.path.insert(0, str(Path(__file__).resolve().parent))
import wheels  # noqa: E402  (beside this file; .ci is no package)

MANIFEST = "blender_manifest.toml"
# Seconds since 1970 of every file in a zip: the second day that zips know, the first in every time zone.
FILE_TIME = 315_619_200


def tree(root: Path = wheels.ROOT) -> list[str]:
    """The checkout's files that git tracks, as paths with forward slashes; what else lies there may be anything."""
    command = ["git", "-C", str(root), "ls-files", "-z", "--cached"]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split("\0")
    return sorted({name for name in names if name and (root / name).is_file()})


def is_excluded(name: str, patterns: Iterable[str]) -> bool:
    """Blender's rule, after .gitignore, for the patterns in use: `/x` at the root only, `x/` for folders only."""
    parts = PurePosixPath(name).parts
    for pattern in patterns:
        bare = pattern.strip("/")
        if "/" in bare or "**" in bare or bare.startswith("!"):
            raise ValueError(f"paths_exclude_pattern {pattern!r} is of a kind that only Blender's build understands")
        candidates = parts[:1] if pattern.startswith("/") else parts
        folders = candidates[: len(parts) - 1] if pattern.endswith("/") else candidates
        if any(fnmatch.fnmatchcase(part, bare) for part in folders):
            return True
    return False


def build(platform: str, pythons: Sequence[str], blender: Sequence[str], output: Path) -> Path:
    """The path of the finished zip."""
    carried = wheels.fetch(platform, pythons)
    output.mkdir(parents=True, exist_ok=True)
    # Beside the output and not in the system's temporary folder: a Blender in a container need not see that one.
    with tempfile.TemporaryDirectory(dir=output, prefix=".stage-") as temporary:
        stage = Path(temporary, "edf_stitch")
        _stage(stage, platform, carried)
        with open(stage / MANIFEST, "rb") as file:
            manifest = tomllib.load(file)
        name = f"{manifest['id']}-{manifest['version']}-{platform}.zip"
        made = Path(temporary, name)
        if blender:
            tool = [*blender, "-b", "--command", "extension"]
            subprocess.run([*tool, "build", "--source-dir", str(stage), "--output-filepath", str(made)], check=True)
            subprocess.run([*tool, "validate", str(made)], check=True)
        else:
            _zip(stage, made, manifest["build"]["paths_exclude_pattern"], manifest["wheels"])
        bill = made.with_suffix(".zip.cdx.json")
        bill.write_text(bill_of_materials(manifest, platform, wheels.wheels_for(platform, pythons)), "utf-8")
        os.replace(bill, output / bill.name)
        os.replace(made, output / name)
    return output / name


def bill_of_materials(manifest: dict, platform: str, carried: Iterable[wheels.Wheel]) -> str:
    """What a zip holds of others, as CycloneDX's JSON, from the lock; no date, so that it is the same twice."""
    components = []
    for wheel in carried:
        name, version = wheel.filename.split("-")[:2]
        components.append({
            "type": "library", "bom-ref": wheel.filename, "name": name, "version": version,
            "hashes": [{"alg": "SHA-256", "content": wheel.sha256}],
        })  # fmt: skip
    about = {"type": "application", "name": manifest["id"], "version": manifest["version"],
             "description": f"{manifest['name']} for {platform}",
             "licenses": [{"license": {"id": one.removeprefix("SPDX:")}} for one in manifest["license"]]}  # fmt: skip
    bill = {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1, "metadata": {"component": about},
            "components": components}  # fmt: skip
    return json.dumps(bill, indent=1) + "\n"


def _stage(stage: Path, platform: str, carried: Iterable[Path]) -> None:
    for name in tree():
        (stage / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(wheels.ROOT / name, stage / name)
    (stage / "wheels").mkdir(exist_ok=True)
    listed = []
    for wheel in carried:
        shutil.copy2(wheel, stage / "wheels")
        listed.append(f"./wheels/{wheel.name}")
    text = (stage / MANIFEST).read_text("utf-8")
    text = wheels.with_list(wheels.with_list(text, "platforms", [platform]), "wheels", listed)
    (stage / MANIFEST).write_text(text, "utf-8")
    for path in stage.rglob("*"):  # Blender's zip has the files' times
        os.utime(path, (FILE_TIME, FILE_TIME))


def _zip(stage: Path, made: Path, patterns: Sequence[str], listed: Iterable[str]) -> None:
    names = [path.relative_to(stage).as_posix() for path in stage.rglob("*") if path.is_file()]
    shipped = {name for name in names if not is_excluded(name, patterns)}
    # Wheels ship although /wheels/ is excluded: the manifest lists them.
    shipped |= {entry.removeprefix("./") for entry in listed}
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(shipped):
            # A fixed date, so that the same tree gives the same bytes.
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
            archive.writestr(entry, (stage / name).read_bytes())


def this_platform() -> str:
    """Blender's name of the platform that this runs on. Raises SystemExit where there is no zip for it."""
    systems = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
    processors = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}
    name = f"{systems.get(machine.system())}-{processors.get(machine.machine().lower())}"
    if name not in wheels.PYTHONS:
        raise SystemExit(f"build_extension.py: there are no wheels for this machine; for: {', '.join(wheels.PYTHONS)}")
    return name


def python_of(blender: Sequence[str]) -> str:
    """The Python inside a Blender, as wheels name it. Raises SystemExit where no wheels are locked for it."""
    code = "import sys; print('PYTHON %d.%d' % sys.version_info[:2])"
    said = subprocess.run([*blender, "-b", "--python-expr", code], check=True, capture_output=True, text=True).stdout
    found = said.split("PYTHON ")[1].split()[0]
    if found not in wheels.SCIPY:
        raise SystemExit(
            f"build_extension.py: this Blender has Python {found}; wheels are locked for {', '.join(wheels.SCIPY)}"
        )
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platform", action="append", choices=wheels.PYTHONS, help="default: all, one zip each")
    parser.add_argument("--python", action="append", default=[], choices=wheels.SCIPY, help="default: all it serves")
    parser.add_argument("--local", action="store_true", help="for this machine and its Blender only")
    parser.add_argument("--blender", default="", metavar="COMMAND", help="how to run Blender; without it, Python zips")
    parser.add_argument("-o", "--output-dir", required=True, type=Path)
    arguments = parser.parse_args()
    blender = shlex.split(arguments.blender)
    platforms, pythons = arguments.platform or list(wheels.PYTHONS), arguments.python
    if arguments.local:
        platforms = [this_platform()]
        pythons = [python_of(blender)] if blender else []
    for platform in platforms:
        print(build(platform, pythons, blender, arguments.output_dir.resolve()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
