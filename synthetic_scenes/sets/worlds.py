"""The worlds that sets are shot in, built with bpy, all around the viewpoint; z = 0 is the floor."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..stage import Colour, Place, Stage
from ..worlds import BRICK, MORTAR, MOSS, SAND, SKY, STONE, person
from .places import ELSEWHERE

OAK: tuple[Colour, Colour] = ((0.16, 0.08, 0.03), (0.48, 0.3, 0.14))
BLUE: tuple[Colour, Colour] = ((0.2, 0.25, 0.35), (0.12, 0.15, 0.25))
# x and y of a room's walls, and how high it is, m.
ROOM = (-3.2, 3.6, -3.0, 4.0, 2.8)
# Where (x, y), m, somebody is while pictures are taken, by their numbers.
WALK = {2: (-0.45, 2.05), 1: (0.25, 2.0), 3: (1.05, 1.75), 5: (1.6, 0.9)}
# Sets up what moves as it is while a picture is taken, by its number; None: without what moves, as the sphere shows it.
Pose = Callable[[int | None], None]


def room(stage: Stage, glossy: bool = False) -> None:
    """Four walls with pictures, floor and ceiling, things of all sizes from 1.4 to 4 m away, with numbers from 1."""
    _shell(stage, glossy)
    _pictures(stage, 14)
    stage.thing(1, *_table(stage, 0.3, 3.1))
    paints = (stage.poster(10), stage.wood(*OAK), stage.stone(STONE, 6))
    for k, (x, y) in enumerate(((-1.8, 1.7), (2.4, 0.7), (-1.6, -1.8), (1.1, -2.0), (2.6, 2.7), (-2.5, -0.1))):
        height = stage.random.uniform(0.5, 1.5)
        width, depth = stage.random.uniform(0.3, 0.6), stage.random.uniform(0.3, 0.6)
        size = width, depth, height
        stage.thing(5 + k, stage.box((x, y, height / 2), size, paints[k % 3], yaw=stage.random.uniform(-40, 40)))
    stage.thing(2, stage.post((1.6, 1.4, 0), (1.6, 1.4, ROOM[4]), 0.07, stage.stone(BRICK, 9)))
    stage.thing(3, stage.post((-1.2, -1.1, 0), (-1.2, -1.1, ROOM[4]), 0.07, stage.wood(*OAK)))
    stage.thing(4, stage.ball((-0.9, 2.0, 1.35), 0.18, stage.poster(10)))


def bright_room(stage: Stage) -> None:
    """A room with a window and a lamp, both far brighter than all else, that its floor mirrors."""
    room(stage, glossy=True)
    _, right, _, front, _ = ROOM
    daylight = stage.light((5.0, 6.0, 7.5))
    for side in (-1, 1):
        stage.card((0.9 + 0.36 * side, front - 0.1, 1.75), 0.66, 1.3, daylight)
    for x in (0.15, 0.9, 1.65):
        stage.box((x, front - 0.1, 1.75), (0.07, 0.06, 1.44), stage.wood(*OAK))
    for z in (1.06, 2.44):
        stage.box((0.9, front - 0.1, z), (1.57, 0.06, 0.07), stage.wood(*OAK))
    stage.ball((right - 0.9, 1.9, 2.1), 0.14, stage.light((9.0, 7.0, 4.5)))


def _shell(stage: Stage, glossy: bool) -> None:
    left, right, back, front, height = ROOM
    middle, across, along = ((left + right) / 2, (back + front) / 2), right - left, front - back
    x, y = middle
    for at, width, yaw, paint in (
        ((x, front), across, 0, stage.bricks(BRICK, MORTAR, 0.3)), ((x, back), across, 180, stage.stone(SAND, 2.5)),
        ((right, y), along, 90, stage.stone(STONE, 2.5)), ((left, y), along, -90, stage.bricks(BLUE, MORTAR, 0.4)),
    ):  # fmt: skip
        stage.card((*at, height / 2), width, height, paint, yaw=yaw)
    floor = stage.tiles((0.16, 0.12, 0.1), (0.5, 0.44, 0.36), 0.35, glossy)
    stage.card((x, y, 0), across, along, floor, tilt=90)
    stage.card((x, y, height), across, along, stage.stone(((0.3, 0.3, 0.33), (0.8, 0.8, 0.76)), 2.5, 2.0), tilt=-90)


def _pictures(stage: Stage, count: int) -> None:
    """Posters on the walls of a room, each wall in turn."""
    left, right, back, front, _ = ROOM
    for k in range(count):
        before = 0.02 + 0.004 * k  # those that cover each other lie one before the other
        size, z = stage.random.uniform(0.5, 0.9), stage.random.uniform(1.1, 2.0)
        x, y = stage.random.uniform(left + 0.6, right - 0.6), stage.random.uniform(back + 0.6, front - 0.6)
        at, yaw = (
            ((x, front - before), 0), ((x, back + before), 180), ((right - before, y), 90), ((left + before, y), -90)
        )[k % 4]  # fmt: skip
        stage.card((*at, z), size, 1.3 * size, stage.poster(8 / size), yaw=yaw)


def _table(stage: Stage, x: float, y: float) -> list[Any]:
    """The parts of a table with a box and a ball on it."""
    parts = [stage.box((x, y, 0.73), (1.3, 0.7, 0.06), stage.wood(*OAK), yaw=15)]
    cosine, sine = math.cos(math.radians(15)), math.sin(math.radians(15))
    for right in (-0.58, 0.58):
        for ahead in (-0.28, 0.28):
            foot = x + right * cosine + ahead * sine, y - right * sine + ahead * cosine
            parts.append(stage.post((*foot, 0), (*foot, 0.7), 0.035, stage.wood(*OAK)))
    parts.append(stage.box((x - 0.25, y, 0.92), (0.3, 0.25, 0.32), stage.poster(14), yaw=35))
    return [*parts, stage.ball((x + 0.35, y - 0.1, 0.91), 0.15, stage.stone(BRICK, 9))]


def posts(stage: Stage) -> None:
    """A room with near, thin things all along its middle: posts, railings, leaves."""
    room(stage)
    iron = stage.stone(((0.03, 0.035, 0.04), (0.07, 0.08, 0.09)), 5)
    pale = stage.stone(((0.45, 0.44, 0.4), (0.62, 0.6, 0.56)), 5)
    for k in range(7):
        a = math.radians(-66 + 22 * k)
        x, y = 1.7 * math.sin(a), 1.7 * math.cos(a)
        stage.thing(11 + k, stage.post((x, y, 0), (x, y, 2.2), 0.02 + 0.012 * (k % 3), (iron, pale)[k % 2], 16))
    rails = [stage.post((-1.4, 1.9, height), (1.2, 1.9, height), 0.022, iron, 12) for height in (0.6, 1.1)]
    bars = [-1.4 + 0.26 * k for k in range(11)]
    stage.thing(18, *rails, *(stage.post((x, 1.9, 0.6), (x, 1.9, 1.1), 0.013, iron, 12) for x in bars))
    leaves: list[Place] = []
    for _ in range(60):
        x, y, z = (stage.random.uniform(*span) for span in ((-1.9, 1.9), (1.5, 2.2), (1.6, 2.4)))
        a, size = stage.random.uniform(0, math.pi), stage.random.uniform(0.04, 0.08)
        along, across = (size * math.cos(a), size * math.sin(a)), (-0.4 * size * math.sin(a), 0.4 * size * math.cos(a))
        leaves += [(x + i * along[0] + j * across[0], y + 0.2 * i * size, z + i * along[1] + j * across[1])
                   for i, j in ((-1, 0), (0, -1), (1, 0), (0, 1))]  # fmt: skip
    stage.mesh(leaves, [range(4 * k, 4 * k + 4) for k in range(len(leaves) // 4)], stage.stone(MOSS[1:], 9))


def street(stage: Stage) -> None:
    """Fronts with balconies to be walked along, things parked and trees before them."""
    stage.card((2.5, 6, 0), 60, 40, stage.stone(((0.08, 0.08, 0.09), (0.28, 0.28, 0.29)), 4.0), tilt=90)
    stage.card((2.5, 40, 12), 140, 40, stage.stone(SKY, 0.25))
    paints = (stage.bricks(BRICK, MORTAR, 0.45), stage.stone(SAND, 1.6), stage.stone(STONE, 1.4))
    for k in range(8):
        x, front = -9.0 + 3.4 * k, 6.5 + 0.35 * (k % 3)
        stage.box((x, front + 1.5, 3.5), (3.38, 3.0, 7.0 + (k * 2) % 3), paints[k % 3])
        for z in (1.4, 4.2):
            for side in (-0.85, 0.85):
                stage.card((x + side, front - 0.03, z), 0.9, 1.4, stage.poster(5))
        if k % 2:
            stage.box((x, front - 0.45, 3.0), (2.4, 0.9, 0.12), stage.stone(STONE, 5))
            for side in range(7):
                at = x - 1.1 + 0.36 * side, front - 0.85
                stage.post((*at, 3.0), (*at, 3.9), 0.025, stage.stone(STONE, 9), 12)
    for k in range(4):
        x = -5.0 + 4.6 * k
        paint, yaw = stage.poster(3), stage.random.uniform(-8, 8)
        stage.thing(1 + k, stage.box((x, 4.6, 0.55), (1.9, 0.9, 1.1), paint, yaw=yaw))
        tree = x + 2.2, 4.0
        trunk = stage.post((*tree, 0), (*tree, 2.6), 0.09, stage.wood((0.05, 0.03, 0.02), (0.3, 0.2, 0.12), 20))
        stage.thing(5 + k, trunk, stage.ball((*tree, 3.3), 0.85, stage.stone(MOSS, 7)))


def walked_through(stage: Stage) -> Pose:
    """A room that somebody walks through while the second, third, fourth and sixth picture are taken."""
    room(stage)
    parts = person(stage, 0.0, 0.0)
    stood = [tuple(part.location) for part in parts]

    def pose(number: int | None) -> None:
        # between pictures the floor hides them
        x, y, z = (*WALK[number], 0.0) if number in WALK else (0.0, 0.0, -20.0)
        for part, (at_x, at_y, at_z) in zip(parts, stood, strict=True):
            part.location = at_x + x, at_y + y, at_z + z

    return pose


def two_rooms(stage: Stage) -> None:
    """A room, and far from it another one that no camera of the first sees: a hedge, a sandy ground, a pale sky."""
    room(stage)
    x, y = ELSEWHERE
    stage.card((x, y + 5, 2), 24, 10, stage.stone(MOSS, 3.5))
    stage.card((x, y + 3, 0), 24, 12, stage.stone(SAND, 3.0), tilt=90)
    for _ in range(9):
        at = x + stage.random.uniform(-3, 3), y + stage.random.uniform(2.5, 4.5)
        size = stage.random.uniform(0.25, 0.7)
        stage.ball((*at, size), size, stage.stone(SKY, 6 / size))


def outdoor(stage: Stage) -> None:
    """Ground with few things on it, far hills, and a sky 400 m away with few features."""
    # in small faces: of one as large as all of it Cycles hits what is near a little beside its rays
    ground = stage.relief(160, 160, lambda x, y: 0.0, stage.stone((*SAND, MOSS[1]), 1.2))
    ground.rotation_euler = (math.radians(-90), 0.0, 0.0)
    stage.ball((0, 0, 0), 400.0, stage.stone(SKY, 0.02, 0.5))
    hills = stage.stone((*MOSS, STONE[1]), 0.25)
    for k in range(16):
        a = math.radians(22.5 * k + stage.random.uniform(-8, 8))
        away, size = stage.random.uniform(60, 78), stage.random.uniform(9, 19)
        stage.ball((away * math.sin(a), away * math.cos(a), -0.3 * size), size, hills)
    for k in range(22):
        a, away = math.radians(17 * k + stage.random.uniform(-6, 6)), stage.random.uniform(4, 22)
        at, size = (away * math.sin(a), away * math.cos(a)), stage.random.uniform(0.3, 0.8)
        if k % 3:
            paint = stage.poster(4) if k % 2 else stage.stone(STONE, 5)
            parts = [stage.box((*at, size), (size, size, 2 * size), paint, yaw=31.0 * k)]
        else:
            parts = [stage.post((*at, 0), (*at, 2.4), 0.1, stage.wood(*OAK))]
            parts.append(stage.ball((*at, 3.0), 1.1, stage.stone(MOSS, 6)))
        stage.thing(1 + k, *parts)


SET_WORLDS: dict[str, Callable[[Stage], Pose | None]] = {
    build.__name__: build for build in (room, bright_room, posts, street, walked_through, two_rooms, outdoor)
}
