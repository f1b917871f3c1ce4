"""What is written for users is true: links lead somewhere, options exist, commands are understood, snippets run."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest
from edf_stitch.core.commands.parser import edf_parser
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.edf_addon import offered

ROOT = Path(__file__).resolve().parent.parent
PAGES = [*(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING", "SECURITY")),
         *sorted((ROOT / "docs").glob("*.md"))]  # fmt: skip
WITH_COMMANDS = [ROOT / "README.md", ROOT / "docs" / "tutorial.md", ROOT / "docs" / "how-to.md",
                 ROOT / "docs" / "farm.md"]  # fmt: skip
# Scripts have options of their own, and what changed may name what is gone.
OF_EDF = [page for page in PAGES if page.name not in ("CHANGELOG.md", "CONTRIBUTING.md")]
# Options of other programs: pip's, Blender's own, GNU parallel's, SLURM's and shtab's.
FOREIGN = {"--command", "--enable", "--python", "--jobs", "--joblog", "--retries", "--sshlogin", "--array", "--mem",
           "--cpus-per-task", "--shell", "--prog"}  # fmt: skip
# Pages that name buttons and settings of the panel, and what in them is Blender's own.
OF_PANEL = ("tutorial", "blender")
OF_BLENDER = {"Install from Disk", "Environment Texture", "Start Frame", "Frame Offset"}


def named(pages: list[Path]) -> dict[str, list]:
    return {"argvalues": pages, "ids": [page.name for page in pages]}


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^(```.*?^```$|(?: {4}[^\n]*\n)+)", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What its headings are called in links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def options() -> set[str]:
    """Every option of every command."""
    parser = edf_parser()
    known = {name for action in parser._actions for name in action.option_strings}
    for command in parser.commands.values():
        known |= {name for action in command._actions for name in action.option_strings}
    return known


def commands(page: Path) -> Iterator[list[str]]:
    """The calls of `edf` in its blocks of code, but for what shows how a call is formed."""
    whole = re.sub(r" \\\n +", " ", page.read_text("utf-8"))
    for line in re.findall(r"^ {4}(?:.*--command )?(edf .*)$", whole, re.MULTILINE):
        call = re.split(r" {2,}|#", line)[0]
        if not re.search(r"\[|…", call):
            yield shlex.split(call)[1:]


@pytest.mark.parametrize("page", **named(PAGES))
def test_links_lead_somewhere(page: Path) -> None:
    """Files and headings of this repository; nothing is asked of a network."""
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


def test_the_map_names_every_page() -> None:
    named_there = set(re.findall(r"\]\((\w[\w-]*\.md)\)", (ROOT / "docs" / "index.md").read_text("utf-8")))
    assert named_there == {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"}


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 130


def test_pictures_are_small_and_shown() -> None:
    text = "".join(page.read_text("utf-8") for page in PAGES)
    for picture in (ROOT / "docs").glob("*.jpg"):
        assert picture.stat().st_size < 250_000 and re.search(rf"!\[.*\]\((docs/)?{picture.name}\)", text), picture.name


def ci_module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"ci_{name}", ROOT / ".ci" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["reference", "man_page"])
def test_what_is_made_from_the_program_is_current(name: str) -> None:
    module = ci_module(name)
    assert module.FILE.read_text("utf-8") == getattr(module, name)(), "run `make reference`"


def test_the_man_page_is_one() -> None:
    """Every option is in it, every line is text or a macro that man(7) has; groff, where it is, has no complaint."""
    page = (ROOT / "docs" / "edf.1").read_text("utf-8")
    written = page.replace("\\-", "-")
    assert {name for name in options() if f"\\fB{name}\\fR" not in written} <= {"--version", "-h"}
    assert {line.split()[0] for line in page.splitlines() if line[:1] in (".", "'")} <= {
        ".TH", ".SH", ".SS", ".TP", ".PP", ".B", ".I", ".br"}  # fmt: skip
    if shutil.which("groff"):
        command = ["groff", "-man", "-Kutf8", "-Tutf8", "-ww", "-z"]
        done = subprocess.run(command, input=page.encode(), capture_output=True)
        assert done.returncode == 0 and not done.stderr, done.stderr.decode()


@pytest.mark.parametrize("page", **named(OF_EDF))
def test_options_that_are_named_exist(page: Path) -> None:
    text = re.sub(r"`\.venv/bin/python [^`]*`|\]\([^)]*\)", "", page.read_text("utf-8"))
    found = set(re.findall(r"(?<![\w-])--[a-z][\w-]*(?<!-)", text))
    assert found - options() <= FOREIGN


@pytest.mark.parametrize("page", **named([ROOT / "README.md", *(ROOT / "docs" / f"{name}.md" for name in OF_PANEL)]))
def test_buttons_and_settings_are_called_as_in_the_panel(page: Path) -> None:
    """What stands in italics with a capital letter; of “Level: Automatic” both words."""
    folder = ROOT / "edf_addon"
    called = {path.stem.replace("_", " ") for path in (folder / "presets").rglob("*.py")}
    for path in folder.rglob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        called |= {one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)}
    called |= {f"{name} Guide" for _, name, _ in offered.GUIDES}
    found = re.findall(r"(?<![*\w])\*([A-Z][^*]{1,40})\*(?![*\w])", prose(page))
    words = {word for one in found for word in re.sub(r"\s+", " ", one).split(": ")}
    assert words and words - called <= OF_BLENDER


@pytest.mark.parametrize("page", **named(WITH_COMMANDS))
def test_commands_are_understood(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the configuration that the page shows, in the file that it names."""
    for block in re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        (tmp_path / re.match(r"# (\S+):", block)[1]).write_text(block, "utf-8")
    monkeypatch.chdir(tmp_path)
    calls = list(commands(page))
    for call in calls:
        edf_parser().parse_args(call)
    assert calls


@pytest.mark.parametrize("page", **named([ROOT / "README.md", ROOT / "docs" / "how-to.md"]))
def test_python_runs(page: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder with the files that it names; errors would be caught there, so what it saves is looked for."""
    lines = r"(?:(?: {4}.*)?\n)*"
    (block,) = re.findall(rf"^({lines} {{4}}from edf_stitch import .*\n{lines})", page.read_text("utf-8"), re.MULTILINE)
    for name, source in (("left.jpg", "reference.png"), ("right.jpg", "target.png")):
        shutil.copy(folder / source, tmp_path / name)
    height, width = load_picture(folder / "target.png").light.shape[:2]
    cv2.imwrite(str(tmp_path / "walker.png"), np.zeros((height, width), np.uint8))
    monkeypatch.chdir(tmp_path)
    exec("\n".join(line[4:] for line in block.splitlines()), {})
    assert (tmp_path / "panorama.exr").is_file()
