"""A pair by every field: its geometry is estimated once, then each field is fitted, composed and measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from ..alignment import Geometry, estimate_geometry, fit_and_warp
from ..cameras.sources import CameraRequest
from ..frames.frame import Frame
from ..frames.reading import read_frame
from ..measure.projectivity import independent_fundamental
from ..options import StitchOptions
from ..pipeline import StitchResult, compose
from ..system.errors import BadRequest, Cancelled, StitchError
from ..system.progress import Stopwatch
from .figures import figures_of, figures_of_placed
from .outcome import PICTURES, Outcome
from .pairs import PairFiles
from .pictures import field_pictures, origin_of, placed_pictures
from .published import published
from .sets import Fundamentals, Made


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


def compared_pair(
    pair: PairFiles, fields: Sequence[str], options: StitchOptions, truths: Truths | None, measures: Sequence[str],
    outside: Mapping[str, Made], begin: Callable[[str], Stopwatch],
) -> Outcome:  # fmt: skip
    """Stitches a pair with every field and measures what comes out.

    Parameters
    ----------
    pair : PairFiles
    fields : sequence of str
        Some of FIELDS.
    options : StitchOptions
        With which figures can be compared, see `comparable`.
    truths : callable, optional
        truths(folder) -> the truth about a rendered pair in that folder, or None.
    measures : sequence of str
        Some of MEASURES.
    outside : mapping
        Results made elsewhere, by name.
    begin : callable
        begin(what comes next) -> where its progress is told.

    Returns
    -------
    Outcome

    Raises
    ------
    StitchError
        The pictures cannot be read, or have no geometry. What a field cannot do is a row that says why.
    Cancelled
    """
    truth = truths(pair.folder) if truths is not None and pair.folder is not None else None
    # figures are taken here, alike for all fields; a cache would make the seconds meaningless
    options = replace(options, measure=False, cache=None)
    if truth is not None:
        options = replace(options, camera=truth.camera)
    watch, start = begin("registration"), time.process_time()
    watch("read")
    frame = read_frame((pair.reference, pair.target), options)
    if len(frame.pictures) > 2:
        raise BadRequest("a sphere is worked with as several views, and fields are compared on two flat pictures")
    geometry = estimate_geometry([frame], options, watch)
    edge = geometry.edges[0]
    view = edge.two_view
    entry: dict[str, Any] = {
        "name": pair.name, "reference": pair.reference.name, "target": pair.target.name, "status": "failed",
        "message": "", "published": published(pair.name), "fields": {},
        "size": list(geometry.cameras[edge.i].size), "target_size": list(geometry.cameras[edge.j].size),
        "model": view.model, "why": view.why, "matches": len(edge.matches), "inliers": int(view.inliers.sum()),
        "focal_source": view.focal_source, "rendered": truth is not None,
    }  # fmt: skip
    outcome = Outcome(entry, seconds={"registration": time.process_time() - start})
    independent = independent_fundamental(edge.ideal, options.seed)
    results: dict[str, StitchResult] = {}
    for name in fields:
        try:
            results[name] = _stitched(name, frame, geometry, options, begin(name), outcome.seconds)
        except Cancelled:
            raise
        except StitchError as error:
            outcome.failed_at(name, str(error), error.exit_code)
            continue
        figures = figures_of(results[name], edge, independent, options.seed, measures)
        _note(outcome, name, figures, field_pictures(results[name]))
        entry["fields"][name]["origin"] = origin_of(results[name])
        if truth is None:
            del results[name]  # only needed to be compared with the truth
    if truth is not None:
        for name, figures in truth.figures(results).items():
            entry["fields"][name]["figures"] |= figures
    fundamental = Fundamentals(options.seed)
    for name, made in outside.items():
        begin(name)
        try:
            panorama = made(frame.pictures)
        except StitchError as error:
            outcome.failed_at(name, str(error), error.exit_code)
            continue
        figures = figures_of_placed(panorama, panorama.used_of(frame.pictures), fundamental, measures)
        _note(outcome, name, figures, placed_pictures(panorama))
    return outcome.settled()


def _note(outcome: Outcome, name: str, figures: Mapping[str, float], pictures: Mapping[str, bytes]) -> None:
    """Adds what a field or program has made to a pair's outcome."""
    pair = outcome.entry["name"]
    outcome.pictures |= {f"{pair}/{name}-{kind}.jpg": data for kind, data in pictures.items()}
    outcome.entry["fields"][name] = {
        "status": "done", "message": "", "figures": dict(figures),
        "pictures": {kind: f"{PICTURES}/{pair}/{name}-{kind}.jpg" for kind in pictures},
    }  # fmt: skip


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
