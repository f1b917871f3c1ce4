"""What `edf_stitch.stitch` gives: a finished panorama that can be saved, and shows itself in a notebook."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..choices import EXR_COMPRESSIONS, EXR_DEPTHS
from ..compose.stitch_result import StitchResult
from ..output.camera_file import camera_table
from ..output.depth.range_image import range_image
from ..output.outputs import OutputRequest, check, write
from ..pictures.encoding import encode_picture
from ..pictures.exr import ExrForm
from ..system.errors import BadRequest
from ..system.output_files import OutputFiles
from .messages import verdict_line
from .options import NOTEBOOK


@dataclass(frozen=True, repr=False, eq=False)
class Panorama(StitchResult):
    """A finished panorama and everything it was made of.

    Its last line in a notebook shows a small copy and the verdict. What a StitchResult has, it has as well; what most
    people need is:

    Attributes
    ----------
    pixels : ndarray (H, W, C) float32
        Colours, scene-linear.
    alpha : ndarray (H, W) float32
        Straight.
    depth : ndarray (H, W) float32
        Range of each pixel from its viewpoint, in metres or baselines.
    report : dict
        What was measured and decided, JSON-ready (docs/formats.md).
    warnings : tuple of str
        In plain words.
    cameras : tuple of Camera
        Of each picture, the reference first, with `source` in words: of a pair as they were known before the stitch.
    found_cameras : dict
        The cameras that were found, as a camera file has them.
    layers : tuple of Layer
        Each picture on the canvas, before exposure and blending: `pixels` and `alpha`.
    sources : tuple of Path
        The files that it was made of, which `save` never replaces.
    """

    sources: tuple[Path, ...] = ()

    @property
    def depth(self) -> NDArray[np.float32]:
        """Range (H, W) of each pixel from its viewpoint, in metres where a scale is known, else in baselines; infinity
        and NaN as in docs/formats.md. Raises DegenerateGeometry where the panorama has no depth."""
        return range_image(self).range

    @property
    def found_cameras(self) -> dict[str, Any]:
        """K, distortion, R and t of each picture by its name, as `cameras` of another call takes them."""
        return camera_table(self)

    def save(
        self, output: str | Path, *, report: str | Path | None = None, layers: str | Path | None = None,
        warp: str | Path | None = None, cameras_out: str | Path | None = None, depth: str | Path | None = None,
        mesh: str | Path | None = None, exr_depth: str = "float", exr_compression: str = "zip",
        overwrite: bool = False,
    ) -> list[str]:  # fmt: skip
        """Write the panorama, and what else is asked for, all of it or nothing.

        Parameters
        ----------
        output : str or Path
            .png, .jpg, .tif (8 or 16 bit, the deepest input's), .exr or .hdr (float).
        report, layers, warp, cameras_out, depth, mesh : str or Path, optional
            As the options of `edf stitch` of these names; `layers` is a folder.
        exr_depth, exr_compression : str
            Of .exr: "float" or "half"; "zip" or "dwab".
        overwrite : bool
            Whether files that exist may be replaced.

        Returns
        -------
        list of str
            Warnings about what a format could not hold.

        Raises
        ------
        BadRequest
            A format that is not written, one file for two outputs, or one that the panorama was made of.
        UnwritableOutput
            The system does not let it be written, or it exists and is not to be replaced.
        DegenerateGeometry
            Depth is asked for, and there is none.
        """
        for value, known in ((exr_depth, EXR_DEPTHS), (exr_compression, EXR_COMPRESSIONS)):
            if value not in known:
                raise BadRequest(f"{value!r} is not offered for .exr; choose from: {', '.join(known)}")
        request = OutputRequest(
            Path(output), report=_path(report), layers=_path(layers), warp=_path(warp), cameras=_path(cameras_out),
            depth=_path(depth), mesh=_path(mesh), exr=ExrForm(exr_depth, exr_compression),
        )  # fmt: skip
        with OutputFiles(overwrite, self.sources) as files:
            check(request, files, [picture.name for picture in self.pictures], self.labels is not None)
            return write(self, request, files)

    def __repr__(self) -> str:
        height, width = self.alpha.shape
        kind = self.report["canvas"]["projection"]["kind"]
        return f"<Panorama {width}×{height} of {len(self.pictures)} pictures, {kind}: {self._verdict}>"

    @property
    def _verdict(self) -> str:
        return verdict_line(self.report["verdict"])

    def _repr_png_(self) -> bytes:
        """A small copy, for notebooks."""
        pixels, alpha = _small(self, NOTEBOOK.side)
        return encode_picture(pixels, alpha, 8, ".png", self.pictures[0].icc)[0]

    def _repr_html_(self) -> str:
        """The same, with the verdict below it."""
        picture = b64encode(self._repr_png_()).decode()
        return f'<img src="data:image/png;base64,{picture}"><br>{escape(repr(self))}'


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)


def panorama_of(result: StitchResult, sources: Sequence[Path]) -> Panorama:
    """A result as Python users get it, of these files."""
    return Panorama(**{one.name: getattr(result, one.name) for one in fields(result)}, sources=tuple(sources))


def _small(result: StitchResult, side: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Colours (h, w, C) and alpha (h, w) of a panorama, averaged over squares until no side is longer."""
    height, width = result.panorama.alpha.shape
    step = -(-max(height, width) // side)
    rows, columns = height // step, width // step
    light, alpha = result.panorama.light, result.alpha
    colours, covered = np.zeros((rows, columns, light.shape[2]), np.float32), np.zeros((rows, columns), np.float32)
    for row in range(rows):
        part = slice(row * step, (row + 1) * step), slice(0, columns * step)
        weight = alpha[part].reshape(step, columns, step)
        covered[row] = weight.mean(axis=(0, 2))
        total = (light[part].reshape(step, columns, step, -1) * weight[..., None]).mean(axis=(0, 2))
        colours[row] = total / np.maximum(covered[row], np.finfo(np.float32).tiny)[:, None]
    return colours, covered
