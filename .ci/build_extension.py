"""Build the extension's zip for one platform, with that platform's wheels.

    build_extension.py --platform linux-x64 [--python 3.13 ...] [--blender "COMMAND"] -o DIR

With a Blender command, Blender builds and validates the zip. Without one, Python writes the same files. What goes in is
what git knows or would take in, less the manifest's paths_exclude_pattern.
"""

from __future__ import annotations

import argparse
import fnmatch
import os
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


def tree(root: Path = wheels.ROOT) -> list[str]:
    """The checkout's files, tracked or not yet, less the ignored ones; as paths with forward slashes."""
    command = ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
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
        os.replace(made, output / name)
    return output / name


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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platform", required=True, choices=wheels.PYTHONS)
    parser.add_argument("--python", action="append", default=[], choices=wheels.SCIPY, help="default: all it serves")
    parser.add_argument("--blender", default="", metavar="COMMAND", help="how to run Blender; without it, Python zips")
    parser.add_argument("-o", "--output-dir", required=True, type=Path)
    arguments = parser.parse_args()
    command = shlex.split(arguments.blender)
    print(build(arguments.platform, arguments.python, command, arguments.output_dir.resolve()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
