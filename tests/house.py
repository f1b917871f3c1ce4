"""How core/ and edf_addon/ are laid out, in figures: `python tests/house.py` prints them, `test_house.py` holds them.

In core, imports inside functions and under TYPE_CHECKING do not count: they put no module on top of another. In the
add-on those inside functions do: they are late only so that Blender starts sooner.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "core"
ADDON = ROOT / "edf_addon"
# Files that Blender runs when an artist chooses one; nothing imports them.
PRESETS = ADDON / "presets"

# Which rooms each may import, itself left out. Rooms stand in the order of the data.
BELOW_POSE = ("system", "raster", "pictures", "cameras")
BELOW_MEASURE = (*BELOW_POSE, "pose", "rig", "field", "dense", "continuation", "panorama", "compose")
TOP = ("frames", "choices", "options", "fields", "mapping", "alignment", "pipeline")
MAY_IMPORT = {
    "system": (),
    "raster": ("system",),
    "pictures": ("system", "raster", "choices"),
    "cameras": ("system", "raster", "pictures"),
    "pose": BELOW_POSE,
    "rig": (*BELOW_POSE, "pose", "choices"),
    "field": ("system", "raster", "cameras"),
    "rivals": ("system", "raster", "cameras", "pose", "field"),
    "dense": (*BELOW_POSE, "field"),
    "continuation": ("system", "raster", "cameras", "field"),
    "panorama": (*BELOW_POSE, "field", "continuation", "choices"),
    "compose": (*BELOW_POSE, "field", "panorama", "choices", "options"),
    "measure": BELOW_MEASURE,
    "output": (*BELOW_MEASURE, "measure", "pipeline"),
    "batch": (*BELOW_MEASURE, "measure", "output", *TOP),
    "compare": (*BELOW_MEASURE, "measure", "output", *TOP),
    "commands": (*BELOW_MEASURE, "measure", "rivals", "output", "batch", "compare", *TOP),
    "choices": (),
    "options": ("system", "pictures", "cameras", "choices"),
    "frames": (*BELOW_POSE, "options"),
    "fields": ("system", "raster", "pictures", "cameras", "field", "panorama", "rivals", "choices", "options"),
    "mapping": (*BELOW_MEASURE, "choices", "options"),
    "alignment": (*BELOW_MEASURE, "frames", "options", "fields", "mapping"),
    "pipeline": (*BELOW_MEASURE, "frames", "measure", "options", "mapping", "alignment"),
}
# The same for the add-on. What lies beside its rooms is known to all of them, or to those after it.
BESIDE = ("idnames", "offered", "pair", "pictures", "properties", "earlier", "engine_options", "status", "editor",
          "explain", "list_entries", "switches")  # fmt: skip
ADDON_MAY_IMPORT = {
    "idnames": (),
    "status": (),
    "switches": ("offered",),
    "explain": ("switches",),
    "offered": (),
    "engine_options": (),
    "earlier": (),
    "pair": ("earlier", "status"),
    "pictures": ("idnames", "pair"),
    "list_entries": ("offered", "pictures"),
    "properties": ("bridge", "list_entries", "idnames", "offered", "earlier", "pair", "pictures", "status"),
    "bridge": (),
    "editor": ("bridge", "earlier", "engine_options", "pictures", "properties"),
    "jobs": ("bridge", "idnames", "offered", "pair", "pictures", "properties", "engine_options", "editor",
             "status", "explain"),  # fmt: skip
    "scene": ("bridge", "properties", "editor"),
    "overlays": ("bridge", "scene", "idnames", "pictures", "properties", "engine_options", "editor"),
    "operators": ("bridge", "jobs", "scene", "overlays", "idnames", "offered", "pair", "pictures",
                  "properties", "editor", "switches"),  # fmt: skip
    "panels": ("bridge", "jobs", "scene", "overlays", "operators", *BESIDE),
}
# Names of the first layout that only its builders knew (modules, classes, functions), and what they are called now.
RENAMED = {
    "light": "lazy", "Light": "LazyImage", "tone": "log_encoding", "relief": "refined_depth", "Relief": "RefinedDepth",
    "Sureness": "Confidence", "Shown": "CoverageSamples", "line_map": "epipolar_lines", "Lines": "EpipolarLines",
    "Ways": "ArcLengths", "line_search": "matching", "moved": "moving_things", "seen": "inspection",
    "around": "wraparound", "Rolled": "WrappedImage", "uprights": "upright_edges", "lay": "fit_and_warp",
    "slid": "transfer", "sends": "predict", "through": "project_rows",
    "beyond_infinity": "cheirality_residual", "steps": "progress", "tied": "strengthen", "broken": "cut_edges",
    "told": "trust", "raised": "build_refinement", "held": "keep", "third": "w_rate",
}  # fmt: skip

Graph = dict[str, set[str]]


def modules(core: Path = CORE) -> dict[str, Path]:
    """Every module by its name: `room/module`, or `module` directly in core (or in the add-on)."""
    paths = (path for path in core.rglob("*.py") if path.name != "__init__.py" and PRESETS not in path.parents)
    return {path.relative_to(core).with_suffix("").as_posix(): path for path in sorted(paths)}


def room_of(module: str) -> str:
    """The folder of a module, or the module itself where it lies directly in core."""
    return module.partition("/")[0]


def imports(core: Path = CORE, late: bool = False) -> Graph:
    """Which modules of core each module imports when it is loaded; late: inside functions too."""
    known = modules(core)
    return {name: set(_imported(name, _tree(path), known, late)) for name, path in known.items()}


def by_room(graph: Graph) -> Graph:
    """The same between rooms."""
    rooms: Graph = {room_of(name): set() for name in graph}
    for name, targets in graph.items():
        rooms[room_of(name)] |= {room_of(target) for target in targets} - {room_of(name)}
    return rooms


def _imported(name: str, tree: ast.Module, known: Iterable[str], late: bool) -> Iterable[str]:
    folder = name.split("/")[:-1]
    for node, within in statements(tree):
        if not isinstance(node, ast.ImportFrom) or not 1 <= node.level <= len(folder) + 1:
            continue
        if any(_is_type_checking(outer) or isinstance(outer, ast.FunctionDef) and not late for outer in within):
            continue
        base = folder[: len(folder) + 1 - node.level] + (node.module.split(".") if node.module else [])
        for target in ["/".join(base)] + ["/".join([*base, alias.name]) for alias in node.names]:
            if target in known:
                yield target


def statements(tree: ast.Module) -> Iterator[tuple[ast.stmt, tuple[ast.AST, ...]]]:
    """Every statement, each with those that it stands in; expressions, which hold none, are not walked through."""
    waiting: list[tuple[ast.AST, tuple[ast.AST, ...]]] = [(tree, ())]
    while waiting:
        node, within = waiting.pop()
        if isinstance(node, ast.stmt):
            yield node, within
        blocks = [getattr(node, name, ()) for name in ("body", "orelse", "finalbody", "handlers", "cases")]
        inner = [one for block in blocks for one in block]
        waiting += [(one, (*within, node)) for one in reversed(inner)]


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """The circles of a graph that a walk in depth meets; none where it has none."""
    found: list[list[str]] = []
    done: set[str] = set()

    def walk(node: str, way: list[str]) -> None:
        if node in way:
            found.append([*way[way.index(node) :], node])
        elif node not in done:
            for target in sorted(graph.get(node, ())):
                walk(target, [*way, node])
            done.add(node)

    for node in sorted(graph):
        walk(node, [])
    return found


def floors(graph: Mapping[str, set[str]]) -> int:
    """How many nodes the longest chain of imports has; the graph has no circles."""
    heights: dict[str, int] = {}

    def height(node: str) -> int:
        if node not in heights:
            heights[node] = 1 + max((height(target) for target in graph.get(node, ())), default=0)
        return heights[node]

    return max(height(node) for node in graph)


def old_names(core: Path = CORE) -> list[str]:
    """Modules, classes and functions that still bear a name of the first layout."""
    found = [name for name in modules(core) if name.rpartition("/")[2] in RENAMED]
    for name, path in modules(core).items():
        for node, _ in statements(_tree(path)):
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name.strip("_") in RENAMED:
                found.append(f"{name}: {node.name}")
    return found


def main() -> None:
    """Prints the figures of the layout."""
    graph = imports()
    rooms = by_room(graph)
    folders = [room for room in rooms if (CORE / room).is_dir()]
    print(f"modules directly in core: {len(rooms) - len(folders)}")
    print(f"folders: {len(folders)}")
    for what, of in (("folders", rooms), ("files", graph)):
        loops = circles(of)
        print(f"circles between {what}: {len(loops)}", *(" -> ".join(loop) for loop in loops), sep="\n  ")
        if not loops:
            print(f"longest chain of imports between {what}: {floors(of)}")
    rooms = by_room(imports(ADDON, late=True))
    print(f"rooms of the add-on: {len([room for room in rooms if (ADDON / room).is_dir()])}")
    print(f"longest chain of imports between them: {floors(rooms)}")
    names = old_names()
    print(f"names of the first layout: {len(names)}", *names, sep="\n  ")


if __name__ == "__main__":
    main()
