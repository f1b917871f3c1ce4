"""Two layers into one picture, in scene-linear float: in bands across a seam, feathered, or averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import Part, bounds, copied_where, for_each_channel, in_any_channel, within
from ..raster.distance import distance_inside, distance_to_border
from ..raster.lazy import AnyImage, LazyImage, Retouched
from ..raster.log_encoding import log_decode, log_encode
from .multiband import bands_for, correction
from .overlap import Overlap

# Blending in bands changes a tone by this share of itself and this much at most.
HALF, DARK = np.float32(0.5), np.float32(0.02)


def averaged(reference: Layer, target: Layer) -> Layer:
    """Both count alike wherever both show something: the plain average of the literature, which hides nothing."""
    return mixed(reference, target, np.broadcast_to(np.float32(0.5), reference.alpha.shape))


def feathered(reference: Layer, target: Layer, hidden: NDArray[np.bool_]) -> Layer:
    """Each picture counts by the distance to its own border, so that neither shows an edge; what the target cannot see
    (hidden) comes from the reference."""
    inner, inner_too = distance_to_border(reference.alpha > 0), distance_to_border(target.alpha > 0)
    share = inner / np.maximum(inner + inner_too, 1e-6)
    share[hidden & (reference.alpha > 0)] = 1
    return mixed(reference, target, share)


def distance_labels(reference: Layer, target: Layer) -> NDArray[np.bool_]:
    """The seam that distances alone give (H, W): True, for the target, where its border is further away."""
    return distance_to_border(reference.alpha > 0) < distance_to_border(target.alpha > 0)


def feathered_across(
    reference: Layer, target: Layer, from_target: NDArray[np.bool_], overlap: Overlap | None
) -> Layer:
    """One picture gives way to the other over the width of the coarsest band (see `multiband`), where both show the
    same; elsewhere they are cut hard along the seam."""
    if overlap is None:
        return cut_hard(reference, target, from_target)
    share = np.where(from_target, np.float32(0), np.float32(1))
    here = from_target[overlap.box]
    past = distance_inside(here) - distance_inside(~here)
    ramp = np.clip(0.5 - past / np.float32(1 << bands_for(from_target)), 0, 1)
    share[overlap.box] = np.where(overlap.same, ramp, share[overlap.box])
    return mixed(reference, target, share)


def mixed(reference: Layer, target: Layer, share: NDArray[np.float32]) -> Layer:
    """One layer from two on the same canvas, straight alpha: share (H, W) is the reference's weight where both show
    something; where one shows nothing the other is taken as it is."""
    shows, shows_too = reference.alpha > 0, target.alpha > 0
    both = shows & shows_too
    alpha = np.where(shows, reference.alpha, target.alpha)
    # what one picture shows whole is not seen through, however soft the other's edge
    np.maximum(alpha, target.alpha, out=alpha, where=both)
    return Layer(Mixed(reference, target, share), alpha)


@dataclass(frozen=True, eq=False)
class Mixed(LazyImage):
    """Two layers by the share (H, W) of the first (see `mixed`)."""

    first: Layer
    second: Layer
    share: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.first.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        alpha, alpha_too = self.first.alpha[part], self.second.alpha[part]
        shows, both = alpha > 0, (alpha > 0) & (alpha_too > 0)
        light = self.first.light[part]
        pixels = self.second.light[part].copy()
        copied_where(shows, light, pixels)
        box = bounds(both)
        if box is not None:
            share = self.share[part][box]
            weight, weight_too = share * alpha[box], (1 - share) * alpha_too[box]
            total = np.maximum(weight + weight_too, np.float32(1e-12))
            first, second = (for_each_channel(w / total, light.shape[2]) for w in (weight, weight_too))
            mix = light[box] * first + self.second.light[part][box] * second
            copied_where(both[box], mix, pixels[box])
        return pixels


def cut_hard(reference: Layer, target: Layer, from_target: NDArray[np.bool_]) -> Layer:
    """Each pixel from the picture that from_target (H, W) names, bit for bit; what one shows whole is not seen
    through."""
    return Layer(Cut(reference.light, target.light, from_target), np.maximum(reference.alpha, target.alpha))


@dataclass(frozen=True, eq=False)
class Cut(LazyImage):
    """Light of the second where from_second (H, W) says so, else of the first."""

    first: AnyImage
    second: AnyImage
    from_second: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.first.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        second = self.from_second[part]
        box = bounds(second)
        out = self.first[part]
        if box is None:
            return out
        out = out.copy()
        rows, columns = (
            slice(one.start + inner.start, one.start + inner.stop)
            for one, inner in zip(within(part, self.shape), box, strict=True)
        )
        copied_where(second[box], self.second[rows, columns], out[box])
        return out


def in_bands(reference: Layer, target: Layer, from_target: NDArray[np.bool_], overlap: Overlap | None) -> Layer:
    """Cut hard along the seam, and the light of the two evened out across it (see `multiband`)."""
    out = cut_hard(reference, target, from_target)
    bands = bands_for(out.alpha)
    region = seam_region(from_target, out.alpha > 0, 4 << bands)
    if region is None or overlap is None:
        return out
    shown = out.alpha[region] > 0
    parts = [_on_region(values, overlap.box, region) for values in (overlap.difference, overlap.same)]
    del overlap  # as large as they are: the peak of memory is ahead
    same = parts.pop()
    change = correction(parts.pop(), same, from_target[region], shown, bands)
    touched = in_any_channel(change != 0) & shown
    return Layer(Evened(out.light, (region[0].start, region[1].start), touched, change), out.alpha)


@dataclass(frozen=True, eq=False)
class Evened(Retouched):
    """Light with a change (h, w, C) of the tones of the pixels that are touched."""

    change: NDArray[np.float32]

    def anew(self, before: NDArray[np.float32], there: Part) -> NDArray[np.float32]:
        """See `Retouched`."""
        tones = log_encode(before)
        # what brighter neighbours differ by is too much for the dark: it stays dark, and no light turns negative
        most = HALF * np.abs(tones) + DARK
        after = log_decode(tones + np.clip(self.change[there][self.touched[there]], -most, most))
        return np.maximum(after, np.minimum(before, 0))


def seam_region(
    from_target: NDArray[np.bool_], shown: NDArray[np.bool_], margin: int
) -> tuple[slice, slice] | None:
    """Rows and columns that hold all borders between the two pictures and a margin (px); None where there are none."""
    borders = np.zeros(from_target.shape, bool)
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        borders[first] |= (from_target[first] != from_target[second]) & shown[first] & shown[second]
    box = bounds(borders)
    if box is None:
        return None
    rows, columns = (
        slice(max(0, part.start - margin), min(side, part.stop + 1 + margin))
        for part, side in zip(box, from_target.shape, strict=True)
    )
    return rows, columns


def _on_region(
    values: NDArray, box: tuple[slice, slice], region: tuple[slice, slice]
) -> NDArray:
    """Values of a box of the canvas, as those of a region of it; 0 where the box does not reach."""
    out = np.zeros((*(part.stop - part.start for part in region), *values.shape[2:]), values.dtype)
    low = [max(part.start, other.start) for part, other in zip(box, region, strict=True)]
    high = [min(part.stop, other.stop) for part, other in zip(box, region, strict=True)]
    if all(a < b for a, b in zip(low, high, strict=True)):
        here = tuple(slice(a - part.start, b - part.start) for a, b, part in zip(low, high, region, strict=True))
        there = tuple(slice(a - part.start, b - part.start) for a, b, part in zip(low, high, box, strict=True))
        out[here] = values[there]
    return out
