"""Passes of a multilayer EXR that Blender wrote."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .blender_process import RenderFailed

# Where a ray meets nothing Blender writes 1e10.
NOTHING = 1e9


@dataclass(frozen=True)
class Passes:
    """light (H, W, 3) scene-linear; depth (H, W) along the camera's axis, inf where there is nothing; position
    (H, W, 3) in the world; all float32. things (H, W) uint8: numbers of the things that a world names, else 0."""

    light: NDArray[np.float32]
    depth: NDArray[np.float32]
    position: NDArray[np.float32]
    things: NDArray[np.uint8]


def read_passes(path: Path) -> Passes:
    """Reads Combined, Depth, Position and the object index. Raises RenderFailed where one is missing."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        # "ViewLayer.Depth.Z": whatever the layer is called
        channels = [item for part in file.parts for item in part.channels.items()]
        found = {".".join(name.split(".")[-2:]): channel.pixels for name, channel in channels}

    def stacked(name: str, letters: str) -> NDArray[np.float32]:
        try:
            return np.dstack([found[f"{name}.{letter}"] for letter in letters]).astype(np.float32)
        except KeyError as error:
            raise RenderFailed(f"{path.name} has no pass {error}; it has {', '.join(sorted(found))}") from None

    depth = stacked("Depth", "Z")[..., 0]
    # as Blender 5 calls it, and as earlier ones do
    things = stacked("Object Index" if "Object Index.X" in found else "IndexOB", "X")[..., 0]
    return Passes(
        stacked("Combined", "RGB"), np.where(depth > NOTHING, np.inf, depth), stacked("Position", "XYZ"),
        np.rint(things).astype(np.uint8),
    )  # fmt: skip
