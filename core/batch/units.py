"""Which pieces of a batch a run makes: all, those of a shard, or those of one unit, as farms take them one by one.

A unit is what one task of a farm makes: a pair, a set, or consecutive frames of a clip, so many that aligning the clip
is little beside them.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..options import StitchOptions
from ..system.errors import BadRequest, UnreadableImage
from ..system.output_files import OutputFiles
from .list import BatchItem, same_name
from .options import CLIP
from .pieces import BatchRequest, Piece, exists, real


@dataclass(frozen=True)
class Job:
    """The pieces of an item in this shard or unit, and those of them that are to be made."""

    item: BatchItem
    options: StitchOptions
    pieces: tuple[Piece, ...]
    todo: tuple[Piece, ...]


def plan(items: Sequence[BatchItem], options: StitchOptions, request: BatchRequest) -> list[Job]:
    """The work of this run, in the order of the items.

    Shards take turns with pairs and with the frames of clips: given the same items they never share an output. Units do
    not either.

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
        Two outputs have one name, one would replace a picture that is read, or there is no such unit.
    UnwritableOutput
        An output cannot be written, or exists and may not be replaced.
    """
    names: set[str] = set()
    for item in items:
        if same_name(item.name) in names:
            raise BadRequest(f"two items are named {item.name!r}: give each its own name")
        names.add(same_name(item.name))
    mine = list(_of_shard(items, request.shard)) if request.unit is None else [_of_unit(items, request.unit)]
    whole = [(item, *_pieces(item, frames, options, request)) for item, frames in mine]
    _check([piece for _, _, pieces in whole for piece in pieces], request)
    jobs = []
    for item, own, pieces in whole:
        if request.retry_failed and not any(piece.failure.is_file() for piece in pieces):
            continue
        jobs.append(Job(item, own, pieces, tuple(piece for piece in pieces if piece.is_due())))
    if request.summary and not (request.goes_on or request.overwrite) and os.path.exists(request.summary):
        raise exists(request.summary)
    return jobs


def units_of(items: Sequence[BatchItem]) -> list[tuple[BatchItem, tuple[int | None, ...]]]:
    """The units of all items, in order: of each its item and the frames that it makes, None standing for the pictures
    of a pair or set, and for the report of a clip."""
    units: list[tuple[BatchItem, tuple[int | None, ...]]] = []
    for item in items:
        frames = _frames(item)
        starts = range(0, len(frames), CLIP.unit_frames)
        units += [(item, frames[start : start + CLIP.unit_frames]) for start in starts]
    return units


def _of_unit(items: Sequence[BatchItem], unit: tuple[int, int]) -> tuple[BatchItem, tuple[int | None, ...]]:
    number, planned = unit
    units = units_of(items)
    if planned and planned != len(units):
        raise BadRequest(f"{planned} units were planned, and the list has {len(units)} now: plan again (--plan)")
    if number > len(units):
        raise BadRequest(f"unit {number} is asked for, and the list has {len(units)}")
    return units[number - 1]


def _of_shard(
    items: Sequence[BatchItem], shard: tuple[int, int]
) -> Iterator[tuple[BatchItem, tuple[int | None, ...]]]:
    """The items of a shard, and of each the frames whose turn it is."""
    index, count = shard
    turn = 0
    for item in items:
        frames = _frames(item)
        chosen = tuple(frame for at, frame in enumerate(frames, turn) if at % count == index - 1)
        turn += len(frames)
        if chosen:
            yield item, chosen


def _frames(item: BatchItem) -> tuple[int | None, ...]:
    return (None,) if item.frames is None else (None, *item.frames)


def _pieces(
    item: BatchItem, frames: Sequence[int | None], options: StitchOptions, request: BatchRequest
) -> tuple[StitchOptions, tuple[Piece, ...]]:
    """The item's own options, and its pieces of these frames with the fingerprint of what they are made from."""
    if item.camera is not None:
        options = replace(options, camera=replace(item.camera, principal=options.camera.principal))
    version = str(import_module(__package__.rpartition(".core")[0]).__version__)
    outcome = asdict(replace(options, cache=None, memory_gb=None))
    decided = [
        version, outcome, request.suffix.lower(), request.warp, request.layers, request.depth, request.mesh,
        asdict(request.exr),
    ]  # fmt: skip
    shared = [path for frame in item.aligned_on for path in item.files(frame)]
    known = [*decided, *(_identity(path) for path in (*options.files_read, *shared))]
    pieces = []
    for frame in frames:
        piece = Piece(item, frame, options, request)
        own = [_identity(path) for path in piece.pictures] if piece.panorama else []
        text = json.dumps([known, own], default=_plain)
        pieces.append(replace(piece, made_from=hashlib.sha256(text.encode()).hexdigest()))
    return options, tuple(pieces)


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


def _check(pieces: Sequence[Piece], request: BatchRequest) -> None:
    """Checks before the work that inputs exist and outputs can be written; raises as `plan` does."""
    for path in {path for piece in pieces for path in piece.options.files_read}:
        if not path.is_file():
            raise UnreadableImage(f"{path}: no such file; every pair of the batch would need it")
    inputs = {real(path) for piece in pieces for path in (*piece.pictures, *piece.options.files_read)}
    names: dict[Path, list[str]] = defaultdict(list)
    names[request.folder] += [request.summary.name] if request.summary else []
    for piece in pieces:
        for path in (*piece.outputs, piece.stamp):
            if real(path) in inputs:
                raise BadRequest(f"{path} is read by this batch and would be replaced by it; choose another folder")
            names[path.parent].append(path.name)
    for folder, wanted in names.items():
        OutputFiles(overwrite=True).check_folder(folder, wanted)
