"""`edf demo`: render a pair and a set of five, stitch each, measure the results against the truth, and say so in a few
lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core.cameras.sources import CameraRequest
from ..core.output.outputs import OutputRequest, write
from ..core.pictures.encoding import encode_picture
from ..core.pipeline import stitch
from ..core.raster.sampling import fetch
from ..core.system.errors import StitchError
from ..core.system.output_files import OutputFiles
from .measures import figures, on_the_wide_canvas, truth_of, whole_picture
from .recipes import RECIPES, Difficulty
from .rendered import rendered_pair
from .sets.recipes import SETS
from .sets.rendered_set import rendered_set
from .sets.set_measures import (
    Found,
    SetTruth,
    colour_figures,
    map_figures,
    on_the_sphere,
    pose_figures,
    range_figures,
)
from .sets.set_stitches import ON_SPHERE, told_pictures
from .stitches import ON_REFERENCE

PAIR, PAIR_SIZE = "tabletop", (640, 480)
SET, SET_SIZE = "small_room", (480, 360)
MEASURES = (
    ("rotation_deg", "rotation error", "degrees"),
    ("epipole_deg", "direction of the baseline, error", "degrees"),
    ("h_inf_px", "infinite homography, median transfer error", "px"),
    ("projectivity_px", "distance from the true lines, beyond the overlap", "px"),
    ("alignment_px", "distance from the true target pixel, median", "px"),
    ("overlap_psnr_db", "overlap of the two pictures, PSNR", "dB"),
    ("whole_psnr_db", "panorama against the true panorama, PSNR", "dB"),
)
SET_MEASURES = (
    ("rotation_max_deg", "rotation error, worst of all", "degrees"),
    ("position_max_mm", "place of a camera, error, worst of all", "mm"),
    ("focal_percent", "focal length, error", "%"),
    ("overlap_px", "distance from the true pixel, seen by several", "px"),
    ("alone_px", "distance from the true pixel, seen by one", "px"),
    ("range_percent", "range of what is seen, error, median", "%"),
    ("psnr_db", "panorama against the true panorama, PSNR", "dB"),
)
LABEL = 50  # characters
FILES = ("panorama.png", "warp.npz", "report.json", "report.timing.json", "report.matches.csv", "truth.png")
# Of the set, in a folder of its own.
SET_FOLDER = "room"
SET_FILES = (
    "panorama.png", "truth.png", "report.json", "report.html", "report.timing.json", "report.matches.csv",
)  # fmt: skip
# All around, whole, as the truth is known: from the first picture's place.
ALL_AROUND = replace(ON_SPHERE, projection="cylindrical", crop="inscribed")
Tell = Callable[[str, float], None]


def run_demo(folder: Path, overwrite: bool, progress: Tell | None = None) -> list[str]:
    """Renders into a folder's `pictures` and `sets`, writes panoramas, true panoramas, reports and the pair's warp;
    returns what to print.

    Raises RenderFailed where there is nothing to render with.
    """
    tell = progress or (lambda *_: None)
    with OutputFiles(overwrite) as files:
        files.check_folder(folder, FILES)
        files.check_folder(folder / SET_FOLDER, SET_FILES)
        of_pair = _pair(folder, files, lambda stage, share: tell(stage, share / 2))
        of_set = _set(folder, files, lambda stage, share: tell(stage, (1 + share) / 2))
    rendered = sorted([*(folder / "pictures").glob("*/*.png"), *(folder / "sets").glob("*/*.png")])
    left = [folder / name for name in FILES] + [folder / SET_FOLDER / name for name in SET_FILES]
    return [*of_pair, *of_set, *map(str, rendered), *map(str, left)]


def _pair(folder: Path, files: OutputFiles, tell: Tell) -> list[str]:
    """The pair on the reference's plane; returns what was measured."""
    tell("render", 0.0)
    pair = rendered_pair(RECIPES[PAIR], Difficulty(), PAIR_SIZE, folder / "pictures")
    # a camera's EXIF would tell the focal length
    known = CameraRequest(focal_px=(float(pair.cameras["reference"].K[0, 0]),))
    result = stitch((pair.reference, pair.target), replace(ON_REFERENCE, camera=known), tell)
    truth = truth_of(pair)
    picture, shown = on_the_wide_canvas(result, truth)
    measured = figures(result, truth) | whole_picture(picture, shown, truth)
    files.add_to_folder(folder, "truth.png", encode_picture(pair.wide, None, 8, ".png")[0])
    write(result, OutputRequest(folder / "panorama.png", folder / "report.json", warp=folder / "warp.npz"), files)
    return said("Two pictures", MEASURES, measured)


def _set(folder: Path, files: OutputFiles, tell: Tell) -> list[str]:
    """The set on a cylinder, seen from the first picture's place; returns what was measured."""
    tell("render", 0.0)
    rendered = rendered_set(SETS[SET], SET_SIZE, folder / "sets")
    result = stitch(told_pictures(rendered), ALL_AROUND, tell)
    if result.rig is None or len(result.rig) < len(rendered.pictures):
        raise StitchError("the demo's set did not connect: " + " ".join(result.warnings))
    truth = SetTruth.of(rendered)
    found = Found.of(result, truth)
    measured = pose_figures(found) | map_figures(found)[0] | colour_figures(*on_the_sphere(found), truth)[0]
    measured["range_percent"] = 100 * float(np.expm1(range_figures(found)["range_log"]))
    to = folder / SET_FOLDER
    files.add_to_folder(to, "truth.png", encode_picture(true_panorama(found), None, 8, ".png")[0])
    write(result, OutputRequest(to / "panorama.png", to / "report.json"), files)
    return said(f"{len(rendered.pictures)} pictures", SET_MEASURES, measured)


def true_panorama(found: Found) -> NDArray[np.float32]:
    """The true sphere (H, W, 3), scene-linear, as a round panorama of the set lies."""
    canvas, sphere = found.result.canvas, found.truth.rendered.sphere
    assert canvas.projection is not None
    plane = np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1)
    x, y = sphere.pixels(canvas.projection.rays(plane) @ found.gauge)
    # bicubic sampling asks for two pixels to every side, and the sphere goes on behind either end
    around = np.pad(found.truth.rendered.shown, ((0, 0), (2, 2), (0, 0)), mode="wrap")
    around = np.pad(around, ((2, 2), (0, 0), (0, 0)), mode="edge")
    light: NDArray[np.float32] = fetch(around, (x + 2).astype(np.float32), (y + 2).astype(np.float32))
    return np.maximum(light, 0)


def said(what: str, measures: tuple[tuple[str, str, str], ...], measured: dict[str, float]) -> list[str]:
    """A heading, and a line for each figure."""
    return [f"{what}:", *(f"{label:<{LABEL}}{measured[key]:8.3f} {unit}" for key, label, unit in measures)]
