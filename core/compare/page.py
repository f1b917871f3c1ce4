"""compare.html: one page that opens offline; pictures lie beside it, and the loupe's script in it.

For every pair a table, the panorama of every field with the average and the difference in the overlap, and the
reference alternating with the warped target of a field that can be chosen.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from typing import Any
from urllib.parse import quote

from ..output.page import STYLE, table
from .figures import FIGURES
from .loupe import LOUPE_NOTE, LOUPE_SCRIPT, LOUPE_STYLE, loupe_of
from .options import COMPARISON
from .tables import Summary, best, failures, figure, medians, shown

# The overview's columns: two figures a field.
OVERVIEW = ("overlap_psnr_db", "overlap_ssim", "projectivity_px")
SET_OVERVIEW = ("gained_psnr_db", "gained_ssim", "bent_px")
KINDS = {
    "panorama": "panorama", "average": "average of both in the overlap: what is off shows twice",
    "difference": f"difference × {COMPARISON.difference_gain} in the overlap",
}  # fmt: skip
SET_KINDS = {
    "panorama": "the average of all that it shows at a place: what is off shows twice",
    "difference": f"between the least and the most that it shows at a place, × {COMPARISON.difference_gain}",
}  # fmt: skip
BLINK = "\n".join([
    ".best { font-weight: 700; }",
    ".blink { margin: 0.8rem 0; }",
    ".blink input { margin: 0 0.25rem 0 0.75rem; }",
    ".blink .stacks > div { display: none; position: relative; margin-top: 0.5rem; }",
    ".blink img { width: auto; max-width: 100%; aspect-ratio: auto; background: none; border-radius: 0; }",
    ".blink img + img { position: absolute; inset: 0; animation: blink 1.2s steps(1) infinite; }",
    ".blink .stacks > div:hover img + img { animation-play-state: paused; }",
    "@keyframes blink { 0% { opacity: 1; } 50% { opacity: 0; } }",
    *(
        f".blink input:nth-of-type({k}):checked ~ .stacks > div:nth-child({k}) {{ display: block; }}"
        for k in range(1, COMPARISON.max_fields + 1)
    ),
])  # fmt: skip


# Nothing is loaded but the pictures beside the page.
POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src \'self\' file:; '
    "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">"
)


def comparison_page(summary: Summary) -> str:
    """The page as HTML, from the content of compare.json."""
    sets: Summary = summary["sets"]
    pairs, fields = [*summary["pairs"], *sets["pairs"]], summary["fields"]
    done = sum(entry["status"] == "done" for entry in pairs)
    header = (
        f'<header class="{"good" if done == len(pairs) else "bad"}"><h1>{len(fields)} fields, {done} pairs and sets '
        f"compared{'' if done == len(pairs) else f', {len(pairs) - done} not'}</h1>"
        f'<p class="quiet">EDF Stitch {escape(summary["version"])}. Overlap figures are taken between the reference '
        "and the warped target, 8 bit, before any blending; exposure differences are in them. Best of each pair: bold."
        "</p></header>"
    )
    return "\n".join([
        "<!doctype html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">', POLICY,
        f"<title>Fields compared on {done} pairs and sets</title>",
        f"<style>{STYLE}{BLINK}{LOUPE_STYLE}</style>", "</head>", "<body>", "<main>", header,
        *_all("All pairs", summary, OVERVIEW), *_all("All sets", sets, SET_OVERVIEW), "</main>",
        f"<script>{LOUPE_SCRIPT}</script>", "</body>", "</html>", "",
    ])  # fmt: skip


def _all(title: str, summary: Summary, columns: Sequence[str]) -> list[str]:
    """An overview of all pairs, or all sets, and a section for each."""
    if not summary["pairs"]:
        return []
    sections = (_section(entry, summary["fields"]) for entry in summary["pairs"])
    return [f"<h2>{title}</h2>", _overview(summary, columns), *sections]


def _overview(summary: Summary, columns: Sequence[str]) -> str:
    pairs, fields = summary["pairs"], summary["fields"]
    groups = "".join(f'<th colspan="{len(fields)}" class=first>{_named(name)}</th>' for name in columns)
    names = "".join(
        f'<th class="n{" first" if field == fields[0] else ""}">{escape(field)}</th>' for _ in columns
        for field in fields
    )  # fmt: skip
    rows = []
    for entry in pairs:
        title = f'<tr><th><a href="#{_slug(entry["name"])}">{escape(entry["name"])}</a></th>'
        if entry["status"] != "done":
            why = f'<td class=bad colspan="{len(columns) * len(fields)}">{escape(entry["message"])}</td>'
            rows.append(f"{title}{why}</tr>")
            continue
        cells = (_cell(entry, field, name, fields, field == fields[0]) for name in columns for field in fields)
        rows.append(f"{title}{''.join(cells)}</tr>")
    middles = [(name, medians(summary, name)) for name in columns]
    cells = (f"<td class=n>{shown(middle[field], name)}</td>" for name, middle in middles for field in fields)
    rows.append(f"<tr><th>median</th>{''.join(cells)}</tr>")
    return table(f"<tr><th rowspan=2>pair</th>{groups}</tr><tr>{names}</tr>", rows)


def _section(entry: dict[str, Any], fields: Sequence[str]) -> str:
    slug, name = _slug(entry["name"]), escape(entry["name"])
    parts = [f'<section id="{slug}"><h2>{name}</h2>']
    if entry["status"] == "done" and "pictures" in entry:
        parts.append(f'<p class="quiet">{len(entry["pictures"])} pictures: {escape(", ".join(entry["pictures"]))}</p>')
    elif entry["status"] == "done":
        (width, height), about = entry["size"], f"{entry['inliers']} of {entry['matches']} matches"
        facts = [f"{width} × {height}", f"model: {entry['model']}", about, entry["focal_source"]]
        parts.append(f'<p class="quiet">{escape("; ".join(facts))}</p>')
    said = [f"{field}: {message}" if field else message for field, message in failures(entry)]
    if said:
        parts.append(f'<ul class="failures bad">{"".join(f"<li>{escape(one)}</li>" for one in said)}</ul>')
    there = [field for field in fields if entry["fields"].get(field, {}).get("status") == "done"]
    if there:
        in_turn = [field for field in there if "warped" in entry["fields"][field]["pictures"]]
        parts += [_figures(entry, there), *([_blink(entry, in_turn, slug)] * bool(in_turn)), _grid(entry, there)]
    return "\n".join([*parts, '<p class="quiet"><a href="#">to the top</a></p></section>'])


def _figures(entry: dict[str, Any], fields: Sequence[str]) -> str:
    head = f"<tr><th></th><th></th>{''.join(f'<th class=n>{escape(field)}</th>' for field in fields)}</tr>"
    rows = []
    for name in FIGURES:
        if any(figure(entry, field, name) is not None for field in fields):
            cells = "".join(_cell(entry, field, name, fields) for field in fields)
            rows.append(f"<tr><th>{_named(name)}</th><td>{escape(FIGURES[name][1])}</td>{cells}</tr>")
    notes = []
    for method, (ssim, psnr, projectivity) in entry["published"].get("paper", {}).items():
        notes.append(f"{method} as published: canvas {psnr:.2f} dB / {ssim:.3f}, projectivity {projectivity:g} px")
    for method, (psnr, ssim) in entry["published"].get("measured", {}).items():
        notes.append(f"{method} measured elsewhere: overlap {psnr:.2f} dB / {ssim:.3f}")
    said = f'<p class="quiet">{escape("; ".join(notes))}.</p>' if notes else ""
    return table(head, rows) + said


def _blink(entry: dict[str, Any], fields: Sequence[str], slug: str) -> str:
    choices = "".join(
        f'<input type="radio" name="{slug}" id="{slug}-{escape(field)}"{" checked" if field == fields[0] else ""}>'
        f'<label for="{slug}-{escape(field)}">{escape(field)}</label>'
        for field in fields
    )
    stacks = "".join(
        f'<div><img loading="lazy" src="{_path(entry, field, "reference")}" alt="reference">'
        f'<img loading="lazy" src="{_path(entry, field, "warped")}" alt="target warped by {escape(field)}"></div>'
        for field in fields
    )
    about = "Blink: reference and warped target in the overlap, in turn. A pointer on it holds it still."
    viewer = f'<div class="blink">{choices}<div class="stacks">{stacks}</div></div>'
    return f"<details><summary>{about}</summary>{viewer}</details>"


def _grid(entry: dict[str, Any], fields: Sequence[str]) -> str:
    figures = []
    for kind, caption in (SET_KINDS if "pictures" in entry else KINDS).items():
        for field in fields:
            if kind not in entry["fields"][field]["pictures"]:
                continue
            path, alt = _path(entry, field, kind), escape(f"{entry['name']}: {field}, {caption}")
            psnr = "gained_psnr_db" if "pictures" in entry else "overlap_psnr_db"
            score = f"{shown(figure(entry, field, psnr), psnr)} dB"
            figures.append(
                f'<figure{loupe_of(entry["fields"][field], kind)}><a href="{path}">'
                f'<img loading="lazy" src="{path}" alt="{alt}"></a><span class="glass"></span>'
                f"<figcaption><b>{escape(field)}</b> ({score}): {escape(caption)}</figcaption></figure>"
            )
    return f'<p class="quiet">{LOUPE_NOTE}</p><div class="pictures">{"".join(figures)}</div>'


def _path(entry: dict[str, Any], field: str, kind: str) -> str:
    return escape(quote(entry["fields"][field]["pictures"][kind], safe="/="))


def _cell(entry: dict[str, Any], field: str, name: str, fields: Sequence[str], first: bool = False) -> str:
    kinds = ["n", *["first"] * first, *["best"] * (field in best(entry, fields, name))]
    return f'<td class="{" ".join(kinds)}">{shown(figure(entry, field, name), name)}</td>'


def _named(name: str) -> str:
    return escape(FIGURES[name][0])


def _slug(name: str) -> str:
    return "pair-" + re.sub(r"[^A-Za-z0-9_.=-]", "_", name)
