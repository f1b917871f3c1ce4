"""Photographs that Blender cannot open, camera RAW and HEIC: an image stands in for each; the worker reads the file.

The stand-in is as large as the photograph is upright, so that matches, masks and overlays lie where they belong.
"""

from __future__ import annotations

from pathlib import Path

import bpy

# Custom property of the image: bytes of its packed file, which is another one once it was painted on, and the
# photograph's absolute path.
KEY = "edf_stitch_photograph"
HEIC_SUFFIXES = (".heic", ".heif", ".hif")


def endings() -> str:
    """Of such files, as Blender's file dialog takes them."""
    from ...core.pictures.camera_raw import RAW_SUFFIXES

    return ";".join(f"*{suffix}" for suffix in (*HEIC_SUFFIXES, *sorted(RAW_SUFFIXES)))


def is_needed(path: Path) -> bool:
    """Whether a file is a photograph that Blender cannot open; by what it holds, whatever its name."""
    from ...core.pictures.camera_raw import raw_bytes
    from ...core.pictures.containers import container_brand

    try:
        with open(path, "rb") as file:
            brand = container_brand(file.read(64))
    except OSError:
        return False
    return brand == "HEIC" or raw_bytes(path) is not None


def bring(shown: Path, photograph: Path) -> bpy.types.Image:
    """The picture that the worker made of a photograph as a packed image, which stands in for it: the one that does
    already, where nothing has changed."""
    kept = f"{shown.stat().st_size} {photograph}"
    for known in bpy.data.images:
        if known.get(KEY) == kept and photograph_of(known) is not None:
            return known
    image = bpy.data.images.load(str(shown))
    image.pack()
    # no path: that of the photograph would let Blender unpack this over it
    image.filepath_raw, image.name = "", photograph.name
    image[KEY] = kept
    return image


def photograph_of(image: bpy.types.Image) -> Path | None:
    """The file that an image stands in for; None for all others, and where it was painted on since."""
    kept, packed = image.get(KEY), image.packed_file
    if not isinstance(kept, str) or packed is None or image.is_dirty:
        return None
    size, _, path = kept.partition(" ")
    return Path(path) if size == str(packed.size) else None
