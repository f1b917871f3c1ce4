"""What a user may decide about a stitch."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cameras.scale import ScaleMetres
from .cameras.sources import CameraRequest
from .choices import (
    BLENDS,
    BRACKETS,
    CENTRE,
    CROPS,
    EXPOSURES,
    FADES,
    FIELDS,
    GUIDES,
    HOLES,
    LEVELS,
    PROJECTIONS,
    ROUND_FIELDS,
    SEAMS,
    Brackets,
    Crop,
    Exposing,
    Level,
    Slide,
)
from .pictures.naming import number_of
from .system.errors import BadRequest

# Below a fiftieth of its side a photograph has too few pixels for features.
LEAST_SCALE = 0.02
# Beyond ten stops nothing is left of a photograph.
MOST_STOPS = 10


@dataclass(frozen=True)
class StitchOptions:
    """What a user may decide about a stitch; the defaults are right for two photographs of one camera.

    Attributes
    ----------
    field : str, default "slack"
        The displacement field, one of FIELDS.
    fade : str, default "continue"
        What becomes of depth outside the overlap, one of FADES.
    camera : CameraRequest
        What is known of the cameras. By default nothing: EXIF is asked, or the focal length estimated.
    matches : Path or ndarray (N, 4 or 5), optional
        Matches instead of those that are found: a file, or rows x, y, x2, y2[, weight] in px of the full pictures. They
        are used as given; those of a report's own file count as found.
    ignore : tuple of (Path, ndarray or None), default empty
        For each picture, the reference first, a mask of what is kept out of everything, white = ignored. None, and what
        is not named: nothing.
    ignore_in : tuple of (str, Path or ndarray), default empty
        The same by the names of pictures, with or without their suffix.
    show : tuple of (int or str, Path or ndarray), default empty
        By a picture's number, from 1, or name, a mask of what the panorama is to show of it, wherever seams are cut:
        white = from this picture. Where those of two pictures meet, the later picture counts.
    guides : tuple of (int or str, str, (4,) floats), default empty
        Lines that level "auto" holds to: a picture's number, from 1, or name; one of GUIDES; x, y, x', y' in px of the
        full picture.
    viewpoint : int, str or None, default None
        The picture from whose place a panorama of more than two is seen: its number, counted from 1, its name, or
        "centre" for the one that is best connected with all others. By default the first that connects with others.
    require_all : bool, default False
        Whether a picture that connects with no others is an error, and not left out.
    brackets : str or int, default "auto"
        Which pictures are exposures of one view, and become one of floats before everything else: one of BRACKETS, or
        how many in a row.
    scale_metres : (int or str, int or str, float), optional
        Two pictures, each by its number, counted from 1, or its name, and how many metres apart they were taken: then
        ranges are in metres. Else they are if the cameras that are given are, and in baselines if nothing is known.
    slide : float, (float, float, float) or "auto", default "auto"
        How far the viewpoint slides from the reference's place to the target's across the overlap: 0 stays, 1 goes all
        the way, "auto" chooses (docs/method.md). Of a pair with two more shares, from and to: within that part of the
        way across, as "auto" may choose to and the report's `slide.part` tells.
    projection : str, default "auto"
        The surface that the panorama lies on, one of PROJECTIONS, or "pannini:D" with a distance D from 0 to 1.
        "reference" keeps every pixel of the reference in its place: nothing slides, and nothing is cropped by itself.
    level : str or (yaw, pitch, roll), default "auto"
        How the panorama is turned: upright ("auto"), as the reference ("none"), or by the reference camera's angles in
        degrees (see `levelling`).
    centre : (yaw, pitch), optional
        Degrees right and up from the middle of all that is shown: moves the frame, turns nothing.
    fov : float, optional
        Horizontal field of view of the frame, degrees; all that is shown by default.
    scale : float, default 1
        Factor by which all pictures are resized first, from LEAST_SCALE to 1.
    crop : str or (left, top, width, height), default "auto"
        What is kept of the panorama: one of CROPS, or a box in px of it (see `crop_box`). "auto" keeps all on the
        reference's plane and of a sphere that is asked for.
    dense : bool, default True
        Whether every pixel of the overlap is searched for along its epipolar line.
    blend : str, default "multiband"
        How the pictures are blended, one of BLENDS.
    seam : str, default "graphcut"
        How the seam between them is found, one of SEAMS; `linear` blending has none.
    mask : Path or ndarray, optional
        Painted over the panorama, whole or as it is cropped: black = from the reference, white = from the target, gray
        or transparent = the seam decides.
    exposure : str or float, default "auto"
        What becomes of the pictures' light: one of EXPOSURES, or stops that are added to "auto" (docs/method.md). At
        "auto" both meet at one exposure between theirs, many at the median of all, and float pictures at the
        reference's.
    holes : str, default "auto"
        What becomes of pixels that no camera saw, one of HOLES: "auto" fills small closed holes, "inpaint" all that
        something near hid, which `linear` blending has none of; of more than two pictures all closed holes.
    preview : bool, default False
        Whether the panorama is only to be looked at, at one or two megapixels. Its geometry is found on the full
        pictures, so that with a cache the same call without it takes that over.
    seed : int, default 0
        Of every random choice, 0 to 2³¹ − 1.
    measure : bool, default True
        Whether the report also compares the pictures in the overlap, and holds matches back to see how far the field
        can be trusted.
    memory_gb : float, optional
        GB (of 10⁹ bytes) that a stitch may take: fewer threads work at once where they need more together, and pictures
        that do not fit even so are refused. By default half of what is free, and refused is what is more than all
        of it; of a pair as much as it takes. The outcome is the same.
    cache : Path, optional
        Folder where features, geometry and fields are kept for the next stitch of the same pictures; the outcome is the
        same. None: they are not kept.
    """

    field: str = "slack"
    fade: str = "continue"
    camera: CameraRequest = CameraRequest()
    matches: Path | NDArray[Any] | None = None
    ignore: tuple[Path | NDArray[Any] | None, ...] = ()
    ignore_in: tuple[tuple[str, Path | NDArray[Any]], ...] = ()
    show: tuple[tuple[int | str, Path | NDArray[Any]], ...] = ()
    guides: tuple[tuple[int | str, str, tuple[float, ...]], ...] = ()
    viewpoint: int | str | None = None
    require_all: bool = False
    brackets: Brackets = "auto"
    scale_metres: ScaleMetres | None = None
    slide: Slide = "auto"
    projection: str = "auto"
    level: Level = "auto"
    centre: tuple[float, float] | None = None
    fov: float | None = None
    scale: float = 1.0
    crop: Crop = "auto"
    dense: bool = True
    blend: str = "multiband"
    seam: str = "graphcut"
    mask: Path | NDArray[Any] | None = None
    exposure: Exposing = "auto"
    holes: str = "auto"
    preview: bool = False
    seed: int = 0
    measure: bool = True
    memory_gb: float | None = dataclasses.field(default=None, compare=False)
    cache: Path | None = dataclasses.field(default=None, compare=False)

    def ignored(self, number: int) -> Path | NDArray[Any] | None:
        """The mask of what is to be kept out of picture `number`, by its number."""
        return self.ignore[number] if number < len(self.ignore) else None

    def ignored_in(self, names: Sequence[str]) -> list[Path | NDArray[Any] | None]:
        """The mask of each of the pictures of these names. Raises BadRequest about a name that none of them has."""
        masks = [self.ignored(number) for number in range(len(names))]
        for name, mask in self.ignore_in:
            masks[number_of(name, names, "--ignore")] = mask
        return masks

    def shown_in(self, names: Sequence[str]) -> list[Path | NDArray[Any] | None]:
        """The mask of what is to be shown of each of the pictures of these names. Raises BadRequest as `ignored_in`."""
        masks: list[Path | NDArray[Any] | None] = [None] * len(names)
        for name, mask in self.show:
            masks[number_of(name, names, "--show") if isinstance(name, str) else name - 1] = mask
        return masks

    def guides_in(self, names: Sequence[str]) -> list[list[tuple[str, tuple[float, ...]]]]:
        """The guides of each of the pictures of these names. Raises BadRequest as `ignored_in`."""
        found: list[list[tuple[str, tuple[float, ...]]]] = [[] for _ in names]
        for name, kind, ends in self.guides:
            number = number_of(name, names, f"--{kind}") if isinstance(name, str) else name - 1
            found[number].append((kind, ends))
        return found

    def check_goes_with(self, count: int) -> None:
        """Raises BadRequest where an option makes no sense for so many pictures."""
        if count == 2:
            if self.viewpoint not in (None, 1, CENTRE):
                raise BadRequest("of two pictures the first is the viewpoint: name the other one first")
            return
        unfit = {
            f"the field {self.field!r}": (self.field not in ROUND_FIELDS, f"choose from: {', '.join(ROUND_FIELDS)}"),
            "a painted mask": (self.mask is not None, "name what is not to be shown by --ignore NAME=MASK"),
            "a part of the way that the viewpoint slides": (
                self.slide_by_hand is not None and self.slide_by_hand[1] != (0, 1), "give one number alone, how far"
            ),
            "the fade to infinity": (self.fade == "infinity", "choose --fade continue"),
            "a value for either of two cameras": (
                self.camera.of_two, "give one for all pictures, or each its own by --cameras FILE.json"
            ),
        }  # fmt: skip
        for what, (given, advice) in unfit.items():
            if given:
                raise BadRequest(f"{what} is for two pictures only, and {count} are given: {advice}")

    @property
    def surface(self) -> tuple[str, float | None]:
        """The kind of projection that is drawn, and the distance that "pannini:D" names: a field that knows the
        reference's plane only is drawn there."""
        kind, _, distance = self.projection.partition(":")
        if kind == "auto" and self.field not in ROUND_FIELDS:
            kind = "reference"
        return kind, float(distance) if distance else None

    @property
    def kept(self) -> Crop:
        """The crop, with "auto" decided where the projection does: on the reference's plane every pixel is kept, and
        a sphere that is asked for is a whole one."""
        return "full" if self.crop == "auto" and self.surface[0] in ("reference", "equirectangular") else self.crop

    @property
    def fills_holes(self) -> bool:
        """Whether what no camera saw may be filled."""
        return self.holes != "transparent"

    @property
    def has_seam(self) -> bool:
        """An average has none; bands need one, if only that which lies midway between the borders."""
        return self.blend == "multiband" or (self.blend == "feather" and self.seam != "none")

    @property
    def may_slide(self) -> bool:
        """On the reference's own plane the viewpoint stays."""
        return self.surface[0] != "reference" and (self.slide_by_hand is None or self.slide_by_hand[0] != 0)

    @property
    def slide_by_hand(self) -> tuple[float, tuple[float, float]] | None:
        """How far it slides, and within which part of the way, from and to shares of it; None where that is chosen."""
        if isinstance(self.slide, str):
            return None
        if not isinstance(self.slide, tuple):
            return self.slide, (0.0, 1.0)
        s1, start, end = self.slide
        return s1, (start, end)

    @property
    def few_features(self) -> bool:
        """A plain average by a smooth field is only looked at: it gets fewer features, found at a smaller size."""
        return self.blend == "linear" and not self.dense

    @property
    def files_read(self) -> list[Path]:
        """The files that these options name."""
        by_name = (mask for _, mask in (*self.ignore_in, *self.show))
        named = (self.camera.cameras, self.matches, *self.ignore, *by_name, self.mask)
        return [Path(one) for one in named if isinstance(one, (str, Path))]

    def __post_init__(self) -> None:
        for name, value, known in (
            ("field", self.field, FIELDS), ("fade", self.fade, FADES), ("blend", self.blend, BLENDS),
            ("seam", self.seam, SEAMS), ("holes", self.holes, HOLES),
        ):  # fmt: skip
            if value not in known:
                raise BadRequest(f"{name} {value!r} is not offered; choose from: {', '.join(known)}")
        self._check_slide()
        self._check_exposure()
        if not LEAST_SCALE <= self.scale <= 1.0:  # NaN too
            raise BadRequest(f"a scale of {self.scale:g}: it must lie between {LEAST_SCALE:g} and 1 (the full size)")
        if self.memory_gb is not None and not self.memory_gb > 0:  # NaN too
            raise BadRequest(f"{self.memory_gb:g} GB of memory: it must be more than 0")
        if not 0 <= self.seed < 2**31:
            raise BadRequest("the seed must be a whole number from 0 to 2147483647")
        if isinstance(self.viewpoint, int) and self.viewpoint < 1:
            raise BadRequest(f"the viewpoint {self.viewpoint}: pictures are counted from 1")
        if self.scale_metres is not None:
            one, other, metres = self.scale_metres
            if not 0 < metres < np.inf or one == other:
                raise BadRequest(
                    f"the scale {one}, {other}, {metres:g}: two different pictures, and their distance in metres above "
                    "0, are needed"
                )
        if self.brackets not in BRACKETS and not (isinstance(self.brackets, int) and self.brackets > 1):
            raise BadRequest(
                f"brackets {self.brackets!r} are not known; choose from: {', '.join(BRACKETS)}, or a number from 2"
            )
        self._check_preview()
        self._check_projection()
        self._check_level()
        self._check_frame()
        self._check_guides()
        if isinstance(self.crop, str) and self.crop not in CROPS:
            raise BadRequest(f"the crop {self.crop!r} is not known; choose from: {', '.join(CROPS)}, or X, Y, W, H")
        if not isinstance(self.crop, str) and (len(self.crop) != 4 or min(self.crop[:2]) < 0 or min(self.crop[2:]) < 1):
            raise BadRequest(
                f"the crop {self.crop} is no box: X, Y, W, H in px are needed, X and Y from 0, W and H at least 1"
            )

    def _check_preview(self) -> None:
        if self.preview and not isinstance(self.crop, str):
            raise BadRequest("a crop in px is one of the full panorama: of a preview leave it out")

    def _check_slide(self) -> None:
        if isinstance(self.slide, tuple):
            shares = [0.0, *self.slide[1:], 1.0]
            if len(self.slide) != 3 or not shares[0] <= shares[1] < shares[2] <= shares[3]:
                raise BadRequest(f"a slide of {self.slide}: beside how far, it is within a part of the way across the "
                                 "overlap, FROM,TO with 0 <= FROM < TO <= 1")  # fmt: skip
        if not (self.slide == "auto" if self.slide_by_hand is None else 0 <= self.slide_by_hand[0] <= 1):
            raise BadRequest(f"a slide of {self.slide}: it is a number from 0 (the reference's place) to 1, or auto")

    def _check_exposure(self) -> None:
        if isinstance(self.exposure, str) and self.exposure not in EXPOSURES:
            raise BadRequest(
                f"exposure {self.exposure!r} is not offered; choose from: {', '.join(EXPOSURES)}, or a number of stops"
            )
        if not isinstance(self.exposure, str) and not abs(self.exposure) <= MOST_STOPS:  # NaN too
            raise BadRequest(
                f"an exposure of {self.exposure:g} stops: it must lie between -{MOST_STOPS} and {MOST_STOPS}"
            )

    def _check_projection(self) -> None:
        kind, colon, distance = self.projection.partition(":")
        if kind not in PROJECTIONS or (colon and kind != "pannini"):
            raise BadRequest(
                f"projection {self.projection!r} is not offered; choose from: {', '.join(PROJECTIONS)}; pannini:D with "
                "a distance D from 0 (a plane) to 1"
            )
        try:
            known = not colon or 0 <= float(distance) <= 1
        except ValueError:
            known = False
        if not known:
            raise BadRequest(f"the distance in {self.projection!r} must be a number from 0 (a plane) to 1")
        if kind not in ("auto", "reference") and self.field not in ROUND_FIELDS:
            raise BadRequest(
                f"the field {self.field!r} knows the reference's plane only: for a {self.projection} panorama choose "
                f"from: {', '.join(ROUND_FIELDS)}"
            )

    def _check_level(self) -> None:
        if isinstance(self.level, str):
            if self.level not in LEVELS:
                known = ", ".join(LEVELS)
                raise BadRequest(f"the level {self.level!r} is not known; choose from: {known}, or yaw, pitch, roll")
        elif len(self.level) != 3 or not np.isfinite(self.level).all():
            raise BadRequest(f"the level {self.level} is not yaw, pitch, roll in degrees")

    def _check_guides(self) -> None:
        for name, kind, ends in self.guides:
            far = len(ends) == 4 and np.hypot(ends[0] - ends[2], ends[1] - ends[3]) >= 1 and np.abs(ends).max() <= 1e6
            if kind not in GUIDES or not far:  # NaN too
                raise BadRequest(
                    f"the guide {kind} of {name} needs two different points, at least 1 px apart and in or near the "
                    "picture: X,Y,X2,Y2 in px"
                )

    def _check_frame(self) -> None:
        if self.centre is not None and (len(self.centre) != 2 or not np.abs(self.centre).max() <= 180):  # NaN too
            raise BadRequest(f"the centre {self.centre} is not yaw, pitch in degrees, each from -180 to 180")
        if self.fov is not None and not 1 <= self.fov <= 360:
            raise BadRequest(f"a field of view of {self.fov:g} degrees: it must lie between 1 and 360")
        kind, framed = self.surface[0], self.centre is not None or self.fov is not None
        if kind == "equirectangular" and framed:
            raise BadRequest(
                "an equirectangular panorama is the whole sphere: leave centre and fov out, turn it by level, or cut a "
                "part out by crop"
            )
        if kind != "reference":
            return
        why = (
            "the projection reference keeps the reference's own plane and place" if self.projection == "reference" else
            f"the field {self.field!r} knows the reference's plane only"
        )  # fmt: skip
        for name, given in (
            ("level", not isinstance(self.level, str)), ("centre", self.centre is not None),
            ("fov", self.fov is not None), ("slide", self.slide_by_hand is not None and self.slide_by_hand[0] != 0),
        ):  # fmt: skip
            if given:
                other = "projection" if self.projection == "reference" else "field"
                raise BadRequest(f"{why}: leave the {name} out, or choose another {other}")
