"""`stitch()`: the one way in. The stages stand here in the order of the data."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import features
from .blend import BLENDS, blend
from .camera import Camera, CameraRequest, cameras_for
from .displacement import StrictField, fit_strict
from .errors import BadRequest, NoOverlap
from .features import Matches
from .images import Picture, in_same_colour_space, load_picture, picture_from_array
from .lens import undistort
from .progress import Progress
from .report import make_report
from .two_view import TwoView, estimate
from .warp import Layer, Warp, build_warp, reference_layer, target_layer

FIELDS = ("strict",)


@dataclass(frozen=True)
class StitchOptions:
    """What a user may decide; the defaults are right for two photographs of one camera.

    field: one of FIELDS; camera: what is known of the cameras; blend: one of BLENDS; seed: of every random choice;
    measure: whether the report also compares the pictures in the overlap (PSNR, SSIM).
    """

    field: str = "strict"
    camera: CameraRequest = CameraRequest()
    blend: str = "feather"
    seed: int = 0
    measure: bool = True

    def __post_init__(self) -> None:
        for name, value, known in (("field", self.field, FIELDS), ("blend", self.blend, BLENDS)):
            if value not in known:
                raise BadRequest(f"{name} {value!r} is not offered; choose from: {', '.join(known)}")
        if not 0 <= self.seed < 2**31:
            raise BadRequest("the seed must be a whole number from 0 to 2147483647")


@dataclass(frozen=True)
class StitchResult:
    """A finished panorama and everything it was made of.

    pixels (H, W, C) float32 scene-linear and alpha (H, W), straight; the two layers and the warp on the same canvas;
    the geometry, the field, the matches (all, before inlier choice), the cameras as known before; `report`: a
    JSON-ready dict; `seconds` by stage.
    """

    pixels: np.ndarray
    alpha: np.ndarray
    reference: Picture
    target: Picture
    reference_layer: Layer
    target_layer: Layer
    warp: Warp
    two_view: TwoView
    field: StrictField
    matches: Matches
    cameras: tuple[Camera, Camera]
    warnings: tuple[str, ...]
    report: dict[str, Any]
    seconds: dict[str, float]

    @property
    def bits(self) -> int:
        """Bits per channel of the deeper input (32: float)."""
        return max(self.reference.bits, self.target.bits)


def stitch(
    reference: str | Path | np.ndarray,
    target: str | Path | np.ndarray,
    options: StitchOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> StitchResult:
    """Stitches the target into the reference's plane.

    reference, target: files, or arrays (see `picture_from_array`: 8 and 16 bit display-encoded, float scene-linear;
    RGB(A) or gray). progress(stage, share of everything done) and cancelled() are called between the steps of the work.
    Raises StitchError and its kinds; Cancelled where asked to stop.
    """
    options = options or StitchOptions()
    steps = _Steps(Progress(progress, cancelled))

    steps("read")
    first, second = in_same_colour_space(_picture(reference), _picture(target))
    cameras, warnings = cameras_for(
        options.camera, (first.name, second.name), (_size(first), _size(second)), (first.exif, second.exif)
    )
    warnings = [*_named(first), *_named(second), *warnings]
    _refuse_identical(first, second)

    steps("features")
    seen = features.detect(first.view, first.alpha)
    steps("features", 0.45)
    seen_too = features.detect(second.view, second.alpha)
    steps("features", 0.9)
    matches = features.match(seen, seen_too)

    steps("geometry")
    ideal = Matches(undistort(matches.x, cameras[0]), undistort(matches.y, cameras[1]), matches.scale)
    two_view = estimate(ideal, *cameras, seed=options.seed)
    warnings += two_view.warnings

    steps("field")
    inliers = ideal.subset(two_view.inliers)
    displacement = fit_strict(two_view, inliers.x, inliers.y, cameras[0].size, cameras[1].size, matches.scale)

    steps("warp")
    warp = build_warp(displacement, two_view, *cameras)
    steps("warp", 0.5)
    base, layer = reference_layer(first, warp.canvas), target_layer(second, warp)

    steps("blend")
    panorama = blend(base, layer, options.blend)

    steps("write")
    report, more = make_report(options, (first, second), cameras, matches, two_view, displacement, warp)
    warnings += more
    report["warnings"] = warnings
    return StitchResult(
        panorama.pixels, panorama.alpha, first, second, base, layer, warp, two_view, displacement, matches, cameras,
        tuple(warnings), report, steps.seconds,
    )  # fmt: skip


class _Steps:
    """Reports each stage, lets it be cancelled, and keeps its seconds."""

    def __init__(self, progress: Progress) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress
        self._stage, self._since = "", time.perf_counter()

    def __call__(self, stage: str, fraction: float = 0.0) -> None:
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._stage, self._since = stage, now
        self._progress(stage, fraction)


def _picture(source: str | Path | np.ndarray) -> Picture:
    return picture_from_array(source) if isinstance(source, np.ndarray) else load_picture(source)


def _size(picture: Picture) -> tuple[int, int]:
    height, width = picture.pixels.shape[:2]
    return width, height


def _named(picture: Picture) -> list[str]:
    return [f"{picture.name}: {warning}" for warning in picture.warnings]


def _refuse_identical(a: Picture, b: Picture) -> None:
    if a.view.shape == b.view.shape and np.array_equal(a.view, b.view):
        raise NoOverlap("the two pictures are the same picture: choose two photographs taken from different places")
