"""Every way in which a scene is stitched for the validation, the rivals among them."""

from __future__ import annotations

from dataclasses import replace

from ..core.alignment import Geometry, estimate_geometry, fit_and_warp
from ..core.cameras.sources import CameraRequest
from ..core.choices import RIVALS, Slide
from ..core.frames.frame import Frame
from ..core.frames.reading import read_frame
from ..core.options import StitchOptions
from ..core.pipeline import StitchResult, compose
from ..core.system.progress import Progress, Stopwatch
from .rendered import RenderedPair

# What is known of the cameras / the field.
WAYS = (
    "known/strict", "known/slack", "known/paper", *(f"known/{rival}" for rival in RIVALS), "unknown/strict",
    "unknown/slack",
)  # fmt: skip

# The reference's own plane and place, whole: there the truth is known pixel by pixel.
ON_REFERENCE = StitchOptions(projection="reference", slide=0.0, fade="continue", crop="full", holes="transparent")
# Feathered, without a seam: alignment is judged, and not what hides its errors.
PLAIN = replace(ON_REFERENCE, exposure="none", seam="none", blend="feather", measure=False)
# How far the viewpoint slides in the stitches that show whether both pictures still meet: as is chosen, and half-way.
SLIDES: dict[str, Slide] = {"auto": "auto", "half": 0.5}

Shared = dict[str, tuple[Frame, Geometry]]


def stitched(pair: RenderedPair, way: str, shared: Shared | None = None) -> StitchResult:
    """The pair stitched on the reference's plane in one of WAYS; shared: features and geometry by what is known, kept
    from way to way.

    Raises StitchError.
    """
    return _stitched(pair, way, PLAIN, {} if shared is None else shared)


def slid(pair: RenderedPair, way: str, slide: Slide, shared: Shared | None = None) -> StitchResult:
    """The pair stitched in one of WAYS on a cylinder, from a viewpoint that slides; shared: as for `stitched`.

    Raises StitchError.
    """
    return _stitched(pair, way, replace(PLAIN, projection="cylindrical", slide=slide), {} if shared is None else shared)


def delivered(pair: RenderedPair, way: str, shared: Shared | None = None) -> StitchResult:
    """The pair stitched in one of WAYS on the reference's plane, with seam, bands and exposure; shared: as for
    `stitched`.

    Raises StitchError.
    """
    return _stitched(pair, way, replace(ON_REFERENCE, measure=False), {} if shared is None else shared)


def _stitched(pair: RenderedPair, way: str, options: StitchOptions, shared: Shared) -> StitchResult:
    known_of, field = way.split("/")
    K, K_prime = (pair.cameras[name].K for name in ("reference", "target"))
    middles = tuple(float(v) for v in (*K[:2, 2], *K_prime[:2, 2]))
    known = CameraRequest(focal_px=(float(K[0, 0]), float(K_prime[0, 0])), principal=middles)
    camera = known if known_of == "known" else CameraRequest()
    options, progress = replace(options, field=field, camera=camera), Stopwatch(Progress())
    if known_of not in shared:
        frame = read_frame((pair.reference, pair.target), options)
        shared[known_of] = frame, estimate_geometry([frame], options, progress)
    frame, geometry = shared[known_of]
    return compose(frame, fit_and_warp(geometry, [frame], options, progress), options, progress)
