"""What a panorama is made of: its image holds the pictures, cameras and masks, and knows what the pictures were like.

Names change and come back as something else; so they are held as Blender's own pointers, which also keep them in the
file for as long as the panorama. That something was painted or replaced since is found by its content.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import bpy

from . import cameras, images, result

# The sides of a pair, in the order of its pictures.
SIDES = ("reference", "target")
# Keys of the image's custom properties: the picture's number, or the setting's name, follows.
PICTURE, SETTING = "edf_stitch_picture ", "edf_stitch_setting "


def called(number: int, count: int) -> str:
    """What one of a panorama's pictures is to it, in words."""
    return f"the {SIDES[number]}" if count == len(SIDES) else f"picture {number + 1}"


def describe(entries: Sequence[Mapping[str, Any]], digests: Sequence[str]) -> list[dict[str, str]]:
    """Name and content of pictures, the reference first, as a result keeps them, by their entries in a job and what the
    worker told of them; what a result keeps of them already stays."""
    return [
        {"name": entry["name"], "fingerprint": entry.get("fingerprint") or images.fingerprint(entry, digest)}
        for entry, digest in zip(entries, digests, strict=True)
    ]


def hold(
    panorama: bpy.types.Image, pictures: Sequence[bpy.types.Image | None], chosen: Mapping[str, bpy.types.ID | None]
) -> None:
    """Lets a panorama hold its pictures and what else was chosen for it, by the settings' names."""
    keys = {f"{PICTURE}{number}": image for number, image in enumerate(pictures)}
    for key, held in {**keys, **{SETTING + name: one for name, one in chosen.items()}}.items():
        if held is not None:
            panorama[key] = held


def pictures(panorama: bpy.types.Image | None) -> list[bpy.types.Image | None]:
    """A panorama's pictures, the reference first; None in place of one that was deleted. Empty where it is none."""
    known = result.read(panorama)
    if panorama is None or known is None:
        return []
    return [panorama.get(f"{PICTURE}{number}") for number in range(len(known["pictures"]))]


def chosen(panorama: bpy.types.Image) -> dict[str, bpy.types.ID]:
    """The images and cameras that were chosen for a panorama and are still there, by the settings' names."""
    held = {key.removeprefix(SETTING): panorama[key] for key in panorama.keys() if key.startswith(SETTING)}
    return {name: one for name, one in held.items() if one is not None}


def missing(panorama: bpy.types.Image) -> list[str]:
    """Which of a panorama's pictures were deleted, a sentence each."""
    return [f"{words} is no longer in the file" for words, image, _ in _named(panorama) if image is None]


def changes(panorama: bpy.types.Image) -> list[str]:
    """What is not as it was when a panorama was stitched from it, a sentence each."""
    said = missing(panorama)
    for words, image, fingerprint in _named(panorama):
        if image is not None and not fingerprint:
            said.append(f"{words} shows whatever was rendered last, or the frame of now")
        elif image is not None and images.has_changed(image, fingerprint):
            said.append(f"{words} has changed since it was stitched, or its file is not there any more")
    return said


def camera_changes(panorama: bpy.types.Image, context: Any) -> list[str]:
    """Which of the scene's cameras that took a panorama's pictures are not as they were, a sentence each."""
    known: Any = result.read(panorama)
    held = chosen(panorama)
    return [
        f"“{camera.name}”, the {side} camera of this panorama, has moved since, or has another lens"
        for side, then in zip(SIDES, known["cameras"] or (), strict=False)
        if (camera := held.get(f"{side}_camera"))
        and not cameras.is_as_described(camera, then, context.scene, context.evaluated_depsgraph_get())
    ]  # fmt: skip


def names(panorama: bpy.types.Image) -> list[str]:
    """What a panorama's pictures are called."""
    known: Any = result.read(panorama)
    both = zip(pictures(panorama), known["pictures"], strict=True)
    return [entry["name"] if image is None else image.name for image, entry in both]


def _named(panorama: bpy.types.Image) -> list[tuple[str, bpy.types.Image | None, str]]:
    """Words for each picture of a panorama, the picture, and its fingerprint then."""
    known: Any = result.read(panorama)
    told = zip(names(panorama), pictures(panorama), known["pictures"], strict=True)
    return [
        (f"“{name}”, {called(number, len(known['pictures']))} of this panorama,", image, entry["fingerprint"])
        for number, (name, image, entry) in enumerate(told)
    ]
