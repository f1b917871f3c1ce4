"""The plan of a batch: its units, what each takes, and the command that makes it, for whatever engine runs a farm."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from ..compose.enlarging.memory_need import need_of
from ..options import StitchOptions
from .list import BatchItem
from .options import UNIT
from .pieces import BatchRequest
from .units import Job, plan, units_of

SCHEMA = 1


def plan_document(
    items: Sequence[BatchItem], options: StitchOptions, request: BatchRequest, command: Sequence[str]
) -> dict[str, Any]:
    """The content of a plan's file: of every unit that has something to make its number, needs and command.

    Parameters
    ----------
    items : sequence of BatchItem
    options : StitchOptions
    request : BatchRequest
    command : sequence of str
        What is called, with its arguments, but for the unit.

    Returns
    -------
    dict
        As docs/formats.md has it.

    Raises
    ------
    StitchError
        Where the batch itself would stop before its work: see `plan`.
    """
    jobs = {id(job.item): job for job in plan(items, options, request)}
    every = units_of(items)
    units = []
    needs: dict[int, tuple[float, int]] = {}  # by item: its units are alike
    for number, (item, frames) in enumerate(every, 1):
        job = jobs.get(id(item))
        if job is None or not {piece.frame for piece in job.todo} & set(frames):
            continue
        if id(item) not in needs:
            needs[id(item)] = _needs(job)
        memory, cores = needs[id(item)]
        read = _files(item, frames)
        units.append({
            "unit": number, "name": item.name, "kind": _kind(item), "frames": _span(frames),
            "pictures": len(item.files()), "memory_gb": round(memory / 1e9, 1), "cores": cores,
            "read_bytes": sum(_size(path) for path in read), "command": [*command, "--unit", f"{number}/{len(every)}"],
        })  # fmt: skip
    return {
        "schema": SCHEMA, "version": str(import_module(__package__.rpartition(".core")[0]).__version__),
        "folder": os.getcwd(), "total": len(every), "units": units,
    }  # fmt: skip


def in_words(document: dict[str, Any]) -> str:
    """A plan in a line."""
    units = document["units"]
    memory, cores = (max((one[key] for one in units), default=0) for key in ("memory_gb", "cores"))
    read = sum(one["read_bytes"] for one in units) / 1e9
    return (
        f"{len(units)} of {document['total']} units to make, with up to {memory:.1f} GB of memory and {cores} "
        f"{'core' if cores == 1 else 'cores'} each; {read:.1f} GB to read"
    )


def _needs(job: Job) -> tuple[float, int]:
    """Bytes of memory and cores for a unit of this item."""
    item, options = job.item, job.options
    files = item.files(item.frames[0] if item.frames else None)
    need = need_of(files, options)
    if len(files) > 2:
        cores = _cores(need.bytes_with(1))
        return need.bytes_with(cores), cores
    largest = max((width * height for width, height in need.sizes), default=0)
    further = max(0.0, largest - UNIT.pair_pixels)
    memory = UNIT.pair_bytes + UNIT.pair_pixel_bytes * min(largest, UNIT.pair_pixels)
    memory += UNIT.pair_further_bytes * further
    return memory, _cores(memory)


def _cores(memory: float) -> int:
    return int(min(UNIT.max_cores, max(1, memory // UNIT.core_bytes)))


def _files(item: BatchItem, frames: Sequence[int | None]) -> set[Path]:
    """What a unit reads: the pictures of its frames, and those of the frames that the clip is aligned on."""
    if item.frames is None:
        return set(item.files())
    read = {frame for frame in frames if frame is not None} | set(item.aligned_on)
    return {path for frame in read for path in item.files(frame)}


def _kind(item: BatchItem) -> str:
    if item.frames is not None:
        return "clip"
    return "pair" if len(item.files()) == 2 else "set"


def _span(frames: Sequence[int | None]) -> dict[str, int] | None:
    """The frames of a unit of a clip: the first, the last, and how many there are."""
    numbers = [frame for frame in frames if frame is not None]
    return {"first": numbers[0], "last": numbers[-1], "count": len(numbers)} if numbers else None


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:  # not there: its unit will say so
        return 0
