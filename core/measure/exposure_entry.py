"""What was done to the pictures' light, for the report and in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compose.options import EXPOSURE
from ..pictures.raw_clipping import clipped_share
from ..raster.arrays import in_any_channel
from .options import WARNING

if TYPE_CHECKING:
    from ..compose.decided import Decided
    from ..compose.tone.exposure import Exposure
    from ..pictures.picture import Picture


def exposure_entry(pictures: Sequence[Picture], decided: Sequence[Decided]) -> dict[str, Any]:
    """What was fitted and applied: lists hold one entry for each picture, the reference first."""
    exposures = [one.exposure for one in decided]
    curves = [one.curve for one in exposures]
    return {
        "gain": [one.gain for one in exposures],
        "stops": [float(np.log2(np.median(one.gain))) for one in exposures],
        "vignetting": [exposures[-1].vignetting.halfway, exposures[-1].vignetting.corner],
        "curve": [None if one is None else [one.slope, one.dark, one.bright] for one in curves],
        "clipped": [_clipped_share(picture) for picture in pictures],
        "overexposed": [one.overexposed for one in exposures],
        "restored": [one.clipped is not None for one in exposures],
    }


def exposure_warnings(names: Sequence[str], exposures: Sequence[Exposure]) -> list[str]:
    """What of the light could not be matched, and which picture is over-exposed beside the other; names: what
    the pictures are called, with a sphere in place of its views."""
    out = []
    other, both = ("other", "both") if len(exposures) == 2 else ("others", "others too")
    for name, one in zip(names, exposures, strict=True):
        if one.why_not:
            out.append(f"the exposure of {name} could not be matched: {one.why_not}; its border may show")
        if one.overexposed > WARNING.overexposed_share:
            out.append(
                f"{name} is over-exposed beside the {other}: {one.overexposed:.0%} of what {both} show is "
                "clipped in it alone; there, colours are guessed and detail is missing"
            )
    return out


def _clipped_share(picture: Picture) -> float:
    """Share of a picture that is clipped in any channel; float pictures do not clip, but for camera RAW."""
    if picture.bits == 32:
        return clipped_share(picture)
    return float(in_any_channel(picture.view >= EXPOSURE.clipped_level).mean())
