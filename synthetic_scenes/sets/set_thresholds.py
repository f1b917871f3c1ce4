"""All that the validation asks of sets, with what was measured."""

from __future__ import annotations

from ..limits import Limit

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
