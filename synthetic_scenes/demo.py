"""`edf demo`: make a pair, stitch it, measure the result against the truth, and say so in a few lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..core.camera import CameraRequest
from ..core.colour import encode
from ..core.epipolar import distance_to_line
from ..core.images import encode_picture, picture_from_array
from ..core.metrics import psnr
from ..core.output_files import OutputFiles
from ..core.outputs import OutputRequest, write
from ..core.pipeline import StitchOptions, StitchResult, stitch
from .ground_truth import TrueGeometry, pose_errors
from .two_planes import Pair, Textures, depth_at, make_pair, render


def run_demo(folder: Path, overwrite: bool, progress: Callable[[str, float], None] | None = None) -> list[str]:
    """Writes reference.png, target.png, panorama.png, truth.png, warp.npz, report.json into a folder; returns what to
    print."""
    with OutputFiles(overwrite) as files:
        names = (
            "reference.png",
            "target.png",
            "panorama.png",
            "truth.png",
            "warp.npz",
            "report.json",
            "report.timing.json",
            "report.matches.csv",
        )
        files.check_folder(folder, names)
        pair = make_pair()
        # a camera's EXIF would tell the focal length; without it two level pictures cannot
        known = CameraRequest(focal_px=(pair.reference_camera.K[0, 0],))
        result = stitch(pair.reference, pair.target, StitchOptions(camera=known), progress)
        truth = true_panorama(pair, result)
        for name, pixels in (("reference", pair.reference), ("target", pair.target), ("truth", truth)):
            picture = picture_from_array(pixels)
            files.add_to_folder(folder, f"{name}.png", encode_picture(picture.pixels, None, 8, ".png")[0])
        request = OutputRequest(folder / "panorama.png", folder / "report.json", warp=folder / "warp.npz")
        write(result, request, files)
    measured = measure(pair, result, truth)
    lines = [f"{label:<46}{measured[key]:8.3f} {unit}" for key, label, unit in MEASURES]
    return [*lines, *(f"{folder / name}" for name in names)]


MEASURES = (
    ("rotation_deg", "rotation error", "degrees"),
    ("baseline_deg", "direction of the baseline, error", "degrees"),
    ("h_inf_px", "infinite homography, median transfer error", "px"),
    ("line_px", "distance from the true epipolar lines, mean", "px"),
    ("alignment_px", "distance from the true target pixel, median", "px"),
    ("psnr_db", "panorama against the true panorama, PSNR", "dB"),
)


def true_panorama(pair: Pair, result: StitchResult) -> np.ndarray:
    """What the reference camera would have seen with a sensor as large as the panorama, uint8 RGB."""
    canvas = result.warp.canvas
    left, top = -canvas.offset[0], -canvas.offset[1]
    return render(pair.reference_camera.widened(left, top, canvas.width, canvas.height), Textures(0))


def measure(pair: Pair, result: StitchResult, truth: np.ndarray) -> dict[str, float]:
    """Errors of a stitch of a pair against its cameras, its depth and its true panorama."""
    geometry = TrueGeometry.of(pair.reference_camera, pair.target_camera)
    warp, (width, height) = result.warp, pair.target_camera.size
    rows, columns = np.nonzero(warp.inside((width, height)))
    some = slice(None, None, max(1, len(rows) // 20_000))
    rows, columns = rows[some], columns[some]
    points = np.column_stack([columns, rows]).astype(float) - warp.canvas.offset
    mapped = np.column_stack([warp.map_x[rows, columns], warp.map_y[rows, columns]]).astype(float)
    true_pixels = geometry.target_pixels(points, depth_at(pair.reference_camera, points))
    return {
        **pose_errors(result.two_view, geometry, (width, height)),
        "line_px": float(distance_to_line(geometry.F, points, mapped).mean()),
        "alignment_px": float(np.nanmedian(np.linalg.norm(mapped - true_pixels, axis=1))),
        "psnr_db": psnr(encode(result.pixels, 8), truth, result.alpha > 0),
    }
