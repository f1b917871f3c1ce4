"""A stitch in plain words for the panel: its report as facts, and long texts as lines. No bpy, nothing heavy."""

from __future__ import annotations

import textwrap
from typing import Any

from . import switches

MODELS = {
    "general": "General scene",
    "rotation": "Rotation: both from one place",
    "plane": "Plane: one homography explains it",
}
STAGES = {
    "read": "Reading the pictures",
    "features": "Looking for matches",
    "matches": "Matching each picture with the others",
    "geometry": "Finding the cameras",
    "field": "Fitting the field",
    "dense": "Refining the overlap",
    "warp": "Bending the pictures",
    "occlusion": "Looking behind things",
    "exposure": "Matching the exposure",
    "seam": "Finding the seam",
    "blend": "Blending",
    "write": "Handing over",
}


def facts(report: dict[str, Any]) -> list[tuple[str, str]]:
    """(what, value) of a report, in the order in which an artist asks."""
    return [(what, value) for what, value in (_of_pair if "two_view" in report else _of_many)(report) if value]


def _of_many(report: dict[str, Any]) -> list[tuple[str, str]]:
    pictures, matches, measured = report["pictures"], report["matches"], report["measured"]
    left_out = report.get("left_out", ())
    out = verdict_facts(report.get("verdict") or {})
    out += [("Used", f"{len(pictures)} of {len(pictures) + len(left_out)} pictures")]
    out += [("", switches.in_the_panel(f"{one['name']} is left out: {one['why']}")) for one in left_out]
    out += [("Size", f"{report['canvas']['width']} × {report['canvas']['height']} px")]
    out += [("Matches", f"{matches['found']}")]
    out += [("Inliers", f"{matches['inliers']} ({_share(matches['inliers'], matches['found'])})")]
    slide = (report.get("slide") or {}).get("s1")
    place = "" if slide is None else f"the place of {pictures[0]['name']}" if not slide else f"slides by {slide:.2f}"
    out += [("Viewpoint", place)]
    camera = pictures[0]["camera"]
    out += [("Focal", f"{camera['focal_px']:.0f} px"), ("Source", camera["source"])]
    return [*out, ("Alignment", _pixels(measured.get("alignment_median_px"), measured.get("alignment_p95_px")))]


def _of_pair(report: dict[str, Any]) -> list[tuple[str, str]]:
    view, matches, measured = report["two_view"], report["matches"], report["measured"]
    found, inliers = matches["found"], matches["inliers"]
    out = verdict_facts(report.get("verdict") or {})
    out += [("Model", MODELS.get(view["model"], view["model"]))]
    out += [("Size", f"{report['canvas']['width']} × {report['canvas']['height']} px")]
    out += [("Matches", f"{found}"), ("Inliers", f"{inliers} ({_share(inliers, found)})")]
    out += viewpoint_facts(report.get("slide") or {})
    out += focal_facts(view)
    out += [("Dense", _dense(report["field"].get("dense") or {}))] if report["options"].get("dense") else []
    out += [("Alignment", _pixels(measured.get("alignment_median_px"), measured.get("alignment_p95_px")))]
    # an F of their own is measured only in a full run; that of the model is known in a preview too
    projectivity = measured.get("projectivity_independent_px")
    if projectivity is None:
        projectivity = measured.get("off_line_mean_px")
    return [*out, ("Projectivity", _pixels(projectivity))]


def verdict_facts(verdict: dict[str, Any]) -> list[tuple[str, str]]:
    """What a report's verdict says of the panorama: what is wrong, where from its upper left corner, and what to do."""
    if not verdict:
        return []
    if verdict["is"] == "good":
        return [("Verdict", "Good")]
    said = [] if verdict["is"] == "look" and verdict["places"] else [sentence(verdict["because"])]
    for place in verdict["places"]:
        left, top, width, height = place["box"]
        said.append(f"{left}, {top} ({width} × {height} px from the upper left): {place['what']}")
    said += [sentence(verdict["what_to_do"])] if verdict["what_to_do"] else []
    look = "Look at these places" if verdict["places"] else "Look at it"
    heading = look if verdict["is"] == "look" else "Not usable"
    return [("Verdict", heading), *(("", words) for words in said)]


def verdict_in_short(report: dict[str, Any]) -> str:
    """The same in a few words, for the line that ends a stitch; nothing of a good panorama."""
    verdict = report.get("verdict") or {"is": "good"}
    if places := len(verdict.get("places", ())) if verdict["is"] == "look" else 0:
        return f"look at {places} place{'s' * (places > 1)} (see Result)"
    told = {"good": "", "look": f"look at it: {verdict.get('because')}"}
    return told.get(verdict["is"], f"not usable: {verdict.get('because')}")


def focal_facts(view: dict[str, Any]) -> list[tuple[str, str]]:
    """The focal lengths of a report's two_view, and where they come from."""
    pair = [value for value in view["focal_px"] if value]
    if not pair:
        return []
    lengths = f"{pair[0]:.0f} px" if max(pair) - min(pair) < 0.5 else " and ".join(f"{one:.0f} px" for one in pair)
    deviation = view.get("focal_deviation")
    if deviation and "matches" in view["focal_source"]:
        lengths += f" ± {deviation:.1%}"
    return [("Focal", lengths), ("Source", view["focal_source"])]


def viewpoint_facts(slide: dict[str, Any]) -> list[tuple[str, str]]:
    """From where a panorama is seen, of its report's `slide`."""
    s1 = slide.get("s1")
    if s1 is None:
        return []
    start, end = slide.get("part", (0.0, 1.0))
    where = f", from {start:.0%} to {end:.0%} of the overlap" if (start, end) != (0.0, 1.0) else ""
    return [("Viewpoint", f"slides by {s1:.2f}{where}" if s1 else "the reference's place")]


def viewpoint(report: dict[str, Any] | None) -> str:
    """How far the viewpoint of a panorama slides, for an artist who let it be chosen."""
    told = (report or {}).get("slide")
    if not told:
        return "How far it slides is chosen by the next stitch"
    chosen = f"Viewpoint chosen: {told['s1']:.2f}"
    return f"{chosen} ({told['why']})" if told.get("why") else chosen


def stage(name: str) -> str:
    """What the engine is doing, in words."""
    return STAGES.get(name, name.capitalize())


def how_far(name: str, share: float, left: float | None) -> str:
    """A stage in words, the share of everything that is done, and the seconds that are left, where these are known."""
    said = f"{stage(name)}  {share:.0%}"
    if left is None:
        return said
    return f"{said}, {left:.0f} s left" if left < 100 else f"{said}, {left / 60:.0f} min left"


def lines(text: str, width: float, character: float = 6.6) -> list[str]:
    """A text in lines that fit into `width` px where a character takes so many; one long word keeps a line."""
    return textwrap.wrap(text, max(12, int(width / character)), break_long_words=False) or [""]


def sentence(text: str) -> str:
    """As a sentence in the panel's words: the engine's messages begin small, as they stand behind a colon on the
    command line, and name its switches. Nothing stays nothing."""
    text = switches.in_the_panel(text.strip())
    return text[:1].upper() + text[1:] + ("" if not text or text.endswith((".", "!", "?")) else ".")


def _dense(told: dict[str, Any]) -> str:
    if not told.get("used"):
        return f"not used: {told.get('why', 'nothing was found')}"
    return f"moved by {told['moved_px']:.2f} px"


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.0%}" if whole else "none"


def _pixels(median: float | None, most: float | None = None) -> str:
    if median is None:
        return ""
    return f"{median:.2f} px" + (f" (95 %: {most:.2f})" if most is not None else "")
