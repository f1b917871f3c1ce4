"""The validation's report: report.json, report.csv, report.html as bytes, and the lines for the terminal.

The same results give the same bytes, whoever measured them and when: no dates, no seconds, no paths of a machine.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from .limits import Result
from .report_page import MEASURES, check_value, named, page
from .sets.set_page import set_overview, set_section
from .thresholds import Median, Verdict, judge, medians, nearer_than_homography

SCHEMA = 1
# Failed checks that the terminal shows.
MOST_LINES = 15


def report_files(results: Sequence[Result], suite: str, complete: bool, version: str) -> dict[str, bytes]:
    """report.json, report.csv and report.html by name.

    results: of scenes, as `scene_process` writes them, in the suite's order; complete: they are the whole suite.

    report.json holds
      schema    1; a change that readers must know of raises it
      suite, version, complete (false: single scenes were asked for, the suite's limits are not judged), passed
      counts    {scenes, scenes_failed (any check of theirs failed), checks, checks_failed}
      checks    [{scene (null: the suite), run ("proof": of the ground truth), measure, value (null: missing, which
                fails), limit, unit, passed}]
      medians   [{run, measure, unit, value, limit, scenes (so many count), missing (so many of them lack the figure and
                count as worst), judged, passed}]; over scenes with parallax
      scenes    [as given: schema, scene, kind ("pair" or "set"), title, size, parallax, status ("done" or "failed"),
                message, blender, made_from, proof {figure: value}, pictures {kind: path beside the report};
                of pairs: expected_model, focal_determined, runs {known/strict: {model (null: no decision),
                undetermined_said, refused (why, or ""), warnings, figures {name: value or null}}, …};
                of sets: count, expected_left_out [name], runs {ours: {refused, warnings, used (how many pictures),
                left_out [name], figures {name: value or null}, by_picture [{picture, figure: value or null}]}, …}]
    The figures' meanings stand in `measures.figures` and `measures.whole_picture`, the proof's in `proof.prove`; of
    sets in `sets.set_measures`, `set_lines`, `set_things`, `set_seams` and `set_proof`.

    report.csv: a row for every run of every scene (one with an empty run where a scene has none): what was expected,
    the model, every figure (empty: undefined, or of the other kind), and whether all checks of the run and of its scene
    passed.
    """
    verdict = judge(results, complete)
    middles = medians(results)
    return {
        "report.json": _json(results, suite, version, verdict, middles),
        "report.csv": _csv(results, verdict),
        "report.html": page(results, suite, version, verdict, middles, _of_sets(results, verdict)).encode(),
    }


def summary_lines(verdict: Verdict, results: Sequence[Result]) -> list[str]:
    """For the terminal: passed or not, the suite's figures, what failed."""
    counts = _counts(results, verdict)
    lines = [
        f"{'PASSED' if verdict.passed else 'FAILED'}: {counts['scenes'] - counts['scenes_failed']} of "
        f"{counts['scenes']} scenes, {counts['checks'] - counts['checks_failed']} of {counts['checks']} checks"
    ]
    pairs = [result for result in results if result.get("kind") != "set"]
    if verdict.complete and pairs:
        lines.append("medians over scenes with parallax:")
        for middle in medians(results):
            limit = middle.limit
            lines.append(
                f"  {'ok  ' if middle.passed else 'FAIL'} {limit.run:14} {named(limit.measure)}: "
                f"{check_value(middle.value, limit.measure)} {limit.unit} (limit {limit.text})"
            )
        nearer, asked = nearer_than_homography(pairs)
        lines.append(f"  what the target alone shows: nearer than one homography in {nearer} of {asked} scenes")
    elif pairs:
        lines.append("not a whole suite: its medians are not judged")
    failed = verdict.failed
    if failed:
        lines.append("failed:")
    for check in failed[:MOST_LINES]:
        where = " ".join(part for part in (check.scene or "suite", check.run) if part)
        value = f"{check_value(check.value, check.measure)} {check.unit}".strip()
        lines.append(f"  {where}: {named(check.measure)} {value} (limit {check.limit})")
    if len(failed) > MOST_LINES:
        lines.append(f"  and {len(failed) - MOST_LINES} more: see report.html")
    return lines


def _of_sets(results: Sequence[Result], verdict: Verdict) -> list[str]:
    """The page's part about sets: an overview, and a section for each; nothing without any."""
    sets = [result for result in results if result.get("kind") == "set"]
    if not sets:
        return []
    sections = (set_section(one, [c for c in verdict.checks if c.scene == one["scene"]]) for one in sets)
    return [f"<h2>Sets of many pictures</h2>{set_overview(sets, verdict.checks)}", *sections]


def _counts(results: Sequence[Result], verdict: Verdict) -> dict[str, int]:
    failed = {check.scene for check in verdict.failed if check.scene is not None}
    return {
        "scenes": len(results), "scenes_failed": len(failed),
        "checks": len(verdict.checks), "checks_failed": len(verdict.failed),
    }  # fmt: skip


def _json(
    results: Sequence[Result], suite: str, version: str, verdict: Verdict, middles: Sequence[Median]
) -> bytes:
    report = {
        "schema": SCHEMA, "suite": suite, "version": version, "complete": verdict.complete, "passed": verdict.passed,
        "counts": _counts(results, verdict), "checks": [asdict(check) for check in verdict.checks],
        "medians": [
            {
                "run": m.limit.run, "measure": m.limit.measure, "unit": m.limit.unit, "value": m.value,
                "limit": m.limit.text, "scenes": m.scenes, "missing": m.missing,
                "judged": verdict.complete and m.scenes > 0,
                "passed": m.passed,
            }
            for m in middles
        ],
        "scenes": list(results),
    }  # fmt: skip
    # `core.outputs.json_bytes` does the same, but brings OpenCV and SciPy with it
    return (json.dumps(report, indent=1, ensure_ascii=False) + "\n").encode()


def _csv(results: Sequence[Result], verdict: Verdict) -> bytes:
    names = list(MEASURES)
    for result in results:
        for run in result["runs"].values():
            names += [name for name in run["figures"] if name not in names]
    first = ["scene", "title", "expected_model", "parallax", "focal_determined", "status", "run", "model", "refused",
             "undetermined_said"]  # fmt: skip
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*first, *names, "run_passed", "scene_passed"])
    bad_runs = {(check.scene, check.run) for check in verdict.failed}
    bad_scenes = {scene for scene, _ in bad_runs}
    nothing: dict[str, Any] = {"model": None, "refused": "", "undetermined_said": None, "figures": {}}
    for result in results:
        scene = result["scene"]
        for way, run in (result["runs"] or {"": nothing}).items():
            row = [scene, *(result.get(name) for name in first[1:6]), way, *(run.get(name) for name in first[7:])]
            row += [run["figures"].get(name) for name in names]
            row += [(scene, way) not in bad_runs, scene not in bad_scenes]
            table.writerow([_cell(value) for value in row])
    return text.getvalue().encode()


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else value
