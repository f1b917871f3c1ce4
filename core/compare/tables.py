"""The comparison as tables in Markdown and CSV, without times; these have a table of their own."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from statistics import median
from typing import Any

from ..system.text_files import name_in_table
from .figures import FIGURES, SHARES

SCHEMA = 1
# The figures that have a table of their own in Markdown, a row a pair; PSNR and SSIM share one.
TABLES = ("projectivity_px", "projectivity_independent_px", "held_out_rms_px", "folds", "truth_alignment_px",
          "truth_alignment_p95_px", "truth_whole_psnr_db", "bent_px", "bent_alone_px", "far_enlarged")  # fmt: skip
# The same of sets.
SET_TABLES = ("gained_ssim_worst", "off_lines_px", "bent_px", "bent_alone_px", "inscribed", "holes", "used")
Summary = dict[str, Any]


def number(value: object) -> float | None:
    """A finite number as float, anything else as None."""
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def shown(value: object, name: str) -> str:
    """A figure as text with the digits of FIGURES; – for none."""
    found = number(value)
    if found is None:
        return "–"
    return f"{100 * found if name in SHARES else found:.{FIGURES[name][2]}f}"


def figure(entry: dict[str, Any], field: str, name: str) -> float | None:
    """A figure of a field on a pair, None if there is none."""
    return number(entry["fields"].get(field, {}).get("figures", {}).get(name))


def best(entry: dict[str, Any], fields: Iterable[str], name: str) -> set[str]:
    """The fields that are best on a pair by a figure, as rounded in tables; none if neither more nor less is better."""
    more = FIGURES[name][3]
    values = {field: figure(entry, field, name) for field in fields}
    known = [value for value in values.values() if value is not None]
    if more is None or not known:
        return set()
    top = max(known) if more else min(known)
    return {field for field, value in values.items() if value is not None and shown(value, name) == shown(top, name)}


def medians(summary: Summary, name: str) -> dict[str, float | None]:
    """The median of a figure over the pairs that have it for every field; None where there is none."""
    fields = summary["fields"]
    rows = [[figure(entry, field, name) for field in fields] for entry in summary["pairs"]]
    whole = [[value for value in row if value is not None] for row in rows]
    whole = [row for row in whole if len(row) == len(fields)]
    return {field: median(row[i] for row in whole) if whole else None for i, field in enumerate(fields)}


def comparison_markdown(summary: Summary) -> str:
    """A table for each important figure, the best in bold, medians below; then published figures."""
    sets: Summary = summary["sets"]
    parts = ["# Fields compared"]
    if summary["pairs"]:
        overlap = _main_table(summary, ("overlap_psnr_db", "overlap_ssim"))
        parts += ["", "Overlap, PSNR in dB / SSIM:", "", *overlap, *_tables(summary, TABLES), *_published(summary)]
    if sets["pairs"]:
        overlap = _main_table(sets, ("gained_psnr_db", "gained_ssim"))
        about = "Overlaps of sets after one gain for each channel, PSNR in dB / SSIM, at 900 px per radian:"
        parts += ["", about, "", *overlap, *_tables(sets, SET_TABLES)]
    failed = [
        f"- {entry['name']}{f', {field}' if field else ''}: {message}"
        for entry in (*summary["pairs"], *sets["pairs"]) for field, message in failures(entry)
    ]  # fmt: skip
    if failed:
        parts += ["", "Not compared:", "", *failed]
    return "\n".join(parts) + "\n"


def failures(entry: dict[str, Any]) -> list[tuple[str, str]]:
    """(field, or "" for the whole pair; message) for everything that failed."""
    if entry["status"] != "done":
        return [("", entry["message"])]
    return [(name, one["message"]) for name, one in entry["fields"].items() if one["status"] != "done"]


def _tables(summary: Summary, names: Iterable[str]) -> list[str]:
    """A table with its title for each figure that any field has."""
    parts: list[str] = []
    for name in names:
        if any(figure(entry, field, name) is not None for entry in summary["pairs"] for field in summary["fields"]):
            title, unit, _, _ = FIGURES[name]
            parts += ["", f"{title[0].upper()}{title[1:]}{f', {unit}' if unit else ''}:", "", *_table(summary, name)]
    return parts


def _main_table(summary: Summary, both: tuple[str, str]) -> list[str]:
    """A table of two figures that share a column."""
    fields = summary["fields"]
    rows = [["pair", *fields], ["---"] * (1 + len(fields))]
    for entry in summary["pairs"]:
        row = [_title(entry)]
        for field in fields:
            row.append(" / ".join(_marked(entry, field, name, fields) for name in both))
        rows.append(row)
    found = [medians(summary, name) for name in both]
    middle = [" / ".join(shown(one[f], name) for one, name in zip(found, both, strict=True)) for f in fields]
    return [_line(row) for row in [*rows, ["median", *middle]]]


def _table(summary: Summary, name: str) -> list[str]:
    fields = summary["fields"]
    rows = [["pair", *fields], ["---"] * (1 + len(fields))]
    rows += [[_title(entry), *(_marked(entry, f, name, fields) for f in fields)] for entry in summary["pairs"]]
    middle = medians(summary, name)
    return [_line(row) for row in [*rows, ["median", *(shown(middle[f], name) for f in fields)]]]


def _published(summary: Summary) -> list[str]:
    """A table of canvas values beside published ones."""
    fields = summary["fields"]
    head = ["pair", *fields, "paper: EDF", "paper: REW", "measured elsewhere: overlap PSNR / SSIM"]
    rows = [head, ["---"] * len(head)]
    for entry in summary["pairs"]:
        known = entry["published"]
        if not known or entry["status"] != "done":
            continue
        ours = [
            f"{shown(figure(entry, f, 'canvas_psnr_db'), 'canvas_psnr_db')} / "
            f"{shown(figure(entry, f, 'canvas_ssim'), 'canvas_ssim')}"
            for f in fields
        ]
        paper = known.get("paper", {})
        theirs = [f"{paper[m][1]:.2f} / {paper[m][0]:.3f}; {paper[m][2]:g} px" if m in paper else "–"
                  for m in ("EDF", "REW")]  # fmt: skip
        others = ", ".join(f"{m} {p:.2f} / {s:.3f}" for m, (p, s) in known.get("measured", {}).items())
        rows.append([entry["name"], *ours, *theirs, others or "–"])
    if len(rows) == 2:
        return []
    note = "Canvas PSNR / SSIM (black outside the overlap counts as perfect: for information only), beside published:"
    return ["", note, "", *(_line(row) for row in rows)]


def _title(entry: dict[str, Any]) -> str:
    size = entry.get("size")
    return f"{entry['name']} ({size[0]}×{size[1]})" if size else entry["name"]


def _marked(entry: dict[str, Any], field: str, name: str, fields: Iterable[str]) -> str:
    text = shown(figure(entry, field, name), name)
    return f"**{text}**" if field in best(entry, fields, name) else text


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def comparison_csv(summary: Summary) -> str:
    """A row for every field of every pair with all figures in full precision; empty cells are undefined."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["pair", "reference", "target", "width", "height", "model", "field", "status", "why", *FIGURES])
    for entry in (*summary["pairs"], *summary["sets"]["pairs"]):
        named = [name_in_table(entry.get(key, "")) for key in ("name", "reference", "target")]
        first = [*named, *entry.get("size", ("", "")), entry.get("model", "")]
        fields = entry["fields"] or {"": {"status": "failed", "message": entry["message"], "figures": {}}}
        for name, one in fields.items():
            values = [number(one["figures"].get(key)) for key in FIGURES]
            row = [*first, name, one["status"], one["message"], *("" if v is None else repr(v) for v in values)]
            table.writerow(row)
    return text.getvalue()


def timing_markdown(seconds: dict[str, dict[str, float]]) -> str:
    """A table of CPU seconds: of what all fields share, and of each field's alignment and composition."""
    names = list(dict.fromkeys(name for one in seconds.values() for name in one))
    rows = [["pair", *names], ["---"] * (1 + len(names))]
    for pair, one in seconds.items():
        rows.append([pair, *(f"{one[name]:.2f}" if name in one else "–" for name in names)])
    return "\n".join(["# CPU seconds", "", *(_line(row) for row in rows)]) + "\n"


def document(summary: Summary, seconds: dict[str, dict[str, float]], made: str) -> str:
    """All tables as one page for a documentation, with what it was made with and the CPU seconds of each field.

    made: the date, and versions of programs, in words.
    """
    about = (
        f"Made by `edf compare`: {made}. Overlap figures of pairs are taken between the reference and the warped "
        "target, 8 bit, before any blending, exposure differences in them; the best of each row is bold. What each "
        "figure is stands in [how-to.md](how-to.md#compare-and-validate), how fields work in [method.md](method.md)."
    )
    tables = comparison_markdown(summary).replace("# Fields compared", "", 1).strip()
    totals = {}
    for name, one in seconds.items():
        totals[name] = {"registration": one["registration"]} if "registration" in one else {}
        for step, value in one.items():
            field = step.partition(":")[0]
            totals[name][field] = value if field == step else totals[name].get(field, 0.0) + value
    pairs, sets = (
        {entry["name"]: totals.get(entry["name"], {}) for entry in part["pairs"]} for part in (summary, summary["sets"])
    )
    parts = ["# Compared with others", "", about, "", tables]
    for title, part in (("pairs", pairs), ("sets (ours with features and registration)", sets)):
        if part:
            parts += ["", f"CPU seconds, {title}:", "", *timing_markdown(part).strip().split("\n")[2:]]
    return "\n".join(parts) + "\n"
