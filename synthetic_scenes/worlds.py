"""The worlds that recipes are shot in, built with bpy. Each takes a stage and fills it; z = 0 is the floor."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .stage import Colour, Place, Stage

BRICK: tuple[Colour, Colour] = ((0.42, 0.13, 0.08), (0.25, 0.09, 0.06))
MORTAR: Colour = (0.45, 0.42, 0.38)
SAND: tuple[Colour, ...] = ((0.12, 0.08, 0.05), (0.45, 0.35, 0.22), (0.75, 0.68, 0.52))
STONE: tuple[Colour, ...] = ((0.06, 0.07, 0.08), (0.3, 0.31, 0.33), (0.62, 0.6, 0.57))
MOSS: tuple[Colour, ...] = ((0.02, 0.05, 0.02), (0.1, 0.22, 0.06), (0.35, 0.45, 0.15))
SKY: tuple[Colour, ...] = ((0.18, 0.3, 0.5), (0.35, 0.5, 0.7), (0.7, 0.78, 0.85))


def two_planes(stage: Stage) -> None:
    stage.card((0, 6, 3), 40, 14, stage.bricks(BRICK, MORTAR))
    stage.card((0, 2, 0), 40, 14, stage.tiles((0.1, 0.1, 0.12), (0.5, 0.5, 0.46)), tilt=90)
    for k in range(9):
        size = stage.random.uniform(0.5, 0.95)
        at = -5.2 + 1.25 * k + stage.random.uniform(-0.15, 0.15), 5.97, stage.random.uniform(1.0, 3.2)
        stage.card(at, size, 1.3 * size, stage.poster(9 / size))


def layered_cards(stage: Stage) -> None:
    stage.card((0, 12, 2), 44, 26, stage.stone(SKY, 0.9))
    stage.card((0, 6, -2.2), 30, 30, stage.stone(SAND, 1.5), tilt=90)
    for k, depth in enumerate((3.4, 4.4, 5.6, 7.4, 9.8)):
        for side in (-0.72, -0.2, 0.3, 0.85):
            x = depth * (0.62 * side + 0.13 * ((k * 2) % 5 - 2) / 2) + stage.random.uniform(-0.1, 0.1)
            z = 1.5 + depth * stage.random.uniform(-0.3, 0.3)
            width, height = depth * stage.random.uniform(0.1, 0.17), depth * stage.random.uniform(0.13, 0.24)
            paint = stage.poster(26 / depth) if (k + round(10 * side)) % 2 else stage.stone(STONE, 12 / depth)
            stage.card((x, depth, z), width, height, paint)


def corner_room(stage: Stage) -> None:
    _walls(stage, stage.stone(SAND, 2.5), stage.bricks(BRICK, MORTAR, 0.25))
    _furniture(stage)


def hdr_interior(stage: Stage) -> None:
    _walls(stage, stage.stone(STONE, 2.5), stage.stone(SAND, 3.0))
    _furniture(stage)
    stage.card((-0.9, 4.25, 2.0), 1.1, 0.9, stage.light((30.0, 33.0, 38.0)), yaw=-35)
    for k in range(2):
        stage.card((-0.9 + 0.02 * k, 4.2, 2.0), *((0.06, 1.0), (1.2, 0.06))[k], stage.wood(*_OAK), yaw=-35)
    stage.ball((1.0, 3.0, 1.75), 0.14, stage.light((9.0, 7.0, 4.0)))


def low_texture(stage: Stage) -> None:
    plain = stage.stone(((0.55, 0.54, 0.5), (0.6, 0.58, 0.54)), 1.2)
    _walls(stage, plain, stage.stone(((0.4, 0.44, 0.5), (0.44, 0.48, 0.54)), 1.0))
    stage.card((-0.6, 4.2, 1.7), 0.5, 0.7, stage.poster(8), yaw=-35)
    stage.box((0.9, 3.2, 0.4), (0.6, 0.6, 0.8), stage.wood(*_OAK), yaw=20)
    stage.box((-1.4, 3.0, 0.25), (0.5, 0.5, 0.5), stage.stone(STONE, 6), yaw=-15)


_OAK: tuple[Colour, Colour] = ((0.12, 0.06, 0.03), (0.5, 0.3, 0.15))


def _walls(stage: Stage, left: Any, right: Any) -> None:
    """Two walls that meet in a corner ahead, a floor and a ceiling."""
    for yaw, paint, side in ((-35.0, left, -1), (55.0, right, 1)):
        a = math.radians(yaw)
        along = 6.0 * side
        stage.card((0.6 + along * math.cos(a), 5.4 - along * math.sin(a), 1.4), 12.0, 2.8, paint, yaw=yaw)
    stage.card((0, 3, 0), 30, 30, stage.tiles((0.16, 0.12, 0.1), (0.5, 0.44, 0.36), 0.35), tilt=90)
    stage.card((0, 3, 2.8), 30, 30, stage.stone(((0.4, 0.4, 0.42), (0.75, 0.75, 0.72)), 1.5), tilt=90)


def _furniture(stage: Stage) -> None:
    stage.box((0.4, 3.3, 0.72), (1.3, 0.7, 0.06), stage.wood(*_OAK), yaw=20)
    for x, y in ((-0.15, 3.2), (0.85, 3.0), (0.05, 3.65), (0.95, 3.4)):
        stage.post((x, y, 0), (x, y, 0.7), 0.035, stage.wood(*_OAK))
    stage.box((0.15, 3.3, 0.9), (0.3, 0.25, 0.3), stage.poster(14), yaw=35)
    stage.ball((0.75, 3.15, 0.9), 0.15, stage.stone(BRICK, 9))
    stage.box((-1.5, 3.2, 0.5), (0.6, 0.6, 1.0), stage.wood((0.08, 0.1, 0.12), (0.35, 0.4, 0.42)), yaw=-20)
    for x, z, yaw in ((-1.5, 1.75, -35), (-0.5, 1.8, -35), (1.55, 1.7, 55), (2.3, 1.8, 55)):
        a = math.radians(yaw)
        along = (x - 0.6) / math.cos(a)
        nearer = 0.03
        stage.card((x - nearer * math.sin(a), 5.4 - along * math.sin(a) - nearer * math.cos(a), z), 0.6, 0.75,
                   stage.poster(10), yaw=yaw)  # fmt: skip


def street(stage: Stage) -> None:
    stage.card((0, 14, 0), 60, 50, stage.stone(((0.08, 0.08, 0.09), (0.28, 0.28, 0.29)), 4.0), tilt=90)
    stage.card((0, 34, 8), 80, 40, stage.stone(SKY, 0.35))
    for side in (-1, 1):
        for k in range(5):
            paints = (stage.bricks(BRICK, MORTAR, 0.45), stage.stone(SAND, 1.6), stage.stone(STONE, 1.4))
            centre = side * (4.6 + 0.25 * (k % 2)), 4.5 + 5.0 * k, 3.0
            stage.box(centre, (1.0, 4.9, 6.0 + 1.5 * ((k * 2) % 3)), paints[(k + side) % 3])
            for i in range(3):
                at = side * (4.07 + 0.25 * (k % 2)), 3.0 + 5.0 * k + 1.5 * i, 1.5 + 1.7 * (i % 2)
                stage.card(at, 0.8, 1.2, stage.poster(5), yaw=90.0 * side)
    for k in range(4):
        x = 2.7 if k % 2 else -2.7
        stage.post((x, 5.5 + 3.0 * k, 0), (x, 5.5 + 3.0 * k, 4.5), 0.09, stage.stone(STONE, 7))
    stage.box((1.6, 8.0, 0.6), (1.4, 2.6, 1.2), stage.poster(3.0), yaw=4)


def foliage(stage: Stage) -> None:
    stage.card((0, 8, 2), 26, 14, stage.stone(MOSS, 3.5))
    stage.card((0, 4, -0.6), 24, 12, stage.stone(SAND, 3.0), tilt=90)
    for _ in range(14):
        x, y = stage.random.uniform(-3.4, 3.4), stage.random.uniform(3.8, 7.0)
        lean = stage.random.uniform(-0.5, 0.5)
        stage.post((x, y, -0.6), (x + lean, y, 4.5), 0.03, stage.wood((0.05, 0.03, 0.02), (0.3, 0.2, 0.12), 20), 10)
    for paint in (stage.stone(MOSS, 9), stage.stone(((0.2, 0.1, 0.02), (0.5, 0.35, 0.05)), 9), stage.stone(SAND, 9)):
        corners: list[tuple[float, float, float]] = []
        for _ in range(130):
            x, y, z = (stage.random.uniform(*span) for span in ((-3.6, 3.6), (3.6, 7.2), (-0.4, 3.6)))
            a, size = stage.random.uniform(0, math.pi), stage.random.uniform(0.06, 0.13)
            along = size * math.cos(a), size * stage.random.uniform(-0.6, 0.6), size * math.sin(a)
            across = -0.45 * along[2], 0.0, 0.45 * along[0]
            for i, j in ((-1, 0), (0, -1), (1, 0), (0, 1)):
                corners.append((x + i * along[0] + j * across[0], y + i * along[1], z + i * along[2] + j * across[2]))
        stage.mesh(corners, [range(4 * k, 4 * k + 4) for k in range(len(corners) // 4)], paint)


def relief(stage: Stage) -> None:
    waves = [(stage.random.uniform(0.5, 1.3), stage.random.uniform(0, 2 * math.pi), stage.random.uniform(0, 6))
             for _ in range(7)]  # fmt: skip

    def depth(x: float, z: float) -> float:
        hills = sum(math.sin(f * (x * math.cos(a) + z * math.sin(a)) + p) / f for f, a, p in waves)
        return 5.6 + 0.22 * hills

    wall = stage.relief(18, 12, depth, stage.stone((*SAND, MOSS[1], STONE[2]), 3.0))
    wall.location = (0, 0, 1.5)


def tabletop(stage: Stage) -> None:
    stage.card((0, 0.2, 0), 3.0, 2.2, stage.wood(*_OAK, 10), tilt=90)
    stage.card((0, 1.3, 0.6), 6.0, 4.0, stage.bricks(BRICK, MORTAR, 0.16))
    stage.box((-0.28, 0.1, 0.09), (0.2, 0.14, 0.18), stage.poster(28), yaw=25)
    stage.box((0.3, 0.25, 0.13), (0.16, 0.2, 0.26), stage.poster(24), yaw=-30)
    stage.box((0.02, -0.12, 0.02), (0.22, 0.3, 0.04), stage.poster(20), yaw=12)
    stage.ball((0.05, 0.3, 0.09), 0.09, stage.stone(BRICK, 22))
    stage.ball((0.32, -0.12, 0.06), 0.06, stage.stone(SKY, 26))
    stage.post((-0.12, 0.5, 0), (-0.12, 0.5, 0.3), 0.05, stage.stone(MOSS, 22))
    stage.post((0.55, 0.05, 0), (0.55, 0.05, 0.2), 0.06, stage.stone(STONE, 20))
    stage.box((0.8, 0.4, 0.12), (0.2, 0.2, 0.24), stage.poster(22), yaw=10)


def single_plane(stage: Stage) -> None:
    stage.card((0, 6, 2), 40, 30, stage.poster(1.6), yaw=6)


def occluder(stage: Stage) -> None:
    two_planes(stage)
    stage.post((0.25, 2.0, 0), (0.25, 2.0, 4.5), 0.11, stage.wood((0.08, 0.1, 0.12), (0.5, 0.52, 0.5), 9))


def thin_things(stage: Stage) -> None:
    """A far wall behind what is near and thin: posts, a railing, a lamp, a sign, leaves, and a cup on a table."""
    stage.card((0, 9, 3), 40, 16, stage.bricks(BRICK, MORTAR, 0.5))
    stage.card((0, 4, 0), 40, 14, stage.tiles((0.12, 0.11, 0.1), (0.5, 0.47, 0.42), 0.5), tilt=90)
    for k in range(8):
        at = -6.2 + 1.75 * k + stage.random.uniform(-0.2, 0.2), 8.95, stage.random.uniform(1.2, 3.4)
        stage.card(at, 1.2, 1.6, stage.poster(6))
    dark, pale = ((0.03, 0.035, 0.04), (0.07, 0.08, 0.09)), ((0.45, 0.44, 0.4), (0.62, 0.6, 0.56))
    iron, paint = stage.stone(dark, 5), stage.stone(pale, 5)
    for x, radius, colour in ((-2.05, 0.05, paint), (-1.65, 0.03, iron), (1.95, 0.06, iron), (2.4, 0.025, paint)):
        stage.post((x, 4.6, 0), (x, 4.6, 3.4), radius, colour)
    for height in (0.5, 1.05):
        stage.post((-1.5, 4.0, height), (0.1, 4.0, height), 0.025, iron)
    for k in range(9):
        stage.post((-1.5 + 0.2 * k, 4.0, 0.5), (-1.5 + 0.2 * k, 4.0, 1.05), 0.014, iron, 12)
    stage.post((0.45, 3.6, 0), (0.45, 3.6, 1.95), 0.035, iron)
    stage.ball((0.45, 3.6, 2.05), 0.13, stage.stone(((0.6, 0.58, 0.5), (0.75, 0.72, 0.62)), 3))
    stage.post((-0.45, 5.2, 0), (-0.45, 5.2, 2.2), 0.03, paint)
    stage.box((-0.45, 5.15, 2.35), (0.6, 0.03, 0.5), stage.poster(4))
    stage.box((1.0, 2.6, 0.92), (0.7, 0.5, 0.04), stage.wood(*_OAK, 8), yaw=-10)
    stage.post((0.95, 2.5, 0.94), (0.95, 2.5, 1.06), 0.045, stage.stone(((0.7, 0.2, 0.15), (0.8, 0.3, 0.22)), 4))
    _twig(stage, (-1.0, 3.2, 2.75), (0.2, 3.4, 2.3))


def _twig(stage: Stage, start: Place, end: Place) -> None:
    """A thin branch with single leaves."""
    stage.post(start, end, 0.012, stage.wood((0.05, 0.03, 0.02), (0.3, 0.2, 0.12), 20), 10)
    corners: list[Place] = []
    for k in range(22):
        share, a = (k + 0.5) / 22, stage.random.uniform(0, 2 * math.pi)
        x, y, z = (begin + share * (stop - begin) for begin, stop in zip(start, end, strict=True))
        along, across = (0.09 * math.cos(a), 0.09 * math.sin(a)), (-0.03 * math.sin(a), 0.03 * math.cos(a))
        for i, j in ((0.1, 0), (1.1, -1), (2.1, 0), (1.1, 1)):
            corners.append((x + i * along[0] + j * across[0], y + 0.02 * i, z + i * along[1] + j * across[1]))
    leaves = [range(4 * k, 4 * k + 4) for k in range(len(corners) // 4)]
    stage.mesh(corners, leaves, stage.stone(MOSS[1:], 9))


def cut_branch(stage: Stage) -> None:
    two_planes(stage)
    bark = stage.wood((0.05, 0.03, 0.02), (0.3, 0.2, 0.12), 20)
    parts = [stage.post((2.15, 2.6, 2.3), (0.8, 2.5, 1.75), 0.035, bark)]
    for k in range(7):
        x, z = 0.95 + 0.17 * k, 1.81 + 0.07 * k
        side = 0.3 if k % 2 else -0.3
        parts.append(stage.post((x, 2.55, z), (x - 0.2, 2.5, z + side), 0.014, bark, 10))
        leaf = stage.stone(MOSS, 14)
        for along in (0.5, 0.75, 1.0):
            at = x - 0.2 * along, 2.53 - 0.02 * along, z + side * along
            parts.append(stage.card(at, 0.16, 0.1, leaf, yaw=stage.random.uniform(-25, 25)))
    stage.thing(1, *parts)


def person(stage: Stage, x: float, y: float) -> list[Any]:
    """The parts of somebody who stands at a place, 1.74 m high."""
    cloth, trousers = stage.poster(6), stage.stone(STONE, 9)
    skin = stage.stone(((0.35, 0.2, 0.14), (0.6, 0.4, 0.3)), 5)
    parts = [stage.ball((x, y, 1.62), 0.12, skin), stage.box((x, y, 1.2), (0.44, 0.24, 0.6), cloth, yaw=10)]
    for side in (-1, 1):
        parts.append(stage.post((x + 0.12 * side, y, 0), (x + 0.1 * side, y, 0.92), 0.085, trousers))
        parts.append(stage.post((x + 0.34 * side, y, 0.8), (x + 0.26 * side, y, 1.46), 0.055, cloth))
    parts.append(stage.post((x, y, 1.45), (x, y, 1.55), 0.06, skin))
    return parts


def cut_person(stage: Stage) -> None:
    two_planes(stage)
    stage.thing(1, *person(stage, -0.62, 3.9))


WORLDS: dict[str, Callable[[Stage], None]] = {
    build.__name__: build for build in (
        two_planes, layered_cards, corner_room, hdr_interior, low_texture, street, foliage, relief, tabletop,
        single_plane, occluder, thin_things, cut_branch, cut_person,
    )
}  # fmt: skip
