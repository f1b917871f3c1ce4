"""What a panorama's surfaces and World are made of: materials, nodes, and what catches shadows."""

from __future__ import annotations

from typing import Any

import bpy
from mathutils import Matrix

from ..bridge import compat


def surround(world: bpy.types.World, image: bpy.types.Image, turn: Matrix) -> None:
    """Makes a World show an equirectangular panorama; turn (3, 3): from the scene's directions to the texture's."""
    nodes, link = _cleared(compat.node_tree(world))
    kinds = ("TexCoord", "Mapping", "TexEnvironment", "Background", "OutputWorld")
    where, mapping, texture, background, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    for number, node in enumerate((where, mapping, texture, background, output)):
        node.location = (220 * number - 800, 0)
    texture.image = image
    mapping.inputs["Rotation"].default_value = turn.to_euler("XYZ")
    link(where.outputs["Generated"], mapping.inputs["Vector"])
    link(mapping.outputs["Vector"], texture.inputs["Vector"])
    link(texture.outputs["Color"], background.inputs["Color"])
    link(background.outputs["Background"], output.inputs["Surface"])


def emission(image: bpy.types.Image) -> bpy.types.Material:
    """A material that shows an image as it is, whatever the lights; transparent where the image is."""
    material = _cut_out(image, "Emission")
    if hasattr(material, "cycles"):  # every face a lamp: 200 000 of them cost each render ten seconds before it begins
        material.cycles.emission_sampling = "NONE"
    return material


def receiving(image: bpy.types.Image) -> bpy.types.Material:
    """A matt material that is coloured as an image, and takes light and shadow; transparent where the image is."""
    return _cut_out(image, "BsdfDiffuse")


def catch(surface: bpy.types.Object) -> None:
    """Cycles shows of an object only the shadows that others cast on it, and what it reflects on them. It keeps no
    light away itself: a room is lit as if it were open."""
    surface.is_shadow_catcher, surface.visible_shadow = True, False


def _cut_out(image: bpy.types.Image, kind: str) -> bpy.types.Material:
    material = bpy.data.materials.new(image.name)
    nodes, link = _cleared(compat.node_tree(material))
    kinds = ("TexImage", kind, "BsdfTransparent", "MixShader", "OutputMaterial")
    texture, shader, clear, mix, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    places = (-600, 0), (-300, -60), (-300, 60), (0, 0), (200, 0)
    for node, place in zip((texture, shader, clear, mix, output), places, strict=True):
        node.location = place
    texture.image, texture.extension = image, "EXTEND"
    link(texture.outputs["Color"], shader.inputs["Color"])
    link(texture.outputs["Alpha"], mix.inputs[0])
    link(clear.outputs[0], mix.inputs[1])
    link(shader.outputs[0], mix.inputs[2])
    link(mix.outputs[0], output.inputs["Surface"])
    return material


def _cleared(tree: bpy.types.NodeTree) -> tuple[Any, Any]:
    """The nodes of a tree without any, and what links their sockets."""
    tree.nodes.clear()
    return tree.nodes, tree.links.new
