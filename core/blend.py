"""Two layers into one picture, in scene-linear float: in bands across a seam, feathered, or averaged."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .multiband import bands_for, correction
from .overlap import Overlap, bounds, distance_inside, distance_to_border
from .tone import to_light, to_tones
from .warp import Layer

BLENDS = ("multiband", "feather", "linear")
# Blending in bands changes a tone by this share of itself and this much at most.
HALF, DARK = np.float32(0.5), np.float32(0.02)


def averaged(reference: Layer, target: Layer) -> Layer:
    """Both count alike wherever both show something: the plain average of the literature, which hides nothing."""
    return mixed(reference, target, np.full(reference.alpha.shape, 0.5, np.float32))


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
    pixels, alpha = target.pixels.copy(), np.where(shows, reference.alpha, target.alpha)
    copied_where(shows, reference.pixels, pixels)
    box = bounds(shows & shows_too)
    if box is not None:
        both = (shows & shows_too)[box]
        weight, weight_too = share[box] * reference.alpha[box], (1 - share[box]) * target.alpha[box]
        total = weight + weight_too
        mix = reference.pixels[box] * weight[..., None] + target.pixels[box] * weight_too[..., None]
        mix /= np.maximum(total, 1e-12)[..., None]
        np.copyto(pixels[box], mix, where=both[..., None])
        # what one picture shows whole is not seen through, however soft the other's edge
        np.maximum(alpha[box], target.alpha[box], out=alpha[box], where=both)
    return Layer(pixels, alpha)


def copied_where(mask: NDArray[np.bool_], source: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Puts the pixels (H, W, C) of a source where a mask (H, W) says so; `np.copyto` takes ten times as long."""
    cv2.copyTo(source, np.ascontiguousarray(mask).view(np.uint8), out)


def cut_hard(reference: Layer, target: Layer, from_target: NDArray[np.bool_]) -> Layer:
    """Each pixel from the picture that from_target (H, W) names, bit for bit; what one shows whole is not seen
    through."""
    pixels = reference.pixels.copy()
    copied_where(from_target, target.pixels, pixels)
    return Layer(pixels, np.maximum(reference.alpha, target.alpha))


def in_bands(reference: Layer, target: Layer, from_target: NDArray[np.bool_], overlap: Overlap | None) -> Layer:
    """Cut hard along the seam, and the light of the two evened out across it (see `multiband`)."""
    out = cut_hard(reference, target, from_target)
    bands = bands_for(out.alpha)
    region = seam_region(from_target, out.alpha > 0, 4 << bands)
    if region is None or overlap is None:
        return out
    shown = out.alpha[region] > 0
    change = correction(
        _on_region(overlap.difference, overlap.box, region), _on_region(overlap.same, overlap.box, region),
        from_target[region], shown, bands,
    )  # fmt: skip
    touched = change.any(axis=2) & shown
    pixels = out.pixels[region]
    before, tones = pixels[touched], to_tones(pixels[touched])
    # what brighter neighbours differ by is too much for the dark: it stays dark, and no light turns negative
    most = HALF * np.abs(tones) + DARK
    after = to_light(tones + np.clip(change[touched], -most, most))
    pixels[touched] = np.maximum(after, np.minimum(before, 0))
    return out


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
