"""What tells the content of a job's pictures from any other: found here, since a window would wait for it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ..pictures.decoding import read_file
from ..system.errors import UnreadableImage


def digests_of(folder: Path, job: dict[str, Any]) -> list[str]:
    """For each picture whose entry asks for its `digest` that of its file, or shape and digest of its array; "" of a
    file that cannot be read, which reading will say."""
    return [_digest(folder, entry) if entry.get("digest") else "" for entry in job["pictures"]]


def _digest(folder: Path, entry: dict[str, Any]) -> str:
    if "path" in entry:
        try:
            data = read_file(folder / entry["path"])
        except UnreadableImage:
            return ""
        return hashlib.blake2b(data, digest_size=16).hexdigest()
    pixels = np.ascontiguousarray(np.load(folder / entry["array"], allow_pickle=False))
    digest = hashlib.blake2b(pixels.data, digest_size=16).hexdigest()
    return f"{'×'.join(map(str, pixels.shape))} {digest}"
