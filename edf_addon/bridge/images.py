"""Blender's images to what the worker reads, and the worker's pictures to Blender's images.

Blender's rows begin at the bottom and ours at the top; its float pixels are scene-linear and multiplied by alpha, its
bytes are display-encoded and not. Both are dealt with here, once each way. What is a file's own goes by the file, with
all that Blender leaves behind (16 bits, ICC profile, EXIF); what was painted, generated or rendered goes as an array.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import compat, stand_ins

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Kinds of files that the engine reads itself.
READABLE = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr", ".webp", ".bmp"})
# How a fingerprint begins: of a file, or of pixels that are in no file.
FILE, PIXELS = "file ", "pixels "
# Bits per pixel, over all channels, of images without alpha.
OPAQUE_DEPTHS = (8, 24, 48, 96)
# The chunk that every PNG ends with.
PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"


class Unusable(Exception):
    """An image that cannot be stitched; says which, why, and what to do."""


def named(name: str) -> bpy.types.Image:
    """One of the file's images. Raises Unusable."""
    image = bpy.data.images.get(name)
    if image is None:
        raise Unusable(f"the file has no image named “{name}”")
    return image


def describe(
    image: bpy.types.Image, stem: str, folder: Path, scene: bpy.types.Scene, user: bpy.types.ImageUser | None = None
) -> dict[str, Any]:
    """The worker's entry for a picture (core/commands/worker.py); what is no file of its own is left in `folder`.

    stem: what its files are called; scene: whose render a Render Result is; user: of the editor that shows the image,
    which knows the frame of a sequence. Raises Unusable.
    """
    if image.source == "MOVIE":
        raise Unusable(f"“{image.name}” is a movie: save the frame that is wanted as a picture, and choose that")
    if image.source == "TILED":
        raise Unusable(f"“{image.name}” is a set of UDIM tiles: choose a single picture")
    import numpy as np

    if image.type == "RENDER_RESULT":
        return {"name": image.name, "path": _save_render(image, folder / f"{stem}.exr", scene)}
    path = file_of(image, user)
    if _goes_as_file(image, path):
        return {"name": image.name, "path": str(path)}
    if path is not None and stand_ins.photograph_of(image) is not None:
        raise Unusable(f"“{image.name}”: its photograph {path} is not there; put it back, or open it again")
    if path is not None and stand_ins.is_needed(path):
        raise Unusable(f"“{image.name}”: Blender cannot show camera RAW and HEIC files; open it with Add Pictures")
    packed = image.packed_file
    if packed is not None:
        kept = folder / f"{stem}.packed"
        kept.write_bytes(packed.data)
        if _goes_as_packed(image):
            return {"name": image.name, "path": kept.name}
        path = kept
    if image.source == "FILE" and path is not None and not path.is_file() and not image.has_data:
        raise Unusable(
            f"“{image.name}”: its file {path} is not there; find it with File ▸ External Data ▸ Find Missing Files"
        )
    np.save(folder / f"{stem}.npy", read(image))
    entry: dict[str, Any] = {"name": image.name, "array": f"{stem}.npy"}
    if path is not None and path.is_file():
        entry["exif_of"] = str(path) if packed is None else path.name
    return entry


def fingerprint(entry: Mapping[str, Any], digest: str) -> str:
    """What tells the content of a picture from any other, by its entry (see `describe`) and the digest that the worker
    told of what it got, a file or pixels; "" where there is none."""
    return (FILE if "path" in entry else PIXELS) + digest if digest else ""


def has_changed(image: bpy.types.Image, known: str) -> bool:
    """Whether a picture has another content than when `fingerprint` gave `known`. Being renamed, moved, packed or saved
    is no change; a file that is not there is one."""
    try:
        if known.startswith(PIXELS):
            return known != PIXELS + _digest_of_pixels(image)
        path, packed = file_of(image), image.packed_file
        if image.is_dirty or path is None and packed is None:
            return True
        return known != FILE + (_digest(packed.data) if path is None else _digest_of_file(path))
    except (Unusable, OSError):
        return True


def _digest_of_pixels(image: bpy.types.Image) -> str:
    pixels = read(image)
    return f"{'×'.join(map(str, pixels.shape))} {_digest(pixels.data)}"


def _digest_of_file(path: Path) -> str:
    stamp = path.stat()
    return _digest_of_version(path, stamp.st_mtime_ns, stamp.st_size)


@lru_cache(maxsize=32)
def _digest_of_version(path: Path, _changed: int, _size: int) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _digest(data: bytes | memoryview) -> str:
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _goes_as_file(image: bpy.types.Image, path: Path | None) -> bool:
    """Whether the worker reads the picture's file itself."""
    if stand_ins.photograph_of(image) is not None:
        return path is not None and path.is_file()
    return path is not None and path.is_file() and is_files_own(image) and path.suffix.lower() in READABLE


def _goes_as_packed(image: bpy.types.Image) -> bool:
    """Whether the worker reads the picture's packed file as it is."""
    return image.packed_file is not None and not image.is_dirty and not image.is_float and _is_plain(image)


def file_of(image: bpy.types.Image, user: bpy.types.ImageUser | None = None) -> Path | None:
    """The absolute path of an image's file, or of the photograph that it stands in for, there or not; None where it has
    none."""
    photograph = stand_ins.photograph_of(image)
    if photograph is not None:
        return photograph
    if image.source not in ("FILE", "SEQUENCE") or not image.filepath_raw or image.packed_file is not None:
        return None
    if image.source == "SEQUENCE" and user is not None:
        return Path(image.filepath_from_user(image_user=user))
    return Path(bpy.path.abspath(image.filepath_raw, library=image.library))


def is_files_own(image: bpy.types.Image) -> bool:
    """Whether the file holds what Blender shows: nothing painted since, nothing read in another way than it says."""
    if image.packed_file is not None or image.is_dirty:
        return False
    if image.source == "SEQUENCE" or image.type == "MULTILAYER":
        return True  # Blender has no pixels of these without a window
    return _is_plain(image)


def _is_plain(image: bpy.types.Image) -> bool:
    """Whether colour space and alpha are those that the kind of file has anyway."""
    holds_light = Path(image.filepath_raw).suffix.lower() in (".exr", ".hdr")
    usual_alpha = "PREMUL" if holds_light else "STRAIGHT"
    # an image that was not looked at yet is loaded when it is asked for its depth or floats: that comes last
    if image.alpha_mode != usual_alpha and image.depth not in OPAQUE_DEPTHS:
        return False
    # bytes stay bytes whatever they mean, and the panorama gets their colour space; floats were converted
    usual_space = compat.LINEAR if holds_light else compat.DISPLAY
    return image.colorspace_settings.name == usual_space or not image.is_float


def read(image: bpy.types.Image) -> NDArray[np.uint8] | NDArray[np.float32]:
    """An image's pixels (H, W, 3 or 4 with straight alpha), row 0 on top: uint8 display-encoded, or float32
    scene-linear. Raises Unusable where there are none."""
    import numpy as np

    width, height = image.size
    if not width or not height or not len(image.pixels):
        raise Unusable(f"“{image.name}” has no pixels: load it again, render it, or choose another image")
    flat = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(flat)
    if not image.is_float:
        flat *= 255  # in place: Blender's window waits for this
        flat += 0.5
    values: Any = flat if image.is_float else flat.astype(np.uint8)
    rgba = values.reshape(height, width, 4)[::-1]
    alpha = rgba[..., 3:]
    is_opaque = image.depth in OPAQUE_DEPTHS or image.alpha_mode == "NONE"
    if is_opaque or bool((alpha == (1 if image.is_float else 255)).all()):
        return np.ascontiguousarray(rgba[..., :3])
    if not image.is_float or not is_premultiplied(image):
        return np.ascontiguousarray(rgba)
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = np.where(alpha == 0, np.float32(0), rgba / alpha)
    pixels[..., 3:] = alpha
    return pixels


def is_premultiplied(image: bpy.types.Image) -> bool:
    """Whether a float image's colours are multiplied by alpha in memory."""
    return image.alpha_mode != "CHANNEL_PACKED" and image.colorspace_settings.name != compat.DATA


def _save_render(image: bpy.types.Image, path: Path, scene: bpy.types.Scene) -> str:
    """The last render, whose pixels Blender gives no other way, as a float EXR of its scene-linear values."""
    try:
        with compat.written_as(scene, "OPEN_EXR", 32):  # the render is found by its scene
            image.save_render(str(path), scene=scene)
    except RuntimeError as error:
        raise Unusable(f"“{image.name}” holds no render of this scene: render something first") from error
    return path.name


def bring(path: Path, name: str, pack: bool, fake_user: bool) -> bpy.types.Image:
    """A picture that the worker made as a new image: packed, or in memory only, so that Blender asks before it is
    lost. Raises Unusable where it cannot be read."""
    image = bpy.data.images.load(str(path))
    if not _is_whole(path, image):  # Blender loads damaged files without a word
        bpy.data.images.remove(image)
        raise Unusable(f"the picture {path.name} that the worker made cannot be read; is the disk full?")
    if path.suffix == ".exr":
        compat.set_colour_space(image, compat.LINEAR)
    if pack:
        image.pack()
        image.filepath_raw = ""  # the folder will be gone
    else:
        image = _in_memory(image)
    image.name = name
    image.use_fake_user = fake_user
    return image


def _is_whole(path: Path, image: bpy.types.Image) -> bool:
    """Whether a file was written to its end. A PNG is not decoded for that: .3 s for 12 MP, in which the window stands
    still, and what lies over a panorama may never be looked at."""
    if path.suffix != ".png":
        return all(image.size)
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - len(PNG_END)))
        return file.read() == PNG_END


def _in_memory(loaded: bpy.types.Image) -> bpy.types.Image:
    import numpy as np

    flat = np.empty(len(loaded.pixels), np.float32)
    loaded.pixels.foreach_get(flat)
    image = bpy.data.images.new(
        "EDF Stitch", *loaded.size, alpha=loaded.depth not in OPAQUE_DEPTHS, float_buffer=loaded.is_float
    )
    image.colorspace_settings.name, image.alpha_mode = loaded.colorspace_settings.name, loaded.alpha_mode
    image.pixels.foreach_set(flat)
    image.update()
    bpy.data.images.remove(loaded)
    return image


def save(image: bpy.types.Image, path: Path) -> None:
    """Writes an image with its values kept, whole or not at all: .exr 32-bit float, .hdr float without alpha, .png
    and .tif 8 bit, or 16 for float images. Raises Unusable."""
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise Unusable(f"pictures are not saved as {path.suffix or 'files of no kind'}: use {', '.join(KINDS)}")
    if not image.has_data and not len(image.pixels):
        raise Unusable(f"“{image.name}” has no pixels to save")
    beside = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        try:
            _write(image, beside, kind)
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)
    except (RuntimeError, OSError) as error:
        said = error.strerror if isinstance(error, OSError) else str(error).removeprefix("Error: ").partition("\n")[0]
        raise Unusable(f"{path} cannot be written: {said}; choose another place") from error


def place_of(chosen: str) -> Path:
    """Where an artist wants something written. Raises Unusable where that is beside a .blend file that is nowhere yet,
    since Blender then takes it for a path from where it was started."""
    if chosen.startswith("//") and not bpy.data.filepath:
        raise Unusable(f"“{chosen}” lies beside the .blend file, which is nowhere yet: save it or choose another place")
    return Path(bpy.path.abspath(chosen)).absolute()


KINDS = {".exr": "OPEN_EXR", ".hdr": "HDR", ".png": "PNG", ".tif": "TIFF", ".tiff": "TIFF"}
_SIGNS = {".exr": b"\x76\x2f\x31\x01", ".png": b"\x89PNG\r\n\x1a\n"}


def _write(image: bpy.types.Image, path: Path, kind: str) -> None:
    packed = image.packed_file
    sign = _SIGNS.get(path.suffix.lower())
    if packed is not None and not image.is_dirty and sign is not None and packed.data[: len(sign)] == sign:
        path.write_bytes(packed.data)  # the file that the worker made, EXIF and ICC profile included
        return
    bits = 32 if kind in ("OPEN_EXR", "HDR") else 16 if image.is_float else 8
    with compat.saving_scene(kind, bits) as scene:
        image.save_render(str(path), scene=scene)
