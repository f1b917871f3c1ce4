"""The outputs of a batch, and which of them exist already.

For each output a hidden folder holds a stamp: a fingerprint of everything that it was made from, and of the panorama
itself. With it a later run skips what is up to date, makes again what is out of date, and does not touch what it did
not make or what somebody has changed since. While outputs are put in place the stamp is an unfinished one, which names
the panorama that comes and the one before: a process killed there leaves what the next run knows and makes again.
What failed leaves a record beside the stamps.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

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
from ..system.errors import BadRequest, UnwritableOutput
from ..system.output_files import Made, OutputFiles, undisturbed
from .list import BatchItem

if TYPE_CHECKING:
    from ..pipeline import StitchResult

# Folders in the batch's, and in the first one: names of outputs do not start with a dot.
STAMPS = ".edf"
FAILURES = ".failed"


@dataclass(frozen=True)
class BatchRequest:
    """Where and how a batch is written.

    folder: created if missing; suffix: of the panoramas; warp, layers, depth, mesh: whether these are written too;
    resume: skip what is up to date; overwrite: replace what exists; shard: (I, N), the I-th (from 1) of N runs that
    share the work; unit: (K, N), instead: the K-th (from 1) of the units that a plan counts, whose number is N, or 0 if
    it is not known; keep_going: a failure does not stop the rest; retry_failed: only items that failed the last time;
    exr: how panoramas and layers are written as .exr. Raises BadRequest.
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
    unit: tuple[int, int] | None = None
    keep_going: bool = False
    retry_failed: bool = False

    def __post_init__(self) -> None:
        output_bits((8,), self.suffix)
        if not 1 <= self.shard[0] <= self.shard[1]:
            raise BadRequest(f"shard {self.shard[0]}/{self.shard[1]}: it is I/N with I from 1 to N")
        if self.unit is not None and not 1 <= self.unit[0] <= (self.unit[1] or self.unit[0]):
            raise BadRequest(f"unit {self.unit[0]}/{self.unit[1]}: it is K or K/N with K from 1 to N")
        if self.unit is not None and self.shard != (1, 1):
            raise BadRequest("a unit and a shard are asked for: give one of them")

    @property
    def goes_on(self) -> bool:
        """Whether what an earlier run of this command left is expected, and replaced where it is out of date."""
        return self.resume or self.retry_failed

    @property
    def summary(self) -> Path | None:
        """The file with the outcomes; each shard has its own, and a unit, of which there may be thousands, has none."""
        if self.unit is not None:
            return None
        index, count = self.shard
        return self.folder / ("batch.json" if count == 1 else f"batch.shard-{index}-of-{count}.json")


@dataclass(frozen=True)
class Piece:
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

    @property
    def failure(self) -> Path:
        """The file that says why there are none."""
        return self.request.folder / STAMPS / FAILURES / self._named(".json").relative_to(self.request.folder)

    def write(self, result: StitchResult) -> list[str]:
        """Writes all files or none; returns all warnings. Raises UnwritableOutput and BadRequest.

        Writes nothing where another process has made the same since this one began.
        """
        warnings = list(result.warnings)
        may_replace = self.request.overwrite or self.request.goes_on
        files = PieceFiles(may_replace, (*self.pictures, *self.options.files_read))
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
            made = files.prints[real(self.panorama)] if self.panorama else None
            if self.is_made():
                files.discard()
                return warnings
            with undisturbed(), self._stamped(made):
                files.commit()
        return warnings

    def is_made(self) -> bool:
        """Whether another run of this command has made it meanwhile."""
        return self.request.goes_on and not self.is_due()

    def is_due(self) -> bool:
        """Whether it has to be made. Raises UnwritableOutput if a file exists that may not be replaced."""
        there = [path for path in self.outputs if os.path.exists(path)]
        if not there:
            return True
        stamp = read_json(self.stamp) if self.request.goes_on else {}
        if stamp.get("made_from") == self.made_from and len(there) == len(self.outputs) and self._has_size(stamp):
            return False
        if self.request.overwrite or (stamp and self._is_untouched(stamp)):
            return True
        if self.request.goes_on:
            raise UnwritableOutput(
                f"{there[0]} exists and is not as this command left it: use --overwrite to replace it, or choose "
                "another folder"
            )
        raise exists(there[0])

    def record_failure(self, message: str, exit_code: int) -> None:
        """Leaves a record of why it could not be made. Raises UnwritableOutput."""
        _write_json(self.failure, {"message": message, "exit_code": exit_code})

    @contextmanager
    def _stamped(self, made: list[int | str] | None) -> Iterator[None]:
        """Within this the outputs are put in place, and the stamp says that what is there is either what was there
        before or this; after an error it is as it was."""
        before = read_json(self.stamp)
        others = [one for one in (before.get("panorama"), *before.get("others", [])) if one and one != made]
        _write_json(self.stamp, {"made_from": "", "panorama": made, "others": others})
        try:
            yield
        except BaseException:
            if before:
                _write_json(self.stamp, before)
            else:
                self.stamp.unlink(missing_ok=True)
            raise
        _write_json(self.stamp, {"made_from": self.made_from, "panorama": made})
        self.failure.unlink(missing_ok=True)

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
        return fingerprint_of_file(self.panorama) in (stamp.get("panorama"), *stamp.get("others", []))


class PieceFiles(OutputFiles):
    """Output files whose folders are created when needed; prints: [number of bytes, SHA-256] of each."""

    def __init__(self, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> None:
        super().__init__(overwrite, inputs)
        self.prints: dict[Path, list[int | str]] = {}

    def add_by(self, path: str | Path, make: Callable[[IO[bytes]], Made]) -> Made:
        """See `OutputFiles.add_by`."""
        self.make_folder(Path(path).parent)
        made = super().add_by(path, make)
        self.prints[real(path)] = fingerprint_of_file(self.staged(path))
        return made


def fingerprint_of_file(path: Path) -> list[int | str]:
    """The number of its bytes and their SHA-256."""
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        return [file.tell(), digest.hexdigest()]


def _write_json(path: Path, value: dict[str, Any]) -> None:
    with PieceFiles(overwrite=True) as files:
        files.add(path, json_bytes(value))


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if it cannot be read or is none."""
    try:
        value = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}


def exists(path: Path) -> UnwritableOutput:
    """What is said of a file that stands where an output would."""
    return UnwritableOutput(
        f"{path} exists: use --resume to make what is missing or out of date, --overwrite to make everything again, or "
        "choose another folder"
    )


def real(path: str | Path) -> Path:
    """Links followed."""
    return Path(os.path.realpath(path))
