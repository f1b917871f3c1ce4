"""Figures published or measured for other programs on the pairs of the literature: for information, not a target.

Canvas values average over the whole zero-filled canvas, so black raises them: twice the canvas gains 3 dB. Yu and
Da, arXiv 2311.16637, tables of the paper: canvas SSIM, canvas PSNR (dB), projectivity (px), for EDF and for REW. The
overlap values (PSNR dB, SSIM) were measured by this project with other programs: Hugin, and the best ports of APAP and
REW.
"""

from __future__ import annotations

from collections.abc import Mapping

# by the pair's name in the literature's data sets
PAPER: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "DHW-temple": {"EDF": (0.943, 30.24, 7.2), "REW": (0.934, 29.66, 8.7)},
    "APAP-railtracks": {"EDF": (0.929, 27.10, 14.6), "REW": (0.926, 26.72, 20.8)},
    "DFW_desk": {"EDF": (0.979, 29.96, 0.74), "REW": (0.943, 30.42, 5.5)},
    "SPHP-garden": {"EDF": (0.894, 28.74, 10.2), "REW": (0.904, 29.13, 16.2)},
    "REW_gym": {"EDF": (0.958, 31.69, 9.7), "REW": (0.956, 30.87, 14.3)},
    "REW_worktable": {"EDF": (0.973, 28.99, 6.5), "REW": (0.973, 28.91, 9.3)},
}
MEASURED: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "DHW-temple": {
        "homography": (20.97, 0.544), "REW": (23.74, 0.799), "APAP": (23.07, 0.719), "Hugin": (19.64, 0.424),
    },
    "APAP-railtracks": {
        "homography": (15.15, 0.529), "REW": (20.15, 0.760), "APAP": (18.76, 0.691), "Hugin": (12.40, 0.246),
    },
    "DFW_desk": {
        "homography": (25.51, 0.832), "REW": (29.44, 0.916), "APAP": (25.01, 0.830), "Hugin": (22.58, 0.766),
    },
    "SPHP-garden": {
        "homography": (17.43, 0.441), "REW": (18.76, 0.608), "APAP": (18.42, 0.588), "Hugin": (18.00, 0.393),
    },
    "REW_gym": {
        "homography": (19.66, 0.507), "REW": (26.53, 0.896), "APAP": (25.05, 0.816), "Hugin": (19.56, 0.529),
    },
    "REW_worktable": {
        "homography": (13.56, 0.683), "REW": (24.63, 0.923), "APAP": (18.26, 0.808), "Hugin": (17.13, 0.714),
    },
    "fcase_Maneki-neko": {
        "homography": (17.66, 0.632), "REW": (20.66, 0.711), "APAP": (18.96, 0.650), "Hugin": (16.52, 0.635),
    },
}  # fmt: skip


def published(name: str) -> dict[str, dict[str, tuple[float, ...]]]:
    """{"paper": {method: (canvas SSIM, canvas PSNR, projectivity)}, "measured": {method: (overlap PSNR, SSIM)}} of a
    pair by its name; empty where nothing is known."""
    return {
        kind: dict(values)
        for kind, pairs in (("paper", PAPER), ("measured", MEASURED)) for pair, values in pairs.items()
        if pair.casefold() == name.casefold()
    }  # fmt: skip
