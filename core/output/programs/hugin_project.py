"""A Hugin project: the pictures as they look from the panorama's middle at infinity, its frame, and control points.

The panorama's axes are x right, y down, z ahead (`cameras.programs.hugin`). Hugin knows no parallax: what it stitches
is ours of points infinitely far away.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ...cameras.camera import Camera
from ...cameras.lens import undistort, used_angle
from ...cameras.lens_models import Lens, LensProjection
from ...cameras.programs.hugin import PROJECTIONS
from ...cameras.projective import homogeneous, project
from ...panorama.canvas import border
from ...panorama.levelling import angles_of
from ...raster.arrays import Array
from ...system.errors import UnwritableOutput
from ..camera_file import FoundCamera
from .hugin_frame import Frame

# px that a lens may be off, after Hugin's coefficients were fitted to it, before that is said.
MOST_OFF = 0.1
# Radii of a picture at which those coefficients are fitted.
RADII = 200
_NUMBERS = {projection: number for number, projection in reversed(PROJECTIONS.items())}


@dataclass(frozen=True)
class HuginLens:
    """f: number of the projection; v: degrees that the picture's width covers; a, b, c; d, e: px that the principal
    point lies off the middle; off: px that the lens is off somewhere in the picture."""

    f: int
    v: float
    abc: tuple[float, ...]
    shift: tuple[float, float]
    off: float


def hugin_lens(camera: Camera, name: str) -> HuginLens:
    """The lens of Hugin's that is nearest to a camera's: to the last digit for pinholes, fisheyes, k1 and a, b, c.

    Raises
    ------
    UnwritableOutput
        The picture is wider than its projection shows.
    """
    (width, height), K = camera.size, camera.K
    half, lens = min(width, height) / 2, camera.lens or Lens()
    base = Lens(lens.projection)
    corners = _within_use(np.array([[0.0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]]), camera)
    along = np.linspace(0, 1, RADII)[1:, None] * (corners[np.argmax(np.hypot(*(corners - K[:2, 2]).T))] - K[:2, 2])
    rays = homogeneous(undistort(K[:2, 2] + along, camera)) @ np.linalg.inv(K).T
    s = base.shown_at(np.arctan(np.hypot(*project(rays).T)))
    used = s < base.shown_at(np.array(min(base.limit, 1.55)))
    # px = D s + C s² + B s³ + A s⁴; without distortion D alone
    powers = s[used, None] ** (1, 2, 3, 4)
    D, C, B, A = np.linalg.lstsq(powers, np.hypot(*along[used].T), rcond=None)[0] if camera.bent else (K[0, 0], 0, 0, 0)
    unit = _unit(half, (A, B, C, D))
    focal = unit * half
    abc = tuple(float(one) for one in (A / (focal * unit**3), B / (focal * unit**2), C / (focal * unit)))
    angle = float(base.angle_at(np.array(width / 2 / focal)))
    if not np.isfinite(angle):
        raise UnwritableOutput(f"{name}: its picture is wider than the projection {lens.projection} shows; write .json")
    ours = Lens(lens.projection, ptlens=abc, radius=1 / unit)
    K_hugin = np.array([[focal, 0, K[0, 2]], [0, focal, K[1, 2]], [0, 0, 1]])
    off = _off(camera, replace(camera, K=K_hugin, distortion=np.zeros(5), lens=ours))
    middle = (K[0, 2] - (width - 1) / 2, K[1, 2] - (height - 1) / 2)
    return HuginLens(_NUMBERS[LensProjection(lens.projection)], float(np.degrees(2 * angle)), abc, middle, off)


def _within_use(points: Array, camera: Camera) -> Array:
    """px (N, 2) of a picture, those further from the axis than the lens is used (see `used_angle`) moved in so far."""
    if camera.lens is None:
        return points
    away = points - camera.K[:2, 2]
    reach = float(camera.lens.shown_at(np.array(used_angle(camera.lens)))) * camera.focal
    within: Array = camera.K[:2, 2] + away * np.minimum(1, reach / np.maximum(np.hypot(*away.T), 1e-9))[:, None]
    return within


def _unit(half: float, polynomial: tuple[float, ...]) -> float:
    """Focal lengths a half of the shorter side of Hugin's lens: there D = f (1 − a − b − c)."""
    A, B, C, D = polynomial

    def off(unit: float) -> float:
        return half * unit - A / unit**3 - B / unit**2 - C / unit - D

    start = D / half
    if not (A or B or C):
        return start
    spread = next((one for one in (1.02, 1.1, 1.3, 2.0) if off(start / one) < 0 < off(start * one)), None)
    return start if spread is None else float(brentq(off, start / spread, start * spread, xtol=1e-15, rtol=1e-14))


def _off(camera: Camera, other: Camera) -> float:
    """px by which two cameras see the border of what is used of a picture in different directions, at most."""
    points = _within_use(border(camera.size), camera)
    seen = [homogeneous(undistort(points, one)) @ np.linalg.inv(one.K).T for one in (camera, other)]
    first, second = (rays / np.linalg.norm(rays, axis=1, keepdims=True) for rays in seen)
    return float(np.linalg.norm(first - second, axis=1).max() * camera.focal)


def hugin_project(
    found: Sequence[FoundCamera], frame: Frame, points: Iterable[tuple[int, int, Array]]
) -> tuple[bytes, list[str]]:
    """The content of a project, and warnings about lenses that Hugin's do not reach.

    Parameters
    ----------
    found : sequence of FoundCamera
        With poses, of which the places are left out.
    frame : Frame
        What the panorama shows.
    points : iterable of (int, int, (M, 4) array)
        Numbers of two pictures, and their matches: x, y, x', y' px of the full pictures.

    Returns
    -------
    bytes, list of str

    Raises
    ------
    UnwritableOutput
        A name that Hugin's lines do not hold, or a picture that its lenses do not.
    """
    lines = ["# hugin project file", "#hugin_ptoversion 2", frame.line, "m i0", "", "# images"]
    warnings = []
    for one in found:
        assert one.R is not None
        if any(not letter.isprintable() or letter == '"' for letter in one.name):
            raise UnwritableOutput(f"{one.name!r}: Hugin's lines hold no such name; rename the picture")
        lens, (width, height) = hugin_lens(one.camera, one.name), one.camera.size
        if lens.off > MOST_OFF:
            warnings.append(f"{one.name}: Hugin's lens a, b, c is up to {lens.off:.1f} px off the one that was used")
        values = {
            "f": lens.f, "v": lens.v, "Ra": 0, "Rb": 0, "Rc": 0, "Rd": 0, "Re": 0, "Eev": 0, "Er": 1, "Eb": 1,
            **dict(zip("rpy", reversed(angles_of(one.R @ frame.rotation)), strict=True)),
            "TrX": 0, "TrY": 0, "TrZ": 0, "j": 0, **dict(zip("abc", lens.abc, strict=True)),
            **dict(zip("de", lens.shift, strict=True)), "g": 0, "t": 0,
            "Va": 1, "Vb": 0, "Vc": 0, "Vd": 0, "Vx": 0, "Vy": 0, "Vm": 5,
        }  # fmt: skip
        told = " ".join(f"{key}{_number(value)}" for key, value in values.items())
        lines.append(f'i w{width} h{height} {told} n"{one.name}"')
    lines += ["", "# optimise", *(f"v r{k} p{k} y{k}" for k in range(1, len(found))), "v", "", "# control points"]
    for i, j, rows in points:
        lines += [
            f"c n{i} N{j} " + " ".join(f"{key}{_number(value)}" for key, value in zip("xyXY", row, strict=True)) + " t0"
            for row in rows
        ]
    return ("\n".join(lines) + "\n").encode(errors="replace"), warnings


def _number(value: float) -> str:
    """A number without an exponent's letter, which Hugin would take for a parameter: to the last bit that counts."""
    return str(value) if isinstance(value, int) else f"{float(value):.15f}".rstrip("0").rstrip(".")
