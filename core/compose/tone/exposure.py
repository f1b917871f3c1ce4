"""Exposure and white balance, in scene-linear light: what is done to a picture's light so that it meets the others'.

Either one gain per channel matches a picture to the panorama so far, which keeps its values: a median of ratios between
means over small blocks, for the means forgive an alignment that is a pixel off and the median what moved. Or two
pictures meet at one exposure, with what more tells them apart (see `tone_fit`), and no light is blown (see `toned`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...choices import Exposing
from ...panorama.layers import Layer
from ...raster.arrays import Array
from ...raster.picture_map import CanvasMap
from ..options import EXPOSURE, OVERLAP
from .clipped import ClippedLight, ToldLight, clipped_light
from .tone_blocks import block_weights, bright_blocks, log_ratios, shared_blocks, weighted_median
from .tone_fit import fit_tone
from .tone_options import CLIPPED, TONE
from .toned import NO_VIGNETTING, Exposed, ToneCurve, Toned, Vignetting

TOO_LITTLE = "too little of what both pictures show is neither clipped nor dark"


@dataclass(frozen=True)
class Exposure:
    """What is done to a picture's light.

    Attributes
    ----------
    gain : (C,) float32 array
        What it is multiplied by.
    spread : (C,) float32 array
        Median absolute deviation of the blocks' log ratios; NaN where the gain is unknown.
    blocks : int
        How many blocks were measured; 0 where the gain is unknown and taken for 1.
    vignetting : Vignetting
        What the lens takes off towards the corners, which is given back.
    curve : ToneCurve or None
        By how much more the dark is raised than the bright.
    keeps_white : bool
        Whether highlights are rolled off below white, and white stays white.
    overexposed : float
        Share of what both pictures show that is clipped in this one alone.
    clipped : ClippedLight or None
        What is known of its clipped light.
    why_not : str
        In words, why it could not be matched to the other's; empty if it was, or was not to be.
    """

    gain: NDArray[np.float32]
    spread: NDArray[np.float32]
    blocks: int
    vignetting: Vignetting = NO_VIGNETTING
    curve: ToneCurve | None = None
    keeps_white: bool = False
    overexposed: float = 0.0
    clipped: ClippedLight | None = None
    why_not: str = ""

    def applied(self, layer: Layer, picture_map: CanvasMap) -> Layer:
        """A picture's layer with its light changed; picture_map: where the canvas shows the picture."""
        is_gain = not self.vignetting and self.curve is None
        if is_gain and (self.gain == 1).all():
            return layer
        if is_gain and not self.keeps_white:
            return Layer(Exposed(layer.light, self.gain), layer.alpha)
        toned = Toned(layer.light, self.gain, self.vignetting, self.curve, self.keeps_white, picture_map, self.clipped)
        return Layer(toned, layer.alpha)


def unchanged(channels: int, gain: float = 1.0) -> Exposure:
    """The exposure that changes nothing, or multiplies all by one number."""
    return Exposure(np.full(channels, gain, np.float32), np.full(channels, np.nan, np.float32), 0)


def exposures_for(
    layers: tuple[Layer, Layer], maps: tuple[CanvasMap, CanvasMap], hidden: NDArray[np.bool_],
    floats: tuple[bool, bool], wanted: Exposing,
) -> tuple[Exposure, Exposure]:  # fmt: skip
    """What is done to the light of a pair; of more pictures, see `graph_exposure`.

    Parameters
    ----------
    layers, maps, hidden, floats
        See `match_tones`.
    wanted : str or float
        See `StitchOptions.exposure`.

    Returns
    -------
    pair of Exposure
    """
    nothing = unchanged(layers[0].light.shape[2])
    if wanted == "none":
        return nothing, nothing
    if wanted == "reference":
        return nothing, match_exposure(*layers, hidden, floats)
    return match_tones(layers, maps, hidden, floats, 0.0 if isinstance(wanted, str) else wanted)


def match_exposure(
    before: Layer, layer: Layer, hidden: NDArray[np.bool_], floats: tuple[bool, bool]
) -> Exposure:
    """Measure the gain per channel on what the panorama before and an added layer both show.

    Parameters
    ----------
    before, layer, hidden, floats
        See `shared_blocks`.

    Returns
    -------
    Exposure
        `unchanged` where too little is known, or where the light differs beyond what exposure explains.
    """
    channels = before.light.shape[2]
    shared = shared_blocks(before, layer, hidden, floats)
    if shared is None:
        return unchanged(channels)
    blocks = bright_blocks(shared)
    if len(blocks) < EXPOSURE.min_blocks:
        return replace(unchanged(channels), why_not=TOO_LITTLE)
    ratios, weights = log_ratios(blocks.means), block_weights(blocks)
    middle = np.array([weighted_median(ratios[:, k], weights) for k in range(channels)])
    spread = np.median(np.abs(ratios - middle), axis=0)
    if np.abs(middle).max() > np.log(EXPOSURE.max_gain):
        return replace(unchanged(channels), why_not=too_different(np.exp(middle)))
    return Exposure(np.exp(middle).astype(np.float32), spread.astype(np.float32), len(blocks))


def match_tones(
    layers: tuple[Layer, Layer], maps: tuple[CanvasMap, CanvasMap], hidden: NDArray[np.bool_],
    floats: tuple[bool, bool], stops: float = 0.0,
) -> tuple[Exposure, Exposure]:  # fmt: skip
    """Bring two pictures to one exposure between their own.

    Parameters
    ----------
    layers : pair of Layer
        On the same canvas, the reference's first.
    maps : pair of CanvasMap
        Where the canvas shows the two.
    hidden : (H, W) bool array
        What either cannot see, and so shows something else.
    floats : (bool, bool)
        Whether they come from float pictures. Beside one, radiance is kept: at the reference's exposure, with neither
        a curve nor a roll-off.
    stops : float
        Added to the exposure of both.

    Returns
    -------
    pair of Exposure
        Without gains against each other where too little is known, or where the light differs too much.
    """
    channels, radiance = layers[0].light.shape[2], any(floats)
    shared = shared_blocks(*layers, hidden, floats)
    plain = replace(unchanged(channels, 2.0**stops), keeps_white=not radiance)
    if shared is None:
        return plain, plain
    blocks = bright_blocks(shared)
    if len(blocks) < EXPOSURE.min_blocks:
        return plain, replace(plain, why_not=TOO_LITTLE)
    blocks = blocks.subset(slice(None, None, -(-len(blocks) // TONE.fitted_blocks)))
    fit = fit_tone(blocks, (blocks.radii(maps[0]), blocks.radii(maps[1])), with_curve=not radiance)
    if np.abs(np.log(fit.gain)).max() > np.log(TONE.max_gain):
        return plain, replace(plain, why_not=too_different(fit.gain))
    moved = 0.0 if radiance else -TONE.reference_share * float(np.log2(np.median(fit.gain)))
    common = 2.0 ** (stops + np.clip(moved, -TONE.most_reference_stops, TONE.most_reference_stops))
    if not radiance:
        common = common * _whiter(fit.gain, *shared.overexposed)
    spread = fit.spread.astype(np.float32)
    first, second = (
        Exposure(
            (gain * common).astype(np.float32), spread, len(blocks), fit.vignetting, curve, not radiance, overexposed
        )
        for gain, curve, overexposed in zip(
            (np.ones(channels), fit.gain), (None, fit.curve), shared.overexposed, strict=True
        )
    )
    if radiance:
        return first, second
    return _with_clipped((first, second), layers, maps, hidden)


def _whiter(gain: Array, reference: float, target: float) -> Array:
    """The gains (C,) of both pictures that bring the reference's white balance to the target's, as far as the reference
    is the worse exposed; gain: of the target, to the reference's; then the shares of both that are over-exposed."""
    share = float(np.clip((reference - target) / TONE.worse_exposed, 0.0, 1.0))
    whiter: Array = (np.exp(np.log(gain).mean()) / gain) ** share
    return whiter


def _with_clipped(
    exposures: tuple[Exposure, Exposure], layers: tuple[Layer, Layer], maps: tuple[CanvasMap, CanvasMap],
    hidden: NDArray[np.bool_],
) -> tuple[Exposure, Exposure]:  # fmt: skip
    """The same with what each picture tells of the other's clipped light, where that is over-exposed."""
    if max(one.overexposed for one in exposures) < CLIPPED.least_share:
        return exposures
    shown = (layers[0].alpha > OVERLAP.opaque_alpha) & (layers[1].alpha > OVERLAP.opaque_alpha) & ~hidden
    toned = [one.applied(layer, at).light for one, layer, at in zip(exposures, layers, maps, strict=True)]
    first, second = (
        replace(one, clipped=clipped_light([ToldLight(layer.light, toned[k], toned[1 - k], shown)]))
        if one.overexposed >= CLIPPED.least_share else one
        for k, (one, layer) in enumerate(zip(exposures, layers, strict=True))
    )  # fmt: skip
    return first, second


def too_different(gain: Array) -> str:
    """What is said where a gain (C,) is too large."""
    return f"it differs by {np.abs(np.log2(gain)).max():.1f} stops"


def pooled(exposures: Sequence[Exposure]) -> Exposure:
    """The median of the exposures of several frames of fixed cameras, with a curve if most have one."""
    known = [one for one in exposures if one.blocks]
    if not known:
        return exposures[0]
    curved = 2 * sum(one.curve is not None for one in known) > len(known)
    known = [one for one in known if (one.curve is not None) == curved]
    gain, spread = (_median([getattr(one, name) for one in known]) for name in ("gain", "spread"))
    halfway, corner = np.median([astuple(one.vignetting) for one in known], axis=0).tolist()
    curves = [astuple(one.curve) for one in known if one.curve is not None]
    curve = ToneCurve(*np.median(curves, axis=0).tolist()) if curved else None
    overexposed = float(np.median([one.overexposed for one in known]))
    blocks, keeps_white = sum(one.blocks for one in known), known[0].keeps_white
    # a table cannot be averaged: one frame's serves all, so that nothing flickers
    clipped = next((one.clipped for one in known if one.clipped is not None), None)
    return Exposure(gain, spread, blocks, Vignetting(halfway, corner), curve, keeps_white, overexposed, clipped)


def _median(values: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """The median (C,) of several rows (C,)."""
    median: NDArray[np.float32] = np.median(values, axis=0).astype(np.float32)
    return median
