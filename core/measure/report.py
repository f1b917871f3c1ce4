"""The report: everything that was measured and decided, as JSON-ready values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens_entries import lens_entry
from ..compose.inpaint import closed_holes
from ..compose.window import goes_round
from ..field.slack import SlackField
from ..panorama.canvas import Canvas
from ..panorama.levelling import angles_of
from ..panorama.warp import build_map
from ..raster.arrays import Array
from ..system.json_values import plain
from .exposure_entry import exposure_entry, exposure_warnings
from .focal_doubt import focal_doubt
from .held_out import held_out
from .metrics import coverage_samples, look_up, off_line_mean, overlap_quality
from .options import WARNING
from .projectivity import independent_fundamental, projectivity

if TYPE_CHECKING:
    from ..alignment import Alignment
    from ..cameras.camera import Camera
    from ..cameras.scale import Scale
    from ..compose.decided import Decided
    from ..dense.refine import Dense
    from ..dense.sphere.refine_sphere import DenseSphere
    from ..options import StitchOptions
    from ..panorama.choosing_slide import SlideChoice
    from ..pictures.picture import Picture

SCHEMA = 1


def make_report(
    options: StitchOptions, pictures: Sequence[Picture], alignment: Alignment, canvas: Canvas,
    decided: Sequence[Decided], appearance: dict[str, float], shows: NDArray[np.bool_], inpainted: int,
    open_px: int,
) -> tuple[dict[str, Any], list[str]]:
    """The report of a stitch. It holds no times and no dates: the same input gives the same report.

    Parameters
    ----------
    options : StitchOptions
    pictures : sequence of Picture
        The reference first.
    alignment : Alignment
    canvas : Canvas
        What the panorama shows.
    decided : sequence of Decided
        About the composition of each picture: what is hidden, holes, exposure, folds.
    appearance : dict
        See `metrics.appearance`.
    shows : (H, W) bool array
        Where the panorama shows something.
    inpainted : int
        Pixels that were filled, before cropping.
    open_px : int
        Pixels that no camera saw and that were not filled, before cropping.

    Returns
    -------
    report : dict
        JSON-ready values.
    warnings : list of str
        In plain words, for the user.
    """
    cameras, edge, field = alignment.cameras, alignment.edges[0], alignment.pair_field
    matches, two_view, further = edge.matches, edge.two_view, decided[edge.j]
    holes = sum(one.holes for one in decided)
    measured = _measured(options, pictures, alignment) | {"folds": max(one.folds for one in decided)} | appearance
    doubt = focal_doubt(alignment.cameras, edge, alignment.warp.canvas)
    report = {
        "schema": SCHEMA,
        "pictures": [picture_entry(p, c) for p, c in zip(pictures, cameras, strict=True)],
        "options": options_entry(options, alignment),
        "matches": {
            "found": len(matches), "inliers": int(two_view.inliers.sum()), "noise_px": two_view.sigma,
            "contradicting": two_view.contradicting,
        },
        "two_view": {
            "model": two_view.model, "why": two_view.why, "focal_source": two_view.focal_source,
            "focal_px": [two_view.K[0, 0], two_view.K_prime[0, 0]], "focal_deviation": two_view.focal_deviation,
            "h_inf_spread_px": two_view.h_inf_spread, "focal_off": doubt.off, "focal_lean_deg": doubt.lean_deg,
            "K": two_view.K, "K_prime": two_view.K_prime, "R": two_view.R, "t": two_view.t,
            "F": two_view.F, "H_inf": two_view.H_inf, "e_prime": two_view.e_prime,
        },
        "field": {
            "kind": field.name, "smoothing": field.fit.smoothing, "centres": int(field.fit.inliers_used.sum()),
            "pruned": int(two_view.inliers.sum() - field.fit.inliers_used.sum()), "plane": field.plane,
            "fade_px": field.fit.fade_px, "residual_px": field.fit.residual_px, "held_out_px": field.fit.held_out_px,
            "negative_share": field.fit.negative_share,
            "slack_px": field.slack_px if isinstance(field, SlackField) else 0.0,
            "dense": dense_entry(alignment.dense, ("reach_px", "found", "moved_px", "across_px")),
        },
        "slide": slide_entry(alignment.slide),
        "canvas": canvas_entry(canvas, two_view.K),
        "depth": depth_entry(alignment.scale),
        "composition": {
            "exposure_gain": further.exposure.gain / decided[0].exposure.gain,
            "exposure_spread": further.exposure.spread, "exposure_blocks": further.exposure.blocks,
            "light": exposure_entry(pictures, decided), "occluded_px": int(further.hidden.sum()),
            "hole_px": holes, "inpainted_px": inpainted, "holes": closed_holes(shows, False, goes_round(canvas))[1],
        },
        "measured": measured,
    }  # fmt: skip
    warnings = doubt.warnings(alignment.cameras, edge) + _warnings(alignment, measured["folds"])
    warnings += exposure_warnings([picture.name for picture in pictures], [one.exposure for one in decided])
    if alignment.left_out:
        report["left_out"] = left_out_entry(alignment.left_out)
    if options.projection == "auto" and canvas.projection is None:
        warnings.append(
            f"the field {field.name!r} knows the reference's plane only: the panorama is drawn on it, as by "
            "--projection reference"
        )
    open_holes = open_px if options.holes == "auto" else holes
    if open_holes > WARNING.hole_share * further.hidden.size:
        shown = how_holes_are_shown(options)
        without = "--crop reference" if canvas.projection is None else "--projection reference --crop reference"
        warnings.append(
            f"{open_holes} pixels were seen by neither camera, hidden behind something near: the panorama is "
            f"{shown}; {without} shows none of them"
        )
    return plain(report), warnings


def _measured(
    options: StitchOptions, pictures: Sequence[Picture], alignment: Alignment
) -> dict[str, float]:
    """The figures of an alignment, NaN where undefined; expensive ones only if options.measure asks for them."""
    cameras, edge = alignment.cameras, alignment.edges[0]
    field, warp, two_view = alignment.pair_field, alignment.warp, edge.two_view
    inliers = edge.matches.subset(two_view.inliers)
    # Matches and pixels are compared in the reference's own frame, where only one of the two pictures is resampled.
    flat = warp
    if warp.slide is not None or (options.measure and warp.canvas.projection is not None):
        refinement = None if alignment.dense is None else alignment.dense.refined
        flat = build_map(field, alignment.views, Canvas(*cameras[0].size, (0, 0)), refinement)
    asked = warp if warp.slide is None else flat
    error = np.linalg.norm(look_up(asked, inliers.x, cameras[0], edge.j) - inliers.y, axis=1)
    error = error[np.isfinite(error)]
    shown = coverage_samples(warp, cameras, edge.j)
    measured = {
        "alignment_median_px": _median(error),
        "alignment_p95_px": float(np.percentile(error, 95)) if error.size else math.nan,
        "off_line_mean_px": off_line_mean(two_view.F, shown),
        "negative_share": field.fit.negative_share,
    }
    if not options.measure:
        return measured
    # a pair without a baseline has no F: whatever matches give would mean nothing
    independent = independent_fundamental(edge.ideal, options.seed) if np.isfinite(two_view.F).all() else two_view.F
    unseen = held_out(field, edge.inliers, shown, options.seed)
    return measured | overlap_quality(pictures, flat, edge.j) | {
        "projectivity_own_px": projectivity(two_view.F, shown),
        "projectivity_independent_px": projectivity(independent, shown),
        "projectivity_points": int((~shown.overlap).sum()),
        "held_out_rms_px": unseen.rms_px,
        "held_out_median_px": unseen.median_px,
        "held_out_towards_rms_px": unseen.towards_rms_px,
    }  # fmt: skip


def _warnings(alignment: Alignment, fold_share: float) -> list[str]:
    two_view, field, warp = alignment.edges[0].two_view, alignment.pair_field, alignment.warp
    out = []
    if field.fit.negative_share > WARNING.behind_infinity_share:
        out.append(
            f"{field.fit.negative_share:.0%} of the points lie beyond infinity: the focal length "
            f"({two_view.K[0, 0]:.0f} px) is doubtful, and with it depth and H_inf; the picture itself hardly "
            "depends on it"
        )
    if not warp.canvas.projection and (warp.canvas.width, warp.canvas.height) == alignment.cameras[0].size:
        out.append("the target shows nothing beyond the reference's edges: the panorama is no larger than that")
    if warp.canvas.cropped:
        out.append(
            f"the pictures reach too far for a {warp.canvas.projection.kind} panorama and were cropped there; "
            "--projection equirectangular shows them whole"
            if warp.canvas.projection
            else "the target reaches too far to the side to be shown whole in a flat picture: its far end was cropped; "
            "--projection cylindrical or equirectangular shows it"
        )
    if fold_share > WARNING.fold_share:
        out.append(f"the warp folds over in {fold_share:.1%} of the target: look for doubled or torn things there")
    return out


def options_entry(options: StitchOptions, alignment: Alignment) -> dict[str, Any]:
    """What was asked for."""
    return {
        "field": options.field, "fade": _fade(options, alignment), "dense": options.dense,
        "projection": options.projection,
        "slide": options.slide if options.may_slide else 0, "level": options.level, "centre": options.centre,
        "fov": options.fov, "scale": options.scale, "crop": options.crop, "blend": options.blend,
        "seam": options.seam, "exposure": options.exposure, "holes": options.holes, "seed": options.seed,
        "scale_metres": options.scale_metres, "preview": options.preview, "brackets": options.brackets,
    }  # fmt: skip


def left_out_entry(left_out: Sequence[tuple[str, str]]) -> list[dict[str, str]]:
    """Pictures that are not used, and why."""
    return [{"name": name, "why": why} for name, why in left_out]


def slide_entry(slide: SlideChoice) -> dict[str, Any]:
    """How far the viewpoint slides."""
    return {"s1": slide.s1, "part": slide.part, "costs": [asdict(one) for one in slide.costs], "why": slide.why}


def depth_entry(scale: Scale) -> dict[str, Any]:
    """In which unit depth is given out, and how that is known."""
    return {"unit": scale.unit, "metres_per_baseline": scale.metres, "source": scale.source}


def how_holes_are_shown(options: StitchOptions) -> str:
    """What becomes of holes, in words."""
    if options.holes == "inpaint":
        return "filled smoothly from around there"
    return "transparent there (black in a JPEG); --holes inpaint fills them"


def canvas_entry(canvas: Canvas, K: Array) -> dict[str, Any]:
    """Size and projection of the panorama; K: the reference's intrinsics."""
    return {
        "width": canvas.width, "height": canvas.height, "offset": None if canvas.projection else canvas.offset,
        "cropped": canvas.cropped, "projection": _projection_entry(canvas, K),
    }  # fmt: skip


def _projection_entry(canvas: Canvas, K: Array) -> dict[str, Any]:
    """How canvas pixels map to rays in the reference camera's frame (see `projection`); level: yaw, pitch and roll of
    the reference in degrees, as for --level."""
    if canvas.projection is None:
        focal = float(np.sqrt(K[0, 0] * K[1, 1]))
        kind, centre, rotation = "perspective", K[:2, 2], np.eye(3)
    else:
        kind, focal, centre = canvas.projection.kind, canvas.projection.focal, np.array(canvas.projection.centre)
        rotation = canvas.projection.rotation
    return {
        "kind": kind, "focal_px": focal, "centre": centre + np.array(canvas.offset), "rotation": rotation,
        "level": angles_of(rotation),
    } | ({"distance": canvas.projection.distance} if canvas.projection and kind == "pannini" else {})  # fmt: skip


def picture_entry(picture: Picture, camera: Camera) -> dict[str, Any]:
    """What a picture is, and what was known of its camera."""
    return {
        "name": picture.name, "width": camera.size[0], "height": camera.size[1], "bits": picture.bits,
        "alpha": picture.alpha is not None, "icc": picture.icc is not None,
        "camera": {
            "focal_px": camera.focal, "source": camera.source, "fixed": camera.fixed, "distortion": camera.distortion,
        } | ({} if camera.lens is None else {"lens_model": lens_entry(camera)}),
    }  # fmt: skip


def _fade(options: StitchOptions, alignment: Alignment) -> str:
    """The fade that was used: what goes on beyond the overlap needs depth, and a single pair of pictures."""
    return "plane" if options.fade == "continue" and alignment.continuation is None else options.fade


def dense_entry(dense: Dense | DenseSphere | None, told: Sequence[str]) -> dict[str, Any]:
    """What is said of dense refinement, and those of its figures."""
    if dense is None or dense.refined is None:
        return {"used": False, "why": "not asked for" if dense is None else dense.why}
    return {"used": True} | {name: getattr(dense, name) for name in told}


def _median(values: Array) -> float:
    return float(np.median(values)) if values.size else math.nan
