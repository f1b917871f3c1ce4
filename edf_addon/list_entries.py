"""What the lists of the panel hold: pictures, places that come from one of them, and matches of two."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, PointerProperty, StringProperty

from . import offered, pictures


def look_again(_group: Any, _context: Any) -> None:
    """What lies over the pictures has changed: Image Editors are drawn anew (nothing under `-b`)."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


def joined_in(entry: Any, context: Any) -> None:
    """A guide or a place counts from now on, or no longer: it is drawn so, and whoever follows it is told."""
    look_again(entry, context)
    pictures.joined(entry)


class EDF_PG_match(bpy.types.PropertyGroup):  # noqa: N801 (Blender's own form)
    """A point of the reference and where the target shows the same, px of the full upright pictures: pixel centres are
    integers, (0, 0) at the top left."""

    x: FloatProperty(name="X", description="Column in the reference, from the left", precision=2)
    y: FloatProperty(name="Y", description="Row in the reference, from the top", precision=2)
    x2: FloatProperty(name="X", description="Column in the target, from the left", precision=2)
    y2: FloatProperty(name="Y", description="Row in the target, from the top", precision=2)
    weight: FloatProperty(
        name="Weight", description="How much this match counts beside the others; 1 is usual", default=1.0, min=0.001,
        soft_max=100.0,
    )
    enabled: BoolProperty(name="Use", description="Whether the next stitch may use this match", default=True,
                          update=look_again)
    error: FloatProperty(
        name="Error", description="How far, in target pixels, the last stitch missed this match; -1: not measured",
        default=-1.0, precision=2,
    )
    state: EnumProperty(name="State", description="What the last stitch did with it", items=offered.MATCH_STATES)


class EDF_PG_picture(bpy.types.PropertyGroup):  # noqa: N801
    """A picture of the list."""

    image: PointerProperty(
        name="Picture", type=bpy.types.Image, update=pictures.changed,
        description="Of two the first is the reference, whose place and plane the panorama may keep: the one that "
        "looks at the scene more squarely. The second is the target, which is bent to meet it",
    )
    use: BoolProperty(
        name="Use", description="Whether the next stitch uses this picture", default=True, update=pictures.changed,
    )
    state: EnumProperty(
        name="State", description="What the last stitch did with it", items=offered.PICTURE_STATES
    )
    why: StringProperty(name="Why", description="Why the last stitch left it out")
    ignore: PointerProperty(
        name="Never Use", type=bpy.types.Image,
        description="An image of the picture's shape: what is white in it is kept out of the panorama",
    )
    show: PointerProperty(
        name="Use Here", type=bpy.types.Image,
        description="An image of the picture's shape: what is white in it comes from this picture",
    )


class EDF_PG_guide(bpy.types.PropertyGroup):  # noqa: N801
    """A line in a picture that is upright or level."""

    picture: PointerProperty(name="Picture", type=bpy.types.Image, description="The picture that it lies in")
    kind: EnumProperty(name="Kind", items=offered.GUIDES, update=look_again)
    use: BoolProperty(name="Use", description="Whether level holds to it", default=True, update=joined_in)
    ends: FloatVectorProperty(
        name="Ends", description="Column and row of both ends, in pixels of the upright picture", size=4,
        update=look_again,
    )


class EDF_PG_place(bpy.types.PropertyGroup):  # noqa: N801
    """A place of the panorama that comes from a certain picture."""

    picture: PointerProperty(name="Picture", type=bpy.types.Image, description="The picture that it comes from")
    use: BoolProperty(
        name="Use", description="Whether the next stitch takes it from there", default=True, update=joined_in
    )
    circles: StringProperty(
        name="Circles", description="Where, as JSON: column, row and radius in pixels of the upright picture, of each"
    )


class EDF_PG_clip(bpy.types.PropertyGroup):  # noqa: N801
    """A clip of the list."""

    clip: PointerProperty(
        name="Clip", type=bpy.types.MovieClip,
        description="A movie or an image sequence of a camera that stands still; where it starts, in the scene's "
        "frames, is what its properties say in the Movie Clip Editor",
    )
