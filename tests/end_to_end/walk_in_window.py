"""A new user's way through the extension in a Blender with a window, with a picture of the screen at each step.

    blender --python walk_in_window.py -- EDF_STITCH.zip LEFT RIGHT OUTDIR

Meant for a virtual screen (`real-blender shot`) and a fresh BLENDER_USER_RESOURCES. Whatever happens stands in
OUTDIR/walk.json: the steps that were taken, what was measured on the way, and the traceback of what went wrong.
Pictures are taken with ImageMagick's `import`, the mouse is moved with xdotool.
"""

from __future__ import annotations

import json
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).parent))
from in_window import image_editor, in_area, in_editor, point_at, show, sidebar, window_region  # noqa: E402

ARCHIVE, LEFT, RIGHT, OUT = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
TAB, ADD_ON = "EDF Stitch", "bl_ext.user_default.edf_stitch"
walk: dict = {"steps": [], "facts": {}}
instead: list[type] = []


def way() -> Iterator[float]:
    """The steps; what is yielded are seconds to wait, for Blender to draw or to work."""
    yield 2.0
    subprocess.run(["xdotool", "mousemove", "800", "450", "key", "Escape"], check=True)  # the first start's greeting
    yield 1.0
    bpy.ops.extensions.package_install_files(filepath=str(ARCHIVE), repo="user_default", enable_on_install=True)
    yield 1.0
    bpy.ops.screen.userpref_show(section="EXTENSIONS")
    yield 3.0
    shoot("1_installed")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    yield 1.0

    area = image_editor()
    for _ in range(3):  # the tab is there once the sidebar has been drawn
        yield 1.5
        sidebar(area).active_panel_category = TAB
        area.tag_redraw()
    yield 2.0
    shoot("2_nothing_chosen")

    settings = bpy.context.scene.edf_stitch
    with in_editor(area):
        bpy.ops.edf.open_pair(directory=str(LEFT.parent), files=[{"name": LEFT.name}, {"name": RIGHT.name}])
    show(area, settings.reference)
    yield 2.0
    shoot("3_pair_opened")

    with in_editor(area):
        bpy.ops.edf.stitch("INVOKE_DEFAULT")
    job = bpy.context.window_manager.edf_stitch_job
    yield 5.0
    shoot("4_at_work")
    for _ in range(240):
        if not job.running:
            break
        yield 0.5
    walk["facts"] |= {"running": job.running, "failed": job.failed, "message": job.message}
    settings = bpy.context.scene.edf_stitch
    panorama = settings.result
    walk["facts"] |= {"panorama": list(panorama.size), "matches": len(settings.matches)}
    show(area, panorama)
    yield 3.0
    shoot("5_panorama")

    open_only("EDF_PT_frame")
    first = settings.result.name
    settings.slide_auto, settings.slide = False, 0.1
    settings.slide, settings.centre = 0.5, (0.1, 0.0)  # as one drags: each change begins anew
    area.tag_redraw()
    yield 0.5  # until the window is drawn anew
    shoot("5b_outline_of_the_frame")
    for _ in range(120):
        if settings.result.name != first:
            break
        yield 0.5
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["followed"] = [settings.result.name, area.spaces.active.image.name]
    yield 2.0
    shoot("5c_followed")
    with in_editor(area):
        bpy.ops.ed.undo()
    yield 2.0
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["undone"] = [settings.result.name, getattr(area.spaces.active.image, "name", "")]
    panorama = settings.result
    settings.slide_auto, settings.centre = True, (0.0, 0.0)
    show(area, panorama)
    yield 2.0

    settings.show_matches = settings.show_epipolar = True
    open_only("EDF_PT_overlays")
    yield 1.0
    point_at(area, 0.4, 0.5)
    yield 3.0
    shoot("6_matches_and_lines")
    settings.show_matches = settings.show_epipolar = False
    settings.overlay = "DIFFERENCE"
    yield 3.0
    shoot("7_difference")
    settings.overlay = "DISPLACEMENT"
    yield 3.0
    shoot("8_displacement")
    settings.overlay = "NONE"

    open_only("EDF_PT_camera", "EDF_PT_field", "EDF_PT_frame", "EDF_PT_output")
    yield 2.0
    shoot("9_settings")
    open_only("EDF_PT_matches", "EDF_PT_masks")
    show(area, settings.reference)
    settings.show_matches, settings.match_index = True, len(settings.matches) // 2
    yield 2.0
    shoot("10_matches")
    with in_editor(area):
        bpy.ops.edf.match_edit("INVOKE_DEFAULT")
    before = len(settings.matches)
    for x, y in lonely_point(settings):  # of the reference, then roughly the same of the target
        point_at(area, *in_area(area, x, y))
        subprocess.run(["xdotool", "click", "1"], check=True)
        yield 2.0
    settings = bpy.context.scene.edf_stitch
    walk["facts"] |= {"added": len(settings.matches) - before, "state": settings.matches[-1].state}
    yield 1.0
    shoot("10b_match_added")
    subprocess.run(["xdotool", "key", "Return"], check=True)
    yield 1.0
    settings = bpy.context.scene.edf_stitch
    settings.show_matches = False
    with in_editor(area):
        bpy.ops.edf.mask_paint(side="reference")
    paint(settings.ignore_reference)
    yield 3.0
    shoot("11_painted_out")
    with in_editor(area):
        bpy.ops.edf.mask_done()
    show(area, panorama)

    open_only("EDF_PT_take_along")
    with in_editor(area):
        bpy.ops.edf.create_cameras(baseline=0.16)
        bpy.ops.edf.depth_mesh()
    walk["facts"]["cameras"] = len(bpy.data.cameras)
    yield 2.0
    shoot("12_take_along")
    exr = OUT / "panorama.exr"
    with in_editor(area):
        bpy.ops.edf.save(filepath=str(exr))
    walk["facts"]["exr_bytes"] = exr.stat().st_size

    for name in ("Cube", "Light", "Camera"):
        bpy.data.objects.remove(bpy.data.objects[name])
    area.type = "VIEW_3D"
    space = area.spaces.active
    space.shading.light, space.shading.color_type = "FLAT", "TEXTURE"  # EEVEE takes minutes on software OpenGL
    space.region_3d.view_perspective = "CAMERA"
    yield 8.0
    shoot("13_through_the_panoramas_camera")
    space.region_3d.view_perspective = "PERSP"
    with bpy.context.temp_override(area=area, region=window_region(area)):
        bpy.ops.view3d.view_all()
    space.region_3d.view_rotation = Euler((1.2, 0, 0.6)).to_quaternion()
    yield 4.0
    shoot("14_cameras_and_mesh")


def shoot(name: str) -> None:
    """A picture of the screen."""
    subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=True)
    walk["steps"].append(name)


def open_only(*names: str) -> None:
    """Sub-panels remember whether they are open, where no script reaches: others with their looks take their place."""
    _, *originals = sys.modules[f"{ADD_ON}.edf_addon.panels.sidebar"].PANELS
    for panel in instead or originals:
        bpy.utils.unregister_class(panel)
    instead[:] = [
        type(panel.__name__, (panel,), {
            "bl_idname": f"{panel.__name__}_{len(walk['steps'])}",
            "bl_options": set() if panel.__name__ in names else {"DEFAULT_CLOSED"},
        })
        for panel in originals
    ]  # fmt: skip
    for panel in instead:
        bpy.utils.register_class(panel)


def lonely_point(settings) -> list[tuple[float, float]]:
    """A point of the reference with no match nearby, and where its nearest match says it is in the target."""
    ends = [(match.x, match.y, match.x2 - match.x, match.y2 - match.y) for match in settings.matches if match.enabled]
    width, height = settings.reference.size

    def nearest(x: float, y: float) -> tuple:
        return min(((x - end[0]) ** 2 + (y - end[1]) ** 2, end) for end in ends)

    candidates = [(x, y) for x in range(width // 4, width // 2, 4) for y in range(height // 4, 3 * height // 4, 4)]
    x, y = max(candidates, key=lambda point: nearest(*point)[0])
    _, (_, _, dx, dy) = nearest(x, y)
    return [(x, y), (x + dx, y + dy)]


def paint(mask: bpy.types.Image) -> None:
    """A stroke of white."""
    import numpy as np

    width, height = mask.size
    pixels = np.zeros((height, width, 4), np.float32)
    pixels[..., 3] = 1
    y, x = np.mgrid[:height, :width]
    pixels[np.hypot((x / width - 0.55) * 2, (y / height - 0.35) * 3) < 0.4, :3] = 1
    mask.pixels.foreach_set(pixels.ravel())
    mask.update()


def _step(steps: Iterator[float]) -> float | None:
    try:
        return next(steps)
    except StopIteration:
        walk["done"] = True
    except Exception:
        walk["error"] = traceback.format_exc()
    OUT.joinpath("walk.json").write_text(json.dumps(walk, indent=1), "utf-8")
    return None


def begin() -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    steps = way()
    bpy.app.timers.register(lambda: _step(steps), first_interval=1.0, persistent=True)


begin()
