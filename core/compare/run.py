"""Runs a comparison: every field on every pair and every program on every set, resumable and in shards."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..choices import FIELDS
from ..options import StitchOptions
from ..output.json_file import json_bytes
from ..system.errors import BadRequest, Cancelled, StitchError, UnreadableImage
from ..system.output_files import OutputFiles
from ..system.progress import Progress, Stopwatch
from ..system.threads import asking
from .elsewhere.folders import outside_of
from .elsewhere.hugin import hugin_version
from .figures import MEASURES
from .outcome import Outcome, keep_part, kept_part, mark_of, slug
from .page import comparison_page
from .pair_fields import Truths, compared_pair
from .pairs import PairFiles
from .published import published
from .sets import PROGRAMS, Made, compared_set
from .tables import SCHEMA, comparison_csv, comparison_markdown, document, figure, timing_markdown

FILES = (
    "compare.json", "compare.csv", "compare.md", "compare.html", "timing.json", "timing.md", "timing_and_tables.md",
)  # fmt: skip
Tell = Callable[[str], None]
Show = Callable[[str, float], None]


@dataclass(frozen=True)
class ComparisonRequest:
    """All pairs are compared with all fields and all sets with all programs, into a folder.

    measures: what is measured, some of MEASURES; outside: names of other programs and the folders of their results;
    resume: what an earlier run has kept is not done again; shard: (I, N), the I-th (from 1) of N runs that share the
    work. With either, what is finished is kept in OUTDIR/parts. Raises BadRequest.
    """

    folder: Path
    pairs: tuple[PairFiles, ...]
    fields: tuple[str, ...] = FIELDS
    overwrite: bool = False
    measures: tuple[str, ...] = MEASURES
    outside: tuple[tuple[str, Path], ...] = ()
    resume: bool = False
    shard: tuple[int, int] = (1, 1)

    def __post_init__(self) -> None:
        for what, names, known in (("field", self.fields, FIELDS), ("measure", self.measures, MEASURES)):
            unknown = [name for name in names if name not in known]
            if unknown or not names:
                said = ", ".join(map(repr, unknown)) or "named"
                raise BadRequest(f"no {what} {said}; choose from: {', '.join(known)}")
            if len(set(names)) < len(names):
                raise BadRequest(f"a {what} is named twice")
        others = [name for name, _ in self.outside]
        files = [slug(name).casefold() for name in (*FIELDS, *PROGRAMS, *others)]
        taken = [name for name in others if files.count(slug(name).casefold()) > 1]
        if taken:
            raise BadRequest(f"--outside {taken[0]}=…: the name stands for something else already; choose another")
        if not 1 <= self.shard[0] <= self.shard[1]:
            raise BadRequest(f"shard {self.shard[0]}/{self.shard[1]}: it is I/N with I from 1 to N")

    @property
    def keeps(self) -> bool:
        """Whether what is finished is kept for a later run."""
        return self.resume or self.shard[1] > 1

    @property
    def others(self) -> list[str]:
        """Names of programs whose results were made elsewhere."""
        return [name for name, _ in self.outside]

    def is_ours(self, number: int) -> bool:
        """Whether a pair or set, by its number, is this shard's."""
        return number % self.shard[1] == self.shard[0] - 1


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
    """Compares fields on pairs, and programs on sets, and writes FILES and the pictures into the request's folder.

    Parameters
    ----------
    request : ComparisonRequest
    options : StitchOptions
        Of every stitch; the field they name matters for sets only.
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
        The content of compare.json; `missing` names what other shards have still to do: then no tables are written.
    exit_code : int
        0, or that of the first pair or set for which nothing could be stitched.

    Raises
    ------
    StitchError
        Before the work, or if nothing can be written; nothing is left then but what is kept.
    Cancelled
        The same.
    """
    flat = comparable(options, [pair for pair in request.pairs if not pair.more])
    for name, place in request.outside:
        if not place.is_dir():
            raise UnreadableImage(f"--outside {name}={place}: there is no such folder; check the name")
    read = [path for pair in request.pairs for path in pair.all_pictures]
    with OutputFiles(request.overwrite or request.resume, [*read, *options.files_read]) as files:
        files.check_folder(request.folder, FILES)
        outcomes: list[Outcome] = []
        missing = []
        for number, pair in enumerate(request.pairs):
            outside = outside_of(request.outside, pair, len(request.pairs))
            given = [path for _, folder in request.outside for path in sorted(folder.rglob("*"))]
            mark = mark_of([*pair.all_pictures, *given], version, request.fields, request.measures, options)
            known = kept_part(request.folder, pair.name, mark) if request.keeps else None
            if known is None and not request.is_ours(number):
                missing.append(pair.name)
                continue
            if known is None:
                steps = len(PROGRAMS) if pair.more else len(request.fields)
                progress = _Meter(show, cancelled, number, len(request.pairs), steps + len(outside))
                with asking(cancelled):
                    known = _outcome(pair, request, options if pair.more else flat, truths, outside, progress)
                if request.keeps:
                    keep_part(request.folder, pair.name, mark, known)
                    known.pictures.clear()
                if tell is not None:
                    tell(_in_words(known.entry, number + 1, len(request.pairs)))
            outcomes.append(known)
        summary = _summary(request, version, outcomes) | {"missing": missing}
        if not missing:
            _stage(request.folder, summary, outcomes, files)
    return summary, next((outcome.exit_code for outcome in outcomes if outcome.exit_code), 0)


def _summary(request: ComparisonRequest, version: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The content of compare.json: pairs by fields, and sets by programs in the same form."""
    entries = [outcome.entry for outcome in outcomes]
    pairs, sets = ([entry for entry in entries if ("pictures" in entry) == is_set] for is_set in (False, True))
    return {
        "schema": SCHEMA, "version": version, "measures": list(request.measures),
        "fields": [*request.fields, *request.others], "pairs": pairs,
        "sets": {"fields": [*PROGRAMS, *request.others], "pairs": sets},
    }  # fmt: skip


def _made(version: str) -> str:
    """When it is made, and with which versions."""
    programs = {"EDF Stitch": version, "Python": platform.python_version(), "NumPy": np.__version__,
                "OpenCV": cv2.__version__}  # fmt: skip
    hugin = hugin_version()
    named = ", ".join(f"{name} {number}" for name, number in (programs | ({"Hugin": hugin} if hugin else {})).items())
    return f"{time.strftime('%Y-%m-%d', time.gmtime())}, {named}"


def _stage(folder: Path, summary: dict[str, Any], outcomes: Sequence[Outcome], files: OutputFiles) -> None:
    """Stages all tables, the page and the pictures that are not in place yet."""
    seconds = {outcome.entry["name"]: outcome.seconds for outcome in outcomes}
    texts = {
        "compare.csv": comparison_csv(summary), "compare.md": comparison_markdown(summary),
        "compare.html": comparison_page(summary), "timing.md": timing_markdown(seconds),
        "timing_and_tables.md": document(summary, seconds, _made(summary["version"])),
    }  # fmt: skip
    for name, text in texts.items():
        files.add_to_folder(folder, name, text.encode())
    files.add_to_folder(folder, "compare.json", json_bytes(summary))
    files.add_to_folder(folder, "timing.json", json_bytes(seconds))
    for outcome in outcomes:
        outcome.add_pictures(folder, files)


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
    pair: PairFiles, request: ComparisonRequest, options: StitchOptions, truths: Truths | None,
    outside: Mapping[str, Made], progress: _Meter,
) -> Outcome:  # fmt: skip
    """Processes a pair or set. Raises Cancelled only: any other failure becomes its outcome."""
    entry: dict[str, Any] = {"name": pair.name, "status": "failed", "message": "", "fields": {}}
    if pair.more:
        entry |= {"pictures": [path.name for path in pair.all_pictures], "published": {}}
    else:
        entry |= {
            "reference": pair.reference.name, "target": pair.target.name, "published": published(pair.name),
        }  # fmt: skip
    try:
        if pair.trouble:
            raise BadRequest(pair.trouble)
        if pair.more:
            return compared_set(pair, options, request.measures, outside, progress.begin)
        return compared_pair(pair, request.fields, options, truths, request.measures, outside, progress.begin)
    except Cancelled:
        raise
    except (StitchError, MemoryError) as error:
        message = str(error) if isinstance(error, StitchError) else "not enough memory for pictures of this size"
        code = error.exit_code if isinstance(error, StitchError) else StitchError.exit_code
        return Outcome({**entry, "message": message}, exit_code=code)


def _in_words(entry: dict[str, Any], number: int, count: int) -> str:
    """A line about a pair: its fields, best first, or why there are none."""
    if entry["status"] != "done":
        return f"[{number}/{count}] {entry['name']}: failed: {entry['message']}"
    key = "gained_psnr_db" if "pictures" in entry else "overlap_psnr_db"
    done = [name for name, one in entry["fields"].items() if one["status"] == "done"]
    psnr = {name: figure(entry, name, key) for name in done}
    ranked = sorted(done, key=lambda name: -(psnr[name] or 0.0))
    told = ", ".join(name if psnr[name] is None else f"{name} {psnr[name]:.2f} dB" for name in ranked)
    return f"[{number}/{count}] {entry['name']}: {told}"
