"""The outputs of a batch, and which of them exist already.

For each output a hidden folder holds a stamp: a fingerprint of everything that it was made from, and of the panorama
itself. With it a later run skips what is up to date, makes again what is out of date, and does not touch what it did
not make or what somebody has changed since.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..options import StitchOptions
from ..output.json_file import json_bytes
from ..output.outputs import (
    CANVAS,
    OutputRequest,
    add_depth,
    add_report,
    layer_files,
    write,
)
from ..output.warp_file import write_warp
from ..pictures.encoding import output_bits
from ..pictures.exr import ExrForm
from ..system.errors import BadRequest, UnreadableImage, UnwritableOutput
from ..system.output_files import Made, OutputFiles
from .list import BatchItem, same_name

if TYPE_CHECKING:
    from ..pipeline import StitchResult

STAMPS = ".edf"


@dataclass(frozen=True)
class BatchRequest:
    """Where and how a batch is written.

    folder: created if missing; suffix: of the panoramas; warp, layers, depth, mesh: whether these are written too;
    resume: skip what is up to date; overwrite: replace what exists; shard: (I, N), the I-th (from 1) of N runs that
    share the work; exr: how panoramas and layers are written as .exr. Raises BadRequest.
    """

    folder: Path
    suffix: str = ".png"
    warp: bool = False
    layers: bool = False
    resume: bool = False
    overwrite: bool = False
    shard: tuple[int, int] = (1, 1)
    depth: bool = False
    mesh: bool = False
    exr: ExrForm = ExrForm()

    def __post_init__(self) -> None:
        output_bits((8,), self.suffix)
        if not 1 <= self.shard[0] <= self.shard[1]:
            raise BadRequest(f"shard {self.shard[0]}/{self.shard[1]}: it is I/N with I from 1 to N")

    @property
    def summary(self) -> Path:
        """The file with the outcomes; each shard has its own."""
        index, count = self.shard
        return self.folder / ("batch.json" if count == 1 else f"batch.shard-{index}-of-{count}.json")


@dataclass(frozen=True)
class Unit:
    """Outputs that appear together: all of a pair, one frame of a clip, or (frame None) the report of a clip.

    made_from: fingerprint of everything that decides about their bytes.
    """

    item: BatchItem
    frame: int | None
    options: StitchOptions
    request: BatchRequest
    made_from: str = ""

    @property
    def panorama(self) -> Path | None:
        """None for a clip's report."""
        return None if self._is_clips_report else self._named(self.request.suffix)

    @property
    def report(self) -> Path | None:
        """None for the frames of a clip, which share one."""
        return self._named(".report.json") if self.frame is None else None

    @property
    def stamp(self) -> Path:
        """The file with the fingerprints."""
        return self.request.folder / STAMPS / self._named(".json").relative_to(self.request.folder)

    @property
    def outputs(self) -> list[Path]:
        """All files it will consist of, except those that only float pictures have."""
        out = [self.panorama] if self.panorama else []
        if self._layers:
            names = layer_files(
                [path.name for path in self.pictures], seam=self.options.has_seam,
                inpainted=self.options.fills_holes, slides=self.options.may_slide,
            )  # fmt: skip
            # of more than two, which is numbered how is known only when they are stitched
            out += [self._layers / name for name in (names if len(self.pictures) == 2 else [CANVAS])]
        if self.report:
            out += [self.report, self._named(".matches.csv"), self._named(".timing.json")]
            out += [self._named(".warp.npz")] if self.request.warp else []
            out += [path for path in self._depth if path is not None]
        return out

    @property
    def pictures(self) -> tuple[Path, ...]:
        """The files of its pictures; for a clip's report those of its first frame."""
        frames = self.item.frames
        return self.item.files(frames[0] if self.frame is None and frames else self.frame)

    def write(self, result: StitchResult) -> list[str]:
        """Writes all files or none; returns all warnings. Raises UnwritableOutput and BadRequest."""
        warnings = list(result.warnings)
        may_replace = self.request.overwrite or self.request.resume
        files = UnitFiles(may_replace, (*self.pictures, *self.options.files_read))
        with files:
            if self.panorama:
                outputs = OutputRequest(self.panorama, layers=self._layers, exr=self.request.exr)
                warnings += write(result, outputs, files)
            if self.report:
                matches, timing = self._named(".matches.csv"), self._named(".timing.json")
                warnings += add_depth(result, *self._depth, files)
                add_report(result, warnings, self.report, matches, timing, files)
                if self.request.warp:
                    files.add_by(self._named(".warp.npz"), partial(write_warp, result))
            made = files.prints[_real(self.panorama)] if self.panorama else None
            files.add(self.stamp, json_bytes({"made_from": self.made_from, "panorama": made}))
        return warnings

    def is_due(self) -> bool:
        """Whether it has to be made. Raises UnwritableOutput if a file exists that may not be replaced."""
        there = [path for path in self.outputs if os.path.exists(path)]
        if not there:
            return True
        stamp = read_json(self.stamp) if self.request.resume else {}
        if stamp.get("made_from") == self.made_from and len(there) == len(self.outputs) and self._has_size(stamp):
            return False
        if self.request.overwrite or (stamp and self._is_untouched(stamp)):
            return True
        if self.request.resume:
            raise UnwritableOutput(
                f"{there[0]} exists and is not as this command left it: use --overwrite to replace it, or choose "
                "another folder"
            )
        raise _exists(there[0])

    @property
    def _is_clips_report(self) -> bool:
        return self.frame is None and self.item.frames is not None

    @property
    def _layers(self) -> Path | None:
        return self._named(".layers") if self.request.layers and not self._is_clips_report else None

    @property
    def _depth(self) -> tuple[Path | None, Path | None]:
        """The files of ranges and mesh, where they are asked for."""
        depth, mesh = self.request.depth, self.request.mesh
        return self._named(".depth.exr") if depth else None, self._named(".mesh.glb") if mesh else None

    def _named(self, suffix: str) -> Path:
        folder, name = self.request.folder, self.item.name
        if self.frame is None:
            return folder / (name + suffix)
        return folder / name / (self.item.numbered(self.frame) + suffix)

    def _has_size(self, stamp: dict[str, Any]) -> bool:
        return self.panorama is None or [self.panorama.stat().st_size] == (stamp.get("panorama") or [])[:1]

    def _is_untouched(self, stamp: dict[str, Any]) -> bool:
        """Whether a panorama that exists is the one that was written."""
        if self.panorama is None or not os.path.exists(self.panorama):
            return True
        return fingerprint_of_file(self.panorama) == stamp.get("panorama")


@dataclass(frozen=True)
class Job:
    """The units of an item in this shard, and those of them that are still to be made."""

    item: BatchItem
    options: StitchOptions
    units: tuple[Unit, ...]
    todo: tuple[Unit, ...]


class UnitFiles(OutputFiles):
    """Output files whose folders are created when needed; prints: [number of bytes, SHA-256] of each."""

    def __init__(self, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> None:
        super().__init__(overwrite, inputs)
        self.prints: dict[Path, list[int | str]] = {}

    def add_by(self, path: str | Path, make: Callable[[IO[bytes]], Made]) -> Made:
        """See `OutputFiles.add_by`."""
        self.make_folder(Path(path).parent)
        made = super().add_by(path, make)
        self.prints[_real(path)] = fingerprint_of_file(self.staged(path))
        return made


def plan(items: Sequence[BatchItem], options: StitchOptions, request: BatchRequest) -> list[Job]:
    """This shard's work, in the order of the items.

    Shards take turns with pairs and with the frames of clips: given the same items they never share an output.

    Parameters
    ----------
    items : sequence of BatchItem
    options : StitchOptions
    request : BatchRequest

    Returns
    -------
    list of Job

    Raises
    ------
    UnreadableImage
        A file that the options name is missing.
    BadRequest
        Two outputs have one name, or one would replace a picture that is read.
    UnwritableOutput
        An output cannot be written, or exists and may not be replaced.
    """
    names: set[str] = set()
    for item in items:
        if same_name(item.name) in names:
            raise BadRequest(f"two items are named {item.name!r}: give each its own name")
        names.add(same_name(item.name))
    version = str(import_module(__package__.rpartition(".core")[0]).__version__)
    index, count = request.shard
    mine: list[tuple[BatchItem, StitchOptions, list[Unit]]] = []
    turn = 0
    for item in items:
        own = _options_for(item, options)
        units = list(_units(item, own, request, version))
        chosen = [unit for at, unit in enumerate(units, turn) if at % count == index - 1]
        turn += len(units)
        if chosen:
            mine.append((item, own, chosen))
    _check([unit for *_, units in mine for unit in units], request)
    jobs = []
    for item, own, units in mine:
        jobs.append(Job(item, own, tuple(units), tuple(unit for unit in units if unit.is_due())))
    if not (request.resume or request.overwrite) and os.path.exists(request.summary):
        raise _exists(request.summary)
    return jobs


def fingerprint_of_file(path: Path) -> list[int | str]:
    """The number of its bytes and their SHA-256."""
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        return [file.tell(), digest.hexdigest()]


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if it cannot be read or is none."""
    try:
        value = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}


def _options_for(item: BatchItem, options: StitchOptions) -> StitchOptions:
    if item.camera is None:
        return options
    return replace(options, camera=replace(item.camera, principal=options.camera.principal))


def _units(item: BatchItem, options: StitchOptions, request: BatchRequest, version: str) -> Iterator[Unit]:
    outcome = asdict(replace(options, cache=None, memory_gb=None))
    decided = [
        version, outcome, request.suffix.lower(), request.warp, request.layers, request.depth, request.mesh,
        asdict(request.exr),
    ]  # fmt: skip
    shared = [path for frame in item.aligned_on for path in item.files(frame)]
    known = [*decided, *(_identity(path) for path in (*options.files_read, *shared))]
    frames: Sequence[int | None] = (None,) if item.frames is None else (None, *item.frames)
    for frame in frames:
        unit = Unit(item, frame, options, request)
        own = [_identity(path) for path in unit.pictures] if unit.panorama else []
        text = json.dumps([known, own], default=_plain)
        yield replace(unit, made_from=hashlib.sha256(text.encode()).hexdigest())


def _identity(path: Path) -> list[str | int]:
    """Name, size and time of a file: these change when it does, and not when its folder is moved."""
    try:
        state = path.stat()
    except OSError:
        return [path.name]
    return [path.name, state.st_size, state.st_mtime_ns]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [value.dtype.str, value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    return value.item() if isinstance(value, np.generic) else Path(value).name


def _check(units: Sequence[Unit], request: BatchRequest) -> None:
    """Checks before the work that inputs exist and outputs can be written; raises as `plan` does."""
    for path in {path for unit in units for path in unit.options.files_read}:
        if not path.is_file():
            raise UnreadableImage(f"{path}: no such file; every pair of the batch would need it")
    inputs = {_real(path) for unit in units for path in (*unit.pictures, *unit.options.files_read)}
    names: dict[Path, list[str]] = defaultdict(list, {request.folder: [request.summary.name]})
    for unit in units:
        for path in (*unit.outputs, unit.stamp):
            if _real(path) in inputs:
                raise BadRequest(f"{path} is read by this batch and would be replaced by it; choose another folder")
            names[path.parent].append(path.name)
    for folder, wanted in names.items():
        OutputFiles(overwrite=True).check_folder(folder, wanted)


def _exists(path: Path) -> UnwritableOutput:
    return UnwritableOutput(
        f"{path} exists: use --resume to make what is missing or out of date, --overwrite to make everything again, or "
        "choose another folder"
    )


def _real(path: str | Path) -> Path:
    return Path(os.path.realpath(path))
