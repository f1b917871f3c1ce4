"""The page about more than two pictures: what the panorama is worth, how its pictures hang together, what each is."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import cv2

from ..raster.colour import encode
from .embedded import jpeg_uri
from .options import GRAPH
from .page import STYLE, table
from .rig_graph import rig_graph

if TYPE_CHECKING:
    from ..pipeline import StitchResult

_GRAPH_STYLE = """
.graph { max-width: 100%; height: auto; background: var(--soft); border-radius: 6px; }
.graph line { stroke: var(--link); stroke-linecap: round; } .graph image { image-rendering: auto; }
.graph text { fill: var(--ink); font: 11px system-ui, sans-serif; text-anchor: middle; }
.wide img { aspect-ratio: auto; }
"""
# Nothing is loaded and nothing runs: all that the page shows is in it.
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
    "style-src 'unsafe-inline'\">"
)

# Of a kind of scale (`rig_figures.scale_kind`): how it is known how far apart pictures were taken.
_SCALES = {
    "measured": "of which three pictures see enough to measure how far apart all were taken",
    "continuity": "but how far apart some were taken is only guessed, by depth going on from one to the other",
    "none": "but how far apart some were taken is not known",
    "one place": "and all pictures were taken from one place",
}


def rig_page(result: StitchResult) -> str:
    """The page as HTML, which opens offline and without scripts; result: has a rig."""
    assert result.rig is not None
    report = result.report
    verdict, left_out = report["verdict"], report["left_out"]
    title = f"{len(result.pictures)} pictures, one panorama"
    kind = "bad" if verdict["is"] == "not usable" else "good"
    header = (
        f'<header class="{kind}"><h1>{title}</h1><p>{escape(verdict["is"])}: {escape(verdict["because"])}'
        f"{'. ' + escape(verdict['what_to_do']) if verdict['what_to_do'] else ''}</p></header>"
    )
    warnings = "".join(f"<li>{escape(warning)}</li>" for warning in result.warnings)
    return "\n".join([
        "<!doctype html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">', _POLICY,
        f"<title>{title}</title>", f"<style>{STYLE}{_GRAPH_STYLE}</style>", "</head>", "<body>", "<main>", header,
        f'<figure class="wide"><img alt="the panorama" src="{_small_panorama(result)}"></figure>',
        f"<h2>What to know</h2><ul>{warnings}</ul>" if warnings else "",
        "<h2>How the pictures hang together</h2>",
        "<p class=quiet>Each picture stands where it looks to. The thicker a line, the more matches hold its two "
        "pictures; a dashed one tells no distance.</p>",
        rig_graph(result.pictures, result.rig), _held_together(report["rig"]),
        "<h2>Pictures</h2>", _pictures(report["pictures"]),
        _left_out(left_out), "<h2>Pairs</h2>", _pairs(report["rig"]["edges"]), "</main>", "</body>", "</html>", "",
    ])  # fmt: skip


def _small_panorama(result: StitchResult) -> str:
    """The panorama as the address of a small picture, black where it shows nothing."""
    height, width = result.panorama.alpha.shape
    step = max(1, -(-max(width, height) // GRAPH.panorama_px))
    small = result.panorama.pixels[::step, ::step] * result.panorama.alpha[::step, ::step, None].astype("float32")
    coded = encode(cv2.max(small, 0.0).reshape(small.shape), 8)
    return jpeg_uri(coded)


def _pictures(entries: list[dict[str, Any]]) -> str:
    head = "<tr><th>picture<th class=n>focal length<th class=n>±<th>from<th class=n>place"
    head += "<th class=n>±<th class=n>points<th class=n>residual<th class=n>hidden<th class=n>share</tr>"
    rows = []
    for one in entries:
        camera, place = one["camera"], ", ".join(f"{value:.3f}" for value in one["place"])
        rows.append(
            f"<tr><th>{escape(one['name'])}</th><td class=n>{camera['focal_px']:.1f} px"
            f"<td class=n>{_said(camera['focal_deviation'], '.2%')}<td>{escape(camera['source'])}<td class=n>{place}"
            f"<td class=n>{_said(one['place_deviation'], '.4f', 'not known')}<td class=n>{one['inliers']}"
            f"<td class=n>{_said(one['residual_px'], '.2f')} px<td class=n>{one['hidden_px']} px"
            f"<td class=n>{one['share']:.1%}</tr>"
        )
    return table(head, rows) + "<p class=quiet>Places in units of the longest baseline.</p>"


def _held_together(rig: dict[str, Any]) -> str:
    """What the report says of all pictures together, line by line."""
    lines = [f"{rig['points']} points, {_SCALES[rig['scale']]}."]
    if rig["loop_degrees"] is not None:
        lines.append(f"The rotations of pairs around the worst loop miss closing by {rig['loop_degrees']:.2f}°.")
    lines += [f"Taken from one place: {', '.join(station)}." for station in rig["stations"]]
    if len(rig["focal_guesses"]) > 1:
        listed = "; ".join(f"{one['focal_px']:.1f} px at {one['cost']:.4f} px²" for one in rig["focal_guesses"])
        lines.append(f"Focal lengths that explain all pictures almost alike, and what a match costs: {listed}.")
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def _left_out(entries: list[dict[str, str]]) -> str:
    if not entries:
        return ""
    lines = "".join(f"<li>{escape(one['name'])}: {escape(one['why'])}</li>" for one in entries)
    return f'<h2 class="bad">Left out</h2><ul class="failures bad">{lines}</ul>'


def _pairs(edges: list[dict[str, Any]]) -> str:
    head = "<tr><th>pair<th class=n>matches<th class=n>of which agree<th class=n>noise<th class=n>parallax"
    head += "<th class=n>off the rig<th>baseline</tr>"
    rows = [
        f"<tr><th>{escape(' – '.join(edge['pictures']))}</th><td class=n>{edge['matches']}<td class=n>{edge['inliers']}"
        f"<td class=n>{_said(edge['noise_px'], '.2f')} px<td class=n>{_said(edge['parallax_px'], '.1f')} px"
        f"<td class=n>{_said(edge['off_degrees'], '.2f')}°<td>{escape(edge['baseline'])}</tr>"
        for edge in sorted(edges, key=lambda edge: -edge["inliers"])
    ]
    return table(head, rows)


def _said(value: float | None, form: str, none: str = "–") -> str:
    return none if value is None else format(value, form)
