"""Building with bpy: simple shapes and procedural paints.

Paints emit their colour, so a render has no light to wait for and every point looks the same from everywhere; a fixed
shade by the direction of the surface stands for the sun.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import bpy

Colour = tuple[float, float, float]
Place = tuple[float, float, float]

SUN = (-0.45, -0.6, 0.66)
# Octaves of noise: more would only add what is smaller than a pixel, hence aliasing.
DETAIL = 4.0


class Stage:
    """An empty scene to be filled. `random` is seeded: the same seed builds the same world."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.scene = bpy.context.scene
        for item in list(bpy.data.objects):
            bpy.data.objects.remove(item)

    def card(self, centre: Place, width: float, height: float, paint: Any, yaw: float = 0.0, tilt: float = 0.0) -> Any:
        """An upright rectangle that faces −y; yaw turns it (degrees, to the right), tilt lays it back (90: a floor)."""
        x, y = width / 2, height / 2
        corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]
        card = self.mesh(corners, [(0, 1, 2, 3)], paint)
        card.location = centre
        card.rotation_euler = (math.radians(90 - tilt), 0.0, math.radians(-yaw))
        return card

    def box(self, centre: Place, size: Place, paint: Any, yaw: float = 0.0) -> Any:
        """A box that stands upright; size (x, y, z) m."""
        x, y, z = (side / 2 for side in size)
        corners = [(i * x, j * y, k * z) for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        box = self.mesh(corners, faces, paint)
        box.location, box.rotation_euler = centre, (0.0, 0.0, math.radians(-yaw))
        return box

    def post(self, foot: Place, top: Place, radius: float, paint: Any, sides: int = 24) -> Any:
        """A round bar from one point to another, in rings: Cycles hits needles of triangles 0.03 px beside its rays."""
        axis = [b - a for a, b in zip(foot, top, strict=True)]
        length = math.sqrt(sum(part * part for part in axis))
        rim = [2 * math.pi * k / sides for k in range(sides)]
        rings = max(1, round(length / (4 * radius)))
        levels = [length * i / rings for i in range(rings, -1, -1)]
        corners = [(radius * math.cos(a), radius * math.sin(a), z) for z in levels for a in rim]
        ends = [tuple(range(sides)), tuple(range(rings * sides, (rings + 1) * sides))[::-1]]
        post = self.mesh(corners, [*_quads(rings, sides, closed=True), *ends], paint)
        post.location = foot
        tilt = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
        post.rotation_euler = (0.0, tilt, math.atan2(axis[1], axis[0]))
        return post

    def ball(self, centre: Place, radius: float, paint: Any) -> Any:
        """A sphere."""
        rings, sides = 32, 64
        corners: list[Place] = []
        for i in range(rings + 1):
            up, out = math.cos(math.pi * i / rings), math.sin(math.pi * i / rings)
            for k in range(sides):
                a = 2 * math.pi * k / sides
                corners.append((radius * out * math.cos(a), radius * out * math.sin(a), radius * up))
        ball = self.mesh(corners, _quads(rings, sides, closed=True), paint, smooth=True)
        ball.location = centre
        return ball

    def relief(self, width: float, height: float, depth: Callable[[float, float], float], paint: Any) -> Any:
        """A wall of changing depth y = depth(x, z), x and z about the origin."""
        columns, rows = 240, 180
        corners = []
        for i in range(rows + 1):
            for k in range(columns + 1):
                x, z = width * (k / columns - 0.5), height * (0.5 - i / rows)
                corners.append((x, depth(x, z), z))
        return self.mesh(corners, _quads(rows, columns + 1, closed=False), paint, smooth=True)

    def thing(self, number: int, *parts: Any) -> None:
        """Objects that are one thing, with a number from 1, in the object pass."""
        for part in parts:
            part.pass_index = number

    def mesh(self, corners: Sequence[Place], faces: Sequence[Sequence[int]], paint: Any, smooth: bool = False) -> Any:
        """An object of corner points and faces."""
        data = bpy.data.meshes.new("part")
        data.from_pydata(corners, [], faces)
        data.materials.append(paint)
        if smooth:
            data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
        part = bpy.data.objects.new("part", data)
        self.scene.collection.objects.link(part)
        return part

    def stone(self, colours: Sequence[Colour], scale: float = 3.0, contrast: float = 1.0) -> Any:
        """Cloudy noise between colours; scale: clouds in a metre."""
        paint = _Paint(self.random)
        return paint.finish(paint.ramp(paint.noise(scale), colours, 0.5 / contrast))

    def bricks(self, colours: Sequence[Colour], mortar: Colour, width: float = 0.3) -> Any:
        """Bricks with stains."""
        paint = _Paint(self.random)
        brick = paint.node("ShaderNodeTexBrick")
        paint.link(paint.place, brick.inputs["Vector"])
        for name, colour in zip(("Color1", "Color2", "Mortar"), (*colours[:2], mortar), strict=True):
            brick.inputs[name].default_value = (*colour, 1.0)
        for name, value in (("Scale", 1.0), ("Brick Width", width), ("Row Height", 0.4 * width),
                            ("Mortar Size", 0.03 * width), ("Mortar Smooth", 0.6)):  # fmt: skip
            brick.inputs[name].default_value = value
        return paint.finish(paint.stained(paint.stained(brick.outputs["Color"], 2.2), 2.5 / width))

    def wood(self, dark: Colour, bright: Colour, scale: float = 6.0) -> Any:
        """Grain along x."""
        paint = _Paint(self.random)
        wave = paint.node("ShaderNodeTexWave", wave_type="BANDS", bands_direction="Y")
        for name, value in (("Scale", scale), ("Distortion", 7.0), ("Detail", 2.0), ("Detail Scale", 1.5)):
            wave.inputs[name].default_value = value
        paint.link(paint.place, wave.inputs["Vector"])
        return paint.finish(paint.stained(paint.ramp(wave.outputs[1], [dark, bright]), 5.0))

    def poster(self, scale: float = 5.0) -> Any:
        """Patches of every colour with strong edges; scale: patches in a metre."""
        paint = _Paint(self.random)
        cells = paint.node("ShaderNodeTexVoronoi")
        cells.inputs["Scale"].default_value = scale
        paint.link(paint.place, cells.inputs["Vector"])
        return paint.finish(paint.stained(cells.outputs["Color"], 3.0))

    def tiles(self, dark: Colour, bright: Colour, size: float = 0.4, glossy: bool = False) -> Any:
        """A chequered floor with stains; glossy: what is above it is mirrored in it, as in polished stone."""
        paint = _Paint(self.random)
        tiles = paint.node("ShaderNodeTexChecker")
        for name, colour in (("Color1", dark), ("Color2", bright)):
            tiles.inputs[name].default_value = (*colour, 1.0)
        tiles.inputs["Scale"].default_value = 1 / size
        paint.link(paint.place, tiles.inputs["Vector"])
        # tiles alone look all alike: dirt is what tells one from the next
        return paint.finish(paint.stained(paint.stained(tiles.outputs["Color"], 2.0), 4.0 / size), glossy=glossy)

    def light(self, colour: Colour) -> Any:
        """Something that shines: values above 1, with a little pattern."""
        paint = _Paint(self.random)
        bright = tuple(1.35 * part for part in colour)
        return paint.finish(paint.ramp(paint.noise(3.0), [colour, (bright[0], bright[1], bright[2])]), shaded=False)


def _quads(rows: int, columns: int, closed: bool) -> list[Sequence[int]]:
    """Faces of a grid of points: rows + 1 lines of `columns` points, joined at their ends where closed."""
    out: list[Sequence[int]] = []
    for i in range(rows):
        for k in range(columns if closed else columns - 1):
            after = (k + 1) % columns
            out.append((i * columns + k, (i + 1) * columns + k, (i + 1) * columns + after, i * columns + after))
    return out


class _Paint:
    """A material while its nodes are put together; `place`: where on the object, in metres, moved by chance."""

    def __init__(self, chance: random.Random) -> None:
        self.material = bpy.data.materials.new("paint")
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        coordinates, moved = self.node("ShaderNodeTexCoord"), self.node("ShaderNodeMapping")
        moved.inputs["Location"].default_value = [chance.uniform(0, 50), chance.uniform(0, 50), 0.0]
        self.link(coordinates.outputs["Object"], moved.inputs["Vector"])
        self.place = moved.outputs[0]

    def node(self, kind: str, **settings: Any) -> Any:
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, output: Any, entry: Any) -> None:
        self.tree.links.new(output, entry)

    def noise(self, scale: float) -> Any:
        noise = self.node("ShaderNodeTexNoise")
        for name, value in (("Scale", scale), ("Detail", DETAIL), ("Roughness", 0.6)):
            noise.inputs[name].default_value = value
        self.link(self.place, noise.inputs["Vector"])
        return noise.outputs[0]

    def ramp(self, value: Any, colours: Sequence[Colour], spread: float = 0.5) -> Any:
        """Colours for values about 0.5; spread: from the first to the last."""
        ramp = self.node("ShaderNodeValToRGB")
        steps = ramp.color_ramp.elements
        while len(steps) < len(colours):
            steps.new(0.5)
        for k, colour in enumerate(colours):
            steps[k].position = 0.5 + spread * (k / (len(colours) - 1) - 0.5)
            steps[k].color = (*colour, 1.0)
        self.link(value, ramp.inputs[0])
        return ramp.outputs[0]

    def stained(self, colour: Any, scale: float) -> Any:
        return self.times(colour, self.ramp(self.noise(scale), [(0.35,) * 3, (0.75,) * 3, (1.15,) * 3]))

    def times(self, a: Any, b: Any) -> Any:
        product = self.node("ShaderNodeVectorMath", operation="MULTIPLY")
        self.link(a, product.inputs[0])
        self.link(b, product.inputs[1])
        return product.outputs[0]

    def finish(self, colour: Any, shaded: bool = True, glossy: bool = False) -> Any:
        """The material that emits a colour, shaded by where its surface faces, under a clear coat where glossy."""
        if shaded:
            facing = self.node("ShaderNodeVectorMath", operation="DOT_PRODUCT")
            self.link(self.node("ShaderNodeNewGeometry").outputs["Normal"], facing.inputs[0])
            facing.inputs[1].default_value = SUN
            bright = self.node("ShaderNodeMath", operation="MULTIPLY_ADD")
            self.link(facing.outputs["Value"], bright.inputs[0])
            bright.inputs[1].default_value, bright.inputs[2].default_value = 0.35, 0.6
            colour = self.times(colour, bright.outputs[0])
        emission, output = self.node("ShaderNodeEmission"), self.node("ShaderNodeOutputMaterial")
        self.link(colour, emission.inputs["Color"])
        if glossy:
            mirror, mixed = self.node("ShaderNodeBsdfGlossy"), self.node("ShaderNodeMixShader")
            mirror.inputs["Roughness"].default_value = 0.0
            self.link(self.node("ShaderNodeFresnel").outputs[0], mixed.inputs[0])
            self.link(emission.outputs[0], mixed.inputs[1])
            self.link(mirror.outputs[0], mixed.inputs[2])
            emission = mixed
        self.link(emission.outputs[0], output.inputs["Surface"])
        return self.material
