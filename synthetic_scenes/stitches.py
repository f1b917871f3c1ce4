"""Every way in which a scene is stitched for the validation, the rivals among them."""

from __future__ import annotations

from dataclasses import replace

from ..core.alignment import Frame, Geometry, estimate_geometry, fit_and_warp
from ..core.cameras.sources import CameraRequest
from ..core.choices import RIVALS
from ..core.options import StitchOptions
from ..core.pipeline import StitchResult, Stopwatch, compose, read_frame
from ..core.system.progress import Progress
from .rendered import RenderedPair

# What is told of the cameras / the field.
WAYS = (
    "known/strict", "known/slack", "known/paper", *(f"known/{rival}" for rival in RIVALS), "unknown/strict",
    "unknown/slack",
)  # fmt: skip

# Feathered, without a seam: alignment is judged, and not what hides its errors.
PLAIN = StitchOptions(exposure=False, seam="none", blend="feather", measure=False)


Shared = dict[str, tuple[Frame, Geometry]]


def stitched(pair: RenderedPair, way: str, shared: Shared | None = None) -> StitchResult:
    """The pair stitched in one of WAYS; shared: features and geometry by what is told, kept from way to way.

    Raises StitchError.
    """
    told, field = way.split("/")
    K, K_prime = (pair.cameras[name].K for name in ("reference", "target"))
    middles = tuple(float(v) for v in (*K[:2, 2], *K_prime[:2, 2]))
    known = CameraRequest(focal_px=(float(K[0, 0]), float(K_prime[0, 0])), principal=middles)
    camera = known if told == "known" else CameraRequest()
    options = replace(PLAIN, field=field, camera=camera)
    shared, steps = {} if shared is None else shared, Stopwatch(Progress())
    if told not in shared:
        frame = read_frame(pair.reference, pair.target, options)
        shared[told] = frame, estimate_geometry([frame], options, steps)
    frame, registration = shared[told]
    return compose(frame, fit_and_warp(registration, [frame], options, steps), options, steps)
