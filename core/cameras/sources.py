"""Intrinsics as given or from a camera file, else by EXIF; and how precise they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import BadRequest
from .camera import Camera, Knowledge
from .from_circle import assumed_of_circle
from .from_exif import camera_from_exif, camera_of_focal, focal_from_35mm
from .lens_entries import lens_of
from .options import INTRINSICS
from .plausible import check_plausible, fold_warning
from .programs.lensfun import LensProfile
from .programs.recognised import read_any

if TYPE_CHECKING:
    from ..pictures.metadata import Exif


@dataclass(frozen=True)
class CameraRequest:
    """What the user said about the cameras; one value serves all pictures, two are reference and target of a pair.

    focal_px, focal_mm with sensor_mm (sensor width), focal35; principal (x, y) or (x, y, x', y') px; cameras: a camera
    file's path or its content (see `read_camera_file`), whose `unit` may be "metres".
    """

    focal_px: tuple[float, ...] = ()
    focal_mm: tuple[float, ...] = ()
    sensor_mm: tuple[float, ...] = ()
    focal35: tuple[float, ...] = ()
    principal: tuple[float, ...] = ()
    cameras: str | Path | dict[str, Any] | None = None

    @property
    def of_two(self) -> bool:
        """Whether a value is that of one of two pictures."""
        focals = (self.focal_px, self.focal_mm, self.sensor_mm, self.focal35)
        return any(len(values) == 2 for values in focals) or len(self.principal) == 4

    def __post_init__(self) -> None:
        ways = [self.focal_px, self.focal_mm, self.focal35, (self.cameras,) if self.cameras is not None else ()]
        if sum(bool(way) for way in ways) > 1:
            raise BadRequest(
                "give the focal length one way only: px, mm with sensor width, 35 mm equivalent, or a camera file"
            )
        if bool(self.focal_mm) != bool(self.sensor_mm):
            raise BadRequest(
                "--focal-mm and --sensor-mm go together: the focal length and the sensor's width, both in mm"
            )
        for name, values in (
            ("focal length", (*self.focal_px, *self.focal_mm, *self.focal35)),
            ("sensor width", self.sensor_mm),
        ):
            if any(not np.isfinite(v) or v <= 0 for v in values):
                raise BadRequest(f"a {name} must be a number above 0")
        if any(len(v) > 2 for v in (self.focal_px, self.focal_mm, self.sensor_mm, self.focal35)):
            raise BadRequest(
                "give one focal length for all pictures, or two of a pair: reference,target; of more pictures each has "
                "its own in --cameras FILE.json"
            )
        if len(self.principal) not in (0, 2, 4) or not np.isfinite(self.principal).all():
            raise BadRequest("--principal takes X,Y for all pictures, or X,Y,X2,Y2 of a pair")


def role(number: int) -> str:
    """What messages and camera files call a picture."""
    return "reference" if number == 0 else "target"


def called(number: int, names: Sequence[str]) -> str:
    """What messages call one of these pictures: of two by its role, of more by its name."""
    return f"the {role(number)}" if len(names) == 2 else names[number]


def cameras_for(
    request: CameraRequest, names: Sequence[str], sizes: Sequence[tuple[int, int]], exifs: Sequence[Exif],
    known: Sequence[Camera | None] = (),
) -> tuple[list[Camera], list[str]]:  # fmt: skip
    """What is known of the pictures' cameras before matching.

    The user's word comes first, then EXIF, then another picture's focal length, then a usual one.

    Parameters
    ----------
    request : CameraRequest
        What the user said.
    names : sequence of str
        What a camera file would call the pictures.
    sizes : sequence of (int, int)
        (W, H) px after orientation was applied.
    exifs : sequence of Exif
        Of the upright pictures.
    known : sequence of (Camera or None), optional
        Cameras that follow from what a picture is; only a camera file knows better, and no other picture is taken by
        them.

    Returns
    -------
    cameras : list of Camera
    warnings : list of str
        Where EXIF contradicts itself, a camera file names what is no picture, or a distortion folds the picture or
        was removed already.

    Raises
    ------
    BadRequest
        The camera file lacks a picture or holds something else, or what is given is no lens's.
    UnreadableImage
        The camera file cannot be read.
    """
    warnings: list[str] = []
    profiles: dict[str, LensProfile] = {}
    known = known or [None] * len(names)
    held: Sequence[Camera | None] = known
    if request.cameras is not None:
        table, unit = camera_table(request.cameras, names, exifs)
        profiles = {name: entry for name, entry in table.items() if isinstance(entry, LensProfile)}
        if not profiles:
            told = read_camera_file({"cameras": table, "unit": unit}, names, sizes)
            held = [own if one is None else replace(one, view_of=own.view_of) if own else one
                    for one, own in zip(told, known, strict=True)]  # fmt: skip
        if len(names) > 2 and set(table) - set(names):
            warnings.append(f"the camera file names what is none of the pictures: {_strangers(table, names)}")
    cameras = [
        camera or _one_camera(request, called(number, names), number, size, exif, warnings)
        for number, (camera, size, exif) in enumerate(zip(held, sizes, exifs, strict=True))
    ]
    if None in held:
        lenders = (n for n, camera in enumerate(cameras) if known[n] is None and not camera.assumed)
        lender = next(lenders, None)
        if lender is not None:  # one lens took all pictures more often than not
            lent, name = cameras[lender], "the other picture" if len(names) == 2 else names[lender]
            cameras = [_with_lens_of(lent, camera, name) if camera.assumed else camera for camera in cameras]
    if profiles:
        cameras = [
            profiles[name].on(camera) if own is None else camera
            for name, camera, own in zip(names, cameras, known, strict=True)
        ]
    if request.principal:
        values = [request.principal[i : i + 2] for i in range(0, len(request.principal), 2)]
        cameras = [
            camera if known[number] else _with_principal_point(camera, values[min(number, len(values) - 1)])
            for number, camera in enumerate(cameras)
        ]
    warnings += [assumed_of_circle(name) for name, own, camera in zip(names, known, cameras, strict=True)
                 if camera is own and camera.view_of is None]  # fmt: skip
    for number, (camera, exif) in enumerate(zip(cameras, exifs, strict=True)):
        if known[number] is not None:
            continue
        if exif.undistorted and camera.distortion.any():
            warnings.append(
                f"{called(number, names)} says that its lens's distortion was removed already, and --cameras removes "
                "it once more: give its focal length without a distortion, or pictures as the camera took them"
            )
        check_plausible(camera, called(number, names))
        folds = fold_warning(camera, called(number, names))
        warnings += [folds] if folds else []
    return cameras, warnings


def _with_lens_of(known: Camera, unknown: Camera, name: str) -> Camera:
    """An unknown camera with the lens of a known one, that of the picture of this name."""
    guess = known.focal * max(unknown.size) / max(known.size)
    # the same knowledge as the other picture's, so that the focal prior does not count it twice
    source = f"{name} ({known.source})"
    found = camera_of_focal(guess, unknown.size, source, INTRINSICS.cropped_sigma, known.knowledge)
    return replace(found, lens_of=name)


def _one_camera(
    request: CameraRequest, name: str, index: int, size: tuple[int, int], exif: Exif, warnings: list[str]
) -> Camera:
    def pick(values: tuple[float, ...]) -> float:
        return values[min(index, len(values) - 1)]

    if request.focal_px:
        return camera_of_focal(pick(request.focal_px), size, "given in px", 0.0)
    if request.focal_mm:
        # the sensor's width lies along the picture's longer side, however the camera was turned
        return camera_of_focal(pick(request.focal_mm) / pick(request.sensor_mm) * max(size), size, "given in mm", 0.0)
    if request.focal35:
        return camera_of_focal(focal_from_35mm(pick(request.focal35), size), size, "given as 35 mm equivalent", 0.0)
    return camera_from_exif(exif, size, name, warnings)


def _with_principal_point(camera: Camera, principal: tuple[float, ...]) -> Camera:
    K = camera.K.copy()
    K[:2, 2] = principal
    return replace(camera, K=K, principal_sigma=0.0)


def read_camera_file(
    source: str | Path | dict[str, Any], names: Sequence[str], sizes: Sequence[tuple[int, int]]
) -> list[Camera | None]:
    """Cameras of the pictures from a JSON file or its content.

    Parameters
    ----------
    source : str, path or dict
        {"cameras": {NAME: {"K": 3×3, "distortion": [k1, k2, p1, p2, k3]?, "lens": {…}?, "R": 3×3?, "t": [3]?}},
        "unit": UNIT?} with NAME the picture's file name, or "reference" and "target"; x ~ K (R X + t), OpenCV axes,
        integer pixel centres; `lens`, in place of a distortion, as for `lens_of`; UNIT is "metres" if t is in metres,
        "baselines" if in none that is known (docs/formats.md says what more an entry may hold). Or a file of another
        program (`programs.recognised`).
    names : sequence of str
        The pictures' file names.
    sizes : sequence of (int, int)
        Their (W, H) px.

    Returns
    -------
    list of Camera or None
        None for those of more than two pictures that the file does not name.

    Raises
    ------
    BadRequest
        For the content.
    UnreadableImage
        For the file.
    """
    table, unit = camera_table(source, names)
    out: list[Camera | None] = []
    several = len(names) > 2
    for number, (name, size) in enumerate(zip(names, sizes, strict=True)):
        entry = table.get(name) if several else table.get(name, table.get(role(number)))
        if several and name not in table:
            out.append(None)
            continue
        if not isinstance(entry, dict):
            if several:
                raise BadRequest(f"the camera of {name}: an object with K and perhaps distortion, R and t is needed")
            raise BadRequest(
                f"the camera file has no camera named {name!r} or {role(number)!r}; it has: "
                f"{_strangers(table, ())}"
            )
        out.append(replace(_camera_from_entry(entry, name, size), in_metres=unit == "metres"))
    named = [camera for camera in out if camera is not None]
    if not named:
        raise BadRequest(
            f"the camera file names none of the pictures ({', '.join(names[:3])}, …); it has: "
            f"{_strangers(table, ())}"
        )
    posed = sum(camera.pose is not None for camera in named)
    if posed == 1 or (posed and not several and posed < len(named)):
        if several and set(table) - set(names):
            raise BadRequest(
                "the camera file gives R and t for one of the pictures only; it also names what is none of them: "
                f"{_strangers(table, names)}; check the spelling"
            )
        raise BadRequest("the camera file gives R and t for one picture only: give both or neither")
    return out


def camera_table(
    source: str | Path | dict[str, Any], names: Sequence[str], exifs: Sequence[Exif] = ()
) -> tuple[dict[str, Any], str]:
    """What a camera file of any program (`programs.recognised`), or a camera file's content, holds by the names of
    pictures, and its unit. Raises as `read_camera_file` does."""
    content: Any = source if isinstance(source, dict) else read_any(Path(source), names, exifs)
    table = content.get("cameras", content) if isinstance(content, dict) else None
    if not isinstance(table, dict):
        raise BadRequest('a camera file holds {"cameras": {"NAME": {"K": [[…]], "R": [[…]], "t": […]}}}')
    unit = content.get("unit", "baselines") if table is not content else "baselines"
    if unit not in ("metres", "baselines"):
        raise BadRequest(f"the unit of the camera file is {unit!r}: it is metres, or baselines if it is not known")
    return table, str(unit)


def _strangers(table: dict[str, Any], names: Sequence[str]) -> str:
    """What a camera file names and is none of the pictures, the first few of many, each shortened."""
    strangers = [str(name)[:80] for name in table if name not in names]
    return ", ".join(strangers[:5]) + (", …" if len(strangers) > 5 else "")


def _camera_from_entry(entry: dict[str, Any], name: str, size: tuple[int, int]) -> Camera:
    K = _matrix(entry, "K", (3, 3), name)
    if not (K[0, 0] > 0 and K[1, 1] > 0 and np.allclose(K[2], (0, 0, 1)) and K[1, 0] == 0):
        raise BadRequest(f"the camera of {name}: K must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy above 0")
    distortion = np.zeros(5)
    if entry.get("distortion") is not None:
        try:
            values = np.asarray(entry["distortion"], np.float64).ravel()
        except (TypeError, ValueError, OverflowError):
            values = np.full(1, np.nan)
        if len(values) > 5 or not np.isfinite(values).all():
            raise BadRequest(f"the camera of {name}: distortion is at most k1, k2, p1, p2, k3")
        distortion[: len(values)] = values
    own = _size_of(entry, name, size)
    lens = None if entry.get("lens") is None else lens_of(entry["lens"], K, own, name)
    if lens is not None and distortion.any():
        raise BadRequest(f"the camera of {name}: it has a distortion and a lens; give one of them")
    pose = None
    if entry.get("R") is not None or entry.get("t") is not None:
        pose = (_rotation(entry, "R", name), _matrix(entry, "t", (3,), name))
    start = None if entry.get("start") is None else _rotation(entry, "start", name)
    sigma = entry.get("focal_sigma", 0.0)
    if not isinstance(sigma, (int, float)) or not 0 <= sigma < 10:
        raise BadRequest(f"the camera of {name}: focal_sigma is the deviation of the log of its focal length, 0 to 10")
    camera = Camera(K, own, "camera file", float(sigma), distortion, pose, lens=lens, start=start)
    if sigma:
        camera = replace(camera, principal_sigma=INTRINSICS.principal_sigma, knowledge=Knowledge.EXIF)
    return camera if own == size else camera.resized(size)


def _size_of(entry: dict[str, Any], name: str, size: tuple[int, int]) -> tuple[int, int]:
    """The size (W, H) px that a camera is about: the picture's own (`size`), or another one of the same shape."""
    told = entry.get("size")
    if told is None:
        return size
    whole = isinstance(told, list) and all(isinstance(one, int) and 0 < one < 2**31 for one in told)
    if not (whole and len(told) == 2):
        raise BadRequest(f"the camera of {name}: size must be [width, height], px")
    if abs(told[0] * size[1] - told[1] * size[0]) > max(*told, *size):
        turned = "; it is about the picture as it is stored, and EXIF turns it" if told[::-1] == list(size) else ""
        raise BadRequest(
            f"the camera of {name} is one of {told[0]} × {told[1]} px, the picture has {size[0]} × {size[1]}{turned}: "
            "give the picture that it is about"
        )
    return told[0], told[1]


def _rotation(entry: dict[str, Any], key: str, name: str) -> NDArray[np.float64]:
    """The rotation nearest to the matrix of an entry: files carry six digits."""
    U, S, Vt = np.linalg.svd(_matrix(entry, key, (3, 3), name))
    if np.abs(S - 1).max() > 1e-3 or np.linalg.det(U @ Vt) < 0:
        raise BadRequest(f"the camera of {name}: {key} is not a rotation matrix")
    rotation: NDArray[np.float64] = U @ Vt
    return rotation


def _matrix(entry: dict[str, Any], key: str, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    try:
        value = np.asarray(entry[key], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        value = np.empty(0)
    if value.shape != shape or not np.isfinite(value).all():
        raise BadRequest(f"the camera of {name}: {key} must be {'×'.join(map(str, shape))} numbers")
    return value
