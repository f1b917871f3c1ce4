"""A set of pictures by every program, each measured alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..alignment import Geometry, estimate_geometry
from ..frames.frame import Frame
from ..frames.reading import read_frame
from ..measure.placed.of_result import placed
from ..measure.placed.placed import PlacedSet
from ..measure.projectivity import independent_fundamental
from ..options import StitchOptions
from ..pictures.picture import Picture
from ..pipeline import panorama_of
from ..pose.features import Features, detect, match
from ..raster.arrays import Array
from ..system.errors import BadRequest, Cancelled, StitchError
from ..system.progress import Stopwatch
from .elsewhere.hugin import hugin_panorama
from .elsewhere.opencv_stitcher import stitcher_panorama
from .figures import figures_of_placed
from .options import COMPARISON
from .outcome import PICTURES, Outcome, slug
from .pairs import PairFiles
from .pictures import placed_pictures

# What a set is stitched with: ours, ours as if all were taken from one place, and programs that take them so.
OURS, ROTATION, HUGIN, OPENCV = "ours", "rotation only", "hugin", "opencv"
PROGRAMS = (OURS, ROTATION, HUGIN, OPENCV)
# From the pictures of a set to what somebody else made of them.
Made = Callable[[Sequence[Picture]], PlacedSet]


class Fundamentals:
    """F of any two pictures by features of their own, which no program has seen; each is estimated once."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._features: dict[str, Features] = {}
        self._known: dict[tuple[str, str], Array] = {}

    def __call__(self, one: Picture, other: Picture) -> Array:
        """F (3, 3), x_otherᵀ F x_one = 0; NaN where the pictures' matches do not determine it."""
        pair = one.name, other.name
        if pair not in self._known:
            matches = match(self._of(one), self._of(other))
            self._known[pair] = independent_fundamental(matches, self._seed)
        return self._known[pair]

    def _of(self, picture: Picture) -> Features:
        if picture.name not in self._features:
            self._features[picture.name] = detect(picture.view, picture.alpha, budget=COMPARISON.features)
        return self._features[picture.name]


def compared_set(
    files: PairFiles, options: StitchOptions, measures: Sequence[str], outside: Mapping[str, Made],
    begin: Callable[[str], Stopwatch],
) -> Outcome:  # fmt: skip
    """Stitches a set with every program and measures what comes out.

    Parameters
    ----------
    files : PairFiles
    options : StitchOptions
        Of our own stitches; the whole panorama is looked at, so all of it is kept.
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
        The pictures cannot be read. What a program cannot do is a row that says why.
    Cancelled
    """
    options = replace(options, measure=False, cache=None, crop="full")
    frame = read_frame(files.all_pictures, options)
    if len(frame.pictures) != len(files.all_pictures):
        raise BadRequest(
            f"{len(files.all_pictures)} files are {len(frame.pictures)} pictures: other programs take each file for a "
            "picture of its own; leave copies, further exposures and spheres out, or --brackets off"
        )
    entry: dict[str, Any] = {
        "name": files.name, "pictures": [path.name for path in files.all_pictures], "status": "failed", "message": "",
        "published": {}, "fields": {},
    }  # fmt: skip
    outcome, fundamental, ours = Outcome(entry), Fundamentals(options.seed), _Ours(frame, options)
    sources: dict[str, Callable[[Stopwatch], PlacedSet]] = {
        OURS: lambda watch: ours.placed(False, watch), ROTATION: lambda watch: ours.placed(True, watch),
        HUGIN: lambda watch: hugin_panorama(files.all_pictures, frame.pictures),
        OPENCV: lambda watch: stitcher_panorama(frame.pictures),
        **{name: partial(_elsewhere, made, frame.pictures) for name, made in outside.items()},
    }
    for name, source in sources.items():
        start = _cpu()
        watch = begin(name)
        watch.expect(len(frame.pictures))
        try:
            panorama = source(watch)
        except Cancelled:
            raise
        except StitchError as error:
            outcome.failed_at(name, str(error), error.exit_code)
            continue
        outcome.seconds[name] = _cpu() - start
        used = panorama.used_of(frame.pictures)
        made = placed_pictures(panorama)
        outcome.pictures |= {f"{files.name}/{slug(name)}-{kind}.jpg": data for kind, data in made.items()}
        left = [one.name for one in frame.pictures if one.name not in {placed.name for placed in used}]
        entry["fields"][name] = {
            "status": "done", "message": f"leaves out {', '.join(left)}" if left else "",
            "figures": figures_of_placed(panorama, used, fundamental, measures),
            "pictures": {kind: f"{PICTURES}/{files.name}/{slug(name)}-{kind}.jpg" for kind in made},
        }  # fmt: skip
    return outcome.settled()


def _elsewhere(made: Made, pictures: Sequence[Picture], watch: Stopwatch) -> PlacedSet:
    """What was made elsewhere, read from its folder."""
    watch("read")
    return made(pictures)


def _cpu() -> float:
    """CPU seconds of this process and of the programs that it has run."""
    now = time.process_time()
    try:
        import resource  # not on Windows, where other programs' seconds are not known
    except ImportError:
        return now
    others = resource.getrusage(resource.RUSAGE_CHILDREN)
    return now + others.ru_utime + others.ru_stime


class _Ours:
    """Our own stitches of a set, which share features and geometry."""

    def __init__(self, frame: Frame, options: StitchOptions) -> None:
        self._frame, self._options = frame, options
        self._geometry: Geometry | None = None

    def placed(self, one_place: bool, watch: Stopwatch) -> PlacedSet:
        """Ours, or as if all were taken from one place."""
        if self._geometry is None:
            self._geometry = estimate_geometry([self._frame], self._options, watch)
        geometry = self._geometry
        if one_place and geometry.rig is not None:
            rig = geometry.rig
            still = replace(rig, t=np.zeros_like(rig.t), inverse_ranges=np.zeros_like(rig.inverse_ranges))
            geometry = replace(geometry, rig=still)
        frame = self._frame.only(geometry.numbers)
        return placed(panorama_of(frame, geometry, self._options, watch))
