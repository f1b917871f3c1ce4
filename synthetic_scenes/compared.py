"""The truth beside a rendered pair, for `edf compare`: what no photograph has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.cameras.sources import CameraRequest
from ..core.pipeline import StitchResult
from .measures import Truth, figures, hidden_quality, on_the_wide_canvas, truth_of, whole_picture
from .rendered import RenderedPair
from .rendered import _load as load_rendered  # a new name there would make every kept picture a stranger

# The validation's figures that a comparison shows, and what they are called there.
NAMES = {
    "alignment_px": "truth_alignment_px", "alignment_p95_px": "truth_alignment_p95_px",
    "projectivity_px": "truth_projectivity_px",
}  # fmt: skip


@dataclass(frozen=True)
class RenderedTruth:
    """A rendered pair and the truth about it."""

    pair: RenderedPair
    truth: Truth

    @property
    def camera(self) -> CameraRequest:
        """The true focal lengths, as EXIF would tell them."""
        cameras = self.pair.cameras
        return CameraRequest(focal_px=tuple(float(cameras[name].K[0, 0]) for name in ("reference", "target")))

    def figures(self, results: Mapping[str, StitchResult]) -> dict[str, dict[str, float]]:
        """Figures against the truth by field; whole pictures over the pixels that all of them show."""
        placed = {name: on_the_wide_canvas(result, self.truth) for name, result in results.items()}
        common = np.logical_and.reduce([shown for _, shown in placed.values()]) if placed else None
        out = {}
        for name, result in results.items():
            measured = figures(result, self.truth)
            whole = {} if common is None else whole_picture(placed[name][0], common, self.truth)
            out[name] = {
                **{ours: measured[theirs] for theirs, ours in NAMES.items()},
                **{f"truth_{key}": value for key, value in (whole | hidden_quality(result, self.truth)).items()},
            }
        return out


def truth_beside(folder: Path) -> RenderedTruth | None:
    """The truth in a folder of `edf validate`'s pictures; None where there is none."""
    if not ((folder / "cameras.json").is_file() and (folder / "wide_depth.npy").is_file()):
        return None
    pair = load_rendered(folder, (folder / "reference.exr").is_file())
    return RenderedTruth(pair, truth_of(pair))
