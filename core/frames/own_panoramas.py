"""Panoramas of ours among the pictures that they were made of: they are no further witnesses of what these show."""

from __future__ import annotations

from collections.abc import Sequence

from ..pictures.metadata import SOFTWARE, Exif
from ..pictures.picture import Picture

_WHY = "it shows nothing that they do not, and what is wrong in it counts as if another camera had seen it so"
# DateTimeOriginal and SubSecTimeOriginal, which a panorama has from its reference.
_TAKEN = (36867, 37521)


def own_panorama_warnings(pictures: Sequence[Picture]) -> list[str]:
    """What is said of panoramas that were made by this program, as their EXIF says, of pictures given beside them.

    Parameters
    ----------
    pictures : sequence of Picture
        All that are given. A panorama was made of one whose camera and time it has; where no time is known that is
        left to the user, but of two pictures, one of which then is meant to be there.

    Returns
    -------
    list of str
    """
    photographs = [picture for picture in pictures if picture.exif.software != SOFTWARE]
    out = []
    for picture in pictures:
        if picture.exif.software != SOFTWARE or not photographs:
            continue
        source = next((one.name for one in photographs if _of_one_moment(one.exif, picture.exif)), None)
        if source is not None:
            out.append(
                f"{picture.name} is a panorama that EDF Stitch made of {source}, which is given beside it: {_WHY}; "
                "leave it out"
            )
        elif not picture.exif.text(_TAKEN[0]) and len(pictures) > 2:
            out.append(
                f"{picture.name} is a panorama that EDF Stitch made; if that was of pictures given beside it, leave it "
                f"out: {_WHY}"
            )
    return out


def _of_one_moment(first: Exif, second: Exif) -> bool:
    """Whether two pictures have one camera and time."""
    moments = [(one.make, one.model, *map(one.text, _TAKEN)) for one in (first, second)]
    return bool(first.text(_TAKEN[0])) and moments[0] == moments[1]
