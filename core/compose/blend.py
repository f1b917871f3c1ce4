"""Two layers into one picture, in scene-linear float: in bands across a seam, feathered, or averaged.

`before` is the panorama so far, `layer` the added picture's layer on the same canvas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import NEIGHBOURS, Part, bounds, copied_where, for_each_channel, in_any_channel, within
from ..raster.distance import distance_inside, distance_to_border
from ..raster.lazy import AnyImage, LazyImage, Retouched
from ..raster.log_encoding import log_decode, log_encode
from .multiband import bands_for, correction
from .options import BANDS
from .seams.overlap import Overlap


def averaged(before: Layer, layer: Layer, count: NDArray[Any]) -> Layer:
    """The plain average of all pictures that show something, as papers have it: it hides no misalignment.

    count (H, W): how many pictures `before` is the average of.
    """
    share = count.astype(np.float32)
    share /= share + 1
    return mixed(before, layer, share)


def feathered(
    before: Layer, layer: Layer, hidden: NDArray[np.bool_], behind: NDArray[np.bool_] | None = None
) -> Layer:
    """Each weighted by the distance to its own border, so that neither shows an edge.

    hidden (H, W): what the added picture cannot see, and what therefore stays as it was before; behind (H, W): what the
    panorama before cannot see.
    """
    inner_before, inner = distance_to_border(before.alpha > 0), distance_to_border(layer.alpha > 0)
    share = inner_before / np.maximum(inner_before + inner, 1e-6)
    share[hidden & (before.alpha > 0)] = 1
    if behind is not None:
        share[behind & (layer.alpha > 0)] = 0
    return mixed(before, layer, share)


def distance_labels(before: Layer, layer: Layer) -> NDArray[np.bool_]:
    """The seam by distances alone (H, W): True, for the added layer, where its own border is further away."""
    return distance_to_border(before.alpha > 0) < distance_to_border(layer.alpha > 0)


def feathered_across(before: Layer, layer: Layer, chosen: NDArray[np.bool_], overlap: Overlap | None) -> Layer:
    """A linear ramp across the seam, as wide as the coarsest band (see `multiband`), where both show the same.

    Elsewhere they are cut hard along the seam. chosen (H, W): what comes from the added layer.
    """
    if overlap is None:
        return cut_hard(before, layer, chosen)
    share = np.where(chosen, np.float32(0), np.float32(1))
    here = chosen[overlap.box]
    beyond_seam = distance_inside(here) - distance_inside(~here)
    ramp = np.clip(0.5 - beyond_seam / np.float32(1 << bands_for(chosen)), 0, 1)
    share[overlap.box] = np.where(overlap.same, ramp, share[overlap.box])
    return mixed(before, layer, share)


def mixed(before: Layer, layer: Layer, share: NDArray[np.float32]) -> Layer:
    """Two layers mixed where both show something, by share (H, W), the weight of `before`; else the one that does."""
    shown = before.alpha > 0
    both = shown & (layer.alpha > 0)
    alpha = np.where(shown, before.alpha, layer.alpha)
    # where one is opaque so is the mix, however soft the other's edge
    np.maximum(alpha, layer.alpha, out=alpha, where=both)
    return Layer(Mixed(before, layer, share), alpha)


@dataclass(frozen=True, eq=False)
class Mixed(LazyImage):
    """Two layers by the share (H, W) of the one before (see `mixed`)."""

    before: Layer
    layer: Layer
    share: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.before.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        layers = self.before, self.layer
        alphas = [one.alpha[part] for one in layers]
        shown, both = alphas[0] > 0, (alphas[0] > 0) & (alphas[1] > 0)
        light = self.before.light[part]
        pixels = self.layer.light[part].copy()
        copied_where(shown, light, pixels)
        box = bounds(both)
        if box is not None:
            share = self.share[part][box]
            weights = share * alphas[0][box], (1 - share) * alphas[1][box]
            total = np.maximum(weights[0] + weights[1], np.float32(1e-12))
            shares = [for_each_channel(weight / total, light.shape[2]) for weight in weights]
            mix = light[box] * shares[0] + self.layer.light[part][box] * shares[1]
            copied_where(both[box], mix, pixels[box])
        return pixels


def cut_hard(before: Layer, layer: Layer, chosen: NDArray[np.bool_]) -> Layer:
    """Each pixel bit for bit from the added layer where it is chosen (H, W), else from before; opaque where one is."""
    return Layer(Cut(before.light, layer.light, chosen), np.maximum(before.alpha, layer.alpha))


@dataclass(frozen=True, eq=False)
class Cut(LazyImage):
    """Light of the added layer where it is chosen (H, W), else that of before."""

    before: AnyImage
    added: AnyImage
    chosen: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.before.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        chosen = self.chosen[part]
        box = bounds(chosen)
        out = self.before[part]
        if box is None:
            return out
        out = out.copy()
        rows, columns = (
            slice(one.start + inner.start, one.start + inner.stop)
            for one, inner in zip(within(part, self.shape), box, strict=True)
        )
        copied_where(chosen[box], self.added[rows, columns], out[box])
        return out


def in_bands(before: Layer, layer: Layer, chosen: NDArray[np.bool_], overlap: Overlap | None) -> Layer:
    """Cut hard along the seam, with differences of light evened out across it in bands (see `multiband`)."""
    out = cut_hard(before, layer, chosen)
    bands = bands_for(out.alpha)
    region = seam_region(chosen, out.alpha > 0, BANDS.margin_widths << bands)
    if region is None or overlap is None:
        return out
    shown = out.alpha[region] > 0
    parts = [_on_region(values, overlap.box, region) for values in (overlap.difference, overlap.same)]
    del overlap  # as large as these: the peak of memory is ahead
    same = parts.pop()
    change = correction(parts.pop(), same, chosen[region], shown, bands)
    touched = in_any_channel(change != 0) & shown
    return Layer(Evened(out.light, (region[0].start, region[1].start), touched, change), out.alpha)


@dataclass(frozen=True, eq=False)
class Evened(Retouched):
    """Light with a change (h, w, C) of the tones of the pixels that are touched."""

    change: NDArray[np.float32]

    def anew(self, before: NDArray[np.float32], there: Part) -> NDArray[np.float32]:
        """See `Retouched`."""
        return changed(before, self.change[there][self.touched[there]])


def changed(light: NDArray[np.float32], change: NDArray[np.float32]) -> NDArray[np.float32]:
    """Light (…, C) with a change (…, C) of its tones."""
    tones = log_encode(light)
    # bounded, so that bright neighbours' differences neither brighten the dark nor turn light negative
    most = BANDS.max_relative_change * np.abs(tones) + BANDS.max_dark_change
    after = log_decode(tones + np.clip(change, -most, most))
    return np.maximum(after, np.minimum(light, 0))


def seam_region(
    chosen: NDArray[np.bool_], shown: NDArray[np.bool_], margin: int
) -> tuple[slice, slice] | None:
    """Rows and columns that hold the whole seam and a margin (px); None without a seam.

    chosen (H, W): what comes from one side; shown (H, W): borders of what is not shown do not count.
    """
    borders = np.zeros(chosen.shape, bool)
    for here, there in NEIGHBOURS:
        borders[here] |= (chosen[here] != chosen[there]) & shown[here] & shown[there]
    box = bounds(borders)
    if box is None:
        return None
    rows, columns = (
        slice(max(0, part.start - margin), min(side, part.stop + 1 + margin))
        for part, side in zip(box, chosen.shape, strict=True)
    )
    return rows, columns


def _on_region(
    values: NDArray[Any], box: tuple[slice, slice], region: tuple[slice, slice]
) -> NDArray[Any]:
    """Values of a box of the canvas, as an array over a region of it; 0 where the box does not reach."""
    out = np.zeros((*(part.stop - part.start for part in region), *values.shape[2:]), values.dtype)
    low = [max(part.start, other.start) for part, other in zip(box, region, strict=True)]
    high = [min(part.stop, other.stop) for part, other in zip(box, region, strict=True)]
    if all(a < b for a, b in zip(low, high, strict=True)):
        here = tuple(slice(a - part.start, b - part.start) for a, b, part in zip(low, high, region, strict=True))
        there = tuple(slice(a - part.start, b - part.start) for a, b, part in zip(low, high, box, strict=True))
        out[here] = values[there]
    return out
