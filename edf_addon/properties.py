"""What an artist decides about a stitch, kept in the scene; and what becomes of it in the engine's words."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
import math
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

from . import idnames, pair, status

CAMERA_SOURCES = (
    ("AUTOMATIC", "Automatic", "From the photographs' EXIF; without it, estimated from the matches"),
    ("FOCAL", "Focal Length", "The lens's focal length in millimetres, with the width of the sensor"),
    ("FOCAL35", "35 mm Equivalent", "The focal length that would show as much on a 36 × 24 mm frame"),
    ("FOCAL_PX", "Pixels", "The focal length in pixels of the full picture, as calibration tools give it"),
    ("CAMERAS", "Scene Cameras", "Two cameras of the scene give lens, shift and place; only the field is fitted"),
)
FIELDS = (
    ("SLACK", "Slack", "Along the epipolar lines, with a little slack for what lens distortion does"),
    ("STRICT", "Strict", "Exactly along the epipolar lines: every point of the panorama is geometrically right"),
    ("PAPER", "Paper", "As published: free to leave the epipolar lines"),
    ("REW", "Elastic Warp", "For comparison: one homography, bent freely towards the matches; no depth, no cameras"),
    ("APAP", "As-Projective-As-Possible", "For comparison: a homography for each cell of a grid; no depth, no cameras"),
    ("HOMOGRAPHY", "Homography", "For comparison: what every other stitcher starts from; no depth, no cameras"),
)
# Those that round panoramas can be made of.
ROUND_FIELDS = ("SLACK", "STRICT")
FADES = (
    ("PLANE", "Plane", "Outside the overlap the scene carries on as the plane that fits it best"),
    ("INFINITY", "Infinity", "Outside the overlap the scene is taken as infinitely far"),
)
PROJECTIONS = (
    ("PERSPECTIVE", "Perspective", "Flat: what the reference's camera would see with a larger sensor"),
    ("CYLINDRICAL", "Cylindrical", "Round, for wide panoramas: upright lines stay straight"),
    ("EQUIRECTANGULAR", "Equirectangular", "The whole sphere, as a World's environment texture wants it"),
)
LEVELS = (
    ("AUTO", "Automatic", "The horizon is found by how the cameras were held"),
    ("NONE", "As Taken", "The reference looks straight ahead"),
    ("ANGLES", "Angles", "Yaw, pitch and roll of the reference in the panorama"),
)
BLENDS = (
    ("MULTIBAND", "Multiband", "Light is evened out across the seam, detail is cut at it: what hides a seam best"),
    ("FEATHER", "Feather", "A soft change from one picture to the other, across the whole overlap"),
    ("LINEAR", "Average", "The plain average of both: doubled edges show where they do not fit"),
)
HOLES = (
    ("TRANSPARENT", "Transparent", "Left open, to be painted or filled with another picture"),
    ("INPAINT", "Inpaint", "Filled smoothly from what lies behind; no detail is made up"),
)
SEAMS = (
    ("GRAPHCUT", "Best Cut", "Where the two pictures look most alike, around things rather than through them"),
    ("NONE", "Midway", "Midway between the borders of the two pictures"),
)
CROPS = (
    ("FULL", "Full", "All that either picture shows; transparent elsewhere"),
    ("INSCRIBED", "Inscribed", "The largest rectangle without transparent parts"),
    ("REFERENCE", "Reference", "Only the reference's own frame"),
    ("BOX", "Box", "A rectangle in pixels of the full panorama"),
)
MATCH_STATES = (
    ("USED", "Used", "The field stands on it"),
    ("LEFT_OUT", "Left Out", "It contradicts the others and was not used"),
    ("ADDED", "Added", "Set by hand since the last stitch"),
)
OVERLAYS = (
    ("NONE", "None", "The picture alone"),
    ("DIFFERENCE", "Difference", "How much the two pictures differ where both show something; black is the same"),
    ("DISPLACEMENT", "Displacement", "How far each point slides because it is near: blue little, red much"),
)


def look_again(_group: Any, _context: Any) -> None:
    """What lies over the pictures has changed: Image Editors are drawn anew (nothing under `-b`)."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


def is_camera(_settings: Any, object_: bpy.types.Object) -> bool:
    """What the pointers to camera objects offer."""
    return object_.type == "CAMERA"


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
    state: EnumProperty(name="State", description="What the last stitch did with it", items=MATCH_STATES)


class EDF_PG_settings(bpy.types.PropertyGroup):  # noqa: N801
    """bpy.types.Scene.edf_stitch."""

    reference: PointerProperty(
        name="Reference", type=bpy.types.Image, update=pair.chosen,
        description="The picture whose place and plane the panorama keeps: the one that looks at the scene more "
        "squarely",
    )
    target: PointerProperty(
        name="Target", type=bpy.types.Image, description="The picture that is bent to meet the reference",
        update=pair.chosen,
    )
    result: PointerProperty(name="Panorama", type=bpy.types.Image, description="What was stitched last")

    camera: EnumProperty(name="Camera", description="Where the focal length comes from", items=CAMERA_SOURCES)
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

    field: EnumProperty(name="Field", description="How the target may be bent to meet the reference", items=FIELDS)
    fade: EnumProperty(name="Outside", description="What the field becomes outside the overlap", items=FADES)
    dense: BoolProperty(
        name="Dense", description="Seek every pixel of the overlap along its epipolar line: sharper edges of near "
        "things, at some more time", default=True,
    )
    projection: EnumProperty(name="Projection", description="What the panorama is drawn on", items=PROJECTIONS)
    level: EnumProperty(name="Level", description="How a round panorama is turned", items=LEVELS)
    level_angles: FloatVectorProperty(
        name="Yaw, Pitch, Roll", description="Where the reference looks in the panorama: to the right, above the "
        "horizon, clockwise", size=3, unit="ROTATION", precision=2,
    )
    blend: EnumProperty(name="Blend", description="How the two pictures go over into each other", items=BLENDS)
    seam: EnumProperty(name="Seam", description="Where one picture goes over into the other", items=SEAMS)
    seam_mask: PointerProperty(
        name="Painted Seam", type=bpy.types.Image,
        description="An image of the whole panorama's shape: black comes from the reference, white "
        "from the target; elsewhere the seam decides",
    )
    exposure: BoolProperty(
        name="Match Exposure", description="Match the target's exposure and white balance to the reference's",
        default=True,
    )
    holes: EnumProperty(
        name="Holes", description="What neither camera saw, because something near hid it from the only one that "
        "looked there", items=HOLES,
    )
    crop: EnumProperty(name="Crop", description="What of the panorama is kept", items=CROPS)
    crop_box: IntVectorProperty(
        name="Box", description="Left, top, width and height, in pixels of the full panorama, from its top left",
        size=4, default=(0, 0, 1000, 1000), min=0,
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
        name="Inverse Depth", description="The panorama's inverse depth, in units of the distance between the cameras"
    )
    fake_user: BoolProperty(
        name="Fake User", description="Keep the images in the file even where nothing uses them", default=True
    )
    pack: BoolProperty(
        name="Pack", description="Keep the images' pixels inside the .blend file, so that saving it saves them",
        default=True,
    )

    overlay: EnumProperty(
        name="Overlay", description="What lies over the panorama", items=OVERLAYS, update=look_again
    )
    overlay_opacity: FloatProperty(
        name="Opacity", description="How much the overlay covers", default=0.8, min=0.0, max=1.0, subtype="FACTOR",
        update=look_again,
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


# The properties that are options of the engine under the same name: one word of several, or a plain value.
CHOICES = ("field", "fade", "projection", "seam", "blend", "holes")
VALUES = ("dense", "exposure", "seed")
# What changes places when reference and target do; the lenses only where each picture has its own.
PICTURES = (("reference", "target"), ("reference_camera", "target_camera"), ("ignore_reference", "ignore_target"))
LENSES = tuple((name, f"target_{name}") for name in ("focal", "sensor", "focal35", "focal_px"))
# What is no setting: what is stitched, what came of it, and how it is looked at.
NO_SETTINGS = frozenset({"name", "reference", "target", "result", "matches", "matches_reference", "matches_target",
                         "match_index", "overlay", "overlay_opacity", "show_matches", "show_epipolar"})  # fmt: skip


def options_of(settings: Any, scale: float | None = None) -> dict[str, Any]:
    """The settings as fields of StitchOptions, JSON-ready; `camera` holds those of CameraRequest. What needs images or
    scene cameras (masks, matches, CAMERAS) is added by whoever has them. scale: instead of the settings' own."""
    options: dict[str, Any] = {name: getattr(settings, name).lower() for name in CHOICES}
    options |= {name: getattr(settings, name) for name in VALUES}
    options["scale"] = settings.scale if scale is None else scale
    options["crop"] = settings.crop.lower()
    if settings.crop == "BOX":
        options["crop"] = [int(side * options["scale"]) for side in settings.crop_box]
    options["level"] = "auto" if settings.projection == "PERSPECTIVE" else settings.level.lower()
    if options["level"] == "angles":
        options["level"] = [math.degrees(angle) for angle in settings.level_angles]
    options["camera"] = _camera_of(settings)
    return options


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
    for name in set(names_of_settings(settings)) & set(kept):
        value = chosen.get(name) if settings.bl_rna.properties[name].type == "POINTER" else kept[name]
        try:
            setattr(settings, name, value)
        except (TypeError, ValueError):  # a choice that this version does not offer
            settings.property_unset(name)


def _camera_of(settings: EDF_PG_settings) -> dict[str, Any]:
    def of(name: str) -> list[float]:
        return [getattr(settings, name), *([getattr(settings, f"target_{name}")] if settings.own_lens else [])]

    if settings.camera == "FOCAL":
        return {"focal_mm": of("focal"), "sensor_mm": of("sensor")}
    if settings.camera == "FOCAL35":
        return {"focal35": of("focal35")}
    if settings.camera == "FOCAL_PX":
        return {"focal_px": of("focal_px")}
    return {}


def settings_of(scene: bpy.types.Scene) -> EDF_PG_settings:
    """A scene's settings."""
    return getattr(scene, idnames.SETTINGS)


CLASSES = (EDF_PG_match, EDF_PG_settings, EDF_PG_job)


def register() -> None:
    """Make the properties known and hang them where Blender's files keep them."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    setattr(bpy.types.Scene, idnames.SETTINGS, PointerProperty(type=EDF_PG_settings))
    setattr(bpy.types.WindowManager, idnames.JOB, PointerProperty(type=EDF_PG_job))


def unregister() -> None:
    """Take them away again."""
    delattr(bpy.types.WindowManager, idnames.JOB)
    delattr(bpy.types.Scene, idnames.SETTINGS)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
