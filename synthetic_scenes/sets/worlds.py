"""The worlds that sets are shot in, built with bpy, all around the viewpoint; z = 0 is the floor."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..stage import Colour, Stage
from ..worlds import BRICK, MORTAR, SAND, STONE

OAK: tuple[Colour, Colour] = ((0.16, 0.08, 0.03), (0.48, 0.3, 0.14))
BLUE: tuple[Colour, Colour] = ((0.2, 0.25, 0.35), (0.12, 0.15, 0.25))
# x and y of a room's walls, and how high it is, m.
ROOM = (-3.2, 3.6, -3.0, 4.0, 2.8)


def room(stage: Stage) -> None:
    """Four walls with pictures, floor and ceiling, things of all sizes from 1.4 to 4 m away."""
    _shell(stage)
    _pictures(stage, 14)
    _table(stage, 0.3, 3.1)
    paints = (stage.poster(10), stage.wood(*OAK), stage.stone(STONE, 6))
    for k, (x, y) in enumerate(((-1.8, 1.7), (2.4, 0.7), (-1.6, -1.8), (1.1, -2.0), (2.6, 2.7), (-2.5, -0.1))):
        height = stage.random.uniform(0.5, 1.5)
        width, depth = stage.random.uniform(0.3, 0.6), stage.random.uniform(0.3, 0.6)
        stage.box((x, y, height / 2), (width, depth, height), paints[k % 3], yaw=stage.random.uniform(-40, 40))
    stage.post((1.6, 1.4, 0), (1.6, 1.4, ROOM[4]), 0.07, stage.stone(BRICK, 9))
    stage.post((-1.2, -1.1, 0), (-1.2, -1.1, ROOM[4]), 0.07, stage.wood(*OAK))
    stage.ball((-0.9, 2.0, 1.35), 0.18, stage.poster(10))


def _shell(stage: Stage) -> None:
    left, right, back, front, height = ROOM
    middle, across, along = ((left + right) / 2, (back + front) / 2), right - left, front - back
    x, y = middle
    for at, width, yaw, paint in (
        ((x, front), across, 0, stage.bricks(BRICK, MORTAR, 0.3)), ((x, back), across, 180, stage.stone(SAND, 2.5)),
        ((right, y), along, 90, stage.stone(STONE, 2.5)), ((left, y), along, -90, stage.bricks(BLUE, MORTAR, 0.4)),
    ):  # fmt: skip
        stage.card((*at, height / 2), width, height, paint, yaw=yaw)
    stage.card((x, y, 0), across, along, stage.tiles((0.16, 0.12, 0.1), (0.5, 0.44, 0.36), 0.35), tilt=90)
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


def _table(stage: Stage, x: float, y: float) -> None:
    """A table with a box and a ball on it."""
    stage.box((x, y, 0.73), (1.3, 0.7, 0.06), stage.wood(*OAK), yaw=15)
    cosine, sine = math.cos(math.radians(15)), math.sin(math.radians(15))
    for right in (-0.58, 0.58):
        for ahead in (-0.28, 0.28):
            foot = x + right * cosine + ahead * sine, y - right * sine + ahead * cosine
            stage.post((*foot, 0), (*foot, 0.7), 0.035, stage.wood(*OAK))
    stage.box((x - 0.25, y, 0.92), (0.3, 0.25, 0.32), stage.poster(14), yaw=35)
    stage.ball((x + 0.35, y - 0.1, 0.91), 0.15, stage.stone(BRICK, 9))


SET_WORLDS: dict[str, Callable[[Stage], None]] = {build.__name__: build for build in (room,)}
