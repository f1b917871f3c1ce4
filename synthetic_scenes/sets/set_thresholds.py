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
# Sets by name. Bounds are the project's aims where those were met, else 1.3 × what was measured, or 1 dB below it.
BARS: dict[str, tuple[Bar, ...]] = {
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
        Bar("rotation_max_deg", "°", 0.172, at_most=0.224),
        Bar("position_max_mm", "mm", 9.1, at_most=11.9),
        Bar("focal_percent", "%", 0.027, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 0.38, at_most=0.5),
        Bar("overlap_p90_px", "px", 1.5, at_most=1.95),
        Bar("alone_px", "px", 0.86, at_most=1.12),
        Bar("range_log", "", 0.0103, at_most=0.0133),
        Bar("psnr_db", "dB", 33.5, at_least=32.5),
    ),
    "room_sphere": (  # the aims are 0.1° and 0.3°, 15 mm, 0.5 and 3 px, 31 dB
        Bar("rotation_deg", "°", 0.0094, at_most=0.0122),
        Bar("rotation_max_deg", "°", 0.0198, at_most=0.0258),
        Bar("position_max_mm", "mm", 1.57, at_most=2.05),
        Bar("focal_percent", "%", 0.016, at_most=0.03, absolute=True),
        Bar("overlap_px", "px", 0.184, at_most=0.24),
        Bar("overlap_p90_px", "px", 0.933, at_most=1.21),
        Bar("alone_px", "px", 0.272, at_most=0.353),
        Bar("range_log", "", 0.0057, at_most=0.0074),
        Bar("psnr_db", "dB", 34.4, at_least=33.4),
        Bar("line_p90_px", "px", 1.44, at_most=1.87),
        Bar("things_cut", "", 0.0, at_most=0.0),
        Bar("seam_p90_levels", "levels", 1.85, at_most=2.4),
    ),
    "brackets": (
        Bar("rotation_max_deg", "°", 0.032, at_most=0.042),
        Bar("position_max_mm", "mm", 1.28, at_most=1.7),
        Bar("focal_percent", "%", 0.048, at_most=0.063, absolute=True),
        Bar("overlap_px", "px", 0.23, at_most=0.3),
        Bar("overlap_p90_px", "px", 0.857, at_most=1.12),
        Bar("alone_px", "px", 0.87, at_most=1.14),
        Bar("range_log", "", 0.0078, at_most=0.0101),
        Bar("psnr_db", "dB", 26.8, at_least=25.8),
        Bar("line_p90_px", "px", 1.53, at_most=2.0),
        Bar("things_cut", "", 2.0, at_most=2.0),
        Bar("seam_p90_levels", "levels", 3.5, at_most=4.6),
    ),
    "posts": (
        Bar("rotation_max_deg", "°", 0.095, at_most=0.124),
        Bar("position_max_mm", "mm", 6.1, at_most=7.9),
        Bar("focal_percent", "%", 0.127, at_most=0.165, absolute=True),
        Bar("overlap_px", "px", 0.67, at_most=0.87),
        Bar("overlap_p90_px", "px", 11.3, at_most=14.2),
        Bar("alone_px", "px", 3.15, at_most=4.1),
        Bar("range_log", "", 0.0147, at_most=0.0191),
        Bar("psnr_db", "dB", 23.6, at_least=22.6),
    ),
    "chain": (
        Bar("guessed_lengths", "", 2.0, at_most=2.0, at_least=2.0),
        Bar("rotation_max_deg", "°", 0.894, at_most=1.16),
        Bar("position_max_mm", "mm", 61.4, at_most=74.8),
        Bar("focal_percent", "%", -0.00477, at_most=0.05, absolute=True),
        Bar("overlap_px", "px", 7.44, at_most=9.68),
        Bar("overlap_p90_px", "px", 14.3, at_most=18.6),
        Bar("alone_px", "px", 7.02, at_most=9.12),
        Bar("range_log", "", 0.18, at_most=0.233),
        Bar("psnr_db", "dB", 21.3, at_least=20.3),
    ),
    "two_lenses": (
        Bar("rotation_max_deg", "°", 0.0857, at_most=0.111),
        Bar("position_max_mm", "mm", 12.5, at_most=14.6),
        Bar("focal_percent", "%", 0.135, at_most=0.176, absolute=True),
        Bar("k1_error", "", 0.00118, at_most=0.00154, absolute=True),
        Bar("overlap_px", "px", 0.592, at_most=0.769),
        Bar("overlap_p90_px", "px", 2.65, at_most=3),
        Bar("alone_px", "px", 1.11, at_most=1.45),
        Bar("range_log", "", 0.0678, at_most=0.075),
        Bar("psnr_db", "dB", 29.1, at_least=28.1),
    ),
    "mover": (
        Bar("rotation_max_deg", "°", 0.0216, at_most=0.03),
        Bar("position_max_mm", "mm", 1.99, at_most=2.59),
        Bar("focal_percent", "%", -0.0219, at_most=0.043, absolute=True),
        Bar("overlap_px", "px", 0.223, at_most=0.29),
        Bar("overlap_p90_px", "px", 0.812, at_most=1.06),
        Bar("alone_px", "px", 0.503, at_most=0.654),
        Bar("range_log", "", 0.00659, at_most=0.00857),
        Bar("psnr_db", "dB", 24.6, at_least=23.6),
    ),
    "outdoor": (
        Bar("rotation_max_deg", "°", 0.0415, at_most=0.0539),
        Bar("position_max_mm", "mm", 4.76, at_most=6.19),
        Bar("focal_percent", "%", 0.0083, at_most=0.0165, absolute=True),
        Bar("overlap_px", "px", 0.354, at_most=0.45),
        Bar("overlap_p90_px", "px", 3.51, at_most=4.4),
        Bar("alone_px", "px", 0.784, at_most=0.9),
        Bar("range_log", "", 0.0265, at_most=0.0345),
        Bar("psnr_db", "dB", 36.1, at_least=35.5),
    ),
    "tripod": (
        Bar("rotation_deg", "°", 0.019, at_most=0.03),
        Bar("rotation_max_deg", "°", 0.037, at_most=0.05),
        Bar("places", "", 1.0, at_most=1.0),
        Bar("focal_percent", "%", -0.03, at_most=0.1, absolute=True),
        Bar("overlap_px", "px", 0.19, at_most=0.25),
        Bar("overlap_p90_px", "px", 0.39, at_most=0.51),
        Bar("alone_px", "px", 0.34, at_most=0.44),
        Bar("psnr_db", "dB", 41.1, at_least=40.1),
    ),
    "street_sweep": (
        Bar("rotation_max_deg", "°", 0.016, at_most=0.03),
        Bar("position_max_mm", "mm", 0.39, at_most=0.75),
        Bar("focal_percent", "%", -0.08, at_most=0.1, absolute=True),
        Bar("overlap_px", "px", 0.38, at_most=0.5),
        Bar("overlap_p90_px", "px", 25.1, at_most=32.6),
        Bar("alone_px", "px", 0.35, at_most=0.45),
        Bar("range_log", "", 0.0042, at_most=0.0055),
        Bar("psnr_db", "dB", 27.5, at_least=26.5),
    ),
    "mixed": (
        Bar("rotation_deg", "°", 0.036, at_most=0.047),
        Bar("rotation_max_deg", "°", 0.355, at_most=0.46),
        Bar("position_max_mm", "mm", 15.8, at_most=20.5),
        Bar("places", "", 5.0, at_most=5.0),
        Bar("focal_percent", "%", -0.01, at_most=0.1, absolute=True),
        Bar("overlap_px", "px", 0.26, at_most=0.34),
        Bar("overlap_p90_px", "px", 0.42, at_most=0.55),
        Bar("alone_px", "px", 1.91, at_most=2.5),
        Bar("range_log", "", 0.048, at_most=0.062),
        Bar("psnr_db", "dB", 30.4, at_least=29.4),
    ),
    "stray": (
        Bar("rotation_max_deg", "°", 0.065, at_most=0.085),
        Bar("position_max_mm", "mm", 5.8, at_most=7.5),
        Bar("focal_percent", "%", 0.14, at_most=0.18, absolute=True),
        Bar("overlap_px", "px", 0.92, at_most=1.2),
        Bar("overlap_p90_px", "px", 1.58, at_most=2.1),
        Bar("alone_px", "px", 1.54, at_most=2.0),
        Bar("range_log", "", 0.0109, at_most=0.0142),
        Bar("psnr_db", "dB", 29.7, at_least=28.7),
    ),
}


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
