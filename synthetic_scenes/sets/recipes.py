"""The sets by name: which world, which cameras in it, what must come out. No bpy: `worlds` builds them.

As in `..recipes`, world axes are Blender's and a camera without any turn looks along +y; metres and degrees. The first
camera stands at the viewpoint, from which the true sphere is rendered.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...core.system.errors import BadRequest
from ..recipes import EYE, View
from ..scene_camera import SceneCamera
from .places import ELSEWHERE

Shoot = Callable[[int, float, np.random.Generator], tuple[View, ...]]
MOST_PICTURES = 60


@dataclass(frozen=True)
class SetRecipe:
    """A world and the cameras in it.

    world: a function of `sets.worlds`; shoot: makes `count` views by how far from the viewpoint they lie, `spread`
    (standard deviation, m), and chance; noise: σ of the sensor's, levels of 8 bit; strays: how many pictures, the
    last ones, show another place; parallax: whether one place cannot explain all pictures; agx: whether pictures are 8
    bit by Blender's view AgX, which takes lights back as cameras do, not by Standard; exposures: how often and by how
    much brighter, EV, each picture is taken, the middle one first.
    """

    name: str
    title: str
    world: str
    shoot: Shoot
    count: int
    spread: float
    seed: int = 0
    noise: float = 1.0
    strays: int = 0
    parallax: bool = True
    agx: bool = False
    exposures: tuple[float, ...] = (0.0,)

    @property
    def views(self) -> tuple[View, ...]:
        """All cameras, the viewpoint's first."""
        return self.shoot(self.count, self.spread, np.random.default_rng(self.seed))

    @property
    def left_out(self) -> tuple[int, ...]:
        """Numbers of the pictures that show another place."""
        return tuple(range(self.count - self.strays, self.count))

    def cameras(self, size: tuple[int, int]) -> dict[str, SceneCamera]:
        """The same by name, for pictures of (W, H) px."""
        return {f"{number:02d}": view.camera(size) for number, view in enumerate(self.views)}


@dataclass(frozen=True)
class Body(View):
    """A view through a body of its own: the sides of its pictures as a share of all others', upright or not, and the
    radial distortion of its lens."""

    share: float = 1.0
    portrait: bool = False
    k1: float = 0.0

    def camera(self, size: tuple[int, int]) -> SceneCamera:
        """As a camera, where others have pictures of (W, H) px."""
        width, height = (round(self.share * side) for side in size)
        return replace(super().camera((height, width) if self.portrait else (width, height)), k1=self.k1)


def in_the_hand(view: View, spread: float, random: np.random.Generator) -> View:
    """A view as a hand holds it: off its place by `spread` (two thirds of it in height), and turned by 2 to 3°."""
    x, y, z = (np.array(view.place) + random.normal(0, [spread, spread, spread * 2 / 3])).tolist()
    yaw, pitch, roll = random.normal(0, [3.0, 2.0, 2.0]).tolist()
    return replace(view, place=(x, y, z), yaw=view.yaw + yaw, pitch=view.pitch + pitch, roll=view.roll + roll)


def fan(step: float, lens: float, pitch: float = 4.0) -> Shoot:
    """Views side by side, `step` degrees apart: the first in the middle, the others right and left of it in turn."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        first = View((0.0, 0.0, EYE), 0.0, pitch, 0.0, lens)
        return first, *(in_the_hand(replace(first, yaw=step * aside(k)), spread, random) for k in range(1, count))

    return shoot


def aside(number: int) -> int:
    """How many steps to the right a picture is turned, by its number: 0, 1, -1, 2, -2, …"""
    return (number + 1) // 2 * (1 if number % 2 else -1)


def wide_and_tele(step: float, wide: Body, tele: Body) -> Shoot:
    """Views side by side, `step` degrees apart, through two bodies in turn: the first in the middle is wide."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        bodies = (tele if aside(k) % 2 else wide for k in range(1, count))
        turned = (replace(body, yaw=step * aside(k)) for k, body in enumerate(bodies, start=1))
        return wide, *(in_the_hand(view, spread, random) for view in turned)

    return shoot


def ring(lens: float) -> Shoot:
    """Views all around, whose ends meet."""
    return lambda count, spread, random: fan(360 / count, lens)(count, spread, random)


def rings(lens: float) -> Shoot:
    """Three rings, 35° apart, that show all but what is overhead and underfoot: of 27 views 11 level, 8 up, 8 down."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        slanted = round(count * 8 / 27)
        views = [View(yaw=360 * k / slanted + 15, pitch=-32.0, lens=lens) for k in range(slanted)]
        views += [View(yaw=360 * k / slanted, pitch=38.0, lens=lens) for k in range(slanted)]
        level = ring(lens)(count - 2 * slanted, spread, random)
        return *level, *(in_the_hand(view, spread, random) for view in views)

    return shoot


def chain(step: float, link: float, lens: float) -> Shoot:
    """Views one after the other to the right, `step` degrees apart but for two in between, which are `link` apart."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        first = View((0.0, 0.0, EYE), 0.0, 4.0, 0.0, lens)
        far = (count // 3, count - count // 3)
        turns = np.cumsum([link if k in far else step for k in range(1, count)]).tolist()
        return first, *(in_the_hand(replace(first, yaw=yaw), spread, random) for yaw in turns)

    return shoot


def sweep(step: float, lens: float) -> Shoot:
    """Views that all look ahead, `step` metres apart to the right."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        first = View((0.0, 0.0, EYE), 0.0, -4.0, 0.0, lens)
        others = (replace(first, place=(step * k, 0.0, EYE)) for k in range(1, count))
        return first, *(in_the_hand(view, spread, random) for view in others)

    return shoot


def on_a_tripod(step: float, lens: float, in_hand: int = 0) -> Shoot:
    """A fan from one place. The last `in_hand` views are taken from the hand; if there are none, the last two stand
    `spread` to the right, as where a tripod does not quite turn about the lens's nodal point."""

    def shoot(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        views = list(fan(step, lens)(count, 0.0, random))
        for number in range(count - in_hand, count):
            views[number] = in_the_hand(views[number], spread, random)
        if not in_hand:
            for number in (count - 2, count - 1):
                x, y, z = views[number].place
                views[number] = replace(views[number], place=(x + spread, y, z))
        return tuple(views)

    return shoot


def with_strays(shoot: Shoot, strays: int, lens: float) -> Shoot:
    """Views of which the last show another place."""

    def with_them(count: int, spread: float, random: np.random.Generator) -> tuple[View, ...]:
        x, y = ELSEWHERE
        others = [View((x + 0.3 * k, y, EYE), 12.0 * k, 6.0, 0.0, lens) for k in range(strays)]
        return *shoot(count - strays, spread, random), *others

    return with_them


_SETS = (
    SetRecipe("small_room", "A furnished room, five pictures over half of it", "room", fan(32.0, 24.0), 5, 0.12,
              seed=3),
    SetRecipe("ring", "A furnished room all around, eleven pictures whose ends meet", "room", ring(24.0), 11, 0.15,
              seed=4),
    SetRecipe("posts", "Near, thin posts, a railing and leaves before the walls of a room", "posts", fan(24.0, 26.0),
              6, 0.1, seed=6),
    SetRecipe("chain", "Nine pictures in a row, two of whose links no third picture sees", "room",
              chain(27.0, 48.0, 28.0), 9, 0.12, seed=18),
    SetRecipe("two_lenses", "A bent wide lens and a tele held upright, seven pictures in turn", "room",
              wide_and_tele(24.0, Body(pitch=4.0, lens=20.0, k1=-0.08),
                            Body(pitch=4.0, lens=40.0, share=0.8, portrait=True)), 7, 0.1, seed=12),
    SetRecipe("outdoor", "Few things on open ground, far hills, a sky without features", "outdoor", ring(24.0), 11,
              0.2, seed=10),
    SetRecipe("street_sweep", "A street walked along sideways", "street", sweep(0.9, 26.0), 6, 0.06, seed=5),
    SetRecipe("tripod", "A room from a tripod, two pictures 2 mm off it", "room", on_a_tripod(26.0, 26.0), 8, 0.002,
              seed=7, parallax=False),
    SetRecipe("mover", "A room that somebody walks through in four of eight pictures", "walked_through",
              fan(22.0, 26.0), 8, 0.1, seed=13),
    SetRecipe("room_sphere", "A furnished room all around, up and down, in three rings of pictures", "room",
              rings(24.0), 27, 0.15, seed=4, agx=True),
    SetRecipe("brackets", "Five pictures, each exposed three times, of a room with a window, a lamp and a glossy floor",
              "bright_room", fan(32.0, 24.0), 5, 0.12, seed=14, exposures=(0.0, -4.0, 2.0)),
    SetRecipe("mixed", "Six pictures from a tripod, four more from the hand", "room", on_a_tripod(24.0, 26.0, 4), 10,
              0.15, seed=8),
    SetRecipe("stray", "Nine pictures, two of them of another place", "two_rooms",
              with_strays(fan(26.0, 26.0), 2, 26.0), 9, 0.12, seed=9, strays=2),
)  # fmt: skip
SETS = {recipe.name: recipe for recipe in _SETS}


def parse_set(text: str) -> SetRecipe:
    """A set by name, made harder if wanted: `ring`, `ring:n=9,spread=0.3,noise=3`. Raises BadRequest."""
    name, _, settings = text.partition(":")
    if name not in SETS:
        raise BadRequest(f"no set {name!r}; there are: {', '.join(SETS)}")
    recipe = SETS[name]
    for setting in filter(None, settings.split(",")):
        key, _, value = setting.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if key == "n" and number in range(3, MOST_PICTURES + 1):
            recipe = replace(recipe, count=int(number))
        elif key == "spread" and 0 <= number < 100:
            recipe = replace(recipe, spread=number)
        elif key == "noise" and 0 <= number < 100:
            recipe = replace(recipe, noise=number)
        else:
            known = f"n (3 to {MOST_PICTURES}), spread (m), noise"
            raise BadRequest(f"set {text!r}: {setting!r} is not like spread=0.3; there are: {known}")
    return recipe
