"""The part of report.html that shows sets of many pictures."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from ...core.output.page import table
from ..limits import Check, Result
from ..report_page import BAD, GOOD, address, cell, failures, figure, named, proof_table, slug, unit, warnings_list
from .set_names import OF_A_PICTURE, SET_MEASURES, SET_PICTURES
from .set_thresholds import BARS, HUGIN, LEAD, OPENCV, OURS, ROTATION_ONLY
from .slider import slider

OVERVIEW = (
    "rotation_deg", "rotation_max_deg", "position_max_mm", "focal_percent", "overlap_px", "overlap_p90_px", "alone_px",
    "range_log", "psnr_db", "ssim", "common_psnr_db", "line_px", "upright_deg", "things_cut", "seam_levels",
)  # fmt: skip
# The two that a slider shows one over the other.
BESIDE = ("sphere", "panorama_ours")
RIVALS = (ROTATION_ONLY, HUGIN, OPENCV)


def set_overview(results: Sequence[Result], checks: Sequence[Check]) -> str:
    """A table of all sets: figures of ours, coloured where they are judged, and the rivals' PSNR."""
    heads = "".join(f"<th class=n>{escape(SET_MEASURES[name][0])}<br>{SET_MEASURES[name][1]}</th>" for name in OVERVIEW)
    rivals = "".join(f"<th class=n>{escape(rival)}, the same<br>dB</th>" for rival in RIVALS)
    rows = []
    for result in results:
        mine = [check for check in checks if check.scene == result["scene"]]
        passed = all(check.passed for check in mine)
        ours = result["runs"].get(OURS) or {}
        figures = ours.get("figures") or {}
        judged = {check.measure: check.passed for check in mine if check.run == OURS}
        row = f'<th class="{"good" if passed else "bad"}">{GOOD if passed else BAD} '
        row += f'<a href="#{slug(result)}">{escape(result["scene"])}</a></th>'
        row += f"<td class=n>{ours.get('used', 0)} of {result['count']}</td>"
        row += "".join(cell(figures.get(name), name, judged.get(name)) for name in OVERVIEW)
        for rival in RIVALS:
            row += cell(((result["runs"].get(rival) or {}).get("figures") or {}).get(LEAD), LEAD, None)
        rows.append(f"<tr>{row}</tr>")
    head = f"<tr><th>set</th><th class=n>pictures</th>{heads}{rivals}</tr>"
    return table(head, rows)


def set_section(result: Result, checks: Sequence[Check]) -> str:
    """Everything about one set."""
    passed = all(check.passed for check in checks)
    parts = [
        f'<section id="{slug(result)}"><h2 class="{"good" if passed else "bad"}">{GOOD if passed else BAD} '
        f"{escape(result['scene'])}</h2>", f"<p>{escape(result['title'])}</p>",
    ]  # fmt: skip
    if result["message"]:
        parts.append(f"<pre>{escape(result['message'])}</pre>")
    parts.append(failures([check for check in checks if not check.passed]))
    kinds = [kind for kind in SET_PICTURES if kind in result["pictures"]]
    if set(BESIDE) <= set(kinds):
        true, ours = ((address(result, kind), SET_PICTURES[kind]) for kind in BESIDE)
        parts.append(slider(true, ours))
    if kinds:
        shown = "".join(figure(result, kind, SET_PICTURES[kind]) for kind in kinds)
        parts.append(f'<div class="pictures">{shown}</div>')
    said = warnings_list(result["runs"])
    if said:
        parts.append(f"<details><summary>Refusals and warnings</summary>{said}</details>")
    if result["runs"]:
        parts.append(_figures(result))
    if result["proof"]:
        parts.append(proof_table(result))
    return "\n".join([*parts, '<p class="quiet"><a href="#">to the top</a></p></section>'])


def _figures(result: Result) -> str:
    """All figures by way, with the bounds and what they were set by; and those of each picture."""
    ways = list(result["runs"])
    bars = {bar.measure: bar for bar in BARS.get(result["scene"], ())}
    head = "".join(f"<th class=n>{escape(way)}</th>" for way in ways)
    rows = []
    for name in SET_MEASURES:
        cells = "".join(cell((result["runs"][way]["figures"]).get(name), name, None) for way in ways)
        bar = bars.get(name)
        asked = f"<td>{escape(bar.limit.text)}</td><td class=n>{bar.measured:g}</td>" if bar else "<td></td><td></td>"
        rows.append(f"<tr><th>{escape(named(name, SET_MEASURES))}</th><td>{escape(unit(name))}</td>{cells}{asked}</tr>")
    all_of_them = table(f"<tr><th></th><th></th>{head}<th>asked of ours</th><th>measured then</th></tr>", rows)
    lines = (result["runs"].get(OURS) or {}).get("by_picture") or []
    names = [name for name in (lines[0] if lines else {}) if name != "picture"]
    columns = "".join(f"<th class=n>{escape(named(name, OF_A_PICTURE))}</th>" for name in names)
    each = table(f"<tr><th>picture</th>{columns}</tr>", [
        f"<tr><th>{int(line['picture']):02d}</th>{''.join(cell(line[name], name, None) for name in names)}</tr>"
        for line in lines
    ])  # fmt: skip
    return (
        f"<details><summary>All figures</summary>{all_of_them}</details>"
        f"<details><summary>Each picture</summary>{each}</details>"
    )
