"""Random rigs with known truth: N cameras among points, what each sees of them, and matches of which some are wrong.

The world's unit is a metre, its z points up. A camera sees X at K (R X + t); x points right, y down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.raster.arrays import Array
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

SIZE = (800, 600)
FOCAL = 533.0
# Nearer to the border nothing is found, and nothing that is nearer than this in front.
MARGIN_PX = 4.0
LEAST_DEPTH = 0.1
# Shares of what is in view that a picture's detector finds, and of what two pictures have found that is matched.
FOUND = 0.7
MATCHED = 0.6
# Matches below which a pair is not given.
LEAST_MATCHES = 20

Placed = list[tuple[Array, float, float, float]]  # place in metres; yaw, pitch and roll in degrees


@dataclass(frozen=True, eq=False)
class SyntheticRig:
    """What a registration is given, and the truth.

    cameras: as believed, their focal length off by some per cent; points: of each picture (n, 2) raw px; identity: of
    each picture (n,) the number of the world's point that each is, -1 for none; matches: of each pair; R, t: true poses
    (N, 3, 3), (N, 3); focal: true, px.
    """

    cameras: tuple[Camera, ...]
    points: list[Array]
    identity: list[NDArray[np.intp]]
    matches: list[PictureMatches]
    R: Array
    t: Array
    focal: float

    @property
    def centres(self) -> Array:
        centres: Array = -np.einsum("nji,nj->ni", self.R, self.t)
        return centres

    @property
    def extent(self) -> float:
        """The largest distance of a camera from the mean of all, metres."""
        return float(np.linalg.norm(self.centres - self.centres.mean(axis=0), axis=1).max())

    @property
    def true_cameras(self) -> tuple[Camera, ...]:
        return tuple(camera_of(self.focal, camera.size, camera.log_sigma) for camera in self.cameras)

    def true_matches(self, matches: PictureMatches) -> NDArray[np.intp]:
        """Those of a pair's matches (M, 2) that are right."""
        first = self.identity[matches.i][matches.index[:, 0]]
        second = self.identity[matches.j][matches.index[:, 1]]
        return matches.index[(first == second) & (first >= 0)]

    def shuffled(self, order: NDArray[np.intp]) -> SyntheticRig:
        """The same with its pictures in another order: number k is what number order[k] was."""
        place = np.argsort(order)
        matches = []
        for pair in self.matches:
            i, j = int(place[pair.i]), int(place[pair.j])
            matches.append(PictureMatches(i, j, pair.index) if i < j else PictureMatches(j, i, pair.index[:, ::-1]))
        matches.sort(key=lambda pair: (pair.i, pair.j))
        cameras = tuple(self.cameras[k] for k in order)
        points, identity = [self.points[k] for k in order], [self.identity[k] for k in order]
        return SyntheticRig(cameras, points, identity, matches, self.R[order], self.t[order], self.focal)


def camera_of(focal: float, size: tuple[int, int] = SIZE, log_sigma: float = 0.05) -> Camera:
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    return Camera(K, size, "test", log_sigma, knowledge=Knowledge.EXIF if log_sigma else Knowledge.GIVEN)


def make_rig(
    kind: str, seed: int, points: int = 7000, noise_px: float = 0.5, outliers: float = 0.2, pictures: int | None = None
) -> SyntheticRig:
    """A rig of one of KINDS; pictures: how many, where its kind leaves it open; outliers: share of wrong matches."""
    rng = np.random.default_rng((seed, sum(kind.encode())))
    R, centres = _poses(KINDS[kind](rng, pictures))
    world = _street(rng, points) if kind == "street" else _room(rng, points)
    seen, identity = _observed(rng, R, centres, world, noise_px)
    matches = _matched(rng, seen, identity, outliers, chain=kind == "chain")
    if kind == "wrong":
        matches.append(_false_pair(rng, seen, identity, 0, len(R) // 2, noise_px))
        matches.sort(key=lambda pair: (pair.i, pair.j))
    believed = camera_of(float(FOCAL * np.exp(rng.normal(0, 0.03))))
    t = -np.einsum("nij,nj->ni", R, centres)
    return SyntheticRig((believed,) * len(R), seen, identity, matches, R, t, FOCAL)


def _by_hand(rng: np.random.Generator, sigma: float) -> Array:
    """A place (3,) metres about the origin: up and down people sway less."""
    place: Array = rng.normal(0, sigma, 3) * [1, 1, 0.65]
    return place


def _round(rng: np.random.Generator, count: int, sigma: float | Callable[[int], float], roll: float = 2.0) -> Placed:
    """All around, level."""
    sigmas = [sigma(k) if callable(sigma) else sigma for k in range(count)]
    return [
        (_by_hand(rng, s), 360 * k / count + rng.normal(0, 3), rng.normal(-4, 2), rng.normal(0, roll))
        for k, s in enumerate(sigmas)
    ]


def _ring(rng: np.random.Generator, pictures: int | None) -> Placed:
    return _round(rng, pictures or 11, 0.15)


def _sphere(rng: np.random.Generator, pictures: int | None) -> Placed:
    """Three rows."""
    rows = ((-4, 11, 0), (32, 8, 15), (-38, 8, 0))
    return [
        (_by_hand(rng, 0.15), 360 * k / n + shift + rng.normal(0, 3), pitch + rng.normal(0, 2), rng.normal(0, 2))
        for pitch, n, shift in rows
        for k in range(n)
    ]


def _walk(rng: np.random.Generator, pictures: int | None) -> Placed:
    """Along a façade, 0.75 m a step."""
    count = pictures or 9
    return [
        (np.array([0.75 * (k - (count - 1) / 2), 0, 0]) + _by_hand(rng, 0.05), rng.normal(0, 8), rng.normal(0, 3),
         rng.normal(0, 2))
        for k in range(count)
    ]  # fmt: skip


def _grid(rng: np.random.Generator, pictures: int | None) -> Placed:
    """Before one wall, in rows of three above each other."""
    return [
        (np.array([0.4 * (k % 3 - 1), -0.5, 0.35 * (k // 3 - 1)]) + _by_hand(rng, 0.05), rng.normal(0, 10),
         rng.normal(0, 4), rng.normal(0, 2))
        for k in range(pictures or 9)
    ]  # fmt: skip


def _tripod(rng: np.random.Generator, pictures: int | None) -> Placed:
    """From one place, but for 0 to 2 mm by which the head is off the lens's centre."""
    return _round(rng, pictures or 11, rng.uniform(0, 0.0012), 1.0)


def _mixed(rng: np.random.Generator, pictures: int | None) -> Placed:
    """A ring from a tripod, and a few by hand."""
    count = pictures or 17
    hand = count // 3 + (count == 17)
    return _round(rng, count - hand, 0.0006, 1.0) + [
        (_by_hand(rng, 0.2), 360 * k / hand + rng.normal(0, 8), rng.normal(-4, 5), rng.normal(0, 2))
        for k in range(hand)
    ]


def _half(rng: np.random.Generator, pictures: int | None) -> Placed:
    """Half the ring from a tripod, half by hand."""
    count = pictures or 11
    return _round(rng, count, lambda k: 0.0006 if k < (count + 1) // 2 else 0.15, 1.0)


def _chain(rng: np.random.Generator, pictures: int | None) -> Placed:
    """Neighbours overlap, no point is seen by three."""
    return [
        (_by_hand(rng, 0.2), 40 * k - 80 + rng.normal(0, 2), rng.normal(0, 2), rng.normal(0, 2))
        for k in range(pictures or 5)
    ]


KINDS: dict[str, Callable[[np.random.Generator, int | None], Placed]] = {
    "ring": _ring, "street": _walk, "grid": _grid, "sphere": _sphere, "tripod": _tripod, "mixed": _mixed,
    "half": _half, "chain": _chain, "wrong": _ring,
}  # fmt: skip


def _poses(placed: Placed) -> tuple[Array, Array]:
    """World to camera (N, 3, 3), and places (N, 3)."""
    yaw, pitch, roll = np.radians(np.array([row[1:] for row in placed])).T
    forward = np.stack([-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)], axis=1)
    right = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    level = np.stack([right, np.cross(forward, right), forward], axis=1)
    rolled = Rotation.from_rotvec(roll[:, None] * np.array([0.0, 0, 1])).as_matrix()
    return rolled @ level, np.array([row[0] for row in placed])


def _room(rng: np.random.Generator, count: int) -> Array:
    """Points on the walls of a room of 3 to 8 m, a third of them on floor and ceiling, and on nine boxes in it."""
    half = rng.uniform(1.5, 4) * np.array([1, rng.uniform(0.8, 1.2)])
    u = rng.uniform(-1, 1, (count, 3))
    side = np.where(rng.random(count) < 0.35, rng.integers(0, 6, count), rng.integers(0, 4, count))
    u[np.arange(count), side // 2] = np.where(side % 2, 1, -1)
    height = np.where(u[:, 2] > 0, rng.uniform(1.1, 1.8), 1.5)
    parts = [np.column_stack([u[:, 0] * half[0], u[:, 1] * half[1], u[:, 2] * height])]
    for _ in range(9):
        angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(0.45, 0.8) * half.min()
        centre = np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(-1.3, 0.4)])
        box = rng.uniform(-1, 1, (count // 36, 3))
        axis = rng.integers(0, 3, len(box))
        box[np.arange(len(box)), axis] = np.sign(box[np.arange(len(box)), axis])
        parts.append(centre + box * rng.uniform(0.12, 0.3))
    return np.concatenate(parts)


def _street(rng: np.random.Generator, count: int) -> Array:
    """Points on a façade 6 m away, on things before it, and far away."""
    n = count // 4
    facade = np.column_stack([rng.uniform(-12, 12, 2 * n), np.full(2 * n, 6.0), rng.uniform(-1.6, 6, 2 * n)])
    near = np.column_stack([rng.uniform(-10, 10, n), rng.uniform(2.5, 5.5, n), rng.uniform(-1.5, 1, n)])
    far = np.column_stack([rng.uniform(-60, 60, n), rng.uniform(20, 80, n), rng.uniform(0, 25, n)])
    return np.concatenate([facade, near, far])


def _observed(
    rng: np.random.Generator, R: Array, centres: Array, world: Array, noise_px: float
) -> tuple[list[Array], list[NDArray[np.intp]]]:
    """What each picture finds, raw px, and which points of the world they are."""
    K, limit = camera_of(FOCAL).K, np.array(SIZE) - 1 - MARGIN_PX
    seen, identity = [], []
    for turn, centre in zip(R, centres, strict=True):
        X = (world - centre) @ turn.T
        depth = np.where(X[:, 2] > LEAST_DEPTH, X[:, 2], np.nan)
        pixels = FOCAL * X[:, :2] / depth[:, None] + K[:2, 2]
        inside = np.all((pixels > MARGIN_PX) & (pixels < limit), axis=1)
        found = np.flatnonzero(inside & (rng.random(len(world)) < FOUND))
        seen.append(pixels[found] + rng.normal(0, noise_px, (len(found), 2)))
        identity.append(found)
    return seen, identity


def _matched(
    rng: np.random.Generator, seen: list[Array], identity: list[NDArray[np.intp]], outliers: float, chain: bool
) -> list[PictureMatches]:
    """Of each pair some of the points that both have found, and wrong ones; each feature at most once."""
    matches = []
    for i in range(len(seen)):
        for j in range(i + 1, i + 2 if chain and i + 1 < len(seen) else len(seen)):
            common, first, second = np.intersect1d(identity[i], identity[j], return_indices=True)
            kept = rng.random(len(common)) < MATCHED
            if chain:
                kept &= common % 2 == i % 2
            wrong = int(outliers * kept.sum() / (1 - outliers))
            if kept.sum() + wrong < LEAST_MATCHES:
                continue
            stray = np.column_stack([rng.integers(0, len(seen[k]), wrong) for k in (i, j)])
            index = np.concatenate([np.column_stack([first, second])[kept], stray])
            for column in (0, 1):
                index = index[np.sort(np.unique(index[:, column], return_index=True)[1])]
            matches.append(PictureMatches(i, j, index.astype(np.intp)))
    return matches


def _false_pair(
    rng: np.random.Generator, seen: list[Array], identity: list[NDArray[np.intp]], i: int, j: int, noise_px: float
) -> PictureMatches:
    """Matches of two pictures that do not overlap, all of one geometry that is not theirs; adds their features."""
    depth = rng.uniform(3, 8, (400, 1))
    X = np.column_stack([rng.uniform(-1, 1, (400, 2)), np.ones(400)]) * depth
    turned = X @ Rotation.from_rotvec(rng.normal(0, 0.15, 3)).as_matrix().T + rng.normal(0, 0.3, 3)
    middle, limit = camera_of(FOCAL).K[:2, 2], np.array(SIZE) - 1
    pixels = [FOCAL * Y[:, :2] / Y[:, 2:] + middle for Y in (X, turned)]
    inside = np.flatnonzero(np.all([np.all((p > 0) & (p < limit), axis=1) for p in pixels], axis=0))[:120]
    starts = [len(seen[i]), len(seen[j])]
    for k, p in zip((i, j), pixels, strict=True):
        seen[k] = np.concatenate([seen[k], p[inside] + rng.normal(0, noise_px, (len(inside), 2))])
        identity[k] = np.concatenate([identity[k], np.full(len(inside), -1)])
    return PictureMatches(i, j, np.column_stack([start + np.arange(len(inside)) for start in starts]).astype(np.intp))
