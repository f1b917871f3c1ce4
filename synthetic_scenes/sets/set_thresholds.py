"""All that the validation asks of sets, with what was measured."""

from __future__ import annotations

from dataclasses import dataclass

from ..limits import Check, Limit, Result, number

# Every set: the truth proves itself (figures: `set_proof.SphereProof.figures`).
PROOF = (
    Limit("proof", "position_px", "px", at_most=0.01),  # as of pairs
    Limit("proof", "depth_relative", "", at_most=1e-5),
    Limit("proof", "ray_cast_relative", "", at_most=1e-5),
    Limit("proof", "direction_deg", "°", at_most=0.001),  # a two-hundredth of the sphere's pixels
    Limit("proof", "distance_relative", "", at_most=1e-5),
    Limit("proof", "visibility_wrong", "", at_most=0.0),
    Limit("proof", "visibility_asked", "", at_least=50.0),
    Limit("proof", "sphere_psnr_db", "dB", at_least=35.0),
    Limit("proof", "half_pixel_loss_db", "dB", at_least=1.0),
)
OURS, ROTATION_ONLY, HUGIN, OPENCV = "ours", "rotation only", "hugin", "opencv"


@dataclass(frozen=True)
class Bar:
    """A bound of one set on a figure of ours, and what was measured when it was set."""

    measure: str
    unit: str
    measured: float
    at_most: float | None = None
    at_least: float | None = None
    absolute: bool = False

    @property
    def limit(self) -> Limit:
        """As a limit."""
        return Limit(OURS, self.measure, self.unit, self.at_most, self.at_least, self.absolute)


# What rivals are compared by: the panorama's likeness over what all of them show.
LEAD = "common_psnr_db"
# Bounds are 1.3 × what was measured, or 1 dB below it, and none is narrowed below these: so much came and went between
# two runs of the same sets (rotation of mover, focal lengths of mover and chain), or does with other noise.
FACTOR = 1.3
LEAST = {
    "rotation_deg": 0.03, "rotation_max_deg": 0.03, "position_max_mm": 0.5, "focal_percent": 0.05,
    "overlap_px": 0.1, "alone_px": 0.1, "overlap_p90_px": 0.3,
}  # fmt: skip
# How far beside its ray lies what a picture shows at a pixel of the panorama (`set_sliding`), px, by set: from one
# place, median and 95th percentile, and with the viewpoint as far along as is chosen. small_room has none: it was
# not measured with the noise of Blender 4.3's pictures.
BESIDE_MEASURES = ("still_beside_px", "still_beside_p95_px", "slid_beside_px", "slid_beside_p95_px")
BESIDE = {
    "ring": (0.419, 3.76, 0.409, 2.78),
    "room_sphere": (0.189, 2.18, 0.197, 1.32),
    "brackets": (0.225, 3.2, 0.224, 3.1),
    "posts": (0.456, 18.2, 0.486, 14.4),
    "chain": (7.19, 12.8, 7.22, 12.8),
    "two_lenses": (0.495, 2.35, 0.471, 2.39),
    "mover": (0.4, 17.1, 0.403, 16.5),
    "outdoor": (0.348, 6.53, 0.352, 6.4),
    "tripod": (0.192, 0.406, 0.192, 0.406),
    "street_sweep": (0.369, 113.0, 0.5, 74.2),
    "mixed": (0.173, 0.491, 0.174, 0.507),
    "stray": (0.353, 2.74, 0.355, 2.71),
}
# Figures of the sphere by set, with what was measured when a bound was last narrowed.
_ON_SPHERE: dict[str, tuple[Bar, ...]] = {
    "small_room": (  # the worse of Blender 4.3 and bpy: their pictures' noise differs, and with it all that is matched
        Bar("rotation_max_deg", "°", 0.053, at_most=0.07),
        Bar("position_max_mm", "mm", 6.5, at_most=8.5),
        Bar("focal_percent", "%", 0.156, at_most=0.21, absolute=True),
        Bar("k1_error", "", 0.00072, at_most=0.00094, absolute=True),  # with as much noise again, as the next
        Bar("principal_px", "px", 0.242, at_most=0.32),
        Bar("overlap_px", "px", 0.53, at_most=0.7),  # the aim is 0.5
        Bar("overlap_p90_px", "px", 1.60, at_most=2.1),
        Bar("alone_px", "px", 1.29, at_most=1.7),
        Bar("range_log", "", 0.0072, at_most=0.0095),
        Bar("psnr_db", "dB", 28.8, at_least=27.8),
    ),
    "ring": (
        Bar("rotation_max_deg", "°", 0.171, at_most=0.222),
        Bar("position_max_mm", "mm", 8.81, at_most=11.5),
        Bar("focal_percent", "%", 0.027, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.38, at_most=0.5),
        Bar("overlap_p90_px", "px", 1.46, at_most=1.89),
        Bar("alone_px", "px", 0.805, at_most=1.05),
        Bar("range_log", "", 0.0103, at_most=0.0133),
        Bar("psnr_db", "dB", 33.5, at_least=32.5),
    ),
    "room_sphere": (  # the aims are 0.1° and 0.3°, 15 mm, 0.5 and 3 px, 31 dB
        Bar("rotation_deg", "°", 0.0094, at_most=0.0122),
        Bar("rotation_max_deg", "°", 0.0198, at_most=0.0258),
        Bar("position_max_mm", "mm", 1.57, at_most=2.05),
        Bar("focal_percent", "%", 0.016, at_most=0.03, absolute=True),
        Bar("overlap_px", "px", 0.184, at_most=0.24),
        Bar("overlap_p90_px", "px", 0.822, at_most=1.07),
        Bar("alone_px", "px", 0.272, at_most=0.353),
        Bar("range_log", "", 0.00536, at_most=0.00697),
        Bar("psnr_db", "dB", 34.4, at_least=33.4),
        Bar("line_p90_px", "px", 1.44, at_most=1.87),
        Bar("things_cut", "", 0.0, at_most=0.0),
        Bar("seam_p90_levels", "levels", 1.57, at_most=2.04),
    ),
    "brackets": (
        Bar("rotation_max_deg", "°", 0.032, at_most=0.042),
        Bar("position_max_mm", "mm", 1.27, at_most=1.65),
        Bar("focal_percent", "%", 0.0467, at_most=0.0607, absolute=True),
        Bar("overlap_px", "px", 0.224, at_most=0.291),
        Bar("overlap_p90_px", "px", 0.828, at_most=1.08),
        Bar("alone_px", "px", 0.87, at_most=1.14),
        Bar("range_log", "", 0.0078, at_most=0.0101),
        Bar("psnr_db", "dB", 26.8, at_least=25.8),
        Bar("line_p90_px", "px", 1.53, at_most=2.0),
        Bar("things_cut", "", 2.0, at_most=2.0),
        Bar("seam_p90_levels", "levels", 3.35, at_most=4.35),
    ),
    "posts": (
        Bar("rotation_max_deg", "°", 0.0584, at_most=0.0759),
        Bar("position_max_mm", "mm", 3.13, at_most=4.07),
        Bar("focal_percent", "%", 0.0874, at_most=0.114, absolute=True),
        Bar("overlap_px", "px", 0.45, at_most=0.584),
        Bar("overlap_p90_px", "px", 11.3, at_most=14.2),
        Bar("alone_px", "px", 2.87, at_most=3.73),
        Bar("range_log", "", 0.0116, at_most=0.0151),
        Bar("psnr_db", "dB", 23.7, at_least=22.7),
    ),
    "chain": (
        Bar("guessed_lengths", "", 2.0, at_most=2.0, at_least=2.0),
        Bar("rotation_max_deg", "°", 0.242, at_most=0.314),
        Bar("position_max_mm", "mm", 52.7, at_most=68.5),
        Bar("focal_percent", "%", 0.00477, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 7.22, at_most=9.38),
        Bar("overlap_p90_px", "px", 10.3, at_most=13.4),
        Bar("alone_px", "px", 7.02, at_most=9.12),
        Bar("range_log", "", 0.118, at_most=0.154),
        Bar("psnr_db", "dB", 22.8, at_least=21.8),
    ),
    "two_lenses": (
        Bar("rotation_max_deg", "°", 0.0857, at_most=0.111),
        Bar("position_max_mm", "mm", 12.5, at_most=14.6),
        Bar("focal_percent", "%", 0.135, at_most=0.176, absolute=True),
        Bar("k1_error", "", 0.00118, at_most=0.00154, absolute=True),
        Bar("overlap_px", "px", 0.496, at_most=0.645),
        Bar("overlap_p90_px", "px", 1.15, at_most=1.49),
        Bar("alone_px", "px", 0.834, at_most=1.08),
        Bar("range_log", "", 0.0678, at_most=0.075),
        Bar("psnr_db", "dB", 29.3, at_least=28.3),
    ),
    "mover": (
        Bar("rotation_max_deg", "°", 0.0216, at_most=0.03),
        Bar("position_max_mm", "mm", 1.99, at_most=2.59),
        Bar("focal_percent", "%", 0.0219, at_most=0.043, absolute=True),
        Bar("overlap_px", "px", 0.223, at_most=0.29),
        Bar("overlap_p90_px", "px", 0.812, at_most=1.06),
        Bar("alone_px", "px", 0.503, at_most=0.654),
        Bar("range_log", "", 0.00659, at_most=0.00857),
        Bar("psnr_db", "dB", 24.6, at_least=23.6),
    ),
    "outdoor": (
        Bar("rotation_max_deg", "°", 0.0405, at_most=0.0527),
        Bar("position_max_mm", "mm", 4.64, at_most=6.03),
        Bar("focal_percent", "%", 0.0083, at_most=0.0165, absolute=True),
        Bar("overlap_px", "px", 0.335, at_most=0.436),
        Bar("overlap_p90_px", "px", 3.51, at_most=4.4),
        Bar("alone_px", "px", 0.784, at_most=0.9),
        Bar("range_log", "", 0.0258, at_most=0.0336),
        Bar("psnr_db", "dB", 36.8, at_least=35.8),
    ),
    "tripod": (
        Bar("rotation_deg", "°", 0.019, at_most=0.03),
        Bar("rotation_max_deg", "°", 0.0322, at_most=0.0419),
        Bar("places", "", 1.0, at_most=1.0),
        Bar("focal_percent", "%", 0.0244, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.19, at_most=0.25),
        Bar("overlap_p90_px", "px", 0.357, at_most=0.465),
        Bar("alone_px", "px", 0.306, at_most=0.397),
        Bar("psnr_db", "dB", 41.2, at_least=40.2),
    ),
    "street_sweep": (
        Bar("rotation_max_deg", "°", 0.016, at_most=0.03),
        Bar("position_max_mm", "mm", 0.326, at_most=0.5),
        Bar("focal_percent", "%", 0.00451, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.279, at_most=0.363),
        Bar("overlap_p90_px", "px", 18.9, at_most=24.5),
        Bar("alone_px", "px", 0.0421, at_most=0.1),
        Bar("range_log", "", 0.00372, at_most=0.00483),
        Bar("psnr_db", "dB", 28.4, at_least=27.4),
    ),
    "mixed": (
        Bar("rotation_deg", "°", 0.023, at_most=0.03),
        Bar("rotation_max_deg", "°", 0.118, at_most=0.154),
        Bar("position_max_mm", "mm", 6.95, at_most=9.04),
        Bar("places", "", 5.0, at_most=5.0),
        Bar("focal_percent", "%", 0.0106, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.173, at_most=0.225),
        Bar("overlap_p90_px", "px", 0.326, at_most=0.424),
        Bar("alone_px", "px", 1.53, at_most=1.99),
        Bar("range_log", "", 0.0232, at_most=0.0301),
        Bar("psnr_db", "dB", 31.0, at_least=30.0),
    ),
    "stray": (
        Bar("rotation_max_deg", "°", 0.0387, at_most=0.0503),
        Bar("position_max_mm", "mm", 3.2, at_most=4.16),
        Bar("focal_percent", "%", 0.034, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.353, at_most=0.458),
        Bar("overlap_p90_px", "px", 0.954, at_most=1.24),
        Bar("alone_px", "px", 0.867, at_most=1.13),
        Bar("range_log", "", 0.0078, at_most=0.0101),
        Bar("psnr_db", "dB", 31.2, at_least=30.2),
    ),
}


def _beside(scene: str) -> tuple[Bar, ...]:
    figures = zip(BESIDE_MEASURES, BESIDE.get(scene, ()), strict=scene in BESIDE)
    return tuple(Bar(name, "px", figure, at_most=float(f"{FACTOR * figure:.3g}")) for name, figure in figures)


# All bounds of each set.
BARS = {scene: (*bars, *_beside(scene)) for scene, bars in _ON_SPHERE.items()}


def set_checks(result: Result) -> list[Check]:
    """All that is asked of a set that was measured: the truth proves itself, exactly those pictures are left out that
    show another place, its own bars hold, and where there is parallax every rival is worse."""
    scene = result["scene"]
    ours = result["runs"].get(OURS) or {}
    checks = [_checked(scene, limit, number(result["proof"].get(limit.measure))) for limit in PROOF]
    expected, left = ", ".join(result["expected_left_out"]) or "none", ", ".join(ours.get("left_out") or []) or "none"
    if not ours or ours["refused"]:
        left = "refused"
    checks.append(Check(scene, OURS, "left_out", left, f"= {expected}", "", left == expected))
    figures = ours.get("figures") or {}
    for bar in BARS.get(scene, ()):
        value = number(figures.get(bar.measure))
        checks.append(_checked(scene, bar.limit, abs(value) if bar.absolute and value is not None else value))
    if result["parallax"]:
        mine = number(figures.get(LEAD))
        for rival, run in result["runs"].items():
            theirs = number((run.get("figures") or {}).get(LEAD))
            if rival != OURS and not run["refused"]:
                lead = None if mine is None or theirs is None else mine - theirs
                limit = Limit(OURS, f"{LEAD} over {rival}", "dB", at_least=0.0)
                checks.append(_checked(scene, limit, lead))
    return checks


def _checked(scene: str, limit: Limit, value: float | None) -> Check:
    return Check(scene, limit.run, limit.measure, value, limit.text, limit.unit, limit.holds(value))
