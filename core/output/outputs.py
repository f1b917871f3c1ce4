"""What a stitch leaves on disk: panorama, layers, warp and report, each as bytes for `OutputFiles`."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..measure.report import plain
from ..panorama.layers import Layer
from ..pictures.encoding import encode_picture, output_bits
from ..pipeline import StitchResult
from ..raster.arrays import cut
from ..raster.colour import decode
from ..system.errors import BadRequest
from ..system.output_files import OutputFiles
from .match_table import match_file

# What lies beside the layers, by its name in the result: masks, white where they hold, and shares 0..1.
MASKS = ("occluded", "confidence")
# Where the pictures meet, in the form that --mask takes; only where there is a seam.
SEAM = "seam"
# What was filled though neither picture saw it; only where that is asked for.
INPAINTED = "inpainted"


@dataclass(frozen=True)
class OutputRequest:
    """Where the results go: the panorama always, the others where a path is given."""

    panorama: Path
    report: Path | None = None
    layers: Path | None = None
    warp: Path | None = None

    @property
    def timing(self) -> Path | None:
        """Seconds stand in a file of their own beside the report, which is the same for the same input."""
        return None if self.report is None else self.report.with_name(self.report.stem + ".timing.json")

    @property
    def matches(self) -> Path | None:
        """The matches stand beside the report, in the form that --matches takes."""
        return None if self.report is None else self.report.with_name(self.report.stem + ".matches.csv")


def check(request: OutputRequest, files: OutputFiles) -> None:
    """Asks before the work whether everything could be written. Raises BadRequest or UnwritableOutput."""
    output_bits((8,), request.panorama.suffix)
    if request.warp is not None and request.warp.suffix.lower() != ".npz":
        raise BadRequest(f"the warp is written as .npz, not {request.warp.suffix or 'a file of no kind'}")
    named = (request.panorama, request.report, request.timing, request.matches, request.warp)
    single = [path for path in named if path is not None]
    files.check(*single)
    if request.layers is not None:
        names = [f"{layer}{suffix}" for layer in ("reference", "target") for suffix in (".png", ".exr")]
        names += [f"{mask}.png" for mask in (*MASKS, SEAM, INPAINTED)]
        files.check_folder(request.layers, names)
        taken = {(request.layers / name).resolve() for name in names}
        for path in single:
            if path.resolve() in taken:
                raise BadRequest(f"{path}: named for two outputs, a layer is one; give each its own name")


def write(result: StitchResult, request: OutputRequest, files: OutputFiles) -> list[str]:
    """Stages every requested file; returns warnings about what a file kind could not hold."""
    exif = result.reference.exif
    icc = result.reference.icc
    alpha = None if result.panorama.alpha.min() >= 1.0 else result.panorama.alpha
    data, warned = encode_picture(result.panorama.light, alpha, result.bits, request.panorama.suffix, icc, exif)
    files.add(request.panorama, data)
    warnings = list(warned)
    if request.layers is not None:
        for name, layer in (("reference", result.reference_layer), ("target", result.target_layer)):
            _add_layer(files, request.layers, name, layer.within(result.spread), result)
        for name in MASKS:
            mask = cut(getattr(result, name), result.spread)
            files.add_to_folder(request.layers, f"{name}.png", _mask_bytes(mask))
        if result.report["options"]["holes"] == "inpaint":
            filled = _mask_bytes(cut(result.inpainted, result.spread))
            files.add_to_folder(request.layers, f"{INPAINTED}.png", filled)
        if result.from_target is not None:
            seam = _mask_bytes(cut(result.from_target, result.spread), result.panorama.alpha > 0)
            files.add_to_folder(request.layers, f"{SEAM}.png", seam)
    if request.warp is not None:
        files.add(request.warp, warp_bytes(result))
    if request.report is not None and request.timing is not None and request.matches is not None:
        add_report(result, [*result.warnings, *warnings], request.report, request.matches, request.timing, files)
    return warnings


def add_report(
    result: StitchResult, warnings: list[str], report: Path, matches: Path, timing: Path, files: OutputFiles
) -> None:
    """Stages the report with these warnings, the matches, and the seconds."""
    files.add(report, json_bytes({**result.report, "warnings": warnings}))
    files.add(matches, match_file(result))
    files.add(timing, json_bytes({"seconds": result.seconds}))


def _add_layer(files: OutputFiles, folder: Path, name: str, layer: Layer, result: StitchResult) -> None:
    icc, exif = result.reference.icc, result.reference.exif
    files.add_to_folder(
        folder, f"{name}.png", encode_picture(layer.light, layer.alpha, result.bits, ".png", icc, exif)[0]
    )
    if result.bits == 32:
        files.add_to_folder(folder, f"{name}.exr", encode_picture(layer.light, layer.alpha, 32, ".exr", icc, exif)[0])


def _mask_bytes(mask: np.ndarray, shown: np.ndarray | None = None) -> bytes:
    """A gray PNG of a mask or of shares 0..1 (H, W), 1 white, plain numbers and no light; transparent where nothing is
    shown (H, W)."""
    levels = np.rint(255 * mask.astype(np.float32)).astype(np.uint8)
    alpha = None if shown is None else shown.astype(np.float32)
    return encode_picture(decode(levels[..., None]), alpha, 8, ".png")[0]


def warp_bytes(result: StitchResult) -> bytes:
    """The .npz (docs/formats.md): x' ~ H_inf p + inverse_depth e' for canvas pixels p + offset; NaN: a model lacks it.

    A round panorama has p = K r for unit rays r (see `projection`) and no offset, but projection (its name), focal (px
    per radian), centre (canvas px of the direction ahead) and rotation (from its axes to the reference camera's).
    """
    view, warp = result.two_view, result.warp.within(result.spread)
    # a field without depth slides nothing: inside, its e' is 0
    e_prime = view.e_prime if np.isfinite(warp.inverse_depth).any() else np.full(3, np.nan)
    arrays: dict[str, np.ndarray] = {
        "map_x": warp.map_x, "map_y": warp.map_y, "offset": np.array(warp.canvas.offset, np.int64),
        "F": view.F, "H_inf": view.H_inf, "e_prime": e_prime, "inverse_depth": warp.inverse_depth,
        "K": view.K, "K_prime": view.K_prime, "R": view.R, "t": view.t,
        "dist": result.cameras[0].distortion, "dist_prime": result.cameras[1].distortion,
    }  # fmt: skip
    projection = warp.canvas.projection
    if projection is not None:
        arrays |= {
            "offset": np.full(2, np.nan), "projection": np.array(projection.kind), "focal": np.array(projection.focal),
            "centre": np.array(projection.centre) + warp.canvas.offset, "rotation": projection.rotation,
        }  # fmt: skip
    return npz_bytes(arrays)


def npz_bytes(arrays: dict[str, np.ndarray]) -> bytes:
    """An .npz file of arrays, the same bytes whenever it is made (numpy.savez puts the time of day into it)."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)
    return buffer.getvalue()


def json_bytes(value: dict[str, Any]) -> bytes:
    """JSON as people read it; NaN and infinity become null."""
    return (json.dumps(plain(value), indent=1, ensure_ascii=False) + "\n").encode()
