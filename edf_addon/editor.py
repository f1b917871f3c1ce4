"""Which picture of a stitch an Image Editor shows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy

from . import earlier, engine_options, pictures, properties
from .bridge import images, ownership, photo, result

REFERENCE, TARGET, PANORAMA = "reference", "target", "panorama"


def shown(context: Any) -> bpy.types.Image | None:
    """What the Image Editor shows that the context is of."""
    return getattr(context.space_data, "image", None)


def panorama(context: Any, name: str = "") -> bpy.types.Image | None:
    """The panorama that is meant: the named image; else the one that the editor shows, else the one that was stitched
    last. Raises Unusable for a name that is none's."""
    if name:
        return images.named(name)
    image = shown(context)
    if result.read(image) is not None:
        return image
    last = properties.settings_of(context.scene).result
    return last if last is not None and result.read(last) is not None else None


def known(image: bpy.types.Image | None) -> dict[str, Any]:
    """The result that a panorama carries. Raises ValueError where an image is none."""
    found = result.read(image)
    if found is None:
        raise ValueError("this image is no panorama that was stitched here")
    return found


def report_of(context: Any) -> dict[str, Any] | None:
    """The report of the panorama that is meant (see `panorama`); None where there is none."""
    found = result.read(panorama(context))
    return None if found is None else found["report"]


def is_of_chosen(settings: Any, image: bpy.types.Image | None) -> bool:
    """Whether an image is a panorama of the pictures that are chosen now."""
    made_of = ownership.pictures(image)
    return len(made_of) > 1 and made_of == pictures.images(settings)


def settings_then(settings: Any, image: bpy.types.Image | None) -> Any:
    """The settings that an image was made with, as attributes, where it is a panorama of the pictures that are chosen
    now; else None."""
    found = result.read(image) if is_of_chosen(settings, image) else None
    if image is None or found is None:
        return None
    # a picture is known by itself, whatever it is called by now
    chosen = {"seen_from": ownership.chosen(image).get("seen_from")}
    return SimpleNamespace(**{**earlier.kept_now(found["settings"]), **chosen})


def is_behind(settings: Any, image: bpy.types.Image | None) -> bool:
    """Whether an image is a panorama of the chosen pictures that was made for another frame, viewpoint, light or blend
    than is chosen now."""
    then = settings_then(settings, image)
    return then is not None and engine_options.look_of(then) != engine_options.look_of(settings)


def side_of(settings: Any, image: bpy.types.Image | None) -> str | None:
    """What an image is in the stitch: REFERENCE or TARGET of two, PANORAMA, also a mask that is painted over one of
    them, or None."""
    if image is None:
        return None
    for side in () if pictures.is_set(settings) else (REFERENCE, TARGET):
        if image in (getattr(settings, side), getattr(settings, f"ignore_{side}")):
            return side
    return PANORAMA if image == settings.seam_mask or result.read(image) is not None else None


def beneath(settings: Any, image: bpy.types.Image | None) -> bpy.types.Image | None:
    """What a mask of the panel is painted over; any other image itself."""
    if image is not None and image == settings.seam_mask:
        return settings.result
    for side in (REFERENCE, TARGET):
        if image is not None and image == getattr(settings, f"ignore_{side}"):
            return getattr(settings, side)
    found = pictures.mask_of(settings, image)
    return image if found is None else found[0].image


def side_in(panorama: bpy.types.Image | None, picture: bpy.types.Image | None) -> str | None:
    """What a picture is in a panorama of two, by the panorama's own pictures, whatever is chosen now; None where it has
    no part in it."""
    if panorama is None or picture is None:
        return None
    own = ownership.pictures(panorama)
    if len(own) != len(ownership.SIDES):
        return None
    return PANORAMA if picture == panorama else ownership.SIDES[own.index(picture)] if picture in own else None


def orientation(settings: Any, image: bpy.types.Image) -> int:
    """How an image is stored, as in EXIF; masks lie as their pictures do."""
    picture = beneath(settings, image)
    return 1 if picture is None or result.read(picture) is not None else photo.orientation(picture)


def all_spaces(context: Any) -> list[tuple[bpy.types.Area, bpy.types.SpaceImageEditor]]:
    """Every Image Editor of every window."""
    return [
        (area, area.spaces.active)
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR"
    ]


def may_hold_pointer(context: Any) -> bool:
    """Whether a tool may hold the pointer: it was started in an Image Editor of a window."""
    return context.area is not None and context.area.type == "IMAGE_EDITOR" and context.window is not None


def let_go(context: Any) -> None:
    """Give the pointer and the status bar back, after a tool that held them."""
    context.workspace.status_text_set(None)
    context.window.cursor_modal_restore()
    redraw()


def redraw() -> None:
    """Have every Image Editor draw itself again; nothing where there is no window."""
    for area, _ in all_spaces(bpy.context):
        area.tag_redraw()
