"""How the house is built: one tree that pip, Blender and its worker all import, with arrows that run one way."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

from . import house

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
PACKAGES = ("core", "edf_addon", "synthetic_scenes")
SOURCES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
SOURCES += [ROOT / "__init__.py", ROOT / "__main__.py"]


@cache
def imports(path: Path) -> list[tuple[str, bool]]:
    """Every import of a file: (dotted name, inside a function?). Our own: a dot, then the path from the root."""
    found = []
    for node, within in house.statements(ast.parse(path.read_text("utf-8"))):
        lazy = any(isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef) for outer in within)
        if isinstance(node, ast.Import):
            found += [(alias.name, lazy) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.append((str(node.module), lazy))
        elif isinstance(node, ast.ImportFrom):
            folder = path.relative_to(ROOT).parts[: -node.level]
            for alias in node.names:
                found.append(("." + ".".join([*folder, *filter(None, [node.module]), alias.name]), lazy))
    return found


@pytest.fixture(scope="module")
def graph() -> house.Graph:
    """Which modules of core each imports."""
    return house.imports()


def run_python(code: str) -> str:
    """Outside the checkout, so that only the installed package answers."""
    return subprocess.run(
        [sys.executable, "-P", "-c", code], check=True, capture_output=True, text=True, cwd=ROOT.parent, timeout=120
    ).stdout.strip()


def test_imports_between_our_own_files_are_relative():
    for path in SOURCES:
        absolute = {name.split(".")[0] for name, _ in imports(path) if not name.startswith(".")}
        assert not absolute & {"edf_stitch", "main", *PACKAGES}, path


def test_arrows_run_one_way():
    """core knows neither of the others, and they do not know each other.

    One door is open: a sub-command of core/commands/cli.py may reach for synthetic_scenes when it is called (`edf
    demo`, `edf validate`), so that there is one command behind all doors.
    """
    for path in SOURCES:
        home = path.relative_to(ROOT).parts[0]
        for name, is_lazy in imports(path):
            assert home != "core" or name.split(".")[0] != "bpy", f"{path}: core works without Blender"
            target = name.split(".")[1] if name.startswith(".") else None
            if home in PACKAGES and target in PACKAGES and target not in (home, "core"):
                door = ROOT / "core" / "commands" / "cli.py", "synthetic_scenes"
                assert is_lazy and (path, target) == door, f"{path}: {home} -> {target}"


def test_what_ships_leaves_pythons_search_for_modules_alone():
    """Blender's extension platform refuses what edits sys.path or sys.modules; reading sys.path is fine."""
    for path in SOURCES:
        assert not edits_of_the_search(path.read_text("utf-8")), path


@pytest.mark.parametrize(
    "code",
    [
        "sys.modules['a'] = b",
        "del sys.modules['a']",
        "sys.modules.pop('a')",
        "sys.path += [a]",
        "sys.path[:0] = a",
        "sys.path.insert(0, a)",
        "sys.meta_path.append(a)",
        "from sys import path",
        "site.addsitedir(a)",
        "setattr(sys, 'path', a)",
    ],
)
def test_an_edit_of_the_search_is_seen(code):
    assert edits_of_the_search(code)
    assert not edits_of_the_search("a = [entry for entry in sys.path if entry]\nb = 'bpy' in sys.modules")


def edits_of_the_search(code: str) -> list[str]:
    """Statements and calls that change where, or as what, Python finds modules."""
    state = {f"sys.{name}" for name in ("path", "modules", "meta_path", "path_hooks", "path_importer_cache")}
    found: list[str] = []
    if not re.search(r"\b(sys|site)\b", code):
        return found
    for node in ast.walk(ast.parse(code)):
        targets: list[ast.expr] = []
        if isinstance(node, ast.Assign | ast.Delete):
            targets = node.targets
        elif isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            # reading has no methods but `get`
            targets = [] if node.func.attr == "get" else [node.func.value]
            found += [ast.unparse(node)] * (ast.unparse(node.func) in ("site.addsitedir", "site.addpackage"))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("setattr", "delattr"):
            found += [ast.unparse(node)] * (ast.unparse(node.args[0]) == "sys")
        elif isinstance(node, ast.ImportFrom) and node.module == "sys":
            found += [ast.unparse(node)] * bool({f"sys.{alias.name}" for alias in node.names} & state)
        for target in targets:
            while isinstance(target, ast.Subscript):
                target = target.value
            if ast.unparse(target) in state:
                found.append(ast.unparse(node))
    return found


def test_core_works_where_bpy_cannot_be_imported():
    code = "import sys; sys.modules['bpy'] = None; import edf_stitch.core.pipeline; print(edf_stitch.stitch)"
    assert "stitch" in run_python(code)


def test_importing_the_package_loads_nothing_heavy():
    code = "import edf_stitch, sys; print(*sys.modules)"
    assert not {"numpy", "cv2", "scipy", "bpy", "tomllib"} & set(run_python(code).split())


def test_the_package_offers_what_it_promises():
    code = (
        "import edf_stitch as e; from edf_stitch import StitchError, StitchOptions, stitch\n"
        "assert issubclass(StitchError, Exception) and callable(stitch) and StitchOptions()\n"
        "try: e.nonsense\n"
        "except AttributeError as error: print(error)"
    )
    assert "nonsense" in run_python(code)


def test_the_version_stands_in_one_place():
    version = MANIFEST["version"]
    assert metadata.version("edf-stitch") == version
    assert run_python("import edf_stitch; print(edf_stitch.__version__)") == version
    for door in ([Path(sys.executable).with_name("edf")], [sys.executable, "-m", "edf_stitch"]):
        said = subprocess.run([*door, "--version"], check=True, capture_output=True, text=True, cwd=ROOT.parent).stdout
        assert said.split()[-1] == version


def test_the_manifest_keeps_within_blenders_limits():
    required = "schema_version id name tagline version type maintainer license blender_version_min"
    assert not set(required.split()) - set(MANIFEST)
    for text in (MANIFEST["tagline"], *MANIFEST["permissions"].values()):
        assert len(text) <= 64 and not text.endswith(".")
    assert set(MANIFEST["permissions"]) == {"files"}
    assert {"__pycache__/", ".*", "/*.zip"} <= set(MANIFEST["build"]["paths_exclude_pattern"])
    assert re.fullmatch(r"\d+\.\d+\.\d+", MANIFEST["version"])


def test_nothing_names_a_registrys_host_or_a_place_on_somebodys_machine():
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            check=True,
            capture_output=True,
            text=True,
            cwd=ROOT,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    # In pieces, so that this file does not name them itself.
    hosts = [("pypi", "org"), ("pythonhosted", "org"), ("deb", "debian", "org"), ("npmjs", "org"), ("crates", "io")]
    places = [("", "work", ""), ("", "root", ""), ("", "home", ""), ("C:", "Users", "")]
    words = [".".join(host) for host in hosts] + ["/".join(place) for place in places]
    pattern = re.compile("|".join(map(re.escape, words)).encode())
    for name in filter(None, listed.split("\0")):
        path = ROOT / name
        if path.is_file():
            assert not pattern.search(path.read_bytes().replace(b"\\", b"/")), name


def test_the_wheel_holds_every_package():
    """The list in pyproject.toml names them one by one; a room that it lacks is missing wherever pip installs."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]
    listed, data = settings["packages"], settings["package-data"]["edf_stitch"]
    # type checkers look for the mark beside the package that is imported
    assert set(data) == {"blender_manifest.toml", "py.typed", "edf_addon/presets/edf_stitch/*.py"}
    assert all(list(ROOT.glob(name)) for name in data)
    folders = {path.parent for package in PACKAGES for path in (ROOT / package).rglob("__init__.py")}
    names = [".".join(("edf_stitch", *folder.relative_to(ROOT).parts)) for folder in folders]
    assert sorted(listed) == sorted(["edf_stitch", *names])


def test_every_module_of_core_stands_in_a_room():
    """At most six lie directly in core/, rooms have at most one floor of rooms of their own, and every folder says in
    its docstring what it is for."""
    known = house.modules()
    assert len([name for name in known if "/" not in name]) <= 6
    assert all(name.count("/") <= 2 for name in known)
    assert set(house.MAY_IMPORT) == {house.room_of(name) for name in known}
    for room in {name.rpartition("/")[0] for name in known if "/" in name}:
        tree = ast.parse((ROOT / "core" / room / "__init__.py").read_text("utf-8"))
        assert ast.get_docstring(tree) and len(tree.body) == 1, room
    assert 14 <= len({house.room_of(name) for name in known if "/" in name}) <= 18


def test_a_room_imports_what_the_table_allows(graph):
    for room, imported in house.by_room(graph).items():
        assert not imported - set(house.MAY_IMPORT[room]), room


def test_core_has_no_circle_of_imports(graph):
    rooms = house.by_room(graph)
    assert not house.circles(graph) and not house.circles(rooms)
    assert house.floors(graph) <= 18 and house.floors(rooms) <= 12
    assert house.circles({"a": {"b"}, "b": {"c"}, "c": {"a"}}), "a circle is seen where there is one"


def test_the_add_ons_modules_stand_in_rooms_that_import_what_the_table_allows():
    """What lies beside the rooms is named; an import inside a function counts like any other."""
    graph = house.imports(house.ADDON, late=True)
    rooms = house.by_room(graph)
    assert set(rooms) == set(house.ADDON_MAY_IMPORT)
    folders = {room for room in rooms if (house.ADDON / room).is_dir()}
    assert set(rooms) - folders == set(house.BESIDE) and all(name.count("/") <= 1 for name in graph)
    for room, imported in rooms.items():
        assert not imported - set(house.ADDON_MAY_IMPORT[room]), room
    for room in folders:
        tree = ast.parse((house.ADDON / room / "__init__.py").read_text("utf-8"))
        assert ast.get_docstring(tree) and len(tree.body) == 1, room
    assert not house.circles(graph) and not house.circles(rooms)


def test_names_of_the_first_layout_are_gone():
    assert not house.old_names()


def test_no_file_is_over_400_lines():
    assert not [path for path in SOURCES if len(path.read_text("utf-8").splitlines()) > 400]


def test_the_method_names_modules_that_are_there():
    """docs/method.md goes along when a module moves, and the sections that the code cites are there."""
    method = (ROOT / "docs" / "method.md").read_text("utf-8")
    named = set(re.findall(r"`(\w+/\w+\.py)`", method))
    assert len(named) > 40 and not {name for name in named if not (ROOT / "core" / name).is_file()}
    sections = set(re.findall(r"^## (\d+)\.", method, re.MULTILINE))
    tests = [path for path in sorted((ROOT / "tests").rglob("*.py")) if path != Path(__file__)]
    for path in [*SOURCES, *tests]:
        text = path.read_text("utf-8")
        for cited in re.findall(r"docs/method\.md, (\d+(?: and \d+)*)", text):
            assert set(cited.split(" and ")) <= sections, path
        assert not re.search(r"\bDESIGN\b", text), f"{path} cites what is not in the repository"
