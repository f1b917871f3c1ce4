"""Does a test notice when the geometry is wrong? `python tests/mutation.py --count 150` makes small errors and counts.

Each error ("mutation") is put into a copy of the tree, and the tests run there: those of the module first, then those
of its room, then a few that stitch whole pairs. Which errors are made, and where, is drawn by a seed; modules get
their share by length.

Left alone: texts, type hints, errors raised, what reports progress, strip sizes, and numbers that somebody chose
(module constants, options, fractions): another choice there is no error, and validation holds what it is worth.
An error that changes nothing a caller could see is listed in mutation_equivalent.tsv (file, function, change, why).
"""

from __future__ import annotations

import argparse
import ast
import csv
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("field", "pose", "dense", "panorama", "compose")
EQUIVALENT = Path(__file__).with_name("mutation_equivalent.tsv")
GOAL = 0.95
# Whole stitches held against the truth that the pictures were rendered from.
STITCHES = (
    "tests/core/test_fields.py", "tests/core/test_round_stitch.py",
    "tests/core/test_pipeline.py::test_the_map_is_nearer_to_the_truth_than_a_single_match",
    "tests/core/test_pipeline.py::test_the_map_lies_on_the_true_epipolar_lines",
    "tests/core/test_pipeline.py::test_the_panorama_is_made_of_its_pictures",
    "tests/core/test_pipeline.py::test_transparent_parts_are_neither_matched_nor_shown",
    "tests/core/test_pipeline.py::test_pictures_of_two_sizes",
)  # fmt: skip
SELECTED = ("-x", "-q", "-m", "not slow and not blender and not soak", "-p", "no:cacheprovider", "--durations=0")
# Time of the processor that tests may take: so many times what they take unmutated, and seconds on top.
PATIENCE, GRACE = 4.0, 10.0
MOST_MEMORY = 8 << 30  # bytes; a wrong size must not take the machine down

COMPARISONS = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
BOUNDARIES = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
OPERATORS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
    ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}  # fmt: skip
OPPOSITES = {"min": "max", "minimum": "maximum", "argmin": "argmax", "any": "all", "floor": "ceil", "erode": "dilate"}
OPPOSITES |= {after: before for before, after in OPPOSITES.items()}
AXES = {"-1": "-2", "-2": "-1", "0": "1", "1": "0", "2": "1"}
SHORT = 20
# What takes its arguments in any order; what reports progress and is no part of the result; strip sizes and the like.
SYMMETRIC = {"min", "max", "minimum", "maximum", "hypot", "absdiff", "multiply", "add"}
OBVIOUS = {"isinstance", "zip", "map", "resize", "zeros", "full", "empty", "array", "ones"}  # another order would crash
REPORTS = {"progress", "report", "print"}
KEPT_KEYWORDS = {"strict", "copy", "iterations", "max_nfev", "keepdims"}
# Sides of a comparison that are whole numbers: others are never met exactly.
WHOLE = re.compile(r"^\d+$|len\(|\.size|\.sum\(|shape|[-+] 1\b")
STRIPS = re.compile(r"STRIP|strips\(|at_once|_000\b")


@dataclass(frozen=True)
class Mutation:
    """Bytes start to stop of a file, replaced by `text`; line, function and change say it to a reader."""

    file: str
    line: int
    function: str
    kind: str
    change: str
    start: int
    stop: int
    text: str


@dataclass(frozen=True)
class Row:
    """A line of the table; `by`: the test that noticed, or nothing."""

    file: str
    line: str
    function: str
    kind: str
    change: str
    start: str
    by: str


class Finder(ast.NodeVisitor):
    """Every mutation that the functions of a file allow."""

    def __init__(self, file: str, source: bytes) -> None:
        self.file, self.found, self.function = file, [], ""
        self.lines = source.splitlines(keepends=True)
        self.starts = [sum(map(len, self.lines[:k])) for k in range(len(self.lines))]
        self.visit(ast.parse(source))

    def add(self, kind: str, node: ast.expr | ast.stmt, text: str) -> None:
        if self.function:
            start = self.starts[node.lineno - 1] + node.col_offset
            stop = self.starts[node.end_lineno - 1] + node.end_col_offset
            new, old = text if isinstance(node, ast.stmt) else f"({text})", ast.unparse(node)
            if len(old) < SHORT:  # a number says little without the line it stands in
                line = self.lines[node.lineno - 1]
                after = line[: node.col_offset] + text.encode() + line[node.end_col_offset :]
                old, text = line.decode().strip(), after.decode().strip()
            change = f"{old} → {text}"
            self.found.append(Mutation(self.file, node.lineno, self.function, kind, change, start, stop, new))

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.stmt) and not hasattr(node, "body") and STRIPS.search(ast.unparse(node)):
            return
        super().visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        outer = self.function
        self.function = f"{outer}.{node.name}" if outer else node.name
        for inner in (*node.args.defaults, *node.body):
            self.visit(inner)
        self.function = outer

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for inner in node.body:
            if isinstance(inner, ast.FunctionDef):
                self.visit(inner)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def leave(self, node: ast.AST) -> None:
        """Texts, and errors: whether they come up is up to conditions."""

    visit_JoinedStr = visit_Raise = leave

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call) and _name(node.value.func) not in REPORTS:
            self.add("statement", node, "pass")
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if isinstance(node.targets[0], ast.Subscript):
            self.add("statement", node, "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.add("statement", node, "pass")
        if type(node.op) in OPERATORS and not isinstance(node.value, ast.List | ast.Tuple | ast.JoinedStr):
            other = ast.AugAssign(node.target, OPERATORS[type(node.op)](), node.value)
            self.add("arithmetic", node, ast.unparse(other))
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        kind, rest, sides = type(node.ops[0]), node.ops[1:], node.comparators
        if kind in COMPARISONS:
            self.add("comparison", node, ast.unparse(ast.Compare(node.left, [COMPARISONS[kind](), *rest], sides)))
        if kind in BOUNDARIES and any(WHOLE.search(ast.unparse(side)) for side in (node.left, sides[0])):
            self.add("boundary", node, ast.unparse(ast.Compare(node.left, [BOUNDARIES[kind](), *rest], sides)))
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        sides = node.left, node.right
        if not any(isinstance(side, ast.List | ast.Tuple | ast.JoinedStr) for side in sides):
            if type(node.op) in OPERATORS:
                self.add("arithmetic", node, ast.unparse(ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right)))
            elif isinstance(node.op, ast.MatMult):
                self.add("arguments", node, ast.unparse(ast.BinOp(node.right, node.op, node.left)))
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        self.add("logic" if isinstance(node.op, ast.Not | ast.Invert) else "sign", node, ast.unparse(node.operand))
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        other = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
        self.add("logic", node, ast.unparse(ast.BoolOp(other, node.values)))
        self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if node.attr == "T":
            self.add("transpose", node, ast.unparse(node.value))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self.add("logic", node, str(not node.value))
        elif isinstance(node.value, int):
            self.add("constant", node, str(node.value + (1 if node.value % 2 == 0 else -1)))
        elif node.value == 0.5:
            self.add("constant", node, "0.0")
        elif isinstance(node.value, float) and node.value.is_integer():
            self.add("constant", node, str(node.value + 1))

    def visit_Call(self, node: ast.Call) -> None:
        name = _name(node.func)
        if name in OPPOSITES:
            text = ast.unparse(node.func)
            self.add("extreme", node.func, text[: len(text) - len(name)] + OPPOSITES[name])
        plain = [re.fullmatch(r"(?!np\.|cv2\.)[\w.]+(\[.*\])?", ast.unparse(arg)) for arg in node.args]
        for k in range(len(node.args) - 1):
            if name not in SYMMETRIC | OBVIOUS and plain[k] and plain[k + 1] and plain[k][0] != plain[k + 1][0]:
                args = [*node.args[:k], node.args[k + 1], node.args[k], *node.args[k + 2 :]]
                self.add("arguments", node, ast.unparse(ast.Call(node.func, args, node.keywords)))
        self.visit(node.func)
        for inner in node.args:
            self.visit(inner)
        for keyword in node.keywords:
            value = ast.unparse(keyword.value)
            if keyword.arg == "axis" and value in AXES:
                self.add("axis", keyword.value, AXES[value])
            elif keyword.arg not in KEPT_KEYWORDS:
                self.visit(keyword.value)


def _name(function: ast.expr) -> str:
    return getattr(function, "attr", None) or getattr(function, "id", "")


def drawn(room: str | None, count: int, seed: int) -> list[Mutation]:
    """So many mutations of a room, or of all; modules by their length, kinds in turn."""
    sources = {
        path.relative_to(ROOT).as_posix(): path.read_bytes()
        for each in ([room] if room else ROOMS)
        for path in sorted((ROOT / "core" / each).glob("*.py"))
        if path.name != "__init__.py"
    }
    out: list[Mutation] = []
    length = sum(map(len, sources.values()))
    behind = 0.0  # of what modules so far should have had
    for file, source in sources.items():
        behind += count * len(source) / length
        chosen = _in_turn(Finder(file, source).found, random.Random(f"{seed} {file}"))[: round(behind)]
        behind -= len(chosen)
        out += chosen
    return out


def _in_turn(found: list[Mutation], chance: random.Random) -> list[Mutation]:
    """All of them in an order of chance that has every kind early."""
    kinds: dict[str, list[Mutation]] = defaultdict(list)
    for mutation in found:
        kinds[mutation.kind].append(mutation)
    order = sorted(kinds)
    for some in (order, *kinds.values()):
        chance.shuffle(some)
    longest = max(map(len, kinds.values()), default=0)
    return [kinds[kind][k] for k in range(longest) for kind in order if k < len(kinds[kind])]


class Tree:
    """A copy of the working tree, where mutations are tried."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "edf_stitch"
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0"):
            if name and (ROOT / name).is_file():
                (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, self.root / name)
        # before any installed one; BLAS with several threads may give other last bits from call to call
        self.environment = {**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
        self.seconds: dict[str, float] = {}
        where = subprocess.run(
            [sys.executable, "-c", "import edf_stitch.core as core; print(core.__path__[0])"],
            cwd=folder, env=self.environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
        if Path(where.stdout.strip()).resolve() != (self.root / "core").resolve():
            raise SystemExit(f"Python imports {where.stdout.strip()} instead of the copy in {folder}")

    def noticed_by(self, mutation: Mutation) -> str:
        """The first test that fails, "time limit" where the tests came to no end, "" where all pass."""
        path = self.root / mutation.file
        before = path.read_bytes()
        for tests in self.stages(mutation.file):
            limit = int(PATIENCE * sum(map(self.usual, tests)) + GRACE)
            self.write(path, before[: mutation.start] + mutation.text.encode() + before[mutation.stop :])
            try:
                by, _ = self.failing(tests, limit)
            finally:
                self.write(path, before)
            if by:
                return by
        return ""

    def usual(self, test: str) -> float:
        """Seconds that a file of tests takes without any mutation; all of its folder are run once for that."""
        if test not in self.seconds:
            folder = test.rpartition("/")[0]
            tests = STITCHES if test in STITCHES else tuple(self.tests_in(folder))
            wrong, out = self.failing(tests, None)
            if wrong:
                raise SystemExit(f"fails without any mutation: {wrong}")
            for name in tests:
                took = re.findall(rf"^([\d.]+)s \w+ +{re.escape(name)}\b", out, re.MULTILINE)
                self.seconds[name] = sum(map(float, took))
        return self.seconds[test]

    def tests_in(self, folder: str) -> list[str]:
        """The files of tests in a folder."""
        return sorted(f"{folder}/{path.name}" for path in (self.root / folder).glob("test_*.py"))

    def stages(self, file: str) -> Iterator[tuple[str, ...]]:
        """What is run one after the other: the tests of the module, of its room, whole stitches."""
        _, room, name = file.split("/")
        own, all_of = f"tests/core/{room}/test_{name}", self.tests_in(f"tests/core/{room}")
        if own in all_of:
            yield (own,)
        yield tuple(test for test in all_of if test != own)
        yield STITCHES

    def failing(self, tests: tuple[str, ...], limit: int | None) -> tuple[str, str]:
        """The first of these tests that fails within so many seconds of the processor, and what pytest said."""

        def hold_down() -> None:
            resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
            if limit:
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

        command = [sys.executable, "-m", "pytest", *SELECTED, *tests]
        run = subprocess.run(
            command, cwd=self.root, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            preexec_fn=hold_down,
        )  # fmt: skip
        if run.returncode == 0:
            return "", run.stdout
        if run.returncode < 0:
            return "time limit", run.stdout
        named = re.search(r"^(?:FAILED|ERROR) (\S+)", run.stdout, re.MULTILINE)
        return named[1].removeprefix("tests/core/") if named else f"pytest ended with {run.returncode}", run.stdout

    @staticmethod
    def write(path: Path, source: bytes) -> None:
        """A source file, without what Python keeps compiled of it: that is told apart by size and second only."""
        path.write_bytes(source)
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            compiled.unlink()


def _read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))


def report(rows: list[Row]) -> bool:
    """Prints what was noticed in each room and what was not; says whether that meets the goal."""
    why = {(one["file"], one["function"], one["change"]): one["why"] for one in _read(EQUIVALENT)}
    rooms: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        rooms[row.file.split("/")[1]].append(row)
    for row in rows:
        if not row.by:
            reason = why.get((row.file, row.function, row.change))
            print(f"survived: {row.file}:{row.line} {row.function}: {row.change}" + (f" ({reason})" if reason else ""))
    shares = []
    for room, some in (*rooms.items(), ("all", rows)):
        killed = sum(bool(row.by) for row in some)
        same = sum(not row.by and (row.file, row.function, row.change) in why for row in some)
        shares.append(killed / max(1, len(some) - same))
        print(f"{room}: {killed} of {len(some)} killed, {same} more change nothing: {shares[-1]:.1%} of the rest")
    return shares[-1] >= GOAL


def main() -> int:
    """0 where the goal is met, else 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--room", choices=ROOMS, help="this one only")
    parser.add_argument("--count", type=int, default=150, help="how many mutations")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", action="store_true", help="go on with the table; what was deleted there runs again")
    asked = parser.parse_args()
    table = ROOT / f"mutation_seed{asked.seed}.tsv"
    again = asked.resume and table.exists()
    done = {(row["file"], row["start"], row["change"]): Row(**row) for row in _read(table)} if again else {}
    columns = [field.name for field in fields(Row)]
    mutations, rows = drawn(asked.room, asked.count, asked.seed), []
    with tempfile.TemporaryDirectory() as folder, table.open("a" if again else "w", encoding="utf-8") as out:
        if not out.tell():
            print(*columns, sep="\t", file=out)
        tree = Tree(Path(folder))
        for number, one in enumerate(mutations, 1):
            row = done.get((one.file, str(one.start), one.change))
            if row is None:
                by = tree.noticed_by(one)
                row = Row(one.file, str(one.line), one.function, one.kind, one.change, str(one.start), by)
                print(*asdict(row).values(), sep="\t", file=out, flush=True)
                print(f"{number}/{len(mutations)} {row.file}:{row.line} {row.change}: {by or 'survived'}", flush=True)
            rows.append(row)
    return 0 if report(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
