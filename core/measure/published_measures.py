"""Figures as other papers define them, so that their tables can be read beside ours.

They are for information: where they differ from `metrics`, a trap is named.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..panorama.warp import Warp
from ..pictures.picture import Picture
from ..raster.arrays import bounds, with_margin
from .metrics import box_similarity, overlap_views, psnr

# px by which a 7×7 window reaches beyond its middle.
_REACH = 3


def udis_quality(pictures: Sequence[Picture], warp: Warp, number: int = 1) -> dict[str, float]:
    """udis_psnr_db, udis_ssim: "PSNR" and "SSIM" of Nie et al. (UDIS, IEEE TIP 2021; UDIS++, ICCV 2023).

    Both pictures in the reference's frame, black outside the overlap, averaged over the whole frame: PSNR of all
    channels, SSIM of each channel in plain 7×7 windows, then the mean of the channels. The trap: black agrees with
    black, so a smaller overlap scores higher; of a quarter of the frame, PSNR gains 6 dB.
    """
    view, fetched, inside = overlap_views(pictures, warp, number)
    part = bounds(inside)
    if part is None:
        return {"udis_psnr_db": float("nan"), "udis_ssim": float("nan")}
    # beyond the box of the overlap both are black, and so alike
    box = with_margin(part, _REACH, inside.shape)
    first, second = (np.where(inside[box][..., None], one[box], 0).astype(np.uint8) for one in (view, fetched))
    lost = [
        float((1 - box_similarity(first[..., [c]], second[..., [c]])).sum(dtype=np.float64))
        for c in range(first.shape[2])
    ]  # fmt: skip
    share = float(inside.sum()) / inside.size
    return {
        "udis_psnr_db": psnr(view, fetched, inside) - 10 * float(np.log10(share)),
        "udis_ssim": 1 - float(np.mean(lost)) / inside.size,
    }
