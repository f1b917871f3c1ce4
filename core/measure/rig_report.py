"""The report of more than two pictures: the same keys as a pair's where they mean the same, and what a rig adds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.bodies import called_of_bodies
from ..cameras.rig import Rig
from ..compose.inpaint import closed_holes
from ..compose.window import goes_round
from ..field.sphere_field import SphereField
from ..panorama.canvas import Canvas
from ..raster.enlarging import enlarged_box
from ..system.json_values import plain
from .exposure_entry import exposure_entry, exposure_warnings
from .options import RIG, WARNING
from .report import (
    SCHEMA,
    canvas_entry,
    dense_entry,
    depth_entry,
    how_holes_are_shown,
    left_out_entry,
    options_entry,
    picture_entry,
    slide_entry,
)
from .rig_figures import focal_spread, map_errors, residuals, scale_kind, shares, weak_links

if TYPE_CHECKING:
    from ..alignment import Alignment
    from ..compose.decided import Decided
    from ..options import StitchOptions
    from ..pictures.picture import Picture


# Of a kind of scale: how sure it is, why, and what to do.
_UNSURE_SCALE = {
    "continuity": (
        "only guessed by depth going on from one to the other", "no three of them show the same things",
        "take more pictures between them, so that each thing is in three",
    ),
    "none": (
        "not known", "near and far hardly move against each other from one to the other",
        "this does no harm to what they show; with other places of the viewpoint depth is doubtful there",
    ),
}  # fmt: skip


def make_rig_report(
    options: StitchOptions, pictures: Sequence[Picture], alignment: Alignment, canvas: Canvas,
    decided: Sequence[Decided], appearance: dict[str, float], shows: NDArray[np.bool_], inpainted: int,
    labels: NDArray[np.int16] | None, times: int = 1,
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """The report of a stitch of more than two pictures.

    Parameters
    ----------
    options, pictures, alignment, canvas, decided, appearance, shows, inpainted
        As for `make_report`; the alignment has a rig.
    labels : (H, W) int array, optional
        Which picture each pixel of the panorama comes from.
    times : int
        How many px of the panorama lie along one of the alignment's warp, of labels and of what was decided and
        counted there.

    Returns
    -------
    report : dict
        JSON-ready values.
    warnings : list of str
        In plain words, for the user.
    """
    rig, field, warp = alignment.rig, alignment.field, alignment.warp
    assert rig is not None and isinstance(field, SphereField)
    names = [picture.name for picture in pictures]
    area, looked_at = times**2, shows[times // 2 :: times, times // 2 :: times]
    folds, around = max(one.folds for one in decided), goes_round(canvas)
    open_px, inpainted = area * int(closed_holes(looked_at, None, around)[0].sum()), area * inpainted
    error = times * map_errors(warp, alignment.edges, rig.cameras)
    found, inliers = (sum(int(one) for one in counts) for counts in zip(
        *((len(edge.matches), edge.two_view.inliers.sum()) for edge in alignment.edges), strict=True
    ))  # fmt: skip
    contradicting = found - inliers if alignment.edges[0].matches.given else 0
    report = {
        "schema": SCHEMA,
        "pictures": _pictures(pictures, rig, decided, shares(labels, warp.maps, int(shows.sum())), area),
        "left_out": left_out_entry(alignment.left_out),
        "options": options_entry(options, alignment) | {"fade": options.fade, "viewpoint": options.viewpoint},
        "matches": {
            "found": found, "inliers": inliers, "noise_px": rig.noise_px, "contradicting": contradicting,
        },
        "rig": _rig_entry(rig, names),
        "field": {
            "kind": options.field, "smoothing": field.depth.smoothing, "centres": len(field.depth.inner.centres),
            "leave_one_out_px": times * field.leave_one_out_px,
            "negative_share": float((rig.inverse_ranges < 0).mean()) if len(rig.inverse_ranges) else 0.0,
            "dense": dense_entry(alignment.dense_sphere, ("found",)),
        },
        "slide": slide_entry(alignment.slide),
        "canvas": canvas_entry(canvas, rig.cameras[0].K),
        "depth": depth_entry(alignment.scale),
        "composition": {
            "light": exposure_entry(pictures, decided),
            "occluded_px": area * sum(int(one.hidden.sum()) for one in decided),
            "hole_px": open_px + inpainted, "inpainted_px": inpainted,
            "holes": [enlarged_box(box, times) for box in closed_holes(looked_at, False, around)[1]],
        },
        "measured": {
            "alignment_median_px": _percentile(error, 50), "alignment_p95_px": _percentile(error, 95),
            "folds": folds, **appearance,
        },
    }  # fmt: skip
    warnings = [*rig_warnings(rig, names), *_about_given(contradicting, found)]
    bodies = called_of_bodies(names, rig.cameras)
    warnings += exposure_warnings(list(bodies.values()), [decided[number].exposure for number in bodies])
    if canvas.cropped and canvas.projection is not None:
        warnings.append(
            f"the pictures reach too far for a {canvas.projection.kind} panorama and were cropped there; "
            "--projection equirectangular shows them whole"
        )
    if folds > WARNING.fold_share:
        warnings.append(f"the warp folds over in {folds:.1%} of a picture: look for doubled or torn things there")
    holes = inpainted if options.holes == "inpaint" else open_px
    if holes > WARNING.hole_share * shows.size:
        warnings.append(f"{holes} pixels are shown by no picture: the panorama is {how_holes_are_shown(options)}")
    return plain(report), warnings


def _pictures(
    pictures: Sequence[Picture], rig: Rig, decided: Sequence[Decided], share: Sequence[float], area: int
) -> list[dict[str, Any]]:
    """What is known of each picture, and what became of it; `place` in units of the longest baseline; area: px of the
    panorama in each that was decided about."""
    seen, error = rig.observations, residuals(rig)
    entries = []
    for number, (picture, camera) in enumerate(zip(pictures, rig.cameras, strict=True)):
        own = (seen.picture == number) & seen.used
        entry = picture_entry(picture, camera)
        entry["camera"] |= {
            "focal_deviation": _of(rig.focal_deviation, number), "lens": _of(rig.lenses, number),
            "principal": camera.K[:2, 2], "R": rig.R[number], "t": rig.t[number],
        }  # fmt: skip
        entries.append(entry | {
            "place": rig.centres[number], "place_deviation": place_deviation(rig, number),
            "inliers": int(own.sum()), "residual_px": float(np.median(error[own])) if own.any() else None,
            "hidden_px": area * int(decided[number].hidden.sum()), "share": share[number],
        })  # fmt: skip
    return entries


def _rig_entry(rig: Rig, names: Sequence[str]) -> dict[str, Any]:
    """How the pictures hang together."""
    return {
        "edges": [
            {
                "pictures": [names[edge.i], names[edge.j]], "numbers": [edge.i, edge.j], "matches": edge.matches,
                "inliers": edge.inliers, "noise_px": edge.noise_px, "parallax_px": edge.parallax_px,
                "off_degrees": edge.off_degrees, "baseline": edge.baseline,
            }
            for edge in rig.edges
        ],
        "points": len(rig.rays), "loop_degrees": rig.loop_degrees, "scale": scale_kind(rig),
        "stations": [[names[number] for number in station] for station in rig.stations],
        "focal_guesses": [
            {"focal_px": guess.focal, "k1": guess.k1, "cost": guess.cost} for guess in rig.guesses
        ],
        "focal_spread": focal_spread(rig),
    }  # fmt: skip


def rig_warnings(rig: Rig, names: Sequence[str]) -> list[str]:
    """What is doubtful, and what to do about it."""
    out = []
    for edge in weak_links(rig):
        between = f"{names[edge.i]} and {names[edge.j]}"
        out.append(
            f"only {edge.inliers} matches hold {between} together, and with them all that hangs on either: take more "
            f"pictures between {between}"
        )
    kind = scale_kind(rig)
    if kind in ("continuity", "none"):
        loose = [edge for edge in rig.edges if edge.baseline != "measured"]
        pairs = ", ".join(f"{names[edge.i]} and {names[edge.j]}" for edge in loose[: RIG.most_named])
        how, why, help_ = _UNSURE_SCALE[kind]
        out.append(f"how far apart some pictures were taken is {how} ({pairs}), since {why}: {help_}")
    if focal_spread(rig) > RIG.same_focal:
        listed = ", ".join(f"{guess.focal:.0f} px" for guess in rig.guesses)
        out.append(
            f"the focal length is not sure: {listed} explain the pictures almost alike, and the first is used; give it "
            "(--focal35, --focal-px) if you know it"
        )
    negative = float((rig.inverse_ranges < 0).mean()) if len(rig.inverse_ranges) else 0.0
    if negative > WARNING.behind_infinity_share and rig.t.any():
        out.append(
            f"{negative:.0%} of the points lie beyond infinity: the places of the pictures or the focal length "
            f"({rig.cameras[0].focal:.0f} px) are doubtful, and with them depth"
        )
    return out


def _about_given(contradicting: int, found: int) -> list[str]:
    """A warning about matches that the user gave and that are not used."""
    if not contradicting:
        return []
    return [f"{contradicting} of the {found} given matches contradict the rest and are left out: correct them"]


def place_deviation(rig: Rig, number: int) -> float | None:
    """The deviation of a picture's place; None where it may be anywhere, however large a number the bundle gives."""
    deviation = _of(rig.position_deviation, number)
    return None if deviation is None or not deviation <= RIG.most_place_deviation else float(deviation)


def _of(values: Sequence[Any] | NDArray[Any], number: int) -> Any:
    """What is said of one picture, None where nothing is."""
    return values[number] if len(values) else None


def _percentile(values: NDArray[np.float64], share: float) -> float:
    return float(np.percentile(values, share)) if values.size else float("nan")
