"""Runs a comparison: the geometry of each pair is estimated once, then every field is fitted, composed and measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from ..alignment import Geometry, estimate_geometry, fit_and_warp
from ..cameras.sources import CameraRequest
from ..choices import FIELDS
from ..frames.frame import Frame
from ..frames.reading import read_frame
from ..measure.projectivity import independent_fundamental
from ..options import StitchOptions
from ..output.json_file import json_bytes
from ..pipeline import StitchResult, compose
from ..system.errors import BadRequest, Cancelled, StitchError
from ..system.output_files import OutputFiles
from ..system.progress import Progress, Stopwatch
from ..system.threads import asking
from .figures import figures_of
from .page import comparison_page
from .pairs import PairFiles
from .pictures import field_pictures
from .published import published
from .tables import SCHEMA, comparison_csv, comparison_markdown, timing_markdown

FILES = ("compare.json", "compare.csv", "compare.md", "compare.html", "timing.json", "timing.md")
PICTURES = "pictures"
Tell = Callable[[str], None]
Show = Callable[[str, float], None]


class PairTruth(Protocol):
    """The truth about a rendered pair."""

    @property
    def camera(self) -> CameraRequest:
        """What the stitch is told about the cameras."""
        ...

    def figures(self, results: Mapping[str, StitchResult]) -> dict[str, dict[str, float]]:
        """Figures against the truth, by field, over the pixels that all fields show."""
        ...


Truths = Callable[[Path], PairTruth | None]


@dataclass(frozen=True)
class ComparisonRequest:
    """All pairs are compared with all fields, into a folder. Raises BadRequest."""

    folder: Path
    pairs: tuple[PairFiles, ...]
    fields: tuple[str, ...] = FIELDS
    overwrite: bool = False

    def __post_init__(self) -> None:
        unknown = [name for name in self.fields if name not in FIELDS]
        if unknown or not self.fields:
            raise BadRequest(f"no field {', '.join(map(repr, unknown)) or 'named'}; choose from: {', '.join(FIELDS)}")
        if len(set(self.fields)) < len(self.fields):
            raise BadRequest("a field is named twice")


@dataclass
class PairOutcome:
    """The results of a pair: its entry in compare.json; pictures by path below `pictures`; CPU seconds by step; the
    exit code, not 0 if no field could be stitched."""

    entry: dict[str, Any]
    pictures: dict[str, bytes] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    exit_code: int = 0


def comparable(options: StitchOptions, pairs: Sequence[PairFiles]) -> StitchOptions:
    """The options with which figures can be compared: all of the reference's own plane, from its place, where all
    fields exist, and nothing made up. Raises BadRequest where something else is asked for."""
    if options.crop not in ("auto", "full"):
        raise BadRequest("a comparison looks at whole panoramas: leave --crop out")
    if options.projection not in ("auto", "reference") or options.centre is not None or options.fov is not None:
        raise BadRequest(
            "a comparison looks at the reference's own plane, where all fields exist: leave --projection, --centre and "
            "--fov out"
        )
    if options.slide not in ("auto", 0):
        raise BadRequest("a comparison looks from the reference's place, where all fields exist: leave --slide out")
    if len(pairs) > 1:
        for name, value in (
            ("--matches", options.matches), ("--ignore-ref", options.ignored(0)),
            ("--ignore-target", options.ignored(1)),
        ):  # fmt: skip
            if value is not None:
                raise BadRequest(f"{name} belongs to one pair, and {len(pairs)} are named")
    fade = "plane" if options.fade == "continue" else options.fade
    holes = "transparent" if options.holes == "auto" else options.holes
    return replace(options, crop="full", projection="reference", slide=0.0, fade=fade, holes=holes)


def run_comparison(
    request: ComparisonRequest, options: StitchOptions, version: str, truths: Truths | None = None,
    show: Show | None = None, tell: Tell | None = None, cancelled: Callable[[], bool] | None = None,
) -> tuple[dict[str, Any], int]:  # fmt: skip
    """Compares fields on pairs and writes all of FILES and the pictures into the request's folder.

    Parameters
    ----------
    request : ComparisonRequest
    options : StitchOptions
        Of every stitch; the field they name does not matter.
    version : str
        Of this program, for the files.
    truths : callable, optional
        truths(folder) -> the truth about a rendered pair in that folder, or None.
    show : callable, optional
        show(what is being done, share of everything).
    tell : callable, optional
        tell(a line about a pair), after each.
    cancelled : callable, optional
        cancelled() -> bool, called between steps.

    Returns
    -------
    summary : dict
        The content of compare.json.
    exit_code : int
        0, or that of the first pair for which no field could be stitched.

    Raises
    ------
    StitchError
        Before the work, or if nothing can be written; nothing is left then.
    Cancelled
        Nothing is left.
    """
    options = comparable(options, request.pairs)
    read = [path for pair in request.pairs for path in (pair.reference, pair.target)]
    with OutputFiles(request.overwrite, [*read, *options.files_read]) as files:
        files.check_folder(request.folder, FILES)
        outcomes = []
        for number, pair in enumerate(request.pairs):
            progress = _Meter(show, cancelled, number, len(request.pairs), len(request.fields))
            with asking(cancelled):
                outcomes.append(_outcome(pair, request.fields, options, truths, progress))
            if tell is not None:
                tell(_in_words(outcomes[-1].entry, number + 1, len(request.pairs)))
        summary = {
            "schema": SCHEMA, "version": version, "fields": list(request.fields),
            "pairs": [outcome.entry for outcome in outcomes],
        }  # fmt: skip
        seconds = {outcome.entry["name"]: outcome.seconds for outcome in outcomes}
        texts = {
            "compare.csv": comparison_csv(summary), "compare.md": comparison_markdown(summary),
            "compare.html": comparison_page(summary), "timing.md": timing_markdown(seconds),
        }  # fmt: skip
        for name, text in texts.items():
            files.add_to_folder(request.folder, name, text.encode())
        files.add_to_folder(request.folder, "compare.json", json_bytes(summary))
        files.add_to_folder(request.folder, "timing.json", json_bytes(seconds))
        for outcome in outcomes:
            for path, data in outcome.pictures.items():
                place = request.folder / PICTURES / path
                files.add_to_folder(place.parent, place.name, data)
    return summary, next((outcome.exit_code for outcome in outcomes if outcome.exit_code), 0)


class _Meter:
    """The progress of the work on one pair, in pieces: its geometry, then each field."""

    def __init__(
        self, show: Show | None, cancelled: Callable[[], bool] | None, number: int, count: int, fields: int
    ) -> None:
        self._show, self._cancelled = show, cancelled
        self._number, self._count, self._pieces = number, count, fields + 1
        self._piece, self._label = 0, ""

    def begin(self, label: str) -> Stopwatch:
        """Begins the next piece."""
        piece, self._label = self._piece, label
        self._piece += 1

        def report(stage: str, share: float) -> None:
            if self._show is not None:
                done = self._number + (piece + share) / self._pieces
                self._show(f"[{self._number + 1}/{self._count}] {label} {stage}", min(1.0, done / self._count))

        return Stopwatch(Progress(report, self._cancelled))


def _outcome(
    pair: PairFiles, fields: Sequence[str], options: StitchOptions, truths: Truths | None, progress: _Meter
) -> PairOutcome:
    """Processes a pair. Raises Cancelled only: any other failure becomes its outcome."""
    entry: dict[str, Any] = {
        "name": pair.name, "reference": pair.reference.name, "target": pair.target.name, "status": "failed",
        "message": "", "published": published(pair.name), "fields": {},
    }  # fmt: skip
    try:
        if pair.trouble:
            raise BadRequest(pair.trouble)
        return _compared(pair, fields, options, truths, progress, entry)
    except Cancelled:
        raise
    except (StitchError, MemoryError) as error:
        message = str(error) if isinstance(error, StitchError) else "not enough memory for pictures of this size"
        code = error.exit_code if isinstance(error, StitchError) else StitchError.exit_code
        return PairOutcome({**entry, "message": message}, exit_code=code)


def _compared(
    pair: PairFiles, fields: Sequence[str], options: StitchOptions, truths: Truths | None, progress: _Meter,
    entry: dict[str, Any],
) -> PairOutcome:  # fmt: skip
    truth = truths(pair.folder) if truths is not None and pair.folder is not None else None
    # figures are taken here, alike for all fields; a cache would make the seconds meaningless
    options = replace(options, measure=False, cache=None)
    if truth is not None:
        options = replace(options, camera=truth.camera)
    watch, start = progress.begin("registration"), time.process_time()
    watch("read")
    frame = read_frame((pair.reference, pair.target), options)
    if len(frame.pictures) > 2:
        raise BadRequest("a sphere is worked with as several views, and fields are compared on two flat pictures")
    geometry = estimate_geometry([frame], options, watch)
    edge = geometry.edges[0]
    seconds = {"registration": time.process_time() - start}
    independent = independent_fundamental(edge.ideal, options.seed)
    outcome = PairOutcome(entry, seconds=seconds)
    results: dict[str, StitchResult] = {}
    for name in fields:
        try:
            results[name] = _stitched(name, frame, geometry, options, progress.begin(name), seconds)
        except Cancelled:
            raise
        except StitchError as error:
            entry["fields"][name] = {"status": "failed", "message": str(error), "figures": {}, "pictures": {}}
            outcome.exit_code = error.exit_code
            continue
        figures = figures_of(results[name], edge, independent, options.seed)
        made = field_pictures(results[name])
        outcome.pictures |= {f"{pair.name}/{name}-{kind}.jpg": data for kind, data in made.items()}
        entry["fields"][name] = {
            "status": "done", "message": "", "figures": figures,
            "pictures": {kind: f"{PICTURES}/{pair.name}/{name}-{kind}.jpg" for kind in made},
        }  # fmt: skip
        if truth is None:
            del results[name]  # only needed to be compared with the truth
    if truth is not None:
        for name, figures in truth.figures(results).items():
            entry["fields"][name]["figures"] |= figures
    done = [one for one in entry["fields"].values() if one["status"] == "done"]
    view = edge.two_view
    entry |= {
        "status": "done" if done else "failed",
        "message": "" if done else next(one["message"] for one in entry["fields"].values()),
        "size": list(geometry.cameras[edge.i].size), "target_size": list(geometry.cameras[edge.j].size),
        "model": view.model, "why": view.why, "matches": len(edge.matches), "inliers": int(view.inliers.sum()),
        "focal_source": view.focal_source, "rendered": truth is not None,
    }  # fmt: skip
    outcome.exit_code = 0 if done else outcome.exit_code
    return outcome


def _stitched(
    name: str, frame: Frame, geometry: Geometry, options: StitchOptions, watch: Stopwatch,
    seconds: dict[str, float],
) -> StitchResult:  # fmt: skip
    chosen, start = replace(options, field=name), time.process_time()
    alignment = fit_and_warp(geometry, [frame], chosen, watch)
    aligned = time.process_time()
    result = compose(frame, alignment, chosen, watch)
    seconds |= {f"{name}: alignment": aligned - start, f"{name}: composition": time.process_time() - aligned}
    return result


def _in_words(entry: dict[str, Any], number: int, count: int) -> str:
    """A line about a pair: its fields, best first, or why there are none."""
    if entry["status"] != "done":
        return f"[{number}/{count}] {entry['name']}: failed: {entry['message']}"
    psnr = {
        name: one["figures"]["overlap_psnr_db"] for name, one in entry["fields"].items() if one["status"] == "done"
    }  # fmt: skip
    ranked = sorted(psnr, key=lambda name: -psnr[name])
    return f"[{number}/{count}] {entry['name']}: " + ", ".join(f"{name} {psnr[name]:.2f} dB" for name in ranked)
