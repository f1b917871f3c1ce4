"""What a panorama is worth as it is delivered: beyond the overlap, and whether things are whole or gone."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.measure.metrics import psnr, ssim
from ..core.pipeline import StitchResult
from ..core.raster.arrays import dilated
from ..core.raster.colour import decode, encode
from ..core.raster.sampling import fetch
from .measures import Truth, common_part, on_the_wide_canvas
from .rendered import RenderedPair

# Levels of 8 bit between which a picture's light is known well enough to tell its exposure.
DARKEST, BRIGHTEST = 5, 250
# px beside a thing's true place that are still its own: its rim is mixed with what lies behind.
RIM_PX = 3


def finished(result: StitchResult, pair: RenderedPair, truth: Truth) -> dict[str, float]:
    """Figures of a panorama on the reference's plane, made with all that the defaults do.

    delivered_target_only_psnr_db, delivered_target_only_ssim: see `target_only`; things_half, of worlds that name
    things: see `things_half`.
    """
    found = {f"delivered_{key}": value for key, value in target_only(result, truth).items()}
    return found | ({"things_half": things_half(result, pair, truth)} if pair.things else {})


def target_only(result: StitchResult, truth: Truth) -> dict[str, float]:
    """target_only_psnr_db, target_only_ssim: what the target alone sees, against the true panorama; what is not shown
    is black. One gain per channel is allowed for: no picture says which exposure is the true one."""
    picture, _ = on_the_wide_canvas(result, truth)
    return _alone(picture, truth, np.ones(truth.in_target.shape, bool), "target_only")


def target_only_together(
    picture: NDArray[np.uint8], common: NDArray[np.bool_], truth: Truth
) -> dict[str, float]:
    """target_only_common_psnr_db, target_only_common_ssim: the same of a picture as the true panorama lies, over what
    all show of it (H, W): a map that stretches too far leaves nothing black, and is no better for that."""
    return _alone(picture, truth, common, "target_only_common")


def _alone(picture: NDArray[np.uint8], truth: Truth, where: NDArray[np.bool_], name: str) -> dict[str, float]:
    alone = truth.in_target & ~truth.in_reference & where
    if not alone.any():
        return {f"{name}_psnr_db": math.nan, f"{name}_ssim": math.nan}
    exposed = evened(decode(picture), truth.picture, truth.in_reference)
    return {f"{name}_psnr_db": psnr(exposed, truth.picture, alone),
            f"{name}_ssim": ssim(exposed, truth.picture, alone)}  # fmt: skip


def evened(light: NDArray[np.float32], true: NDArray[np.uint8], where: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """A picture (H, W, 3), scene-linear, with one gain per channel that brings it nearest to the true one over a mask,
    where neither is too dark or too bright to tell."""
    picture = encode(light, 8)
    known = where & (picture > DARKEST).all(axis=-1) & (picture < BRIGHTEST).all(axis=-1)
    gain = np.median(decode(true)[known] / decode(picture)[known], axis=0) if known.any() else np.float32(1)
    return encode((light * gain).astype(np.float32), 8)


def things_half(result: StitchResult, pair: RenderedPair, truth: Truth) -> float:
    """How far things are from being whole or gone, of that which is farthest: the share of its true pixels that show it
    or that do not, whichever is less, or the pixels beside its place that show it, by the same area, if they are more.

    Which picture a pixel comes from, and where it is fetched there, tell whether it shows a thing.
    """
    here, there = common_part(result, truth)
    labels = np.zeros(result.alpha.shape, np.int16) if result.labels is None else result.labels
    shown: NDArray[np.uint8] = np.zeros(truth.in_target.shape, np.uint8)
    within = shown[there]
    for number, name in enumerate(("reference", "target")):
        picture_map = result.warp.maps[number].arrays()
        seen = fetch(pair.things[name][..., None], picture_map.x[here], picture_map.y[here], cv2.INTER_NEAREST)[..., 0]
        comes_from = (labels[here] == number) & (result.alpha[here] > 0.5)
        within[comes_from] = seen[comes_from]
    seen_at_all = np.where(truth.in_target | truth.in_reference, pair.things["wide"], 0)
    return max(_half(shown == number, seen_at_all == number) for number in np.unique(seen_at_all[seen_at_all > 0]))


def _half(shown: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """The figure of one thing: where (H, W) it is shown, and where it is."""
    area = int(true.sum())
    whole = int((shown & true).sum()) / area
    beside = int((shown & ~dilated(true, RIM_PX)).sum()) / area
    return max(min(whole, 1 - whole), beside)
