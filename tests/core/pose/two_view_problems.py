"""Random two-view point problems whose answer is known and decidable, and a table of what `estimate` makes of them.

    .venv/bin/python tests/core/two_view_problems.py [--jobs 2] [--only plane] [--indices 3,17,40-60]

The generator's own mathematics is NumPy alone: it must not inherit a mistake of what it judges.

A problem is only asked where its answer follows from the points. All is measured on the true inliers without noise,
with floor = max(noise, 0.3 px) and off = 3 · max(noise, 0.5 px):

- general: the best homography leaves an RMS of 5 floors or more; 15 % or more of the inliers lie `off` or further from
  the homography that holds most of them; and an epipole through two of these would not by chance, among all outliers,
  find the rest of them on its lines (number of false alarms below e⁻¹⁰).
- plane: the best rotation leaves an RMS of 5 floors or more, with the focal lengths free as far as they are unknown:
  EXIF ± 15 % each; nothing known: 0.4 to 8 longer sides, the second ± 35 % of the first.
- rotation has no parallax at all. With the very same camera twice, refusing is right as well.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.pose.estimation import estimate
from edf_stitch.core.system.errors import StitchError
from numpy.typing import NDArray

Array = NDArray[np.float64]

COUNT = 500
ATTEMPTS = 80
GIVEN, EXIF, UNKNOWN = "given", "EXIF", "unknown"
ANY = (GIVEN, EXIF, UNKNOWN)
# What calibrations each kind is asked with, in turn.
KINDS: dict[str, tuple[str, ...]] = {
    "general/sideways": ANY,
    "general/converging": ANY,
    "general/oblique": ANY,
    "general/forward": ANY,
    "general/parallel": ANY,
    "general/two layers": ANY,
    "general/dominant plane": ANY,
    "general/points at infinity": ANY,
    "general/portrait": ANY,
    "general/two sizes": ANY,
    "general/two lenses": (GIVEN, EXIF),
    "general/short lens": ANY,
    "general/long lens": ANY,
    "general/principal point": (GIVEN,),
    "general/many outliers": ANY,
    "plane/tilted": ANY,
    "plane/frontal": ANY,
    "plane/floor": ANY,
    "plane/forward": ANY,
    "rotation/turned": ANY,
    "rotation/small": ANY,
    "rotation/roll": ANY,
    "rotation/zoom": (GIVEN, EXIF),
    "rotation/unknown": (UNKNOWN,),
    "rotation/identity": ANY,
    "refused/chance": ANY,
    "refused/too few": ANY,
    "refused/line": ANY,
    "refused/spot": ANY,
}
NAMES = tuple(KINDS)
# Numbers of matches, a stratum per round through the kinds.
STRATA = ((60, 140), (140, 350), (350, 850), (850, 2000))
SIZES = ((1200, 900), (1600, 1200), (1920, 1080), (640, 480), (1500, 1000), (1024, 1024))
FULL_FRAME_DIAGONAL = math.hypot(36, 24)


@dataclass(frozen=True)
class Problem:
    """Matches, what is known of the cameras, and the truth: target sees X at R X + t with |t| = 1, t = 0 for a
    rotation, R and t None where there is nothing to find. `expected`: the outcomes that are right; `inliers` (N,): the
    true ones; `noise`: standard deviation of each coordinate in px; `outliers`: share."""

    index: int
    kind: str
    calibration: str
    expected: frozenset[str]
    matches: Matches
    camera: Camera
    camera_prime: Camera
    K: Array
    K_prime: Array
    R: Array | None
    t: Array | None
    inliers: NDArray[np.bool_]
    noise: float
    outliers: float

    @property
    def family(self) -> str:
        return self.kind.split("/")[0]


@dataclass(frozen=True)
class _Conditions:
    """What does not change between attempts to build a problem."""

    kind: str
    calibration: str
    count: int
    noise: float
    outliers: float

    @property
    def inliers(self) -> int:
        return self.count - round(self.outliers * self.count)


@dataclass(frozen=True)
class _Stage:
    """Two cameras and a way to draw inverse depths (N,) for rays (N, 3) with z = 1; t as long as the baseline."""

    size: tuple[int, int]
    size_prime: tuple[int, int]
    K: Array
    K_prime: Array
    R: Array
    t: Array
    inverse_depth: Callable[[np.random.Generator, Array], Array]

    def target(self, x: Array, inverse_depth: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Target pixels (N, 2) of reference pixels, and which of them are in the picture and in front."""
        there = _rays(x, self.K) @ self.R.T + inverse_depth[:, None] * self.t
        front = there[:, 2] > 1e-6
        y = _pixels(np.where(front[:, None], there, 1.0), self.K_prime)
        seen = front & (inverse_depth >= 0) & (y >= 0).all(axis=1) & (y <= np.array(self.size_prime) - 1).all(axis=1)
        return y, seen


def quick_indices() -> list[int]:
    """Three of every kind, each with another calibration, none with many matches: what a quick test has time for."""
    return [turn * len(NAMES) + i for turn in (0, 1, 8) for i in range(len(NAMES))]


def kind_of(index: int) -> tuple[str, str]:
    """Kind and calibration of a problem."""
    turn, which = divmod(index, len(NAMES))
    calibrations = KINDS[NAMES[which]]
    return NAMES[which], calibrations[turn % len(calibrations)]


def stratum_of(index: int) -> tuple[int, int]:
    """Between which numbers of matches a problem's lies, but for many outliers, which need more."""
    return STRATA[index // len(NAMES) % len(STRATA)]


def problem(index: int) -> Problem:
    """Problem 0 … 499; always the same one for the same index."""
    kind, calibration = kind_of(index)
    low, high = stratum_of(index)
    random = np.random.default_rng((index, ATTEMPTS))
    count = round(math.exp(random.uniform(math.log(low), math.log(high))))
    noise = 0.0 if random.random() < 0.15 else random.uniform(0, 1)
    outliers = random.choice([0.0, random.uniform(0, 0.3), random.uniform(0.3, 0.6)])
    if kind == "general/many outliers":
        outliers = 0.6
    count = max(count, math.ceil(60 / (1 - outliers)) + 1)  # enough inliers for there to be an answer
    conditions = _Conditions(kind, calibration, count, noise, outliers)
    for attempt in range(ATTEMPTS):
        found = _attempt(index, conditions, attempt)
        if found is not None:
            return found
    raise RuntimeError(f"problem {index}, {conditions}, could not be made decidable")


def _attempt(index: int, conditions: _Conditions, attempt: int) -> Problem | None:
    """The problem with this sub-seed, or None where it would not be decidable; later attempts stand further apart."""
    random = np.random.default_rng((index, attempt))
    family, variant = conditions.kind.split("/")
    # from hardly decidable to wide apart
    apart = math.exp(random.uniform(math.log(0.15), 0)) * 1.1**attempt
    stage = _stage(family, variant, random, apart)
    camera, camera_prime = _cameras(stage, conditions.calibration, variant in ("zoom", "two lenses"), random)
    if family == "refused":
        drawn = _hopeless(variant, stage, conditions.count, random)
    else:
        drawn = _draw(stage, conditions.inliers, random)
    if drawn is None:
        return None
    x, y = drawn
    strays = 0 if family == "refused" else conditions.count - conditions.inliers
    if family == "general" and not _general_is_evident(x, y, conditions.noise, strays, stage.size_prime, random):
        return None
    if family == "plane" and not _plane_is_evident(x, y, conditions.noise, camera, camera_prime):
        return None
    x, y = (points + random.normal(0, conditions.noise, points.shape) for points in (x, y))
    x = np.concatenate([x, _anywhere(stage.size, strays, random)])
    y = np.concatenate([y, _anywhere(stage.size_prime, strays, random)])
    order = random.permutation(len(x))
    hopeless = family == "refused"
    length = float(np.linalg.norm(stage.t))
    return Problem(
        index, conditions.kind, conditions.calibration,
        frozenset({"rotation", "refused"} if variant == "identity" else {family}),
        Matches(x[order], y[order]), camera, camera_prime, stage.K, stage.K_prime,
        None if hopeless else stage.R, None if hopeless else stage.t / (length or 1.0),
        np.zeros(len(x), bool) if hopeless else order < conditions.inliers,
        conditions.noise, 0.0 if hopeless else conditions.outliers,
    )  # fmt: skip


# --- how the cameras stand, and what they see ------------------------------------------------------------------------


def _stage(family: str, variant: str, random: np.random.Generator, apart: float) -> _Stage:
    size = SIZES[random.integers(len(SIZES))]
    if variant == "portrait":
        size = size[::-1]
    size_prime, focal35 = size, math.exp(random.uniform(math.log(24), math.log(60)))
    if variant == "short lens":
        focal35 = random.uniform(19, 24)
    if variant == "long lens":
        focal35 = random.uniform(85, 135)
    focal = focal35 * math.hypot(*size) / FULL_FRAME_DIAGONAL
    ratio = 1.0
    if variant == "two sizes":
        ratio = random.uniform(0.5, 1.5)
        size_prime = (round(size[0] * ratio), round(size[1] * ratio))
    if variant == "two lenses":
        ratio = random.choice([random.uniform(1.2, 1.6), 1 / random.uniform(1.2, 1.6)])
    if variant == "zoom":
        ratio = random.choice([random.uniform(1.15, 2), 1 / random.uniform(1.15, 2)])
    K, K_prime = _intrinsics(focal, size), _intrinsics(focal * ratio, size_prime)
    if variant == "principal point":
        K[:2, 2] += random.uniform(-0.2, 0.2, 2) * size
        K_prime[:2, 2] += random.uniform(-0.2, 0.2, 2) * size_prime
    half_view = math.atan(max(size) / 2 / focal)
    if family == "rotation":
        return _Stage(size, size_prime, K, K_prime, _turn(variant, half_view, random), np.zeros(3), _at_infinity)
    motion = {"sideways": "sideways", "converging": "converging", "oblique": "oblique", "forward": "forward",
              "parallel": "parallel", "floor": "sideways"}.get(variant)  # fmt: skip
    if motion is None:
        motion = ("sideways", "converging", "oblique")[random.integers(3)]
    R, place = _motion(motion, K, size, half_view, random, apart)
    inverse_depth = _depths(family, variant, half_view, random)
    return _Stage(size, size_prime, K, K_prime, R, -R @ place, inverse_depth)


def _turn(variant: str, half_view: float, random: np.random.Generator) -> Array:
    if variant == "identity":
        return np.eye(3)
    axis = _unit(random.normal(0, (0.5, 1, 0)))
    if variant == "small":
        return _rotation(math.radians(random.uniform(0.2, 1)) * axis)
    pan = _rotation(half_view * random.uniform(0.2, 0.9) * axis)
    if variant == "roll":
        return _rotation(np.array([0, 0, math.radians(random.uniform(-90, 90))])) @ pan
    return _rotation(np.array([0, 0, math.radians(random.uniform(-5, 5))])) @ pan


def _motion(
    motion: str, K: Array, size: tuple[int, int], half_view: float, random: np.random.Generator, apart: float
) -> tuple[Array, Array]:
    """R and the target camera's place in the reference's frame; the nearest points are one unit away."""
    wander = _rotation(random.normal(0, 0.05 * half_view, 3))
    pan = _rotation(half_view * random.uniform(0, 0.8) * _unit(random.normal(0, (0.4, 1, 0)))) @ wander
    aside = _unit(np.array([*random.normal(0, (1, 0.4)), 0]))
    tangent = 2 * math.tan(half_view)
    if motion == "parallel":
        return np.eye(3), apart * tangent * random.uniform(0.04, 0.12) * aside
    if motion == "sideways":
        return pan, apart * tangent * random.uniform(0.04, 0.12) * _unit(aside + random.normal(0, 0.05, 3))
    if motion == "oblique":
        ahead = random.choice([-1.0, 1.0]) * random.uniform(0.4, 1.2)
        return pan, apart * tangent * random.uniform(0.06, 0.15) * (aside + np.array([0, 0, ahead]))
    if motion == "forward":
        # as a share of the nearest depth; the epipole lies in the middle 60 % of the picture
        e = random.uniform(0.2, 0.8, 2) * size
        ahead = _unit(np.array([(e[0] - K[0, 2]) / K[0, 0], (e[1] - K[1, 2]) / K[1, 1], 1]))
        length = min(0.6, apart * random.uniform(0.15, 0.35))
        return _rotation(random.normal(0, 0.03 * half_view, 3)), random.choice([-1.0, 1.0]) * length * ahead
    # converging: both axes meet, up to a little, at one point between the nearest and twice that
    place = apart * tangent * random.uniform(0.1, 0.35) * _unit(aside + random.normal(0, 0.2, 3))
    towards = _unit(np.array([0, 0, random.uniform(1.0, 2.0)]) - place)
    axis = np.cross(towards, (0, 0, 1.0))
    return wander @ _rotation(_unit(axis) * math.asin(min(1.0, float(np.linalg.norm(axis))))), place


def _depths(
    family: str, variant: str, half_view: float, random: np.random.Generator
) -> Callable[[np.random.Generator, Array], Array]:
    """A way to draw inverse depths, in 1 / (the nearest depth); as distances in pictures go, evenly in 1/Z."""
    far = 1 / random.uniform(3, 15)
    slope = {"frontal": 0.0, "tilted": random.uniform(0.3, 0.8), "floor": random.uniform(0.8, 0.95)}.get(
        variant, random.uniform(0.2, 0.6)
    )
    across = random.choice([0.3, -0.3]) if variant == "floor" else random.uniform(-math.pi, math.pi)
    direction = slope / math.tan(half_view) * np.array([math.sin(across), math.cos(across)])

    def plane(rays: Array) -> Array:
        return (1 + rays[:, :2] @ direction) / (1 + slope)

    if family == "plane":
        return lambda _, rays: plane(rays)
    share = random.uniform(0.2, 0.4)

    def draw(random: np.random.Generator, rays: Array) -> Array:
        scattered = random.uniform(far, 1, len(rays))
        if variant == "two layers":
            return np.where(random.random(len(rays)) < 0.5, 1.0, 2 * far)
        if variant == "dominant plane":
            return np.where(random.random(len(rays)) < share, scattered, plane(rays))
        if variant == "points at infinity":
            return np.where(random.random(len(rays)) < 0.3, 0.0, scattered)
        return scattered

    return draw


def _at_infinity(_: np.random.Generator, rays: Array) -> Array:
    return np.zeros(len(rays))


def _cameras(stage: _Stage, calibration: str, zoom: bool, random: np.random.Generator) -> tuple[Camera, Camera]:
    """What is known: everything; the focal lengths from EXIF; nothing.

    EXIF is off by 3 %, for both pictures alike since it is one lens; a zoom, whose EXIF is rounded, by 1 % more.
    """
    off, rounding = random.normal(0, (0.03, 0.01 if zoom else 0.0))
    knowledge = {GIVEN: Knowledge.GIVEN, EXIF: Knowledge.EXIF}.get(calibration, Knowledge.ASSUMED)
    if calibration == GIVEN:
        believed, sigma = (stage.K, stage.K_prime), 0.0
    elif calibration == EXIF:
        focals = (stage.K[0, 0] * math.exp(off), stage.K_prime[0, 0] * math.exp(off + rounding))
        believed, sigma = (_intrinsics(focals[0], stage.size), _intrinsics(focals[1], stage.size_prime)), 0.05
    else:
        focals = (0.9 * max(stage.size), 0.9 * max(stage.size_prime))
        believed, sigma = (_intrinsics(focals[0], stage.size), _intrinsics(focals[1], stage.size_prime)), 0.4
    return (
        Camera(believed[0], stage.size, calibration, sigma, knowledge=knowledge),
        Camera(believed[1], stage.size_prime, calibration, sigma, knowledge=knowledge),
    )


# --- drawing points --------------------------------------------------------------------------------------------------


def _draw(stage: _Stage, count: int, random: np.random.Generator) -> tuple[Array, Array] | None:
    """So many noise-free matches that both pictures hold, or None where they hardly overlap."""
    x = _anywhere(stage.size, 8 * count, random)
    y, seen = stage.target(x, stage.inverse_depth(random, _rays(x, stage.K)))
    return (x[seen][:count], y[seen][:count]) if seen.sum() >= count else None


def _hopeless(
    variant: str, stage: _Stage, count: int, random: np.random.Generator
) -> tuple[Array, Array] | None:
    """Matches that say nothing about the cameras, before noise; None where they fall outside the target."""
    if variant == "chance":
        count = round(count * random.uniform(0.5, 1.5))
        return _anywhere(stage.size, count, random), _anywhere(stage.size_prime, count, random)
    if variant == "too few":
        return _draw(stage, int(random.integers(0, 15)), random)
    if variant == "spot":
        radius = random.uniform(1, 4)
        here, there = (_anywhere((w - 20, h - 20), 1, random) + 10 for w, h in (stage.size, stage.size_prime))
        offsets = random.uniform(-radius, radius, (count, 2))
        return here + offsets, there + offsets @ (np.eye(2) + random.normal(0, 0.1, (2, 2)))
    # a straight line in space: its inverse depth is linear along its picture
    ends = _anywhere(stage.size, 2, random)
    if np.linalg.norm(ends[1] - ends[0]) < 0.4 * max(stage.size):
        return None
    along = random.uniform(0, 1, (count, 1))
    x = ends[0] + along * (ends[1] - ends[0])
    depths = random.uniform(0.1, 1, 2)
    y, seen = stage.target(x, depths[0] + along[:, 0] * (depths[1] - depths[0]))
    return (x, y) if seen.all() else None


def _anywhere(size: tuple[int, int], count: int, random: np.random.Generator) -> Array:
    return random.uniform((0, 0), (size[0] - 1, size[1] - 1), (count, 2))


# --- is the answer in the points? ------------------------------------------------------------------------------------


def _general_is_evident(
    x: Array, y: Array, noise: float, strays: int, size_prime: tuple[int, int], random: np.random.Generator
) -> bool:
    """Whether no homography could be taken for the answer (see the head of this file)."""
    off = 3 * max(noise, 0.5)
    if _rms(_distances(_fitted_homography(x, y), x, y)) < 5 * max(noise, 0.3):
        return False
    left = int((_distances(_fullest_homography(x, y, off, random), x, y) >= off).sum())
    if left < max(3, 0.15 * len(x)):
        return False
    width, height = size_prime
    chance = 2 * off * math.hypot(width, height) / (width * height)
    pool = left + strays
    alarms = _log_choose(pool, 2) + _log_choose(pool - 2, left - 2) + (left - 2) * math.log(chance)
    return alarms < -10


def _plane_is_evident(x: Array, y: Array, noise: float, camera: Camera, camera_prime: Camera) -> bool:
    """Whether no rotation could be taken for the answer (see the head of this file)."""
    few = np.linspace(0, len(x) - 1, min(len(x), 100)).astype(int)
    x, y, longer = x[few], y[few], max(camera.size)
    lowest = highest = ratio = 0.0
    if camera.log_sigma == 0.05:
        lowest, highest, ratio = -0.15, 0.15, 0.15
    elif camera.log_sigma > 0:
        lowest, highest, ratio = math.log(0.4 * longer / camera.focal), math.log(8 * longer / camera.focal), 0.3

    def cameras(unknowns: Array) -> tuple[Array, Array]:
        first = float(np.clip(unknowns[3], lowest, highest))
        second = first + float(np.clip(unknowns[4], -ratio, ratio))
        return camera.scaled(math.exp(first)), camera_prime.scaled(math.exp(second))

    def residuals(unknowns: Array) -> Array:
        K, K_prime = cameras(unknowns)
        H = K_prime @ _rotation(unknowns[:3]) @ np.linalg.inv(K)
        return (_pixels(_homogeneous(x) @ H.T, np.eye(3)) - y).ravel()

    best = np.inf
    for first in np.linspace(lowest, highest, 5 if highest > lowest else 1):
        K, K_prime = cameras(np.array([0, 0, 0, first, 0]))
        start = np.array([*_aligning_rotation(_rays(x, K), _rays(y, K_prime)), first, 0])
        best = min(best, float(np.linalg.norm(residuals(_least_squares(residuals, start))) / math.sqrt(len(x))))
    return best >= 5 * max(noise, 0.3)


def _fitted_homography(x: Array, y: Array) -> Array:
    """The homography (3, 3) with the least squared distance in the target, from the first 150 points."""
    x, y = x[:150], y[:150]
    (a, to_a), (b, to_b) = _centred(x), _centred(y)
    rows = np.zeros((2 * len(a), 9))
    rows[0::2, :3] = rows[1::2, 3:6] = _homogeneous(a)
    rows[0::2, 6:], rows[1::2, 6:] = -b[:, :1] * _homogeneous(a), -b[:, 1:] * _homogeneous(a)
    start = np.linalg.svd(rows, full_matrices=False)[2][-1]

    def residuals(h: Array) -> Array:
        return (_pixels(_homogeneous(a) @ h.reshape(3, 3).T, np.eye(3)) - b).ravel()

    return np.linalg.inv(to_b) @ _least_squares(residuals, start / np.linalg.norm(start)).reshape(3, 3) @ to_a


def _fullest_homography(x: Array, y: Array, off: float, random: np.random.Generator) -> Array:
    """The homography that has most points within `off` of where it sends them, as far as 300 quadruples can tell."""
    few_x, few_y = x[:150], y[:150]
    (a, to_a), (b, to_b) = _centred(few_x), _centred(few_y)
    chosen = np.argsort(random.random((300, len(a))), axis=1)[:, :4]
    p, q = _homogeneous(a)[chosen], b[chosen]
    rows = np.zeros((300, 8, 8))
    rows[:, :4, :3] = rows[:, 4:, 3:6] = p
    rows[:, :4, 6:], rows[:, 4:, 6:] = -q[:, :, :1] * p[:, :, :2], -q[:, :, 1:] * p[:, :, :2]
    h = np.linalg.solve(rows, np.concatenate([q[:, :, :1], q[:, :, 1:]], axis=1))[..., 0]
    found = np.concatenate([h, np.ones((300, 1))], axis=1).reshape(-1, 3, 3)
    found = np.linalg.inv(to_b) @ found @ to_a
    best = found[(_distances(found, few_x, few_y) >= off).sum(axis=1).argmin()]
    near = _distances(best, x, y) < off
    fitted = _fitted_homography(x[near], y[near])
    return min((best, fitted), key=lambda H: int((_distances(H, x, y) >= off).sum()))


def _distances(H: Array, x: Array, y: Array) -> Array:
    """How far from y (N, 2) homographies (…, 3, 3) send x; as far as can be where they send it behind the camera."""
    sent = _homogeneous(x) @ np.swapaxes(H, -1, -2)
    sent = sent * np.sign(np.median(sent[..., 2:], axis=-2, keepdims=True))
    front = sent[..., 2] > 1e-12 * np.abs(sent).max()
    there = sent[..., :2] / np.where(front, sent[..., 2], 1.0)[..., None]
    return np.where(front, np.linalg.norm(there - y, axis=-1), 1e6)


def _centred(points: Array) -> tuple[Array, Array]:
    """Points about 0 at distances about 1, and the matrix that brings them there."""
    middle, spread = points.mean(axis=0), max(float(points.std()), 1e-9)
    return (points - middle) / spread, np.array(
        [[1 / spread, 0, -middle[0] / spread], [0, 1 / spread, -middle[1] / spread], [0, 0, 1]]
    )


def _aligning_rotation(rays: Array, rays_prime: Array) -> Array:
    """Rotation vector (3,) that turns rays on to rays' best (Kabsch)."""
    a, b = (r / np.linalg.norm(r, axis=1, keepdims=True) for r in (rays, rays_prime))
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    angle = math.acos(np.clip((np.trace(R) - 1) / 2, -1, 1))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return angle * _unit(axis)


def _least_squares(residuals: Callable[[Array], Array], unknowns: Array, iterations: int = 10) -> Array:
    """Levenberg-Marquardt with derivatives by differences, for unknowns of about unit size."""
    here, damping = residuals(unknowns), 1e-3
    for _ in range(iterations):
        J = _derivatives(residuals, unknowns)
        normal = J.T @ J
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), -J.T @ here)
        there = residuals(unknowns + step)
        if there @ there < here @ here:
            unknowns, here, damping = unknowns + step, there, damping / 10
        else:
            damping *= 10
    return unknowns


def _derivatives(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Jacobian by central differences."""
    steps = step * np.eye(len(at))
    return np.column_stack([(function(at + s) - function(at - s)) / (2 * step) for s in steps])


def _log_choose(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


def _rms(distances: Array) -> float:
    return math.sqrt(float((distances**2).mean()))


# --- small geometry --------------------------------------------------------------------------------------------------


def _intrinsics(focal: float, size: tuple[int, int]) -> Array:
    return np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])


def _homogeneous(points: Array) -> Array:
    return np.column_stack([points, np.ones(len(points))])


def _rays(points: Array, K: Array) -> Array:
    return _homogeneous(points) @ np.linalg.inv(K).T


def _pixels(rays: Array, K: Array) -> Array:
    seen = rays @ K.T
    return seen[:, :2] / seen[:, 2:]


def _unit(v: Array) -> Array:
    return v / max(float(np.linalg.norm(v)), 1e-300)


def _cross(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])


def _rotation(omega: Array) -> Array:
    angle = float(np.linalg.norm(omega))
    axis = _cross(_unit(omega))
    return np.eye(3) + math.sin(angle) * axis + (1 - math.cos(angle)) * axis @ axis


# --- how near one may come -------------------------------------------------------------------------------------------

LEAST_NOISE = 0.05  # px: core believes no keypoint to be placed better
# The Cauchy loss needs 1.15 of the expected error (76 % efficiency); beyond three a normal error is one in a hundred.
BEYOND = 3.0


def transfer_error(H: Array, truth: Problem) -> float:
    """RMS over the reference picture of how far H is from the true H_inf, px."""
    assert truth.R is not None
    return transfer_difference(H, truth.K_prime @ truth.R @ np.linalg.inv(truth.K), truth.camera.size)


def transfer_difference(H: Array, H_other: Array, size: tuple[int, int]) -> float:
    """RMS over a picture of this size of how far apart two homographies send its points, px."""
    one, other = (_pixels(_grid(size), h) for h in (H, H_other))
    return _rms(np.linalg.norm(one - other, axis=1))


def rotation_error(R: Array, truth: Problem) -> float:
    """Angle to the true rotation in degrees."""
    assert truth.R is not None
    return math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm(R - truth.R)) / (2 * math.sqrt(2)))))


def expected_errors(truth: Problem) -> tuple[float, float]:
    """Standard deviations of rotation (degrees) and of H_inf's transfer (px): the Cramér-Rao bound from the true
    inliers and, where the focal length is unknown, what is believed of it."""
    assert truth.R is not None and truth.t is not None
    R, t = truth.R, truth.t
    x, y = _homogeneous(truth.matches.x[truth.inliers]), _homogeneous(truth.matches.y[truth.inliers])
    believed = truth.camera.log_sigma
    tangents = np.linalg.svd(t[None])[2][1:] if t.any() else np.zeros((0, 3))

    def moved(step: Array) -> tuple[Array, Array, Array, Array]:
        """K, K', R, t after a step in rotation (3), log f, direction of t (2 or 0)."""
        zoom = np.diag([math.exp(step[3]), math.exp(step[3]), 1.0])
        direction = _unit(t + step[4:] @ tangents) if t.any() else t
        K, K_prime = truth.K.copy(), truth.K_prime.copy()
        K[:2, :2], K_prime[:2, :2] = K[:2, :2] @ zoom[:2, :2], K_prime[:2, :2] @ zoom[:2, :2]
        return K, K_prime, _rotation(step[:3]) @ R, direction

    def infinity(step: Array) -> Array:
        K, K_prime, R, _ = moved(step)
        return K_prime @ R @ np.linalg.inv(K)

    def residuals(step: Array) -> Array:
        if not t.any():
            return _pixels(x, infinity(step)).ravel() / math.sqrt(2)  # both pictures are noisy
        K, K_prime, R, direction = moved(step)
        F = np.linalg.inv(K_prime).T @ _cross(direction) @ R @ np.linalg.inv(K)
        lines, lines_prime = x @ F.T, y @ F
        gradient = (lines[:, :2] ** 2).sum(axis=1) + (lines_prime[:, :2] ** 2).sum(axis=1)
        return (y * lines).sum(axis=1) / np.sqrt(gradient)

    unknowns = np.zeros(4 + len(tangents))
    J = _derivatives(residuals, unknowns)
    noise = max(truth.noise, LEAST_NOISE)
    information = J.T @ J / noise**2
    if believed:
        information[3, 3] += 1 / believed**2
        free = np.arange(len(unknowns))
    else:
        free = np.delete(np.arange(len(unknowns)), 3)
    covariance = np.zeros_like(information)
    covariance[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
    grid = _grid(truth.camera.size)
    J_transfer = _derivatives(lambda step: _pixels(grid, infinity(step)).ravel(), unknowns)
    transfer = np.trace(J_transfer @ covariance @ J_transfer.T) / len(grid)
    return math.degrees(math.sqrt(np.trace(covariance[:3, :3]))), math.sqrt(transfer)


def _grid(size: tuple[int, int]) -> Array:
    """A grid over the picture, homogeneous."""
    columns, rows = np.meshgrid(np.linspace(0, size[0] - 1, 9), np.linspace(0, size[1] - 1, 7))
    return _homogeneous(np.column_stack([columns.ravel(), rows.ravel()]))


# --- what estimate makes of them -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Result:
    """What came of a problem: outcome is the model, "refused" or "crash: …"; the errors are those of the rotation
    (degrees) and of H_inf (px), each with what could be expected, where there is a truth and a finite estimate."""

    asked: Problem
    outcome: str
    why: str
    seconds: float
    rotation: tuple[float, float] | None = None
    transfer: tuple[float, float] | None = None

    @property
    def right(self) -> bool:
        return self.outcome in self.asked.expected

    @property
    def crashed(self) -> bool:
        return self.outcome.startswith("crash")

    @property
    def exact(self) -> bool:
        """Whether the rotation is as good as the noise allows."""
        return self.rotation is not None and self.rotation[0] < BEYOND * self.rotation[1]


def solve(index: int) -> Result:
    """Runs `estimate` on a problem; nothing it does is an exception here."""
    asked, begun = problem(index), time.perf_counter()
    try:
        view = estimate(asked.matches, asked.camera, asked.camera_prime, seed=0)
    except StitchError as error:
        return Result(asked, "refused", f"{type(error).__name__}: {error}", time.perf_counter() - begun)
    except Exception as error:  # whatever it is, it is a finding, and the other problems are still to be asked
        return Result(asked, f"crash: {type(error).__name__}", str(error), time.perf_counter() - begun)
    return _judged(asked, view, time.perf_counter() - begun)


def _judged(asked: Problem, view: TwoView, seconds: float) -> Result:
    rotation = transfer = None
    if asked.R is not None:
        expected = expected_errors(asked)
        if np.isfinite(view.R).all():
            rotation = (rotation_error(view.R, asked), expected[0])
        transfer = (transfer_error(view.H_inf, asked), expected[1])
    return Result(asked, view.model, view.why, seconds, rotation, transfer)


def summarise(results: Iterable[Result]) -> str:
    """Per kind: how many, how many right, crashes; how exact the general ones are; every wrong or inexact one."""
    done = list(results)
    lines = [f"{'kind':28}{'count':>6}{'right':>8}{'crashes':>9}{'seconds':>9}"]
    families = dict.fromkeys(r.asked.family for r in done)
    for name in (*dict.fromkeys(r.asked.kind for r in done), *families, "all"):
        some = [r for r in done if name in (r.asked.kind, r.asked.family, "all")]
        lines.append(
            f"{name:28}{len(some):6}{sum(r.right for r in some) / max(1, len(some)):8.1%}"
            f"{sum(r.crashed for r in some):9}{sum(r.seconds for r in some) / max(1, len(some)):9.2f}"
        )
    for calibration in ANY:
        general = [r for r in done if r.asked.family == "general" and r.asked.calibration == calibration]
        lines += ["", f"general, K {calibration}: {len(general)}, {sum(r.rotation is None for r in general)} without R"]
        for name, pairs in (
            ("rotation, degrees", [r.rotation for r in general if r.rotation]),
            ("H_inf transfer, px", [r.transfer for r in general if r.transfer]),
        ):
            if pairs:
                error, expected = np.array(pairs).T
                lines += [_quantiles(name, error), _quantiles("  in expected errors", error / expected)]
    lines += ["", "wrong:", *(_line(r) for r in done if not r.right)]
    lines += ["", f"general, rotation beyond {BEYOND} expected errors:"]
    lines += [_line(r) for r in done if r.asked.family == "general" and r.rotation and not r.exact]
    return "\n".join(lines)


def _quantiles(name: str, values: Array) -> str:
    shares = {"50 %": 0.5, "75 %": 0.75, "90 %": 0.9, "95 %": 0.95, "max": 1.0}
    return f"{name:22}" + "".join(f"{title:>6} {np.quantile(values, q):<8.3g}" for title, q in shares.items())


def _line(result: Result) -> str:
    p = result.asked
    text = (
        f"{p.index:4} {p.kind}, {p.calibration}, {len(p.matches)} matches, noise {p.noise:.2f}, "
        f"outliers {p.outliers:.0%}: {result.outcome}"
    )
    if result.rotation:
        text += f"; rotation {result.rotation[0]:.3f}° ({result.rotation[0] / result.rotation[1]:.1f} expected)"
    return text if result.transfer else f"{text}; {result.why[:100]}"


def main() -> None:
    """Asks the problems and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds that contain this")
    parser.add_argument("--indices", default="", help="for instance 3,17,40-60")
    options = parser.parse_args()
    indices = list(range(COUNT))
    if options.indices:
        parts = [part.split("-") for part in options.indices.split(",")]
        indices = [i for part in parts for i in range(int(part[0]), int(part[-1]) + 1)]
    indices = [i for i in indices if options.only in kind_of(i)[0]]
    results = []
    with Pool(options.jobs) as pool:
        for done, result in enumerate(pool.imap(solve, indices), 1):
            results.append(result)
            if sys.stderr.isatty():
                print(f"\r{done} of {len(indices)}", end="", file=sys.stderr, flush=True)
    print(summarise(results))


if __name__ == "__main__":
    main()
