"""What a stitch leaves on disk: panorama, layers, warp and report, each as bytes for `OutputFiles`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..pictures.encoding import encode_into, encode_picture, output_bits
from ..pictures.exr import ExrForm
from ..pictures.naming import VIEWS, view_name
from ..raster.arrays import cut
from ..raster.colour import decode
from ..raster.enlarging import repeated
from ..system.errors import BadRequest
from ..system.output_files import OutputFiles
from .depth.mesh import mesh_bytes
from .depth.range_image import range_bytes, range_image
from .json_file import json_bytes
from .match_table import match_file
from .programs.written import check_cameras, write_cameras
from .rig_page import rig_page
from .sphere_part import sphere_part_of
from .warp_file import write_warp

if TYPE_CHECKING:
    from ..pipeline import StitchResult

# Version of the layers' folder (docs/formats.md).
LAYERS_FORMAT = 2
# Files of a layers' folder. Which picture each pixel comes from, and the same in the form that --mask takes: only where
# there is a seam.
LABELS, SEAM = "labels", "seam"
# What was filled in though neither picture saw it: only where that is asked for.
INPAINTED = "inpainted"
CONFIDENCE, CANVAS = "confidence", "canvas.json"
# Characters of a picture's name in that of its layer: three bytes each, and a file system takes 255.
LONGEST_NAME = 70
_NOT_IN_NAMES = re.compile(r"[^\w.() +-]")


@dataclass(frozen=True)
class OutputRequest:
    """Where the results go.

    Attributes
    ----------
    panorama : Path
        Its suffix says the format.
    report : Path, optional
        .json; matches and seconds go beside it, and of more than two pictures a page.
    layers : Path, optional
        A folder.
    warp : Path, optional
        .npz.
    cameras : Path, optional
        Its name says the form (see `form_of`).
    depth : Path, optional
        .exr.
    mesh : Path, optional
        .glb.
    exr : ExrForm
        How panorama and layers are written as .exr.
    """

    panorama: Path
    report: Path | None = None
    layers: Path | None = None
    warp: Path | None = None
    cameras: Path | None = None
    depth: Path | None = None
    mesh: Path | None = None
    exr: ExrForm = ExrForm()

    @property
    def timing(self) -> Path | None:
        """Seconds have a file of their own beside the report, so that the report is the same for the same input."""
        return None if self.report is None else self.report.with_name(self.report.stem + ".timing.json")

    @property
    def page(self) -> Path | None:
        """The page about more than two pictures lies beside the report."""
        return None if self.report is None else page_beside(self.report)

    @property
    def matches(self) -> Path | None:
        """The matches lie beside the report, in the form that --matches takes."""
        return None if self.report is None else self.report.with_name(self.report.stem + ".matches.csv")


def page_beside(report: Path) -> Path:
    """Where the page about more than two pictures lies."""
    return report.with_suffix(".html")


def check(
    request: OutputRequest, files: OutputFiles, pictures: Sequence[str], seam: bool = True, inpainted: bool = True,
    slides: bool = True,
) -> None:  # fmt: skip
    """Checks, before the work begins, that everything asked for could be written.

    Parameters
    ----------
    request : OutputRequest
    files : OutputFiles
        What is written through later.
    pictures : sequence of str
        Names of the pictures' files, after which their layers are called.
    seam, inpainted, slides : bool
        Whether the stitch will have a seam, whether its holes are to be filled, and whether its viewpoint may slide.

    Raises
    ------
    BadRequest
        A format that is not written, one file for two outputs, or files of another stitch in the folder of layers.
    UnwritableOutput
        The system does not let it be written, or it exists and is not to be replaced.
    """
    output_bits((8,), request.panorama.suffix)
    for what, path, suffix in (
        ("warp", request.warp, ".npz"), ("depth", request.depth, ".exr"), ("mesh", request.mesh, ".glb"),
    ):  # fmt: skip
        if path is not None and path.suffix.lower() != suffix:
            raise BadRequest(f"the {what} is written as {suffix}, not {path.suffix or 'a file of no kind'}")
    if request.cameras is not None and len(set(pictures)) < len(pictures):
        twice = next(name for number, name in enumerate(pictures) if name in pictures[:number])
        raise BadRequest(f"cameras are written by name, and two pictures are called {twice}: rename one of them")
    cameras = [] if request.cameras is None else check_cameras(request.cameras, files)
    named = (
        request.panorama, request.report, request.timing, request.matches, request.warp, *cameras, request.depth,
        request.mesh,
    )  # fmt: skip
    page = request.page if len(pictures) > 2 else None
    single = [path for path in (*named, page) if path is not None]
    files.check(*single)
    if request.layers is not None:
        names = layer_files(pictures, (".png", ".exr"))
        files.check_folder(request.layers, names)
        if not _holds_views(request.layers, pictures):  # which of them are spheres is only known later
            _refuse_other_files(request.layers, _possible_files(pictures, seam, inpainted, slides))
        taken = {(request.layers / name).resolve() for name in names}
        for path in single:
            if path.resolve() in taken:
                raise BadRequest(f"{path}: named for two outputs, a layer is one; give each its own name")


def _possible_files(pictures: Sequence[str], seam: bool, inpainted: bool, slides: bool) -> list[str]:
    """Files that a folder of layers may hold: of more than two pictures any may come first, or be left out."""
    exact = layer_files(pictures, (".png", ".exr"), seam, inpainted, slides)
    if len(pictures) == 2:
        return exact
    return [*exact, f"{SEAM}.png"] + [
        layer_stem(number, name) + suffix for number in range(len(pictures)) for name in pictures
        for suffix in (".png", ".exr")
    ]  # fmt: skip


def _holds_views(folder: Path, pictures: Sequence[str]) -> bool:
    """Whether a folder holds layers of a sphere's views, the sphere being one of these pictures."""
    views = {layer_stem(0, view_name(name, view))[2:] for name in pictures for view in VIEWS}
    return any(path.stem[2:] in views for path in folder.glob("[0-9][0-9]_*.*"))


def _refuse_other_files(folder: Path, names: Sequence[str]) -> None:
    """Raises BadRequest if the folder holds files of another stitch that would stay: they would be taken for this
    one's."""
    layers = sorted(path.name for path in folder.glob("[0-9][0-9]_*.*") if path.suffix in (".png", ".exr"))
    masks = [f"{mask}.png" for mask in (LABELS, SEAM, INPAINTED, _occluded(0)) if (folder / f"{mask}.png").exists()]
    others = [name for name in (*layers, *masks) if name not in names]
    if others:
        raise BadRequest(
            f"{folder}: holds files of another stitch that this one does not write ({', '.join(others[:3])}"
            f"{', …' if others[3:] else ''}); name another folder, or remove them"
        )


def layer_stem(number: int, name: str) -> str:
    """File name of a picture's layer without suffix: its number, and its name, shortened, in characters that any file
    system takes."""
    return f"{number:02d}_{_NOT_IN_NAMES.sub('_', Path(name).stem)[:LONGEST_NAME]}"


def layer_files(
    pictures: Sequence[str], suffixes: Sequence[str] = (".png",), seam: bool = True, inpainted: bool = True,
    slides: bool = True,
) -> list[str]:  # fmt: skip
    """Names of all files of a layers' folder, for pictures of these names; seam, inpainted, slides: whether to count
    the files that only a stitch with a seam, with filled holes, or with a viewpoint that may slide has."""
    out = [layer_stem(number, name) + suffix for number, name in enumerate(pictures) for suffix in suffixes]
    masks = [_occluded(number) for number in range(0 if slides else 1, len(pictures))] + [CONFIDENCE]
    masks += [LABELS, SEAM][: 2 if len(pictures) == 2 else 1] if seam else []
    masks += [INPAINTED] if inpainted else []
    return out + [f"{mask}.png" for mask in masks] + [CANVAS]


def _occluded(number: int) -> str:
    return f"occluded_{number:02d}"


def write(result: StitchResult, request: OutputRequest, files: OutputFiles) -> list[str]:
    """Encodes every requested file and stages it; `files` puts all in place together when it is closed.

    Parameters
    ----------
    result : StitchResult
    request : OutputRequest
    files : OutputFiles

    Returns
    -------
    list of str
        Warnings about what a format could not hold, which are in the report too.

    Raises
    ------
    UnwritableOutput
        A panorama that its format cannot hold, or a file that cannot be written.
    DegenerateGeometry
        Depth or cameras of another program are asked for, and there are none.
    """
    reference = result.pictures[0]
    alpha = None if result.panorama.alpha.min() >= 1.0 else result.panorama.alpha
    suffix = request.panorama.suffix
    warnings = list(files.add_by(request.panorama, lambda file: encode_into(
        file.write, result.panorama.light, alpha, result.bits, suffix, reference.icc, reference.exif, request.exr,
        sphere_part_of(result),
    )))  # fmt: skip
    if request.layers is not None:
        _add_layers(result, request.layers, request.exr, files)
    if request.warp is not None:
        files.add_by(request.warp, lambda file: write_warp(result, file))
    if request.cameras is not None:
        warnings += write_cameras(result, request.cameras, files)
    warnings += add_depth(result, request.depth, request.mesh, files)
    if request.report is not None and request.timing is not None and request.matches is not None:
        add_report(result, [*result.warnings, *warnings], request.report, request.matches, request.timing, files)
    return warnings


def add_depth(result: StitchResult, depth: Path | None, mesh: Path | None, files: OutputFiles) -> list[str]:
    """Stages the ranges and the mesh, where they are asked for; returns warnings. Raises DegenerateGeometry."""
    if depth is None and mesh is None:
        return []
    ranges = range_image(result)
    warnings: list[str] = []
    if depth is not None:
        files.add(depth, range_bytes(ranges))
    if mesh is not None:
        data, warned = mesh_bytes(result, ranges)
        warnings += warned
        files.add(mesh, data)
    return warnings


def add_report(
    result: StitchResult, warnings: list[str], report: Path, matches: Path, timing: Path, files: OutputFiles
) -> None:
    """Stages the report, with these warnings in place of its own; the matches; the seconds; and of more than two
    pictures the page."""
    files.add(report, json_bytes({**result.report, "warnings": warnings}))
    files.add(matches, match_file(result))
    files.add(timing, json_bytes({"seconds": result.seconds}))
    if result.rig is not None:
        files.add(page_beside(report), rig_page(result).encode(errors="replace"))


def _add_layers(result: StitchResult, folder: Path, exr: ExrForm, files: OutputFiles) -> None:
    """Stages everything of a layers' folder."""
    place, names = result.spread, [picture.name for picture in result.pictures]

    def in_full(values: NDArray[Any]) -> NDArray[Any]:
        """What lies on the warp's canvas (h, w) in px of the panorama."""
        return cut(repeated(values, result.times), place)

    if result.rig is not None or _holds_views(folder, names):
        _refuse_other_files(folder, layer_files(names, (".png", ".exr")))
    for number, picture in enumerate(result.pictures):
        layer = result.full_layer(number).within(place)
        _add_layer(files, folder / layer_stem(number, picture.name), layer, result, exr)
    asked = result.report["options"]
    first = 0 if asked["slide"] else 1  # from its own place the reference sees all that it shows
    masks = {
        _occluded(number): _mask_bytes(in_full(mask)) for number, mask in enumerate(result.occluded)
        if number >= first
    }  # fmt: skip
    masks[CONFIDENCE] = _mask_bytes(in_full(result.confidence))
    if asked["holes"] != "transparent":
        masks[INPAINTED] = _mask_bytes(in_full(result.inpainted))
    labels = result.full_labels()
    if labels is not None:
        masks[LABELS] = _label_bytes(labels, len(result.pictures))
        if result.rig is None:
            masks[SEAM] = _mask_bytes(labels > 0, result.panorama.alpha > 0)
    for name, data in masks.items():
        files.add_to_folder(folder, f"{name}.png", data)
    about = {
        "format": LAYERS_FORMAT, "size": [result.canvas.width, result.canvas.height],
        "names": names, "projection": result.report["canvas"]["projection"],
    }  # fmt: skip
    files.add_to_folder(folder, CANVAS, json_bytes(about))


def _add_layer(files: OutputFiles, path: Path, layer: Layer, result: StitchResult, exr: ExrForm) -> None:
    """Stages one layer as .png, and as .exr too where a picture is of floats, which a PNG clips."""
    icc, exif = result.pictures[0].icc, result.pictures[0].exif
    for bits, suffix in ((result.bits, ".png"), (32, ".exr"))[: 2 if result.bits == 32 else 1]:
        data, _ = encode_picture(layer.light, layer.alpha, bits, suffix, icc, exif, exr)
        files.add_to_folder(path.parent, path.name + suffix, data)


def _label_bytes(labels: NDArray[np.int16], count: int) -> bytes:
    """A gray PNG of which picture each pixel (H, W) comes from: its number + 1, 0 for none; 16-bit beyond 254
    pictures."""
    values = (labels + 1).astype(np.uint8 if count < 255 else np.uint16)
    png: bytes = cv2.imencode(".png", values)[1].tobytes()
    return png


def _mask_bytes(mask: NDArray[Any], shown: NDArray[np.bool_] | None = None) -> bytes:
    """A gray PNG of a mask, or of values 0 to 1 (H, W) without a display curve, 1 = white; transparent where not
    `shown` (H, W)."""
    levels = np.rint(255 * mask.astype(np.float32)).astype(np.uint8)
    alpha = None if shown is None else shown.astype(np.float32)
    return encode_picture(decode(levels[..., None]), alpha, 8, ".png")[0]
