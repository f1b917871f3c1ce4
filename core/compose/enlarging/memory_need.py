"""How much memory a stitch takes, before any picture is decoded; and how many threads may work with what there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...options import StitchOptions
from ...pictures.camera_raw import is_raw, raw_size
from ...pictures.containers import read_structure
from ...pictures.decoding import read_file
from ...pictures.exr import exr_size
from ...pictures.picture import Picture
from ...system.errors import NotEnoughMemory, UnreadableImage
from ...system.memory import free_bytes
from ...system.threads import count
from .draft import draft_times
from .options import MEMORY

Size = tuple[int, int]


@dataclass(frozen=True)
class Need:
    """What pictures take.

    Attributes
    ----------
    sizes : tuple of (int, int)
        (W, H) px of each as it is worked on.
    read : int
        Bytes of all while they are read, and shrunk if they are.
    held : int
        Bytes of all as they are worked on.
    times : int
        By how many times they are shrunk to decide about their panorama.
    """

    sizes: tuple[Size, ...]
    read: int
    held: int
    times: int

    def bytes_with(self, threads: int) -> int:
        """Bytes at the peak of a stitch with so many threads."""
        pixels = [width * height for width, height in self.sizes]
        one = MEMORY.features_bytes * min(max(pixels, default=0), MEMORY.features_pixels)
        features = max(one, min(threads * one, MEMORY.features_at_once))
        composed = MEMORY.decided_bytes * sum(pixels) / self.times**2
        enlarged = MEMORY.enlarged_bytes * sum(pixels) if self.times > 1 else 0.0
        working = self.held + max(features, composed + enlarged + threads * MEMORY.strip_bytes)
        return int(MEMORY.program_bytes + max(self.read, working))


def threads_that_fit(sources: Sequence[Any], options: StitchOptions) -> int:
    """How many threads may work at once on pictures: files, arrays or Pictures.

    Raises
    ------
    NotEnoughMemory
        They take more than may be used with a single one. It says what would fit.
    """
    limits = _limits(options, len(sources))
    return count() if limits is None else _threads([_facts(one) for one in sources], options, limits)


def need_of(sources: Sequence[Any], options: StitchOptions) -> Need:
    """What more than two pictures take: files, arrays or Pictures; those that cannot be read count as nothing."""
    return _need([_facts(one) for one in sources], options, options.scale)


def threads_that_fit_merged(sizes: Sequence[Size], options: StitchOptions) -> int:
    """The same once brackets are merged, by the (W, H) px of each view as it came: of those that were looked for, how
    many there are is known only now."""
    facts = [(size, MEMORY.float_bytes) for size in sizes]
    own = replace(options, brackets="off")
    limits = _limits(options, len(sizes), _need(facts, own, options.scale).held)
    return count() if limits is None else _threads(facts, own, limits)


def _limits(options: StitchOptions, pictures: int, held: int = 0) -> tuple[float, float] | None:
    """Bytes that a stitch may take, and that it should; None where nothing limits it. held: what it takes already."""
    if options.memory_gb is not None:
        return 1e9 * options.memory_gb, 1e9 * options.memory_gb
    free = free_bytes()
    return None if free is None or pictures == 2 else (float(free + held), (free + held) / 2)


def _threads(facts: Sequence[tuple[Size, int]], options: StitchOptions, limits: tuple[float, float]) -> int:
    """How many fit for pictures of (W, H) px and so many bytes a pixel. Raises NotEnoughMemory."""
    at_most, may_be_used = limits
    need = _need(facts, options, options.scale)
    if need.bytes_with(1) > at_most:
        raise NotEnoughMemory(_what_fits(facts, options, need.bytes_with(1), at_most))
    return next((n for n in range(count(), 1, -1) if need.bytes_with(n) <= may_be_used), 1)


def _need(facts: Sequence[tuple[Size, int]], options: StitchOptions, scale: float) -> Need:
    """What pictures of (W, H) px and so many bytes a pixel take at a scale."""
    read = sum(width * height * each for (width, height), each in facts)
    if isinstance(options.brackets, int):
        # exposures are let go once they are merged; views are of floats
        largest = max(width * height for (width, height), _ in facts)
        facts = [(size, MEMORY.float_bytes) for size, _ in facts[:: options.brackets]]
        merged = sum(width * height * each for (width, height), each in facts)
        read = max(read, merged + MEMORY.merging_bytes * largest)
    sizes = tuple((max(1, round(scale * width)), max(1, round(scale * height))) for (width, height), _ in facts)
    # shrunk pictures are of floats, and have a view beside
    each_held = [each if scale == 1 else MEMORY.float_bytes for _, each in facts]
    held = sum(width * height * each for (width, height), each in zip(sizes, each_held, strict=True))
    return Need(sizes, read if scale == 1 else read + held, held, draft_times(sizes, options))


def _what_fits(facts: Sequence[tuple[Size, int]], options: StitchOptions, needed: int, at_most: float) -> str:
    """The message about pictures that do not fit."""
    megapixels = sum(width * height for (width, height), _ in facts) / 1e6
    scales = [s / 20 for s in range(int(20 * options.scale), 0, -1) if s / 20 < options.scale]
    fitting = next((s for s in scales if _need(facts, options, s).bytes_with(1) <= at_most), None)
    step = options.brackets if isinstance(options.brackets, int) else 1
    fewer = next((n for n in range(len(facts) - step, step, -step)
                  if _need(facts[:n], options, options.scale).bytes_with(1) <= at_most), None)  # fmt: skip
    ways = [] if fitting is None else [f"--scale {fitting:g}"]
    ways += [] if fewer is None else [f"the first {fewer} of them"]
    fits = f"what would fit: {', or '.join(ways)}" if ways else "nothing of them would fit: use smaller pictures"
    allowed = "--memory allows" if options.memory_gb is not None else "only this much is free:"
    return (
        f"{len(facts)} pictures of {megapixels:.0f} megapixels together take about {needed / 1e9:.1f} GB, and "
        f"{allowed} {at_most / 1e9:.1f} GB; {fits}"
    )


def _facts(source: Any) -> tuple[Size, int]:
    """(W, H) px of a picture and its bytes a pixel once it is read; nothing of what cannot be read, which reading will
    say."""
    if isinstance(source, Picture):
        height, width, channels = source.light.shape
        return (width, height), MEMORY.float_bytes if source.bits == 32 else channels * source.bits // 8
    if isinstance(source, np.ndarray):
        return _of_array(source)
    try:
        data = read_file(Path(source))
    except UnreadableImage:
        return (0, 0), 0
    if is_raw(data, Path(source).suffix.lower()):
        return raw_size(data), MEMORY.raw_bytes
    structure = read_structure(data)
    if structure is None:
        return (0, 0), 0
    if structure.kind == "exr":
        return exr_size(data), MEMORY.float_bytes
    if structure.kind == "hdr":
        return (structure.width, structure.height), MEMORY.float_bytes
    bits = data[24] if structure.kind == "png" else getattr(structure.tiff or structure.heif, "bits", 8)
    return (structure.width, structure.height), MEMORY.deep_bytes if bits > 8 else 3


def _of_array(array: NDArray[Any]) -> tuple[Size, int]:
    """The same of an array (H, W) or (H, W, C)."""
    if array.ndim < 2:
        return (0, 0), 0
    floats = array.dtype.kind == "f"
    return (array.shape[1], array.shape[0]), MEMORY.float_bytes if floats else 3 * array.dtype.itemsize
