"""The scenes by name: which world, which two cameras, what must come out. No bpy: `worlds` builds them.

World axes are Blender's (z up), the reference camera looks along +y; lengths in metres, angles in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ..core.cameras.projective import homogeneous, infinite_homography, project, rotation_from_vector
from ..core.raster.arrays import Array
from ..core.system.errors import BadRequest
from .scene_camera import SceneCamera

SENSOR_MM = 36.0  # the longer side of every sensor
EYE = 1.5  # height of the reference camera


@dataclass(frozen=True)
class View:
    """A camera: place (x, y, z) m; yaw to the right, pitch down, roll clockwise in degrees; lens in mm."""

    place: tuple[float, float, float] = (0.0, 0.0, EYE)
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    lens: float = 30.0

    def camera(self, size: tuple[int, int]) -> SceneCamera:
        """As a camera of a picture of (W, H) px, the principal point in its middle."""
        width, height = size
        focal = self.lens / SENSOR_MM * max(size)
        K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
        yaw, pitch, roll = np.radians([self.yaw, self.pitch, self.roll])
        ahead = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) @ rotation_from_vector(np.array([0, 0, yaw]))
        R = rotation_from_vector(np.array([0, 0, -roll])) @ rotation_from_vector(np.array([pitch, 0, 0])) @ ahead
        return SceneCamera(K, R, -R @ np.array(self.place), size)


@dataclass(frozen=True)
class Difficulty:
    """How hard a scene is made: baseline and turn as factors of the recipe's; overlap: share of the target's pixels
    whose directions the reference sees too, reached by turning more or less (0: as the recipe has it); noise: σ of the
    sensor's noise in levels of 8 bit.
    """

    baseline: float = 1.0
    turn: float = 1.0
    overlap: float = 0.0
    noise: float = 0.0


@dataclass(frozen=True)
class Recipe:
    """A world, two cameras in it, and what is right about them.

    world: a function of `worlds`; model: the one that must be chosen; focal_determined: whether two pictures tell the
    focal length at all (docs/method.md, 3); hdr: float pictures instead of 8 bit; gain: what the target's exposure and
    white balance multiply its linear R, G, B by; vignetting: share of the light that both pictures lose in their
    corners.
    """

    name: str
    title: str
    world: str
    reference: View
    target: View
    seed: int = 0
    portrait: bool = False
    model: str = "general"
    focal_determined: bool = True
    hdr: bool = False
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignetting: float = 0.0

    @property
    def parallax(self) -> bool:
        """Whether one homography cannot do."""
        return self.model == "general"

    def size(self, width: int, height: int) -> tuple[int, int]:
        """(W, H) of its pictures where landscape ones have width × height."""
        return (height, width) if self.portrait else (width, height)

    def cameras(self, size: tuple[int, int], difficulty: Difficulty) -> tuple[SceneCamera, SceneCamera]:
        """Reference and target camera for pictures of (W, H) px. Raises BadRequest where no turn gives the overlap."""
        reference = self.reference.camera(size)
        if not difficulty.overlap:
            return reference, self._target(difficulty).camera(size)
        low, high = 0.0, 12.0
        for _ in range(60):
            turn = (low + high) / 2
            target = self._target(replace(difficulty, turn=turn)).camera(size)
            low, high = (turn, high) if overlap_at_infinity(reference, target) > difficulty.overlap else (low, turn)
        if abs(overlap_at_infinity(reference, target) - difficulty.overlap) > 0.01:
            raise BadRequest(f"no turn gives the scene {self.name} an overlap of {difficulty.overlap:g}")
        return reference, target

    def _target(self, difficulty: Difficulty) -> View:
        a, b = self.reference, self.target
        place = np.array(a.place) + difficulty.baseline * (np.array(b.place) - np.array(a.place))
        yaw, pitch, roll = (x + difficulty.turn * (y - x) for x, y in
                            ((a.yaw, b.yaw), (a.pitch, b.pitch), (a.roll, b.roll)))  # fmt: skip
        x, y, z = map(float, place)
        return View((x, y, z), yaw, pitch, roll, b.lens)


def overlap_at_infinity(reference: SceneCamera, target: SceneCamera) -> float:
    """Share of the target's pixels whose directions lie in the reference's picture."""
    x, y = np.meshgrid(*(np.linspace(0, side - 1, 200) for side in target.size))
    H = infinite_homography(target.K, reference.K, reference.R @ target.R.T)
    rays: Array = homogeneous(np.stack([x, y], axis=-1)) @ H.T
    rays[rays[..., 2] <= 0] = np.nan
    seen = project(rays)
    return float(((seen >= 0) & (seen <= np.array(reference.size) - 1)).all(axis=-1).mean())


def _view(x: float, y: float, z: float, yaw: float, pitch: float = 0.0, roll: float = 0.0, lens: float = 30.0) -> View:
    return View((x, y, EYE + z), yaw, pitch, roll, lens)


_LEVEL = View()
_DOWN = View(pitch=8.0)
_RECIPES = (
    Recipe("two_planes", "A brick wall with posters over a tiled floor", "two_planes",
           _DOWN, _view(0.5, -0.05, 0.05, 14, 10, 1.5)),
    Recipe("layered_cards", "Cards at five depths before a backdrop", "layered_cards",
           _LEVEL, _view(0.3, 0.02, 0.04, 9, 2, -1.5)),
    Recipe("corner_room", "A furnished corner of a room", "corner_room",
           View(pitch=5.0), _view(0.4, 0.1, 0.05, 13, 7, 1.5)),
    Recipe("street", "A street with receding fronts and poles", "street",
           View(pitch=2.0), _view(0.8, 0.3, 0.1, 11, 4, 1.5)),
    Recipe("foliage", "Leaves and branches before a hedge", "foliage",
           _LEVEL, _view(0.18, 0.02, 0.03, 8, 2, 1.5)),
    Recipe("relief", "Smooth hills on a wall", "relief",
           _LEVEL, _view(0.5, 0.05, -0.06, 11, 2, -1.5)),
    Recipe("tabletop", "Things on a table, near by", "tabletop",
           View((0, -1.15, 0.95), pitch=36.0), View((0.16, -1.12, 0.97), 7, 38, 2.0)),
    Recipe("portrait_pair", "The corner of a room in portrait format, the target rolled by 9 degrees", "corner_room",
           View(pitch=3.0), _view(0.35, 0.05, 0.05, 9, 5, 9), seed=1, portrait=True),
    Recipe("zoom_pair", "A street through two focal lengths, 34 and 25 mm", "street",
           View(pitch=2.0, lens=34.0), _view(0.7, 0.2, 0.1, 12, 4, 2, lens=25.0), seed=1),
    Recipe("forward", "A step back in a street: the epipole lies in the picture, the axes are parallel", "street",
           View(pitch=2.0), _view(0.06, -0.9, 0.03, 0, 2), seed=2, focal_determined=False),
    Recipe("sideways", "A step aside without a turn: the epipole lies at infinity", "corner_room",
           View(pitch=3.0), _view(0.45, 0, 0, 0, 3), seed=2, focal_determined=False),
    Recipe("toe_in", "Axes that meet at equal distances from both cameras", "relief",
           _view(-0.5, 0, 0, 5), _view(0.5, 0, 0, -5), seed=1, focal_determined=False),
    Recipe("pure_rotation", "A turn on the spot", "street",
           View(pitch=2.0), _view(0, 0, 0, 17, 4, 2), seed=3, model="rotation"),
    Recipe("single_plane", "Nothing but one front", "single_plane",
           _LEVEL, _view(0.7, 0.2, 0.1, 9, 3, 2), model="plane", focal_determined=False),
    Recipe("exposure_step", "The target 0.7 stops darker and warmer", "two_planes",
           _DOWN, _view(0.45, 0.05, 0.05, 13, 10, -1.5), seed=1, gain=(0.68, 0.62, 0.53)),
    Recipe("hdr_interior", "A room with a lamp and a window 30 times brighter than white, in float", "hdr_interior",
           View(pitch=5.0), _view(0.4, 0.1, 0.05, 12, 7, 1.5), seed=3, hdr=True),
    Recipe("low_texture", "Painted walls with hardly a stain", "low_texture",
           View(pitch=4.0), _view(0.35, 0.05, 0.04, 10, 6, 1.5)),
    Recipe("wide", "A turn of 60 degrees, a quarter in common", "corner_room",
           View(yaw=-26.0, pitch=4.0, lens=23.0), _view(0.3, 0.1, 0.04, 34, 6, 1.5, lens=23.0), seed=4),
    Recipe("occluder", "A post in front of everything", "occluder",
           _DOWN, _view(0.3, 0.0, 0.03, 11, 10, 1.5), seed=4),
    Recipe("thin_things", "Posts, a railing, a lamp, a sign, leaves and a cup before a far wall", "thin_things",
           View(pitch=2.0), _view(0.25, 0.03, 0.03, 9, 3, 1.5), seed=5),
    Recipe("cut_branch", "A branch near by, cut by the reference's border, whole in the target", "cut_branch",
           _LEVEL, _view(0.4, 0.02, 0.03, 13, 2, 1.0), seed=5),
    Recipe("cut_person", "A person near by, whole in the reference, cut by the target's border", "cut_person",
           View(pitch=3.0), _view(0.45, 0.02, 0.03, 14, 4, 1.0), seed=6),
    Recipe("vignetted", "A street, dark in the corners; the target one stop over, where its sky clips", "street",
           View(pitch=2.0), _view(0.5, 0.2, 0.05, 12, 3, 1.0), seed=7, gain=(2.0, 2.0, 2.0), vignetting=0.35),
)  # fmt: skip
RECIPES = {recipe.name: recipe for recipe in _RECIPES}

# A wall and floor, depth in layers, strong relief, no parallax at all.
QUICK = ("two_planes", "layered_cards", "tabletop", "pure_rotation")
FULL = tuple(RECIPES)


def parse_scene(text: str) -> tuple[Recipe, Difficulty]:
    """A scene by name, made harder if wanted: `street`, `street:baseline=2,noise=3`. Raises BadRequest."""
    name, _, settings = text.partition(":")
    if name not in RECIPES:
        raise BadRequest(f"no scene {name!r}; there are: {', '.join(RECIPES)}")
    known = [field.name for field in fields(Difficulty)]
    values: dict[str, float] = {}
    for setting in filter(None, settings.split(",")):
        key, _, value = setting.partition("=")
        try:
            values[key] = float(value)
        except ValueError:
            values[key] = float("nan")
        if key not in known or not 0 <= values[key] < 100:
            raise BadRequest(f"scene {text!r}: {setting!r} is not like baseline=2; there are: {', '.join(known)}")
    return RECIPES[name], Difficulty(**values)
