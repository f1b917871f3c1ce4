"""Where Blender 4.2 to 5.2 differ, and the names that an OCIO configuration may lack: one place for all of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import bpy

# Blender's names of colour spaces, since 4.0.
LINEAR, DISPLAY, DATA = "Linear Rec.709", "sRGB", "Non-Color"


def set_colour_space(image: bpy.types.Image, name: str) -> None:
    """Interpret an image's values so; a studio's own OCIO configuration may lack the name, and its default stays."""
    try:
        image.colorspace_settings.name = name
    except TypeError:
        pass


def take_kept(group: Any, name: str) -> Any:
    """What a file keeps in a group of properties under a name that is no property any more, taken out of it; None where
    there is nothing. Since 5.0 a group's own values are kept apart from what scripts put there."""
    kept = group.bl_system_properties_get() if hasattr(group, "bl_system_properties_get") else group
    return None if kept is None else kept.pop(name, None)


def by_uid(kind: Iterable[Any], uid: int | None) -> Any:
    """The scene, image or object of a `session_uid`, which survives undo and renaming (a reference to it does not)."""
    return next((one for one in kind if one.session_uid == uid), None)


@contextmanager
def written_as(scene: bpy.types.Scene, file_format: str, bits: int) -> Iterator[bpy.types.Scene]:
    """The scene, as long as it lasts, with this format and depth for `Image.save_render`."""
    settings = scene.render.image_settings
    mode = "RGB" if file_format == "HDR" else "RGBA"  # Radiance has no alpha
    # in this order: what a format offers depends on what stands before. 5.0 has media_type (movies, multilayer files).
    wanted = {"media_type": "IMAGE", "file_format": file_format, "color_mode": mode, "color_depth": str(bits)}
    names = [name for name in wanted if hasattr(settings, name)]
    before = [getattr(settings, name) for name in names]
    try:
        for name in names:
            setattr(settings, name, wanted[name])
        yield scene
    finally:
        for name, value in zip(names, before, strict=True):
            setattr(settings, name, value)


@contextmanager
def saving_scene(file_format: str, bits: int) -> Iterator[bpy.types.Scene]:
    """A scene for `Image.save_render` that keeps an image's values: no view transform."""
    scene = bpy.data.scenes.new("EDF Stitch saving")
    try:
        scene.view_settings.view_transform = "Standard"
        with written_as(scene, file_format, bits):
            yield scene
    finally:
        bpy.data.scenes.remove(scene)


def node_tree(owner: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """The nodes of a new material or world; since 5.0 they are there from the start."""
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


def sees_cylinders() -> bool:
    """Whether Cycles has a cylindrical lens: since 4.3."""
    return bpy.app.version >= (4, 3, 0)


def make_panoramic(
    camera: bpy.types.Camera, kind: str, headings: tuple[float, float], elevations: tuple[float, float]
) -> None:
    """Sets a camera's panoramic lens (see scene_geometry.RoundLens). Cycles sees through it. Before 4.5 its properties
    were Cycles' own, and are not there without it."""
    camera.type = "PANO"
    lens = camera if hasattr(camera, "panorama_type") else getattr(camera, "cycles", None)
    if lens is None:
        return
    if kind == "equirectangular":
        lens.panorama_type = "EQUIRECTANGULAR"
        (lens.longitude_min, lens.longitude_max), (lens.latitude_min, lens.latitude_max) = headings, elevations
    else:
        lens.panorama_type, lens.central_cylindrical_radius = "CENTRAL_CYLINDRICAL", 1.0
        lens.central_cylindrical_range_u_min, lens.central_cylindrical_range_u_max = headings
        lens.central_cylindrical_range_v_min, lens.central_cylindrical_range_v_max = elevations


def unified_paint(context: Any) -> Any:
    """What all brushes of the Image Editor share; since 5.0 each kind of painting has its own."""
    paint = context.tool_settings.image_paint
    return getattr(paint, "unified_paint_settings", None) or context.tool_settings.unified_paint_settings


@cache
def picture_shader() -> Any:
    """A shader that shows a texture of display-encoded values times a colour: `pos` (region px) and `uv`, uniforms
    `color` and `image`. Blender's own ones take textures for light in some versions and for encoded in others."""
    import gpu

    info = gpu.types.GPUShaderCreateInfo()
    between = gpu.types.GPUStageInterfaceInfo("edf_stitch_picture")
    between.smooth("VEC2", "uv_between")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_in(1, "VEC2", "uv")
    info.vertex_out(between)
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC4", "color")
    info.sampler(0, "FLOAT_2D", "image")
    info.fragment_out(0, "VEC4", "fragment")
    info.vertex_source(
        "void main() { uv_between = uv; gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0); }"
    )
    # what is drawn over an editor's picture is encoded by the screen's own buffer: it wants light
    info.fragment_source("""
        void main() {
            vec4 shown = texture(image, uv_between) * color;
            vec3 light = pow((shown.rgb + 0.055) / 1.055, vec3(2.4));
            fragment = vec4(mix(light, shown.rgb / 12.92, vec3(lessThanEqual(shown.rgb, vec3(0.04045)))), shown.a);
        }
    """)
    return gpu.shader.create_from_info(info)
