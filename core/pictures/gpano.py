"""What viewers of spheres need to be told: an XMP packet with the properties of Google's Photo Sphere (GPano).

References
----------
Google, Photo Sphere XMP Metadata.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..raster.arrays import Box
from .metadata import SOFTWARE


@dataclass(frozen=True)
class SpherePart:
    """Which part of an equirectangular sphere a picture shows.

    Attributes
    ----------
    full : (int, int)
        (W, H) px of the whole sphere at the picture's scale.
    box : (left, top, width, height)
        px of it that the picture shows.
    heading : float, optional
        Degrees from north to the east at which the middle of the whole sphere looks.
    """

    full: tuple[int, int]
    box: Box
    heading: float | None = None

    @property
    def is_whole(self) -> bool:
        """Whether all of the sphere is shown."""
        return self.box == (0, 0, *self.full)


def xmp_packet(part: SpherePart) -> bytes:
    """The XMP packet of such a picture."""
    left, top, width, height = part.box
    properties = {
        "UsePanoramaViewer": "True", "ProjectionType": "equirectangular", "StitchingSoftware": SOFTWARE,
        "FullPanoWidthPixels": part.full[0], "FullPanoHeightPixels": part.full[1],
        "CroppedAreaLeftPixels": left, "CroppedAreaTopPixels": top,
        "CroppedAreaImageWidthPixels": width, "CroppedAreaImageHeightPixels": height,
    } | ({} if part.heading is None else {"PoseHeadingDegrees": f"{part.heading % 360:.1f}"})
    written = "".join(f'\n    GPano:{name}="{value}"' for name, value in properties.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        ' <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        '  <rdf:Description rdf:about="" xmlns:GPano="http://ns.google.com/photos/1.0/panorama/"'
        f'{written}/>\n'
        ' </rdf:RDF>\n</x:xmpmeta>\n<?xpacket end="r"?>'
    ).encode()
