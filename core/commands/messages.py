"""What the command line says on stderr: a summary, warnings, and how far the work is."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..system.text_files import printable
from .options import MESSAGES

if TYPE_CHECKING:
    from ..output.outputs import OutputRequest


def say(line: str) -> None:
    """A line on stderr, above the bar where there is one."""
    line = printable(line)
    if sys.stderr.isatty():
        from tqdm import tqdm

        tqdm.write(line, file=sys.stderr)
    else:
        print(line, file=sys.stderr, flush=True)


def shortened(names: Sequence[str]) -> str:
    """Names in words: the first ones and the last of many."""
    most = MESSAGES.max_names
    return ", ".join(names) if len(names) <= most else ", ".join([*names[: most - 1], "…", names[-1]])


def print_summary(report: dict[str, Any], seconds: dict[str, float]) -> None:
    """What was decided and measured, from a stitch's report, and its seconds by stage; for --verbose."""
    if "rig" in report:
        print("\n".join(f"edf: {printable(line)}" for line in _rig_lines(report, seconds)), file=sys.stderr)
        return
    view, field, measured = report["two_view"], report["field"], report["measured"]
    focal = ", ".join(f"{value:.1f}" for value in view["focal_px"])
    lines = [
        f"{view['model']}: {view['why']}",
        f"focal length {focal} px ({view['focal_source']}; ± {said(view['focal_deviation'], '.1%')}, at infinity ± "
        f"{said(view['h_inf_spread_px'], '.1f')} px)",
        f"field {field['kind']}: {field['centres']} points, {field['pruned']} left out, "
        f"λ {said(field['smoothing'], '.1e')}",
        f"alignment {said(measured['alignment_median_px'], '.2f')} px (median), "
        f"{said(measured['alignment_p95_px'], '.2f')} px (95 %), {said(measured['off_line_mean_px'], '.2f')} px off "
        "their lines (mean)",
        f"held out: {said(measured['held_out_rms_px'], '.2f')} px (RMS of five folds), "
        f"{said(measured['held_out_towards_rms_px'], '.2f')} px towards the part only the target shows",
        f"projectivity {said(measured['projectivity_own_px'], '.2f')} px, by an independent F "
        f"{said(measured['projectivity_independent_px'], '.2f')} px",
        f"overlap PSNR {said(measured['overlap_psnr_db'], '.2f')} dB, SSIM {said(measured['overlap_ssim'], '.3f')}",
        _seconds_line(seconds),
    ]
    print("\n".join(f"edf: {line}" for line in lines), file=sys.stderr)


def print_result(outputs: OutputRequest, report: dict[str, Any], warnings: Sequence[str]) -> None:
    """What came out of a stitch, as a document on stdout; for --json."""
    files = {"panorama": outputs.panorama, "report": outputs.report, "layers": outputs.layers, "warp": outputs.warp,
             "cameras": outputs.cameras, "depth": outputs.depth, "mesh": outputs.mesh}  # fmt: skip
    document = {
        "schema": 1, "files": {what: str(path) for what, path in files.items() if path is not None},
        "width": report["canvas"]["width"], "height": report["canvas"]["height"], "verdict": report["verdict"],
        "warnings": list(warnings),
    }  # fmt: skip
    print(json.dumps(document, indent=1))


def said(value: float | None, form: str) -> str:
    """A figure in words."""
    return "-" if value is None else format(value, form)


def _seconds_line(seconds: dict[str, float]) -> str:
    return "seconds: " + ", ".join(f"{stage} {value:.2f}" for stage, value in seconds.items())


def _rig_lines(report: dict[str, Any], seconds: dict[str, float]) -> list[str]:
    """The same of more than two pictures."""
    rig, field, measured, pictures = (report[key] for key in ("rig", "field", "measured", "pictures"))
    loop = "" if rig["loop_degrees"] is None else f", worst loop {rig['loop_degrees']:.2f}°"
    lines = [
        f"{len(pictures)} pictures, {len(report['left_out'])} left out; {len(rig['edges'])} pairs, "
        f"{rig['points']} points, "
        f"noise {said(report['matches']['noise_px'], '.2f')} px{loop}",
    ]
    if rig["scale"] == "one place":
        lines.append("taken from one place: rotations alone join the pictures, there is no depth")
    for one in pictures:
        camera = one["camera"]
        lines.append(
            f"{one['name']}: focal length {camera['focal_px']:.1f} px ({camera['source']}; "
            f"± {said(camera['focal_deviation'], '.1%')}), {one['inliers']} points, "
            f"{said(one['residual_px'], '.2f')} px, {one['share']:.0%} of the panorama"
        )
    return [
        *lines,
        f"field {field['kind']}: {field['centres']} points, each told by the others to "
        f"{said(field['leave_one_out_px'], '.2f')} px (median)",
        f"alignment {said(measured['alignment_median_px'], '.2f')} px (median), "
        f"{said(measured['alignment_p95_px'], '.2f')} px (95 %)",
        _seconds_line(seconds),
    ]


def verdict_line(verdict: dict[str, Any]) -> str:
    """A report's verdict in a line: what is wrong, where (left, top, width×height in px), and what to do."""
    if verdict["is"] == "good":
        return "good"
    if verdict["is"] == "not usable":
        return f"not usable: {verdict['because']}; {verdict['what_to_do']}"
    places: dict[str, list[str]] = {}
    for place in verdict["places"]:
        left, top, width, height = place["box"]
        places.setdefault(place["what"], []).append(f"{left},{top} {width}×{height}")
    found = "; ".join(f"{what} ({', '.join(boxes)})" for what, boxes in places.items())
    if not found:
        return f"look at it: {verdict['because']}; {verdict['what_to_do']}"
    elsewhere = "".join(f"{why}; " for why in verdict["because"].split("; ") if why not in places)
    return f"look at these places: {found}; {elsewhere}{verdict['what_to_do']}"


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A progress callable: a bar on a terminal, with the time that is left; elsewhere one plain line for each stage;
    nothing when quiet."""
    if quiet:
        yield lambda stage, total: None
    elif sys.stderr.isatty():
        from tqdm import tqdm

        # without smoothing what is left is told as fast as all went so far: stages differ
        form = "{desc:<9}{bar}{percentage:3.0f} % {elapsed}, {remaining} left"
        with tqdm(total=100, bar_format=form, smoothing=0, miniters=1, leave=False, file=sys.stderr) as bar:

            def move(stage: str, total: float) -> None:
                # tqdm draws ten times a second at most: a new stage is shown all the same
                changed = bar.desc != stage
                bar.set_description_str(stage, refresh=False)
                bar.update(round(100 * total) - bar.n)
                if changed:
                    bar.refresh()

            yield move
    else:
        last = ""

        def tell(stage: str, total: float) -> None:
            nonlocal last
            if stage != last:
                print(f"edf: {stage} ({total:.0%})", file=sys.stderr, flush=True)
                last = stage

        yield tell
