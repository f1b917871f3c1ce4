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
OURS, ROTATION_ONLY = "ours", "rotation only"


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


# Sets by name. Bounds are the project's aims where those were met, else 1.3 × what was measured, or 1 dB below it.
BARS: dict[str, tuple[Bar, ...]] = {
    "small_room": (
        Bar("rotation_max_deg", "°", 0.026, at_most=0.05),
        Bar("position_max_mm", "mm", 3.6, at_most=7.0),
        Bar("focal_percent", "%", -0.01, at_most=0.1, absolute=True),
        Bar("overlap_px", "px", 0.40, at_most=0.55),
        Bar("overlap_p90_px", "px", 1.14, at_most=1.5),
        Bar("alone_px", "px", 0.62, at_most=0.8),
        Bar("range_log", "", 0.0069, at_most=0.01),
        Bar("psnr_db", "dB", 29.4, at_least=28.4),
    ),
}


def set_checks(result: Result) -> list[Check]:
    """All that is asked of a set that was measured: the truth proves itself, exactly those pictures are left out that
    show another place, its own bars hold, and where there is parallax one place for all is worse."""
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
        mine = number(figures.get("psnr_db"))
        for rival, run in result["runs"].items():
            theirs = number((run.get("figures") or {}).get("psnr_db"))
            if rival != OURS and not run["refused"]:
                lead = None if mine is None or theirs is None else mine - theirs
                limit = Limit(OURS, f"psnr_db over {rival}", "dB", at_least=0.0)
                checks.append(_checked(scene, limit, lead))
    return checks


def _checked(scene: str, limit: Limit, value: float | None) -> Check:
    return Check(scene, limit.run, limit.measure, value, limit.text, limit.unit, limit.holds(value))
