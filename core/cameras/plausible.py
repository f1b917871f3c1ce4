"""Whether intrinsics that were given can be a camera's at all."""

from __future__ import annotations

import numpy as np

from ..system.errors import BadRequest
from .camera import Camera
from .lens import fold_radius
from .options import PLAUSIBLE


def check_plausible(camera: Camera, name: str) -> None:
    """Refuse intrinsics that no lens has.

    Parameters
    ----------
    camera : Camera
        As it was given.
    name : str
        What its picture is called.

    Raises
    ------
    BadRequest
        With what was found and the range that is plausible.
    """
    K, side = camera.K, max(camera.size)
    least, most = PLAUSIBLE.least_focal * side, PLAUSIBLE.most_focal * side
    for focal in (K[0, 0], K[1, 1]):
        if not least <= focal <= most:
            raise BadRequest(
                f"{name}: a focal length of {focal:g} px is no lens's: a picture {side} px long has {least:.0f} to "
                f"{most:.0f} px (from fisheye to telescope); focal lengths in mm go with --focal-mm and --sensor-mm, "
                "or as 35 mm equivalent with --focal35"
            )
    aspect = K[1, 1] / K[0, 0]
    if not 1 / PLAUSIBLE.most_aspect <= aspect <= PLAUSIBLE.most_aspect:
        raise BadRequest(
            f"{name}: the two focal lengths of K, {K[0, 0]:g} and {K[1, 1]:g} px, differ by more than "
            f"{PLAUSIBLE.most_aspect:g}×; they are the same but for pixels that are not square"
        )
    if abs(K[0, 1]) > K[0, 0]:
        raise BadRequest(f"{name}: the skew of K is {K[0, 1]:g} px, more than its focal length; mostly it is 0")
    middle = (np.array(camera.size) - 1) / 2
    reach = PLAUSIBLE.principal_reach * side
    if np.abs(K[:2, 2] - middle).max() > reach:
        raise BadRequest(
            f"{name}: the principal point ({K[0, 2]:g}, {K[1, 2]:g}) lies more than {reach:.0f} px from the middle of "
            f"the picture ({middle[0]:g}, {middle[1]:g}): it is given in px of this picture"
        )


def fold_warning(camera: Camera, name: str) -> str | None:
    """What to say of a given distortion that turns back within the picture; None where it does not.

    Parameters
    ----------
    camera : Camera
    name : str
        What its picture is called.
    """
    found = fold_radius(camera)
    if found is None:
        return None
    fold, corner = (radius * camera.focal for radius in found)
    return (
        f"{name}: its distortion folds back {fold:.0f} px from the principal point, and the farthest corner is "
        f"{corner:.0f} px away: beyond it the lens is continued evenly, and what is there may be out of place; "
        "check the distortion (k1, k2, p1, p2, k3 as in OpenCV, for x = (u - cx) / fx)"
    )
