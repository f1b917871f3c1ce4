"""What an artist decides about a stitch, kept in the scene, and with each panorama."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
import math
from collections.abc import Callable
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import earlier, idnames, offered, pictures, status
from .bridge import compat
from .list_entries import EDF_PG_clip, EDF_PG_guide, EDF_PG_match, EDF_PG_picture, EDF_PG_place, look_again

# Called with a scene's settings when an artist changes what of the scene the panorama shows, from where, or its look.
on_reframe: list[Callable[[Any], None]] = []


def reframe(settings: Any, _context: Any) -> None:
    """Frame, viewpoint, light or blend was changed: the outline is drawn anew, and whoever follows it is told."""
    look_again(settings, _context)
    for follow in on_reframe:
        follow(settings)


def is_camera(_settings: Any, object_: bpy.types.Object) -> bool:
    """What the pointers to camera objects offer."""
    return object_.type == "CAMERA"


def show_picture(settings: Any, context: Any) -> None:
    """A row of the list was chosen: the editor that the list is in shows its picture."""
    space = context.space_data
    if isinstance(space, bpy.types.SpaceImageEditor) and 0 <= settings.picture_index < len(settings.pictures):
        space.image = settings.pictures[settings.picture_index].image or space.image


class EDF_PG_settings(bpy.types.PropertyGroup):  # noqa: N801
    """bpy.types.Scene.edf_stitch. Of a list with two pictures that are used, `reference` is the first and `target` the
    second."""

    pictures: CollectionProperty(
        name="Pictures", type=EDF_PG_picture, description="What is stitched: two, or up to 60, in any order",
    )
    clips: CollectionProperty(
        name="Clips", type=EDF_PG_clip,
        description="Movies or image sequences of cameras that stand still: two or more",
    )
    picture_index: IntProperty(
        name="Active Picture", description="The picture of the list that the editor shows", default=0, min=0,
        options={"SKIP_SAVE"}, update=show_picture,
    )
    seen_from: PointerProperty(
        name="Seen From", type=bpy.types.Image, update=reframe,
        description="The picture from whose place more than two are seen; without one, the first that connects with "
        "others",
    )
    reference = property(
        lambda self: pictures.side(self, 0), lambda self, image: pictures.set_side(self, 0, image)
    )
    target = property(lambda self: pictures.side(self, 1), lambda self, image: pictures.set_side(self, 1, image))
    result: PointerProperty(name="Panorama", type=bpy.types.Image, description="What was stitched last")

    camera: EnumProperty(name="Camera", description="Where the focal length comes from", items=offered.CAMERA_SOURCES)
    focal: FloatProperty(
        name="Focal Length", description="The lens's focal length, as engraved, not its 35 mm equivalent", default=24.0,
        min=0.1, soft_min=1.0, soft_max=300.0, unit="CAMERA", precision=2,
    )
    sensor: FloatProperty(
        name="Sensor Width", description="The sensor's longer side", default=36.0, min=0.1, soft_min=3.0, soft_max=60.0,
        unit="CAMERA", precision=2,
    )
    focal35: FloatProperty(
        name="Focal Length", description="35 mm equivalent, as phones give it", default=26.0, min=0.1, soft_min=5.0,
        soft_max=300.0, unit="CAMERA", precision=1,
    )
    focal_px: FloatProperty(
        name="Focal Length", description="In pixels of the full picture", default=3000.0, min=1.0, precision=1,
        subtype="PIXEL",
    )
    own_lens: BoolProperty(
        name="Target Has Its Own Lens", description="The target was taken with another lens, zoom or sensor",
    )
    target_focal: FloatProperty(
        name="Target Focal Length", description="The focal length of the target's lens", default=24.0, min=0.1,
        soft_min=1.0, soft_max=300.0, unit="CAMERA", precision=2,
    )
    target_sensor: FloatProperty(
        name="Target Sensor Width", description="The longer side of the target's sensor", default=36.0, min=0.1,
        soft_min=3.0, soft_max=60.0, unit="CAMERA", precision=2,
    )
    target_focal35: FloatProperty(
        name="Target Focal Length", description="The target's 35 mm equivalent", default=26.0, min=0.1, soft_min=5.0,
        soft_max=300.0, unit="CAMERA", precision=1,
    )
    target_focal_px: FloatProperty(
        name="Target Focal Length", description="In pixels of the full target", default=3000.0, min=1.0, precision=1,
        subtype="PIXEL",
    )
    reference_camera: PointerProperty(
        name="Reference Camera", type=bpy.types.Object, poll=is_camera, description="The camera that took the reference"
    )
    target_camera: PointerProperty(
        name="Target Camera", type=bpy.types.Object, poll=is_camera, description="The camera that took the target"
    )

    field: EnumProperty(
        name="Field", description="How the target may be bent to meet the reference", items=offered.FIELDS
    )
    fade: EnumProperty(
        name="Outside", description="What becomes of the field outside the overlap", items=offered.FADES,
        default="CONTINUE",
    )
    dense: BoolProperty(
        name="Dense", description="Seek every pixel of the overlap along its epipolar line: sharper edges of near "
        "things, at some more time", default=True,
    )
    projection: EnumProperty(
        name="Projection", description="What the panorama is drawn on", items=offered.PROJECTIONS, default="AUTO",
        update=reframe,
    )
    pannini_distance: FloatProperty(
        name="Roundness", description="0 is flat, as Perspective; 1 bends level lines most and stretches the sides "
        "least", default=0.5, min=0.0, max=1.0, subtype="FACTOR", update=reframe,
    )
    slide_auto: BoolProperty(
        name="Automatic Viewpoint", description="Choose how far the viewpoint slides so that straight things stay "
        "straight and near things whole", default=True, update=reframe,
    )
    slide: FloatProperty(
        name="Viewpoint", description="Where the panorama is seen from, across the overlap: 0 all of it from the "
        "reference's place; 1 slides to the target's, so that what the target alone shows looks as it was taken",
        default=0.0, min=0.0, max=1.0, subtype="FACTOR", update=reframe,
    )
    slide_part: FloatVectorProperty(
        name="Within", description="From and to which share of the way across the overlap the viewpoint slides; an "
        "automatic one leaves here what it chose", size=2, default=(0.0, 1.0), min=0.0, max=1.0, update=reframe,
    )
    centre: FloatVectorProperty(
        name="Centre", description="Moves the frame to the right and up, from where it would be; turns nothing",
        size=2, unit="ROTATION", precision=1, min=-math.pi, max=math.pi, update=reframe,
    )
    fov: FloatProperty(
        name="Field of View", description="How much the frame shows from left to right; 0: all there is", default=0.0,
        min=0.0, max=2 * math.pi, unit="ROTATION", precision=1, update=reframe,
    )
    level: EnumProperty(
        name="Level", description="How the panorama is turned", items=offered.LEVELS, update=reframe
    )
    level_angles: FloatVectorProperty(
        name="Yaw, Pitch, Roll", description="Where the reference looks in the panorama: to the right, above the "
        "horizon, clockwise", size=3, unit="ROTATION", precision=2, update=reframe,
    )
    blend: EnumProperty(name="Blend", description="How the two pictures go over into each other", items=offered.BLENDS,
                        update=reframe)
    seam: EnumProperty(
        name="Seam", description="Where one picture goes over into the other", items=offered.SEAMS, update=reframe,
    )
    seam_mask: PointerProperty(
        name="Painted Seam", type=bpy.types.Image,
        description="An image of the whole panorama's shape: black comes from the reference, white "
        "from the target; elsewhere the seam decides",
    )
    light: EnumProperty(
        name="Exposure", description="What becomes of the pictures' light", items=offered.EXPOSURES, default="AUTO",
        update=reframe,
    )
    exposure: BoolProperty(
        name="Match Exposure", description="As earlier releases asked it: on is Reference, off is As Taken",
        default=True, options={"HIDDEN"}, update=earlier.asked_for_exposure,
    )
    light_stops: FloatProperty(
        name="Brighter", description="Stops by which the panorama is brighter than by itself; no light is blown",
        default=0.0, min=-10.0, max=10.0, soft_min=-3.0, soft_max=3.0, precision=2, update=reframe,
    )
    holes: EnumProperty(
        name="Holes", description="What neither camera saw, because something near hid it from the only one that "
        "looked there", items=offered.HOLES, default="AUTO",
        update=reframe,
    )
    crop: EnumProperty(
        name="Crop", description="What of the panorama is kept", items=offered.CROPS, default="AUTO", update=reframe
    )
    crop_box: IntVectorProperty(
        name="Box", description="Left, top, width and height, in pixels of the full panorama, from its top left",
        size=4, default=(0, 0, 1000, 1000), min=0, update=reframe,
    )
    exr_depth: EnumProperty(
        name="Float Depth", description="How a panorama of float pictures is held in the Blender file, and saved as "
        "EXR", items=offered.EXR_DEPTHS,
    )
    exr_compression: EnumProperty(
        name="Compression", description="How a panorama of float pictures is packed in the Blender file, and saved as "
        "EXR", items=offered.EXR_COMPRESSIONS,
    )
    scale: FloatProperty(
        name="Scale", description="Both pictures are resized by this first", default=1.0, min=0.02, max=1.0,
        subtype="FACTOR",
    )
    preview_scale: FloatProperty(
        name="Preview Scale", description="Size of the quick preview, as a share of the full one", default=0.25,
        min=0.02, max=1.0, subtype="FACTOR",
    )
    seed: IntProperty(
        name="Seed", description="Of every random choice: the same seed gives the same panorama", default=0, min=0
    )

    ignore_reference: PointerProperty(
        name="Ignore in Reference", type=bpy.types.Image,
        description="An image of the reference's shape: what is white in it is kept out of everything",
    )
    ignore_target: PointerProperty(
        name="Ignore in Target", type=bpy.types.Image,
        description="An image of the target's shape: what is white in it is kept out of everything",
    )
    guides: CollectionProperty(
        name="Guides", type=EDF_PG_guide, description="Upright and level lines that Level ▸ Automatic holds to",
    )
    guide_index: IntProperty(
        name="Active Guide", description="The guide that is removed", default=0, min=0, options={"SKIP_SAVE"},
    )
    places: CollectionProperty(
        name="Places", type=EDF_PG_place, description="Places of the panorama that come from a certain picture",
    )
    place_index: IntProperty(
        name="Active Place", description="The place that is removed", default=0, min=0, options={"SKIP_SAVE"},
    )
    edited_matches: BoolProperty(
        name="Use These Matches", description="Stitch with the matches of the list, as they were edited, instead of "
        "searching for new ones",
    )
    matches: CollectionProperty(type=EDF_PG_match)
    matches_reference: PointerProperty(
        name="Matches' Reference", type=bpy.types.Image, description="The picture that the list's matches lie in"
    )
    matches_target: PointerProperty(
        name="Matches' Target", type=bpy.types.Image, description="The picture that the list's matches lead to"
    )
    match_index: IntProperty(name="Active Match", default=-1, options={"SKIP_SAVE"}, update=look_again)

    take_layers: BoolProperty(
        name="Layers", description="Both pictures on the panorama's canvas, with alpha, before they are blended"
    )
    take_masks: BoolProperty(
        name="Masks", description="Where each picture shows something, what the target cannot see, and which picture "
        "each point comes from (which can be painted on, as the seam), as images",
    )
    take_depth: BoolProperty(
        name="Inverse Depth", description="The panorama's inverse depth, from where each of its points is seen, in "
        "units of the distance between the cameras"
    )
    fake_user: BoolProperty(
        name="Fake User", description="Keep the images in the file even where nothing uses them", default=True
    )
    pack: BoolProperty(
        name="Pack", description="Keep the images' pixels inside the .blend file, so that saving it saves them",
        default=True,
    )

    version: IntProperty(
        name="Version", options={"HIDDEN"},
        description="Of what the settings mean; 0 where an earlier release has chosen the pictures, or nobody",
    )

    overlay: EnumProperty(
        name="Overlay", description="What lies over the panorama", items=offered.OVERLAYS, update=look_again
    )
    overlay_opacity: FloatProperty(
        name="Opacity", description="How much the overlay covers", default=0.8, min=0.0, max=1.0, subtype="FACTOR",
        update=look_again,
    )
    show_places: BoolProperty(
        name="Places to Look At", description="Boxes around the places of the panorama that the verdict names",
        default=True, update=look_again,
    )
    show_matches: BoolProperty(
        name="Matches", description="Matches over the pictures, coloured by how far the stitch missed them",
        update=look_again,
    )
    show_epipolar: BoolProperty(
        name="Epipolar Lines", description="The line in the other picture on which the point under the pointer lies",
        update=look_again,
    )


class EDF_PG_job(bpy.types.PropertyGroup):  # noqa: N801
    """bpy.types.WindowManager.edf_stitch_job: what is going on. Read only, and never part of a file or an undo step:
    every value is looked up where the work keeps it."""

    running: BoolProperty(name="Running", get=lambda _: status.now.running)
    cancelling: BoolProperty(name="Cancelling", get=lambda _: status.now.cancelling)
    stage: StringProperty(name="Stage", get=lambda _: status.now.stage)
    share: FloatProperty(name="Done", get=lambda _: status.now.share, min=0.0, max=1.0, subtype="FACTOR")
    message: StringProperty(name="Message", get=lambda _: status.now.message)
    failed: BoolProperty(name="Failed", get=lambda _: status.now.failed)


# What changes places when reference and target do; the lenses only where each picture has its own.
PICTURES = (("reference", "target"), ("reference_camera", "target_camera"), ("ignore_reference", "ignore_target"))
LENSES = tuple((name, f"target_{name}") for name in ("focal", "sensor", "focal35", "focal_px"))
# What is no setting: what is stitched, what came of it, and how it is looked at.
NO_SETTINGS = frozenset({"name", "pictures", "clips", "picture_index", "result", "matches", "matches_reference",
                         "matches_target", "match_index", "places", "place_index", "guides", "guide_index", "version",
                         "exposure", "overlay", "overlay_opacity", "show_matches", "show_epipolar",
                         "show_places"})  # fmt: skip


def names_of_settings(settings: Any) -> list[str]:
    """The settings' own properties: what `reset` sets back, and what a panorama keeps."""
    return [name for name in settings.bl_rna.properties.keys() if name not in NO_SETTINGS | {"rna_type"}]


def keep(settings: Any) -> dict[str, Any]:
    """All settings, JSON-ready; images and cameras by name, for whoever reads them."""
    kept = {}
    for name in names_of_settings(settings):
        value = getattr(settings, name)
        if settings.bl_rna.properties[name].type == "POINTER":
            value = None if value is None else value.name
        elif getattr(settings.bl_rna.properties[name], "is_array", False):
            value = list(value)
        kept[name] = value
    return kept


def pointers(settings: Any) -> dict[str, bpy.types.ID | None]:
    """The images and cameras among the settings."""
    names = names_of_settings(settings)
    return {name: getattr(settings, name) for name in names if settings.bl_rna.properties[name].type == "POINTER"}


def restore(settings: Any, kept: dict[str, Any], chosen: dict[str, bpy.types.ID]) -> None:
    """Settings that `keep` gave, perhaps in an earlier version: what is not there any more, or not yet, is left out.
    chosen: the images and cameras among them."""
    kept = earlier.kept_now(kept)
    for name in set(names_of_settings(settings)) & set(kept):
        value = chosen.get(name) if settings.bl_rna.properties[name].type == "POINTER" else kept[name]
        try:
            setattr(settings, name, value)
        except (TypeError, ValueError):  # a choice that this version does not offer
            settings.property_unset(name)


def settings_of(scene: bpy.types.Scene) -> EDF_PG_settings:
    """A scene's settings."""
    return getattr(scene, idnames.SETTINGS)


@bpy.app.handlers.persistent
def bring_up_to_date(*_: Any) -> None:
    """What Blender calls when a file was opened or something appended: scenes of an earlier release mean the same."""
    for scene in bpy.data.scenes:
        if scene.library is None:
            settings = settings_of(scene)
            chosen = [compat.take_kept(settings, side) for side in ("reference", "target")]
            if any(chosen):
                version = settings.version
                pictures.choose(settings, chosen)
                settings.version = version  # to choose says that it was done now
            earlier.bring_up_to_date(settings)


def _handlers() -> list[list[Any]]:
    """Where `bring_up_to_date` waits; appending is told of since 4.3."""
    names = ("load_post", "blend_import_post")
    return [getattr(bpy.app.handlers, name) for name in names if hasattr(bpy.app.handlers, name)]


CLASSES = (EDF_PG_match, EDF_PG_picture, EDF_PG_clip, EDF_PG_place, EDF_PG_guide, EDF_PG_settings, EDF_PG_job)


def register() -> None:
    """Make the properties known and hang them where Blender's files keep them."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    setattr(bpy.types.Scene, idnames.SETTINGS, PointerProperty(type=EDF_PG_settings))
    setattr(bpy.types.WindowManager, idnames.JOB, PointerProperty(type=EDF_PG_job))
    for handlers in _handlers():
        handlers.append(bring_up_to_date)


def unregister() -> None:
    """Take them away again."""
    for handlers in _handlers():
        if bring_up_to_date in handlers:
            handlers.remove(bring_up_to_date)
    delattr(bpy.types.WindowManager, idnames.JOB)
    delattr(bpy.types.Scene, idnames.SETTINGS)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
