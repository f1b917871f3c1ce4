"""`edf demo`: render a pair, stitch it on the reference's plane, measure the result against the truth, and say so in a
few lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..core.cameras.sources import CameraRequest
from ..core.output.outputs import OutputRequest, write
from ..core.pictures.encoding import encode_picture
from ..core.pipeline import stitch
from ..core.system.output_files import OutputFiles
from .measures import figures, on_the_wide_canvas, truth_of, whole_picture
from .recipes import RECIPES, Difficulty
from .rendered import rendered_pair
from .stitches import ON_REFERENCE

SCENE, SIZE = "tabletop", (640, 480)
MEASURES = (
    ("rotation_deg", "rotation error", "degrees"),
    ("epipole_deg", "direction of the baseline, error", "degrees"),
    ("h_inf_px", "infinite homography, median transfer error", "px"),
    ("projectivity_px", "distance from the true lines, beyond the overlap", "px"),
    ("alignment_px", "distance from the true target pixel, median", "px"),
    ("overlap_psnr_db", "overlap of the two pictures, PSNR", "dB"),
    ("whole_psnr_db", "panorama against the true panorama, PSNR", "dB"),
)
LABEL = 50  # characters
FILES = ("panorama.png", "warp.npz", "report.json", "report.timing.json", "report.matches.csv", "truth.png")


def run_demo(folder: Path, overwrite: bool, progress: Callable[[str, float], None] | None = None) -> list[str]:
    """Renders into a folder's `pictures`, writes panorama, true panorama, warp and report; returns what to print.

    Raises RenderFailed where there is nothing to render with.
    """
    with OutputFiles(overwrite) as files:
        files.check_folder(folder, FILES)
        if progress:
            progress("render", 0.0)
        pair = rendered_pair(RECIPES[SCENE], Difficulty(), SIZE, folder / "pictures")
        # a camera's EXIF would tell the focal length
        known = CameraRequest(focal_px=(float(pair.cameras["reference"].K[0, 0]),))
        result = stitch((pair.reference, pair.target), replace(ON_REFERENCE, camera=known), progress)
        truth = truth_of(pair)
        picture, shown = on_the_wide_canvas(result, truth)
        measured = figures(result, truth) | whole_picture(picture, shown, truth)
        files.add_to_folder(folder, "truth.png", encode_picture(pair.wide, None, 8, ".png")[0])
        write(result, OutputRequest(folder / "panorama.png", folder / "report.json", warp=folder / "warp.npz"), files)
    lines = [f"{label:<{LABEL}}{measured[key]:8.3f} {unit}" for key, label, unit in MEASURES]
    rendered = sorted((folder / "pictures").glob("*/*.png"))
    return [*lines, *map(str, rendered), *(str(folder / name) for name in FILES)]
