"""report.html: one page that opens offline; pictures lie beside it. Nothing but sliders needs scripts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any
from urllib.parse import quote

from ..core.output.page import STYLE, table
from .limits import Check, Result
from .sets import slider
from .sets.set_names import SET_MEASURES, SET_PROOF_NAMES
from .thresholds import BEYOND_MEASURES, BEYOND_RUN, LEAD, SAYING_RUN, Median, Verdict

# Figures of a run: what people call them, their unit, digits after the point.
MEASURES = {
    "rotation_deg": ("rotation", "°", 3), "focal_percent": ("focal length", "%", 2),
    "epipole_deg": ("baseline's direction", "°", 2), "h_inf_px": ("H∞ transfer, median", "px", 3),
    "h_inf_p95_px": ("H∞ transfer, 95th", "px", 3), "f_px": ("F: true matches off their lines", "px", 3),
    "projectivity_px": ("projectivity, mean", "px", 3), "projectivity_p95_px": ("projectivity, 95th", "px", 3),
    "alignment_px": ("alignment, median", "px", 3), "alignment_p95_px": ("alignment, 95th", "px", 3),
    "beyond_px": ("outside the overlap, median", "px", 3), "beyond_p90_px": ("outside the overlap, 90th", "px", 3),
    "overlap_psnr_db": ("overlap PSNR", "dB", 2), "overlap_ssim": ("overlap SSIM", "", 4),
    "covered": ("share of the target's own part shown", "", 3),
    "whole_psnr_db": ("whole picture PSNR", "dB", 2), "whole_ssim": ("whole picture SSIM", "", 4),
    "composed_psnr_db": ("composed: whole picture PSNR", "dB", 2),
    "composed_ssim": ("composed: whole picture SSIM", "", 4),
    "over_average_db": ("composed: ahead of the plain average", "dB", 3),
    "over_average_ssim": ("composed: SSIM ahead of the plain average", "", 5),
    "overlap_over_average_db": ("composed: ahead of the plain average in the overlap", "dB", 2),
    "source_fidelity_mean": ("source fidelity, mean", "", 4),
    "source_fidelity_p5": ("source fidelity, 5th percentile", "", 4),
    "seam_visibility": ("seam visibility", "levels", 2),
    "slid_auto_px": ("viewpoint slides as chosen: both pictures meet, median", "px", 3),
    "slid_auto_p95_px": ("viewpoint slides as chosen: both pictures meet, 95th", "px", 3),
    "slid_half_px": ("viewpoint slides half-way: both pictures meet, median", "px", 3),
    "slid_half_p95_px": ("viewpoint slides half-way: both pictures meet, 95th", "px", 3),
    **{f"slid_{how}_{of}_{name}": (f"viewpoint slides {said}: the {of} beside the truth's rays, {what}", "px", 3)
       for how, said in (("auto", "as chosen"), ("half", "half-way")) for of in ("reference", "target")
       for name, what in (("px", "median"), ("p95_px", "95th"))},
    **{f"{made}target_only{where}_{name}": (f"{said}what the target alone shows{of}, {name[:4].upper()}", unit, digits)
       for made, said, where, of in (("", "", "", ""), ("", "", "_common", ", of it what all show"),
                                     ("delivered_", "delivered: ", "", ""))
       for name, unit, digits in (("psnr_db", "dB", 2), ("ssim", "", 4))},
}  # fmt: skip
Names = dict[str, tuple[str, str, int]]
OTHER_NAMES = {
    "lead_db": "whole picture's lead over the best rival",
    "nearer_scenes": "scenes in which ours is nearer than one homography",
    "model": "model", "status": "status",
    "undetermined_said": "undetermined focal length said", "position_px": "Position pass from pixel centres",
    "depth_relative": "Position against Depth, relative", "ray_cast_relative": "ray casts against Depth, relative",
    "warp_psnr_db": "target by the true map: PSNR", "half_pixel_psnr_db": "the same, half a pixel off: PSNR",
    "half_pixel_loss_db": "what half a pixel costs", "wide_psnr_db": "wide render against reference: PSNR",
    **SET_PROOF_NAMES,
}  # fmt: skip
PICTURES = {
    "reference": "Reference", "target": "Target", "stitch": "Stitch (K known, strict)",
    "truth": "True panorama (dim: seen by neither)", "difference": "Difference × 4",
    "lines": "Epipolar lines in the target: true green, estimated pink",
    "error_map": "Error of the map: black 0, yellow ≥ 4 px; gray: nothing to compare",
}  # fmt: skip
# The overview's columns for each of the two ways; a model is a word, the rest are figures.
OVERVIEW = (
    ("known/strict", "K known, strict", ("model", "rotation_deg", "h_inf_px", "projectivity_px", "alignment_px",
                                         "overlap_psnr_db", "whole_psnr_db")),
    ("unknown/strict", "K unknown, strict", ("model", "focal_percent", "rotation_deg", "h_inf_px", "projectivity_px",
                                             "alignment_px", "overlap_psnr_db", "whole_psnr_db")),
)  # fmt: skip
HEADS = {
    "model": "model", "focal_percent": "focal<br>%", "rotation_deg": "rotation<br>°", "h_inf_px": "H∞<br>px",
    "projectivity_px": "projectivity<br>px", "alignment_px": "alignment<br>px", "overlap_psnr_db": "overlap<br>dB",
    "whole_psnr_db": "whole<br>dB",
}  # fmt: skip
GOOD, BAD = '<b class="mark">✓</b>', '<b class="mark">✗</b>'


def page(
    results: Sequence[Result], suite: str, version: str, verdict: Verdict, middles: Sequence[Median],
    of_sets: Sequence[str] = (),
) -> str:  # fmt: skip
    """The whole page. middles: the suite's medians, shown also where they are not judged; of_sets: what stands about
    sets above the sections of pairs, then their own sections."""
    pairs = [result for result in results if result.get("kind") != "set"]
    failed = {check.scene for check in verdict.failed if check.scene is not None}
    word = "passed" if verdict.passed else "failed"
    counts = (
        f"{len(results) - len(failed)} of {len(results)} scenes and "
        f"{len(verdict.checks) - len(verdict.failed)} of {len(verdict.checks)} checks passed"
    )
    about = f"EDF Stitch {version}, suite {suite}{'' if verdict.complete else ', not whole: no medians judged'}"
    general = [check for check in verdict.failed if check.scene is None]
    return "\n".join([
        '<!doctype html>', '<html lang="en">', "<head>", '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Validation {word}: {escape(suite)}</title>", f"<style>{STYLE}{slider.STYLE}</style>", "</head>",
        "<body>", "<main>",
        f'<header class="{_class(verdict.passed)}"><h1>{"✓" if verdict.passed else "✗"} Validation {word}</h1>',
        f"<p>{escape(counts)}</p>", f'<p class="quiet">{escape(about)}</p></header>',
        failures(general), *(_of_pairs(pairs, verdict, middles) if pairs else ()), *of_sets[:1],
        *(_section(result, [c for c in verdict.checks if c.scene == result["scene"]]) for result in pairs),
        *of_sets[1:],
        "</main>", "</body>", "</html>", "",
    ])  # fmt: skip


def _of_pairs(pairs: Sequence[Result], verdict: Verdict, middles: Sequence[Median]) -> list[str]:
    return [
        _bars(middles, verdict.complete), "<h2>Scenes</h2>", _overview(pairs, verdict),
        "<h2>Whole picture against the true panorama</h2>", _rivals(pairs), "<h2>Outside the overlap</h2>",
        _beyond(pairs),
    ]  # fmt: skip


def named(measure: str, first: Names = MEASURES) -> str:
    """A figure as people call it; first: where its name is looked up first."""
    figure, _, rival = measure.partition(" over ")
    names = SET_MEASURES | MEASURES | first
    name = names[figure][0] if figure in names else OTHER_NAMES.get(figure, figure)
    return f"{name}, lead over {rival}" if rival else name


def check_value(value: object, measure: str) -> str:
    """A value with the digits that its measure is worth; – for none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, (int, float)):
        return str(value)
    if measure.endswith("_relative"):
        return f"{value:.1e}"
    known = SET_MEASURES | MEASURES
    other = 2 if "_db" in measure else 0 if measure.endswith("scenes") else 4
    digits = known[measure][2] if measure in known else other
    return f"{value:.{digits}f}"


def _bars(middles: Sequence[Median], judged: bool) -> str:
    rows = []
    for middle in middles:
        limit = middle.limit
        lacking = f", {middle.missing} of them without" if middle.missing else ""
        rows.append(
            f"<tr><td>{escape(limit.run)}</td><td>{escape(named(limit.measure))}</td>"
            + cell(middle.value, limit.measure, middle.passed if judged else None, f" {limit.unit}")
            + f"<td class=n>{escape(f'{limit.text} {limit.unit}')}</td><td class=n>{middle.scenes}{lacking}</td></tr>"
        )
    head = "<tr><th>run</th><th>median of</th><th class=n>value</th><th class=n>limit</th><th class=n>scenes</th></tr>"
    return f"<h2>The suite’s bars</h2>{table(head, rows)}"


def _overview(results: Sequence[Result], verdict: Verdict) -> str:
    groups = "".join(f'<th colspan="{len(columns)}" class=first>{title}</th>' for _, title, columns in OVERVIEW)
    columns = "".join(
        f"<th class='{'t' if name == 'model' else 'n'}{' first' if name == 'model' else ''}'>{HEADS[name]}</th>"
        for _, _, names in OVERVIEW for name in names
    )  # fmt: skip
    head = f"<tr><th rowspan=2>scene</th><th rowspan=2>truth<br>proved</th>{groups}</tr><tr>{columns}</tr>"
    rows = []
    for result in results:
        checks = [check for check in verdict.checks if check.scene == result["scene"]]
        passed = all(check.passed for check in checks)
        name = f'<a href="#{slug(result)}">{escape(result["scene"])}</a>'
        row = f'<tr><th class="{_class(passed)}">{GOOD if passed else BAD} {name}</th>'
        if result["status"] != "done":
            width = 1 + sum(len(names) for _, _, names in OVERVIEW)
            why = escape(f"no figures: {_last(result['message'])}")
            rows.append(f'{row}<td colspan="{width}" class=bad>{why}</td></tr>')
            continue
        proved = all(check.passed for check in checks if check.run == "proof")
        row += f'<td class="{_class(proved)}">{GOOD if proved else BAD}</td>'
        for way, _, names in OVERVIEW:
            run = result["runs"].get(way) or {"figures": {}, "model": None, "refused": ""}
            for measure in names:
                mine = [c.passed for c in checks if c.run == way and _column(c) == measure]
                value = run["figures"].get(measure)
                if measure == "model":
                    value = "refused" if run["refused"] else run["model"]
                row += cell(value, measure, all(mine) if mine else None, first=measure == "model")
        rows.append(row + "</tr>")
    note = (
        "Coloured and marked: judged. Overlap and whole: PSNR. Of the whole picture it is judged that no rival is "
        "better by more than 0.2 dB; where the focal length is not determined, that this is said."
    )
    return table(head, rows) + f'<p class="quiet">{note}</p>'


def _column(check: Check) -> str:
    """The overview's column that shows a check."""
    figure = check.measure.partition(" over ")[0]
    return "focal_percent" if (check.run, figure) == (SAYING_RUN, "undetermined_said") else figure


def _rivals(results: Sequence[Result]) -> str:
    ways: list[str] = []
    for result in results:
        ways += [way for way in result["runs"] if way not in ways]
    head = f"<tr><th>scene</th>{''.join(f'<th class=n>{escape(way)}</th>' for way in ways)}</tr>"
    rows = []
    for result in results:
        runs = result["runs"]
        values = [runs[way]["figures"].get(LEAD.measure) if way in runs else None for way in ways]
        best = max((value for value in values if value is not None), default=None)
        cells = ""
        for value in values:
            text = check_value(value, LEAD.measure)
            cells += f"<td class=n>{f'<b>{text}</b>' if value is not None and value == best else text}</td>"
        rows.append(f'<tr><th><a href="#{slug(result)}">{escape(result["scene"])}</a></th>{cells}</tr>')
    return table(head, rows) + '<p class="quiet">PSNR in dB over the pixels that all of them show; best: bold.</p>'


def _beyond(results: Sequence[Result]) -> str:
    """How far the map is off where the target alone sees: the default field beside one homography."""
    titles = ("K known, slack", "K known, one homography")
    groups = "".join(f'<th colspan="{len(BEYOND_MEASURES)}" class=first>{title}</th>' for title in titles)
    columns = "<th class=n>median px</th><th class=n>90th px</th>" * len(titles)
    rows = []
    for result in results:
        cells = ""
        for way in (BEYOND_RUN, "known/homography"):
            run = result["runs"].get(way) or {"figures": {}}
            cells += "".join(cell(run["figures"].get(name), name, None) for name in BEYOND_MEASURES)
        rows.append(f'<tr><th><a href="#{slug(result)}">{escape(result["scene"])}</a></th>{cells}</tr>')
    return table(f"<tr><th rowspan=2>scene</th>{groups}</tr><tr>{columns}</tr>", rows)


def _section(result: Result, checks: Sequence[Check]) -> str:
    passed = all(check.passed for check in checks)
    facts = [
        f"{result['size'][0]} × {result['size'][1]}" if result.get("size") else "",
        f"right model: {result['expected_model']}", "" if result["parallax"] else "no parallax",
        "" if result["focal_determined"] else "focal length not determined by two pictures",
    ]  # fmt: skip
    parts = [
        f'<section id="{slug(result)}"><h2 class="{_class(passed)}">{GOOD if passed else BAD} '
        f"{escape(result['scene'])}</h2>",
        f"<p>{escape(result['title'])}</p>", f'<p class="quiet">{escape("; ".join(f for f in facts if f))}</p>',
    ]  # fmt: skip
    if result["message"]:
        parts.append(f"<pre>{escape(result['message'])}</pre>")
    parts.append(failures([check for check in checks if not check.passed]))
    if result["pictures"]:
        parts.append(f'<div class="pictures">{"".join(_pictures(result))}</div>')
    said = warnings_list(result["runs"])
    if said:
        parts.append(f"<details><summary>Refusals and warnings</summary>{said}</details>")
    if result["runs"]:
        parts.append(f"<details><summary>All figures</summary>{_figures(result['runs'])}</details>")
    if result["proof"]:
        parts.append(proof_table(result))
    return "\n".join([*parts, '<p class="quiet"><a href="#">to the top</a></p></section>'])


def proof_table(result: Result) -> str:
    """How far the ground truth is from what it is made of."""
    rows = [f"<tr><th>{escape(named(name))}</th>{cell(value, name, None)}<td>{escape(unit(name))}</td></tr>"
            for name, value in result["proof"].items()]  # fmt: skip
    title = "Proof of the ground truth: worst distances, px and relative, and PSNR"
    return f"<details><summary>{title}</summary>{table('', rows)}</details>"


def failures(failed: Sequence[Check]) -> str:
    """A list of checks that failed, empty for none."""
    items = []
    for check in failed:
        value = f"{check_value(check.value, check.measure)} {check.unit}".strip()
        text = f"{check.run} {named(check.measure)}: {value} (limit {check.limit})".strip()
        items.append(f"<li>{BAD} {escape(text)}</li>")
    return f'<ul class="failures bad">{"".join(items)}</ul>' if items else ""


def _pictures(result: Result) -> Iterable[str]:
    kinds = [kind for kind in PICTURES if kind in result["pictures"]]
    kinds += [kind for kind in result["pictures"] if kind not in PICTURES]
    for kind in kinds:
        yield figure(result, kind, PICTURES.get(kind, kind))


def figure(result: Result, kind: str, caption: str) -> str:
    """One picture of a scene with what it shows."""
    path = escape(address(result, kind))
    alt = escape(f"{result['scene']}: {caption}")
    return (
        f'<figure><a href="{path}"><img loading="lazy" src="{path}" alt="{alt}"></a>'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def address(result: Result, kind: str) -> str:
    """Where a picture of a scene lies, as seen from the page."""
    return quote(result["pictures"][kind], safe="/=")


def _figures(runs: dict[str, dict[str, Any]]) -> str:
    names = list(MEASURES)
    names += [name for run in runs.values() for name in run["figures"] if name not in MEASURES]
    head = f"<tr><th></th><th></th>{''.join(f'<th class=n>{escape(way)}</th>' for way in runs)}</tr>"
    models = ("refused" if run["refused"] else run["model"] for run in runs.values())
    rows = [f"<tr><th>model</th><td></td>{''.join(cell(model, 'run', None) for model in models)}</tr>"]
    for name in dict.fromkeys(names):
        cells = "".join(cell(run["figures"].get(name), name, None) for run in runs.values())
        rows.append(f"<tr><th>{escape(named(name))}</th><td>{escape(unit(name))}</td>{cells}</tr>")
    said = "".join(cell(run["undetermined_said"], "undetermined_said", None) for run in runs.values())
    rows.append(f"<tr><th>{escape(named('undetermined_said'))}</th><td></td>{said}</tr>")
    return table(head, rows)


def warnings_list(runs: dict[str, dict[str, Any]]) -> str:
    """Each text once, with the runs that gave it: most runs say the same."""
    texts: dict[str, list[str]] = {}
    for way, run in runs.items():
        for text in ([f"refused: {run['refused']}"] if run["refused"] else []) + list(run["warnings"]):
            texts.setdefault(text, []).append(way)
    items = [f"<li><b>{escape(', '.join(ways))}</b>: {escape(text)}</li>" for text, ways in texts.items()]
    return f"<ul>{''.join(items)}</ul>" if items else ""


def cell(value: object, measure: str, passed: bool | None, behind: str = "", first: bool = False) -> str:
    """A table's cell; passed: None where nothing is asked."""
    kinds = [kind for kind, wanted in (("n", measure != "model"), ("first", first)) if wanted]
    kinds += [] if passed is None else [_class(passed)]
    mark = "" if passed is None else f" {GOOD if passed else BAD}"
    return f'<td class="{" ".join(kinds)}">{escape(check_value(value, measure) + behind)}{mark}</td>'


def unit(measure: str) -> str:
    """A figure's unit, empty for none."""
    for known in (MEASURES, SET_MEASURES):
        if measure in known:
            return known[measure][1]
    return "dB" if measure.endswith("_db") else "px" if measure.endswith("_px") else ""


def slug(result: Result) -> str:
    """The name of a scene's section in the page."""
    return "scene-" + re.sub(r"[^A-Za-z0-9_.=-]", "_", result["scene"])


def _last(message: str) -> str:
    lines = message.strip().splitlines()
    return lines[-1] if lines else "no reason given"


def _class(passed: bool) -> str:
    return "good" if passed else "bad"
