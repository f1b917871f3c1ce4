"""A lens in the words of OpenCV, COLMAP and NeRF programs, which share them."""

from __future__ import annotations

from ...cameras.lens_models import LensProjection
from ...system.errors import UnwritableOutput
from ..camera_file import FoundCamera


def opencv_model(found: FoundCamera, what: str) -> tuple[str, tuple[float, ...]]:
    """COLMAP's name of a camera's model, and its coefficients: none; k1, k2, p1, p2; with k3 as well; or k1 to k4 of
    a fisheye.

    Raises
    ------
    UnwritableOutput
        These programs (`what` of them) have no model for the lens.
    """
    lens, K = found.camera.lens, found.camera.K
    if lens is not None and lens.bends:
        if lens.projection != LensProjection.EQUIDISTANT or any(lens.ptlens):
            told = "with a, b, c" if any(lens.ptlens) else "as it is"
            raise UnwritableOutput(
                f"{found.name}: {what} has no model for its {lens.projection} lens {told}; write the cameras as .json "
                "or .pto"
            )
        model, values = "OPENCV_FISHEYE", tuple(lens.angular)
    else:
        k1, k2, p1, p2, k3 = (float(value) for value in found.camera.distortion)
        model, values = ("FULL_OPENCV", (k1, k2, p1, p2, k3)) if k3 else ("OPENCV", (k1, k2, p1, p2))
        if not any(values):
            model, values = "PINHOLE", ()
    if K[0, 1]:
        raise UnwritableOutput(f"{found.name}: its K has a skew, which {what} does not; write the cameras as .json")
    return model, values
