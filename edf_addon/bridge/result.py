"""What a panorama carries with it: settings, report, geometry, matches. As one custom property of its image, so that
it stays with the file, is appended along, and can be stitched again."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

KEY = "edf_stitch"
VERSION = 2
# Custom property of the depth of its nodes, as bytes of DepthNodes (core/output/depth/nodes.py).
DEPTH = "edf_stitch_depth"
# Images that belong to a panorama hang on it by custom properties too: key, then the worker's name of the file.
COMPANION = "edf_stitch "


def store(image: bpy.types.Image, result: dict[str, Any]) -> None:
    """Keeps a result with its image, as compact JSON.

    result: the worker's result.json without its files, and `settings` (see properties.keep), `pictures`: of each the
    name and fingerprint (see ownership), `cameras`: what the worker got of the scene's own for each, or null.
    """
    image[KEY] = json.dumps({"version": VERSION, **result}, separators=(",", ":"), ensure_ascii=False)


def read(image: bpy.types.Image | None) -> dict[str, Any] | None:
    """The result that an image carries, to be read only; None where it is none of ours, or a later version's."""
    kept = None if image is None else image.get(KEY)
    return _parse(kept) if isinstance(kept, str) else None


@lru_cache(maxsize=4)  # panels ask each time they are drawn
def _parse(kept: str) -> dict[str, Any] | None:
    try:
        found = json.loads(kept)
    except ValueError:
        return None
    return found if isinstance(found, dict) and found.get("version") == VERSION else None


def attach(image: bpy.types.Image, name: str, companion: bpy.types.Image) -> None:
    """Lets the panorama hold an image that belongs to it, which then lives as long."""
    image[COMPANION + name] = companion


def companions(image: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """The images that belong to a panorama, by the worker's name: "difference", "inverse depth", "target layer", …"""
    found = {key.removeprefix(COMPANION): image[key] for key in image.keys() if key.startswith(COMPANION)}
    return {name: other for name, other in found.items() if isinstance(other, bpy.types.Image)}


def cover(image: bpy.types.Image, overlay: str) -> NDArray[np.float32] | None:
    """What lies over a panorama as pixels (h, w, 4), the bottom row first as Blender has them, over its whole canvas.

    overlay: DIFFERENCE or DISPLACEMENT, as in the settings. None where the panorama has none.
    """
    other = companions(image).get({"DIFFERENCE": "difference", "DISPLACEMENT": "heat"}.get(overlay, ""))
    if other is None or not all(other.size):
        return None
    import numpy as np

    flat = np.empty(other.size[0] * other.size[1] * 4, np.float32)
    other.pixels.foreach_get(flat)
    return flat.reshape(other.size[1], other.size[0], 4)
