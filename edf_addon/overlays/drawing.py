"""What is drawn over the pictures in the Image Editor: matches, epipolar lines, differences, what is painted out.

The draw handler reads the settings and the result and changes nothing. There is no drawing under `-b`.
"""

from __future__ import annotations

from typing import Any

import bpy

from .. import editor, engine_options, idnames, pictures, properties
from ..bridge import compat, ownership, result

MATCH_RADIUS, LINE_WIDTH = 3.5, 1.6
LINE, POINTER = (1.0, 0.85, 0.2, 0.95), (1.0, 1.0, 1.0, 0.9)
FRAME, PLACE = (1.0, 0.45, 0.1, 1.0), (1.0, 0.1, 0.5, 1.0)
CHOSEN, WAITING = (1.0, 1.0, 1.0, 1.0), (0.2, 1.0, 0.9, 1.0)
SHADE = (0.0, 0.0, 0.0, 0.55)
PAINTED_OUT, WANTED, FROM_TARGET = (0.9, 0.08, 0.05, 0.6), (0.05, 0.7, 0.2, 0.6), (1.0, 0.55, 0.1, 0.6)
LONGEST_SIDE = 2048  # of a picture that lies under its mask

# The draw handler, and the keymap items of the pointer.
_handlers: list[Any] = []
_keys: list[tuple[Any, Any]] = []
# Where the pointer is: px of a picture, which it is in which panorama (its session_uid); None while it is over none.
_pointer: dict[str, Any] = {"panorama": None, "side": None, "point": None}
# The point that was clicked and waits for its counterpart, by side; px of the upright picture.
pending: dict[str, tuple[float, float]] = {}
# Textures made of pictures, by what they were made of; and rays around the frame, by what was chosen.
_textures: dict[tuple, Any] = {}
_frames: dict[tuple, Any] = {}


class EDF_OT_pointer(bpy.types.Operator):  # noqa: N801
    """Follow the pointer with epipolar lines"""

    bl_idname = idnames.Operator.POINTER
    bl_label = "Epipolar Lines under the Pointer"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        space = context.space_data
        return (
            space is not None and space.type == "IMAGE_EDITOR" and space.image is not None
            and properties.settings_of(context.scene).show_epipolar
        )  # fmt: skip

    def invoke(self, context: Any, event: Any) -> set[str]:
        follow(context, (event.mouse_region_x, event.mouse_region_y))
        return {"PASS_THROUGH"}


def follow(context: Any, position: tuple[float, float]) -> None:
    """The pointer stands at `position` px of the context's region."""
    import numpy as np

    from . import overlay_geometry

    space, settings = context.space_data, properties.settings_of(context.scene)
    panorama = editor.panorama(context)
    side = editor.side_in(panorama, editor.beneath(settings, space.image))
    point = None
    if side is not None and context.region.type == "WINDOW":
        size = (space.image.size[0], space.image.size[1])
        point = overlay_geometry.from_view(np.array(context.region.view2d.region_to_view(*position)), size)
        if ((point >= -0.5) & (point <= np.array(size) - 0.5)).all():
            point = overlay_geometry.upright(point, size, editor.orientation(settings, space.image))
        else:
            side = point = None
    _pointer.update(panorama=panorama and panorama.session_uid, side=side, point=point)
    editor.redraw()


def match_arrays(settings: Any) -> dict[str, Any]:
    """The matches of the list: `reference`, `target` (N, 2) px, `error` (N,) NaN where not measured, `enabled`."""
    import numpy as np

    count = len(settings.matches)
    columns = {name: np.empty(count, np.float32) for name in ("x", "y", "x2", "y2", "error")}
    for name, values in columns.items():
        settings.matches.foreach_get(name, values)
    enabled = np.empty(count, bool)
    settings.matches.foreach_get("enabled", enabled)
    return {
        editor.REFERENCE: np.stack([columns["x"], columns["y"]], axis=-1).astype(np.float64),
        editor.TARGET: np.stack([columns["x2"], columns["y2"]], axis=-1).astype(np.float64),
        "error": np.where(columns["error"] < 0, np.nan, columns["error"]).astype(np.float64), "enabled": enabled,
    }  # fmt: skip


def draw() -> None:
    """What Blender calls after it has drawn a picture."""
    context = bpy.context
    space, settings = context.space_data, properties.settings_of(context.scene)
    image = space.image
    side = editor.side_of(settings, image)
    if image is None or not space.overlay.show_overlays or not all(image.size):
        return
    import gpu

    gpu.state.blend_set("ALPHA")
    view = View(context, settings, image)
    if image == settings.seam_mask:
        _draw_under_mask(view, editor.panorama(context), image, FROM_TARGET)
    elif side == editor.PANORAMA:
        _draw_cover(view, settings, image)
    elif view.picture != image:
        is_wanted = (pictures.mask_of(settings, image) or (None, ""))[1] == "show"
        _draw_under_mask(view, view.picture, image, WANTED if is_wanted else PAINTED_OUT)
    if side == editor.PANORAMA and settings.show_places:
        from . import overlay_geometry

        lines(view.at(overlay_geometry.places(editor.known(image)["report"])), PLACE, view)
    if side is not None:
        _draw_frame(view, settings, image if side == editor.PANORAMA else settings.result, side)
    if settings.show_matches and side is not None:
        _draw_matches(view, settings, side)
    if settings.show_epipolar:
        _draw_lines(view)
    _draw_waiting(view, side)
    gpu.state.blend_set("NONE")


class View:
    """One editor's window region and the picture in it."""

    def __init__(self, context: Any, settings: Any, image: bpy.types.Image) -> None:
        import numpy as np

        view2d, region = context.region.view2d, context.region
        self.size, self.picture = (image.size[0], image.size[1]), editor.beneath(settings, image)
        self.orientation = editor.orientation(settings, image)
        self.region = (region.width, region.height)
        self.seen = np.array([view2d.region_to_view(0, 0), view2d.region_to_view(*self.region)])
        self.unit = context.preferences.system.ui_scale

    def at(self, points: Any) -> Any:
        """px of this editor's upright picture, in region px."""
        from . import overlay_geometry

        points = overlay_geometry.as_stored(points, self.size, self.orientation)
        return overlay_geometry.to_region(points, self.size, self.seen, self.region)

    def corners(self) -> Any:
        """Where the picture's own corners are: lower left, lower right, upper right, upper left."""
        import numpy as np

        from . import overlay_geometry

        width, height = self.size
        corners = np.array([[0, height], [width, height], [width, 0], [0, 0]]) - 0.5
        return overlay_geometry.to_region(corners, self.size, self.seen, self.region)


def _draw_matches(view: View, settings: Any, side: str) -> None:
    import numpy as np

    from . import overlay_geometry as geometry_of

    matches = match_arrays(settings)
    points = points_on(settings, matches, side, view.picture)
    if points is None or not len(points):
        return
    places = view.at(points)
    colours = geometry_of.residual_colours(matches["error"])
    colours[~matches["enabled"]] = (0.35, 0.35, 0.35, 0.55)
    visible = ((places > -10) & (places < np.array(view.region) + 10)).all(axis=1)
    # the worst on top
    order = np.argsort(np.nan_to_num(matches["error"], nan=-1.0), kind="stable")
    order = order[visible[order]]
    radius = MATCH_RADIUS * view.unit
    shade = np.tile(np.array(SHADE, np.float32), (len(order), 1))
    _triangles(*geometry_of.discs(places[order], radius + view.unit, shade))
    _triangles(*geometry_of.discs(places[order], radius, colours[order]))
    if 0 <= settings.match_index < len(places):
        lines(geometry_of.rings(places[[settings.match_index]], 2.2 * radius), CHOSEN, view)


def points_on(settings: Any, matches: dict[str, Any], side: str, picture: bpy.types.Image | None) -> Any:
    """The matches (N, 2) in px of a picture, which is `side` to the chosen pair; None on a panorama of others."""
    from . import overlay_geometry

    if side != editor.PANORAMA:
        return matches[side]
    known = result.read(picture)
    if known is None or ownership.pictures(picture) != [settings.reference, settings.target]:
        return None
    return overlay_geometry.on_panorama(known, matches[editor.REFERENCE], matches[editor.TARGET])


def _draw_lines(view: View) -> None:
    from . import overlay_geometry as geometry_of

    panorama = compat.by_uid(bpy.data.images, _pointer["panorama"])
    known, shows = result.read(panorama), editor.side_in(panorama, view.picture)
    if known is None or shows is None or _pointer["point"] is None:
        return
    side, point = _pointer["side"], _pointer["point"][None]
    pointed = point if side == editor.PANORAMA else None
    if side == editor.PANORAMA:
        side, point = editor.REFERENCE, geometry_of.from_panorama(known, point)
    found = geometry_of.epipolar_lines(known["geometry"], point[0], side)
    here = editor.REFERENCE if shows == editor.PANORAMA else shows
    line = found.get(here)
    if line is not None:
        if shows == editor.PANORAMA:
            ends = geometry_of.line_on_panorama(known, line)
        else:
            ends = geometry_of.segments(line)
        ends = view.at(ends)
        lines(ends, SHADE, view, 2 * LINE_WIDTH)
        lines(ends, LINE, view)
    if here == side:
        at = point
        if shows == editor.PANORAMA:
            at = geometry_of.on_panorama(known, point) if pointed is None else pointed
        lines(geometry_of.rings(view.at(at), 6 * view.unit), POINTER, view)


def _draw_frame(view: View, settings: Any, panorama: bpy.types.Image | None, side: str) -> None:
    """The outline of the frame that is chosen now, where the panorama was made for another."""
    known: Any = result.read(panorama) if editor.is_behind(settings, panorama) else None
    rays = None if known is None else _frame_rays(settings, panorama, known)
    if rays is None:
        return
    from . import frame_geometry

    on_panorama = side == editor.PANORAMA
    points = frame_geometry.on_panorama(known, rays) if on_panorama else frame_geometry.on_picture(known, rays, side)
    ends = view.at(frame_geometry.closed_pieces(points, view.size[0] / 2 if on_panorama else 1e6))
    lines(ends, SHADE, view, 2 * LINE_WIDTH)
    lines(ends, FRAME, view)


def _frame_rays(settings: Any, panorama: Any, known: dict[str, Any]) -> Any:
    """Rays around the frame that is chosen now; worked out once for each choice."""
    from . import frame_geometry

    frame, then = map(engine_options.frame_of, (settings, editor.settings_then(settings, panorama)))
    if frame == then:  # other light, or another blend
        return None
    key = (panorama.session_uid, repr(frame), repr(then))
    if key not in _frames:
        _frames.clear()
        _frames[key] = frame_geometry.frame_border(known, frame, then)
    return _frames[key]


def _draw_waiting(view: View, shown: str | None) -> None:
    """The point that was clicked and has no counterpart yet."""
    import numpy as np

    from . import overlay_geometry as geometry_of

    for side, point in pending.items():
        if side == shown:
            place = view.at(np.array([point]))
            lines(geometry_of.rings(place, 7 * view.unit), SHADE, view, 2.5 * LINE_WIDTH)
            lines(geometry_of.rings(place, 7 * view.unit), WAITING, view)


def _draw_cover(view: View, settings: Any, image: bpy.types.Image) -> None:
    """The difference or the displacement over the panorama; a difference means something only alone."""
    if settings.overlay == "NONE":
        return
    texture = _texture_of_cover(image, settings.overlay)
    if texture is not None:
        opacity = settings.overlay_opacity if settings.overlay == "DISPLACEMENT" else 1.0
        _textured(texture, view.corners(), (1.0, 1.0, 1.0, opacity))


def _draw_under_mask(
    view: View, picture: bpy.types.Image | None, mask: bpy.types.Image, colour: tuple[float, ...]
) -> None:
    """The picture that a mask is painted over, and on it what is painted: out in red, wanted in green; of a seam in
    orange what comes from the target, darkened what comes from the reference."""
    import gpu

    if picture is None:
        return
    _textured(_texture_of_picture(picture), view.corners(), (1.0, 1.0, 1.0, 1.0))
    gpu.state.blend_set("ALPHA" if colour == FROM_TARGET else "ADDITIVE")  # black adds nothing
    _textured(gpu.texture.from_image(mask), view.corners(), colour)
    gpu.state.blend_set("ALPHA")


def _texture_of_picture(image: bpy.types.Image) -> Any:
    """A picture as it is shown, reduced: Blender's own textures hold light instead. Made once for each."""
    import numpy as np

    from .overlay_geometry import display_encoded

    key = ("picture", image.session_uid, *image.size)
    if key not in _textures:
        width, height = image.size
        values = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(values)
        step = -(-max(width, height) // LONGEST_SIDE)
        values = np.ascontiguousarray(values.reshape(height, width, 4)[::step, ::step])
        _keep(key, display_encoded(values) if image.is_float else values)
    return _textures[key]


def _texture_of_cover(image: bpy.types.Image, kind: str) -> Any:
    key = (kind, image.session_uid, *image.size)
    if key not in _textures:
        pixels = result.cover(image, kind)
        if pixels is None:
            return None
        _keep(key, pixels)
    return _textures[key]


def _keep(key: tuple, pixels: Any) -> None:
    """Make a texture of pixels (H, W, 4) float32, the bottom row first; only a few are kept."""
    import gpu

    while len(_textures) > 7:
        del _textures[next(iter(_textures))]
    height, width = pixels.shape[:2]
    data = gpu.types.Buffer("FLOAT", width * height * 4, pixels.ravel())
    _textures[key] = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)


def _textured(texture: Any, corners: Any, colour: tuple[float, ...]) -> None:
    """A texture times a colour, on the rectangle of four corners in region px."""
    from gpu_extras.batch import batch_for_shader

    shader = compat.picture_shader()
    around = ((0, 0), (1, 0), (1, 1), (0, 1))
    batch = batch_for_shader(shader, "TRI_FAN", {"pos": corners.tolist(), "uv": around})
    shader.bind()
    shader.uniform_float("color", colour)
    shader.uniform_sampler("image", texture)
    batch.draw(shader)


def _triangles(corners: Any, colours: Any) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    if len(corners):
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        batch_for_shader(shader, "TRIS", {"pos": _flat(corners), "color": colours}).draw(shader)


def lines(ends: Any, colour: tuple[float, ...], view: View, width: float = LINE_WIDTH) -> None:
    """Separate segments (2·N, 2), start and end alternating, of one colour."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    if not len(ends):
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": _flat(ends)})
    shader.bind()
    shader.uniform_float("viewportSize", view.region)
    shader.uniform_float("lineWidth", width * view.unit)
    shader.uniform_float("color", colour)
    batch.draw(shader)


def _flat(points: Any) -> Any:
    """(N, 2) as the shaders want them: (N, 3) float32."""
    import numpy as np

    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


CLASSES = (EDF_OT_pointer,)


def register() -> None:
    """Draw from now on, where there is a window."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    if bpy.app.background:
        return
    _handlers.append(bpy.types.SpaceImageEditor.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL"))
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is not None:
        keymap = keys.keymaps.new(name="Image", space_type="IMAGE_EDITOR")
        _keys.append((keymap, keymap.keymap_items.new(idnames.Operator.POINTER, "MOUSEMOVE", "ANY", any=True)))


def unregister() -> None:
    """Draw nothing any more."""
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
    while _handlers:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handlers.pop(), "WINDOW")
    _textures.clear()
    _frames.clear()
    pending.clear()
    _pointer.update(panorama=None, side=None, point=None)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
