"""What viewers of spheres need to be told, and what files tell of being one: XMP with the properties of Google's Photo
Sphere (GPano).

References
----------
Google, Photo Sphere XMP Metadata.
"""

from __future__ import annotations

import math
import re
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


def whole_sphere(size: tuple[int, int]) -> SpherePart:
    """All of a sphere, in a picture of (W, H) px."""
    return SpherePart(size, (0, 0, *size))


# A property of XMP, as an attribute or an element.
_TOLD = rb"GPano:%b\s*(?:=\s*[\"']|>)\s*([\w.+-]+)"


def sphere_part_told(data: bytes, size: tuple[int, int]) -> SpherePart | None:
    """Which part of a sphere a picture of (W, H) px shows, by its file's XMP; None where that does not say, or says
    what cannot be. Numbers about another size, of a picture that was resized, are taken in proportion."""
    if _text(data, "ProjectionType").lower() != "equirectangular":
        return None
    width, height = size
    numbers = [
        _number(data, name) for name in (
            "CroppedAreaLeftPixels", "CroppedAreaTopPixels", "CroppedAreaImageWidthPixels",
            "CroppedAreaImageHeightPixels", "FullPanoWidthPixels", "FullPanoHeightPixels",
        )
    ]  # fmt: skip
    left, top, own_width, own_height, full_width, full_height = numbers
    if not all(number is None or math.isfinite(number) for number in numbers) or 0 in (own_width, own_height):
        return None
    if full_width is None or full_height is None:  # only a whole sphere needs no numbers
        return whole_sphere(size) if width == 2 * height else None
    across, down = width / (own_width or width), height / (own_height or height)
    scaled = full_width * across, full_height * down, (left or 0) * across, (top or 0) * down
    if not all(map(math.isfinite, scaled)):  # the picture's own size next to 0
        return None
    full, box = (round(scaled[0]), round(scaled[1])), (round(scaled[2]), round(scaled[3]), width, height)
    inside = box[0] >= 0 and box[1] >= 0 and box[0] + width <= full[0] and box[1] + height <= full[1]
    return SpherePart(full, box) if inside and abs(full[0] - 2 * full[1]) <= 2 else None


def _text(data: bytes, name: str) -> str:
    found = re.search(_TOLD % name.encode(), data)
    return "" if found is None else found[1].decode("ascii", "replace")


def _number(data: bytes, name: str) -> float | None:
    """A property that is a number above or at 0; None where it is not there, NaN or infinity where it is something
    else, or too large for a number."""
    text = _text(data, name)
    if not text:
        return None
    return float(text) if re.fullmatch(r"\+?\d+(\.\d*)?", text) else math.nan


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
