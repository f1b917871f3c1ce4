"""Every name under which Blender knows something of ours: one place, so that a panel never names what is not there."""

from __future__ import annotations

from enum import StrEnum


class Operator(StrEnum):
    """Operators, as bpy.ops calls them."""

    STITCH = "edf.stitch"
    PREVIEW = "edf.preview"
    STITCH_FILES = "edf.stitch_files"
    ENVIRONMENT = "edf.stitch_environment"
    SPHERE = "edf.stitch_sphere"
    RESTITCH = "edf.restitch"
    FOLLOW = "edf.follow"
    CANCEL = "edf.cancel"
    ADD_PICTURES = "edf.add_pictures"
    ADD_FOLDER = "edf.add_folder"
    ADD_IMAGES = "edf.add_images"
    DEVELOP = "edf.develop_pictures"
    OPEN_PAIR = "edf.open_pair"
    REMOVE_PICTURE = "edf.remove_picture"
    MOVE_PICTURE = "edf.move_picture"
    CLEAR_PICTURES = "edf.clear_pictures"
    SEE_FROM = "edf.see_from"
    PICTURE_STATE = "edf.picture_state"
    ADD_CLIPS = "edf.add_clips"
    REMOVE_CLIP = "edf.remove_clip"
    STITCH_CLIPS = "edf.stitch_clips"
    CLIP_FRAMES = "edf.stitch_clip_frames"
    SWAP = "edf.swap"
    RESET = "edf.reset"
    REFERENCE_FRAME = "edf.reference_frame"
    RESTORE = "edf.restore"
    SAVE = "edf.save"
    PRESET_ADD = "edf.preset_add"
    MATCH_ADD = "edf.match_add"
    MATCH_DELETE = "edf.match_delete"
    MATCH_ENABLE = "edf.match_enable"
    MATCH_EDIT = "edf.match_edit"
    MASK_PAINT = "edf.mask_paint"
    MASK_DONE = "edf.mask_done"
    PICTURE_MASK = "edf.picture_mask"
    PICTURE_MASK_REMOVE = "edf.picture_mask_remove"
    TAKE_FROM = "edf.take_from"
    PLACE_REMOVE = "edf.place_remove"
    GUIDE_ADD = "edf.guide_add"
    GUIDE_REMOVE = "edf.guide_remove"
    FRAME_DRAG = "edf.frame_drag"
    POINTER = "edf.pointer"
    CREATE_CAMERAS = "edf.create_cameras"
    DEPTH_MESH = "edf.depth_mesh"
    BACKPLATE = "edf.set_up_backplate"
    SET_DISTANCE = "edf.set_distance"
    LOOK_THROUGH = "edf.look_through"
    USE_AS_WORLD = "edf.use_as_world"


class Panel(StrEnum):
    """Panels of the Image Editor's sidebar."""

    MAIN = "EDF_PT_main"
    CAMERA = "EDF_PT_camera"
    FIELD = "EDF_PT_field"
    MATCHES = "EDF_PT_matches"
    MASKS = "EDF_PT_masks"
    FRAME = "EDF_PT_frame"
    CLIPS = "EDF_PT_clips"
    OUTPUT = "EDF_PT_output"
    RESULT = "EDF_PT_result"
    OVERLAYS = "EDF_PT_overlays"
    TAKE_ALONG = "EDF_PT_take_along"
    PRESETS = "EDF_PT_presets"


class Menu(StrEnum):
    """Menus."""

    PRESETS = "EDF_MT_presets"
    PICTURES = "EDF_MT_pictures"
    MATCHES = "EDF_MT_matches"


class List(StrEnum):
    """Lists."""

    PICTURES = "EDF_UL_pictures"
    MATCHES = "EDF_UL_matches"
    PLACES = "EDF_UL_places"
    GUIDES = "EDF_UL_guides"


# Where the properties hang: bpy.types.Scene.edf_stitch (settings), bpy.types.WindowManager.edf_stitch_job.
SETTINGS = "edf_stitch"
JOB = "edf_stitch_job"
# The handler of files that are dropped.
DROPPED = "EDF_FH_pictures"
# The sidebar's tab.
TAB = "EDF Stitch"
