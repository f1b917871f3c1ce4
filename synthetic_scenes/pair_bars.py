"""What each pair of the suites is held to: 1.3 × what was measured, or 1 dB below it."""

from __future__ import annotations

from dataclasses import dataclass

from .limits import Limit, Result

# The default field, K known.
RUN = "known/slack"
FACTOR, BELOW_DB = 1.3, 1.0


@dataclass(frozen=True)
class Measure:
    """A figure. least: no bound is narrower, for another renderer's noise alone does so much; None: more is better."""

    name: str
    unit: str
    least: float | None

    def limit(self, measured: float) -> Limit:
        """The bound that what was measured gives, to three digits."""
        if self.least is None:
            return Limit(RUN, self.name, self.unit, at_least=round(measured - BELOW_DB, 1))
        bound = max(FACTOR * measured, self.least)
        return Limit(RUN, self.name, self.unit, at_most=float(f"{bound:.3g}"))


MEASURES = (
    Measure("rotation_deg", "°", 0.02), Measure("epipole_deg", "°", 0.1), Measure("h_inf_px", "px", 0.2),
    Measure("f_px", "px", 0.02), Measure("projectivity_px", "px", 0.05), Measure("alignment_px", "px", 0.05),
    Measure("alignment_p95_px", "px", 0.3), Measure("beyond_px", "px", 0.1), Measure("beyond_p90_px", "px", 0.3),
    Measure("target_only_psnr_db", "dB", None),
)  # fmt: skip
# By the longer side of the pictures, px, and by scene: what was measured, in the order of MEASURES; None: there is no
# such figure. At 640 px the worst of the pictures as they are and two with as much noise again.
MEASURED: dict[int, dict[str, tuple[float | None, ...]]] = {
    1280: {
        "two_planes": (0.00716, 0.0273, 0.146, 0.00772, 0.0286, 0.0872, 0.298, 0.393, 1.18, 34.2),
        "layered_cards": (0.00638, 0.0515, 0.126, 0.0135, 0.0215, 0.0847, 0.507, 0.553, 4.06, 27.5),
        "corner_room": (0.018, 0.128, 0.36, 0.0202, 0.00928, 0.0827, 0.464, 0.252, 0.96, 33.3),
        "street": (0.00558, 0.0571, 0.113, 0.0165, 0.035, 0.101, 0.644, 6.08, 8.21, 20.1),
        "foliage": (0.00068, 0.0227, 0.00812, 0.00643, 0.013, 0.108, 2.46, 2.04, 6.55, 24.8),
        "relief": (0.00539, 0.0465, 0.107, 0.0078, 0.0105, 0.0723, 0.187, 1.44, 4.86, 22.7),
        "tabletop": (0.00403, 0.0662, 0.0794, 0.0122, 0.0111, 0.0988, 0.315, 0.0978, 1.24, 30.6),
        "portrait_pair": (0.00566, 0.0182, 0.111, 0.00646, 0.0113, 0.0867, 4.89, 0.273, 1.17, 31.0),
        "zoom_pair": (0.00723, 0.0295, 0.125, 0.0173, 0.0421, 0.0848, 0.407, 4.75, 7.01, 21.6),
        "forward": (0.00035, 0.00524, 0.00548, 0.0041, 0.0144, 0.0628, 0.296, 0.576, 3.34, 22.4),
        "sideways": (0.00249, 0.0102, 0.0508, 0.00376, 0.00255, 0.0821, 0.647, 0.216, 1.49, 27.5),
        "toe_in": (0.00293, 0.0129, 0.0579, 0.00556, 0.00932, 0.0631, 0.166, 0.617, 2.81, 18.6),
        "pure_rotation": (0.00015, None, 0.00259, None, None, 0.00232, 0.0031, 0.00293, 0.00329, 47.3),
        "single_plane": (0.00725, 0.0534, 0.143, 0.00889, 0.0281, 0.0139, 0.0445, 0.0248, 0.0567, 45.0),
        "exposure_step": (0.00286, 0.0336, 0.0565, 0.00251, 0.00323, 0.0869, 0.272, 0.11, 0.674, 24.4),
        "hdr_interior": (0.013, 0.0389, 0.269, 0.0157, 0.0527, 0.168, 1.8, 0.603, 1.38, 31.1),
        "low_texture": (0.00278, 0.0172, 0.0523, 0.0105, 0.0249, 0.759, 24.2, 10.0, 12.8, 12.4),
        "wide": (0.0651, 0.331, 1.08, 0.0236, 0.367, 0.11, 1.49, 7.01, 13.2, 19.5),
        "occluder": (0.00211, 0.0106, 0.0429, 0.00528, 0.0146, 0.096, 0.467, 0.21, 0.421, None),
        "thin_things": (0.00168, 0.0624, 0.033, 0.00596, 0.00425, 0.101, 0.513, 0.0935, 0.67, None),
        "cut_branch": (0.00139, 0.024, 0.00565, 0.0048, 0.00902, 0.0828, 0.29, 0.237, 1.01, None),
        "cut_person": (0.0014, 0.0035, 0.0109, 0.00445, 0.0109, 0.0835, 0.284, 0.0663, 0.494, None),
        "vignetted": (0.00262, 0.0296, 0.0151, 0.00693, 0.00544, 0.085, 0.424, 1.14, 1.99, None),
    },
    640: {
        "two_planes": (0.0108, 0.0489, 0.107, 0.00865, 0.0179, 0.0961, 0.334, 0.24, 1.32, 31.6),
        "layered_cards": (0.0251, 0.199, 0.256, 0.017, 0.0299, 0.0962, 0.623, 0.18, 2.67, 28.4),
        "tabletop": (0.00933, 0.0897, 0.0938, 0.00761, 0.014, 0.0876, 0.312, 0.246, 1.37, 30.3),
        "pure_rotation": (0.00268, None, 0.013, None, None, 0.0491, 0.204, 0.0781, 0.0992, 41.9),
    },
}  # fmt: skip


def measured(scene: str, size: tuple[int, int]) -> dict[str, float]:
    """What was measured of a scene of pictures of this size, by name; nothing of one that is in no suite."""
    figures = MEASURED.get(max(size), {}).get(scene, ())
    return {one.name: figure for one, figure in zip(MEASURES, figures, strict=bool(figures)) if figure is not None}


def own_limits(result: Result) -> list[Limit]:
    """The bounds of a scene of a suite."""
    known = measured(result["scene"], tuple(result["size"]))
    return [one.limit(known[one.name]) for one in MEASURES if one.name in known]
