"""The report: everything that was measured and decided, as plain JSON-ready values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .metrics import distances_off_line, folds, look_up, overlap_quality

if TYPE_CHECKING:
    from .camera import Camera
    from .displacement import StrictField
    from .features import Matches
    from .images import Picture
    from .pipeline import StitchOptions
    from .two_view import TwoView
    from .warp import Warp

SCHEMA = 1
# More inliers than this behind infinity means that the focal length, hence H_inf, is doubtful.
NEGATIVE_SHARE = 0.02


def make_report(
    options: StitchOptions,
    pictures: tuple[Picture, Picture],
    cameras: tuple[Camera, Camera],
    matches: Matches,
    two_view: TwoView,
    field: StrictField,
    warp: Warp,
) -> tuple[dict[str, Any], list[str]]:
    """The report of a stitch, and warnings in plain words drawn from it. No seconds, no dates: the same input gives the
    same report."""
    x, y = matches.x[two_view.inliers], matches.y[two_view.inliers]
    mapped = look_up(warp, x)
    error = np.linalg.norm(mapped - y, axis=1)
    error = error[np.isfinite(error)]
    undistorted = not any(camera.distortion.any() for camera in cameras)
    off_line = distances_off_line(two_view.F, x, mapped) if undistorted else np.empty(0)
    fold_share = folds(warp, cameras[1].size)
    measured = {
        "alignment_median_px": _median(error),
        "alignment_p95_px": float(np.percentile(error, 95)) if error.size else math.nan,
        "off_line_mean_px": float(off_line.mean()) if off_line.size else math.nan,
        "folds": fold_share,
    }
    if options.measure:
        measured |= overlap_quality(*pictures, warp)
    report = {
        "schema": SCHEMA,
        "pictures": [_picture_entry(p, c) for p, c in zip(pictures, cameras, strict=True)],
        "options": {"field": options.field, "blend": options.blend, "seed": options.seed},
        "matches": {"found": len(matches), "inliers": int(two_view.inliers.sum()), "noise_px": two_view.sigma},
        "two_view": {
            "model": two_view.model, "why": two_view.why, "focal_source": two_view.focal_source,
            "focal_px": [two_view.K[0, 0], two_view.K_prime[0, 0]], "focal_deviation": two_view.focal_deviation,
            "K": two_view.K, "K_prime": two_view.K_prime, "R": two_view.R, "t": two_view.t,
            "F": two_view.F, "H_inf": two_view.H_inf, "e_prime": two_view.e_prime,
        },
        "field": {
            "kind": field.name, "smoothing": field.smoothing, "centres": int(field.kept.sum()),
            "pruned": int(two_view.inliers.sum() - field.kept.sum()), "plane": field.plane, "fade_px": field.fade_px,
            "residual_px": field.residual_px, "held_out_px": field.held_out_px, "negative_share": field.negative_share,
        },
        "canvas": {
            "width": warp.canvas.width, "height": warp.canvas.height, "offset": warp.canvas.offset,
            "cropped": warp.canvas.cropped,
        },
        "measured": measured,
    }  # fmt: skip
    return plain(report), _warnings(two_view, field, warp, fold_share)


def _warnings(two_view: TwoView, field: StrictField, warp: Warp, fold_share: float) -> list[str]:
    out = []
    if field.negative_share > NEGATIVE_SHARE:
        out.append(
            f"{field.negative_share:.0%} of the points lie beyond infinity: the focal length ({two_view.K[0, 0]:.0f} "
            "px) is doubtful, and with it depth and H_inf; the picture itself hardly depends on it"
        )
    if warp.canvas.cropped:
        out.append(
            "the target reaches too far to the side to be shown whole in a flat picture: its far end was cropped"
        )
    if fold_share > 0.005:
        out.append(f"the warp folds over in {fold_share:.1%} of the target: look for doubled or torn things there")
    return out


def _picture_entry(picture: Picture, camera: Camera) -> dict[str, Any]:
    return {
        "name": picture.name, "width": camera.size[0], "height": camera.size[1], "bits": picture.bits,
        "alpha": picture.alpha is not None, "icc": picture.icc is not None,
        "camera": {
            "focal_px": camera.focal, "source": camera.source, "fixed": camera.fixed, "distortion": camera.distortion,
        },
    }  # fmt: skip


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else math.nan


def plain(value: Any) -> Any:
    """The same with lists for arrays, Python numbers for NumPy's, and None for what JSON has no word for (NaN,
    infinity)."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
