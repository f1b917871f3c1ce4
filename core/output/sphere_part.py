"""Which part of a sphere a panorama shows, for those who view it as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..pictures.gpano import SpherePart

if TYPE_CHECKING:
    from ..pipeline import StitchResult


def sphere_part_of(result: StitchResult) -> SpherePart | None:
    """The part of the sphere that an equirectangular panorama shows; None for all others."""
    canvas = result.canvas
    if canvas.projection is None or canvas.projection.sphere is None:
        return None
    left, top, width, height = canvas.whole
    heading = result.pictures[0].exif.heading
    if heading is not None:
        heading -= result.report["canvas"]["projection"]["level"][0]  # the reference's yaw in the panorama
    return SpherePart((width, height), (-left, -top, canvas.width, canvas.height), heading)
