"""The ways in which a set is stitched for the validation: ours, and ours as if all were taken from one place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.alignment import Geometry, estimate_geometry, fit_and_warp
from ...core.frames.frame import Frame
from ...core.frames.reading import read_frame
from ...core.options import StitchOptions
from ...core.pictures.picture import Picture, load_picture
from ...core.pipeline import StitchResult, compose
from ...core.system.progress import STAGES_OF_MANY, Progress, Stopwatch
from ..scene_camera import SceneCamera
from .rendered_set import RenderedSet
from .set_thresholds import OURS, ROTATION_ONLY

WAYS, SLID = (OURS, ROTATION_ONLY), "slid"
# The whole sphere from the first picture's place, with all that the defaults do: the truth is known there.
ON_SPHERE = StitchOptions(
    projection="equirectangular", level="none", slide=0.0, crop="full", holes="transparent", viewpoint=1, measure=False
)
# On a cylinder, from a viewpoint that slides as far as is chosen.
SLIDING = replace(ON_SPHERE, projection="cylindrical", slide="auto")
# Diagonal of the 36 × 24 mm frame, to which "35 mm equivalent" refers.
FULL_FRAME_MM = float(np.hypot(36.0, 24.0))

Shared = dict[str, tuple[Frame, Geometry]]


def equivalent_mm(camera: SceneCamera) -> float:
    """The 35 mm equivalent focal length that a camera would write: whole millimetres."""
    return float(round(float(camera.K[0, 0]) * FULL_FRAME_MM / float(np.hypot(*camera.size))))


def told_lens(camera: SceneCamera) -> float:
    """The focal length, px, that this says."""
    return equivalent_mm(camera) * float(np.hypot(*camera.size)) / FULL_FRAME_MM


def told_pictures(rendered: RenderedSet) -> list[Picture]:
    """Its pictures, all exposures of each, which say what most cameras write: their 35 mm equivalent focal length in
    whole millimetres."""
    pictures = []
    exposures = rendered.brackets or tuple((path,) for path in rendered.pictures)
    for paths, camera in zip(exposures, rendered.cameras, strict=True):
        for picture in map(load_picture, paths):
            pictures.append(replace(picture, exif=replace(picture.exif, focal35_mm=equivalent_mm(camera))))
    return pictures


def stitched(rendered: RenderedSet, way: str, shared: Shared) -> StitchResult:
    """The set stitched in one of WAYS, or SLID; shared: features and geometry, kept from way to way.

    Raises StitchError.
    """
    progress = Stopwatch(Progress(stages=STAGES_OF_MANY))
    if not shared:
        frame = read_frame(told_pictures(rendered), ON_SPHERE)
        geometry = estimate_geometry([frame], ON_SPHERE, progress)
        shared["read"] = frame.only(geometry.numbers), geometry
    frame, geometry = shared["read"]
    options = SLIDING if way == SLID else ON_SPHERE
    if way == ROTATION_ONLY and geometry.rig is not None:
        rig = geometry.rig
        one_place = replace(rig, t=np.zeros_like(rig.t), inverse_ranges=np.zeros_like(rig.inverse_ranges))
        geometry = replace(geometry, rig=one_place)
    return compose(frame, fit_and_warp(geometry, [frame], options, progress), options, progress)
