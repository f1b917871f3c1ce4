"""From the panel's clips to a job for the worker, and from the frames that it made into the file."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy

from .. import engine_options, explain, offered, properties
from ..bridge import images
from ..bridge.images import Unusable

# The kinds of files that frames are written as.
SUFFIXES = (
    ("PNG", "PNG", "8 or 16 bits, with alpha"),
    ("EXR", "OpenEXR", "Float, for clips that are float"),
    ("JPG", "JPEG", "8 bits, small, black where nothing is shown"),
)
# The folder beside the first clip that is suggested for what is made.
FOLDER = "stitched"


def why_not(settings: Any) -> str:
    """Why the clips cannot be stitched as things stand, in words; "" where they can."""
    chosen = [entry.clip for entry in settings.clips]
    if len(chosen) < 2 or None in chosen:
        return "choose two clips or more, of cameras that stand still"
    if len(set(chosen)) < len(chosen):
        return "a clip stands twice in the list: each camera needs its own"
    if settings.camera == "CAMERAS":
        return "scene cameras are for two pictures: take the focal length from elsewhere, under Camera"
    if len(chosen) > 2 and settings.field not in offered.ROUND_FIELDS:
        return "more than two clips need a field that knows depth everywhere: choose Slack or Strict under Field"
    return ""


def common_range(settings: Any) -> tuple[int, int]:
    """The first and the last of the scene's frames that all clips show; (1, 0) where there are none."""
    clips = [entry.clip for entry in settings.clips if entry.clip is not None]
    first = max((clip.frame_start for clip in clips), default=1)
    last = min((clip.frame_start + clip.frame_duration - clip.frame_offset - 1 for clip in clips), default=0)
    return max(0, first), last


def suggested_folder(settings: Any) -> str:
    """Beside the first clip."""
    return str(_path(settings.clips[0].clip).parent / FOLDER)


def make_job(scene: bpy.types.Scene, first: int, last: int, folder: str, kind: str) -> dict[str, Any]:
    """The job for a scene's clips. kind: of SUFFIXES. Raises Unusable."""
    settings = properties.settings_of(scene)
    if reason := why_not(settings):
        raise Unusable(reason)
    if not folder:
        raise Unusable("choose a folder for the frames")
    if last < first:
        raise Unusable(f"there are no frames from {first} to {last}: the clips start at {common_range(settings)[0]}")
    clips = [entry.clip for entry in settings.clips]
    kept = SimpleNamespace(**properties.keep(settings))
    return {
        "options": engine_options.options_of(kept, is_set=len(clips) > 2),
        "clip": {
            "cameras": [{"path": str(_path(clip)), "start": clip.frame_start - clip.frame_offset} for clip in clips],
            "first": first, "last": last, "folder": str(images.place_of(folder)), "suffix": f".{kind.lower()}",
            "name": bpy.path.clean_name(Path(clips[0].name).stem.rstrip("0123456789_-. ")) or "clip",
        },
    }  # fmt: skip


def take_over(context: Any, found: dict[str, Any]) -> str:
    """The frames that were made become a movie clip and an image sequence of the file, shown in the editor; returns
    words about them."""
    path, frames = found["path"], found["frames"]
    clip = bpy.data.movieclips.load(path, check_existing=True)
    clip.filepath = clip.filepath  # one that is there already looks for further frames
    clip.frame_start = frames[0]
    image = bpy.data.images.load(path, check_existing=True)
    image.source, image.name = "SEQUENCE", clip.name
    space = context.space_data
    if isinstance(space, bpy.types.SpaceImageEditor):
        space.image, user = image, space.image_user
        user.frame_start, user.frame_duration, user.frame_offset = frames[0], frames[-1] - frames[0] + 1, frames[0] - 1
        user.use_auto_refresh = True
    words = f"{clip.name}: {len(frames)} frames in {Path(path).parent}, {found['done']} of them new"
    words += f"; failed: {found['failed']}" if found["failed"] else ""
    words += f" in {found['seconds']:.0f} s"
    return f"{words}. {explain.sentence(found['warnings'][0]) if found['warnings'] else ''}".strip()


def _path(clip: bpy.types.MovieClip) -> Path:
    return Path(bpy.path.abspath(clip.filepath, library=clip.library))
