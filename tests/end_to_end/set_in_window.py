"""A set in a Blender with a window: how long operators and drawing hold it up, and what is done by hand.

    blender --python set_in_window.py -- EDF_STITCH.zip MANY SET OUTDIR

MANY is a folder of many large pictures, which are listed and begun; SET one of a few, which are stitched. What was
measured stands in OUTDIR/walk.json, in ms of the main thread's own time, since machines of tests do other things too.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from in_window import image_editor, in_area, in_editor, point_at, show, sidebar  # noqa: E402

ARCHIVE, MANY, SET, OUT = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
TAB, ADD_ON = "EDF Stitch", "bl_ext.user_default.edf_stitch"
walk: dict = {"facts": {}, "operators": {}, "drawing": {}}


def way() -> Iterator[float]:
    """The steps; what is yielded are seconds to wait, for Blender to draw or to work."""
    yield 2.0
    subprocess.run(["xdotool", "mousemove", "800", "450", "key", "Escape"], check=True)
    bpy.ops.extensions.package_install_files(filepath=str(ARCHIVE), repo="user_default", enable_on_install=True)
    yield 2.0
    watch_drawing()
    area = image_editor()
    for _ in range(3):
        yield 1.5
        sidebar(area).active_panel_category = TAB
        area.tag_redraw()
    yield 3.0

    with in_editor(area):
        timed("add_folder", bpy.ops.edf.add_folder, directory=str(MANY))
    yield 3.0
    shoot("1_many")
    with in_editor(area):
        timed("stitch", bpy.ops.edf.stitch, "INVOKE_DEFAULT")
    yield 1.0
    bpy.ops.edf.cancel()
    job = bpy.context.window_manager.edf_stitch_job
    for _ in range(60):
        if not job.running:
            break
        yield 0.5
    with in_editor(area):
        timed("clear_pictures", bpy.ops.edf.clear_pictures)
        bpy.ops.edf.add_folder(directory=str(SET))
        bpy.ops.edf.stitch("INVOKE_DEFAULT")
    for _ in range(600):
        yield 0.5
        if not job.running:
            break
    walk["facts"]["message"] = job.message
    settings = bpy.context.scene.edf_stitch
    panorama = settings.result.name
    show(area, settings.result)
    yield 2.0
    ahead = sys.modules[f"{ADD_ON}.edf_addon.jobs.modal"]._ahead
    walk["facts"]["worker_waits"] = ahead is not None and ahead.poll() is None
    shoot("2_panorama")

    began = time.monotonic()
    settings.slide_auto, settings.slide, settings.projection = False, 0.5, "CYLINDRICAL"
    yield from until(lambda: bpy.context.scene.edf_stitch.result.name != panorama)
    walk["facts"]["followed_s"] = time.monotonic() - began
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["followed"] = [settings.result.name, area.spaces.active.image.name]
    bpy.ops.ed.undo_push(message="Viewpoint")
    yield 1.0
    shoot("3_followed")

    show(area, settings.result)  # the sidebar lies over its right side
    yield 1.0
    before = settings.result.session_uid
    width, height = settings.result.size
    with in_editor(area):
        timed("frame_drag", bpy.ops.edf.frame_drag, "INVOKE_DEFAULT")
    yield 1.0
    for share in (1.0, 0.95, 0.9):
        point_at(area, *in_area(area, share * width - 2, 0.5 * height))
        subprocess.run(["xdotool", "mousedown", "1"], check=True) if share == 1 else None
        yield 0.7
    shoot("3b_dragging")
    subprocess.run(["xdotool", "mouseup", "1"], check=True)
    yield from until(lambda: bpy.context.scene.edf_stitch.result.session_uid != before)
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["cropped"] = [settings.crop, settings.result.size[0] / width]
    with in_editor(area):
        bpy.ops.ed.undo()
    yield 1.0
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["crop_after_one_undo"] = settings.crop

    settings.picture_index = 0
    show(area, settings.result)
    yield 1.0
    before = settings.result.session_uid
    width, height = settings.result.size
    with in_editor(area):
        timed("take_from", bpy.ops.edf.take_from, "INVOKE_DEFAULT")
    for share in (0.35, 0.37, 0.39):
        point_at(area, *in_area(area, share * width, 0.5 * height))
        subprocess.run(["xdotool", "mousedown", "1"], check=True) if share == 0.35 else None
        yield 0.7
    shoot("4_drawing")
    subprocess.run(["xdotool", "mouseup", "1"], check=True)
    yield 1.0
    walk["facts"]["places"] = [place.picture.name for place in bpy.context.scene.edf_stitch.places]
    yield from until(lambda: bpy.context.scene.edf_stitch.result.session_uid != before)
    yield 1.0
    shoot("5_taken")
    with in_editor(area):
        bpy.ops.ed.undo()
    yield 1.0
    settings = bpy.context.scene.edf_stitch
    walk["facts"]["places_after_one_undo"] = len(settings.places)

    with in_editor(area):
        timed("picture_mask", bpy.ops.edf.picture_mask, row=0, kind="show")
    yield 1.5
    shoot("6_mask")
    with in_editor(area):
        timed("mask_done", bpy.ops.edf.mask_done)
    yield 1.0


def until(is_so: Callable[[], bool]) -> Iterator[float]:
    for _ in range(240):
        if is_so():
            return
        yield 0.25


def timed(name: str, operator: Callable, *arguments, **properties) -> None:
    began = time.thread_time()
    operator(*arguments, **properties)
    walk["operators"][name] = round((time.thread_time() - began) * 1000, 1)


def watch_drawing() -> None:
    """How long each panel and overlay of the add-on takes at most, the first time aside: that loads what it needs."""
    panels = sys.modules[f"{ADD_ON}.edf_addon.panels.sidebar"].PANELS
    for panel in panels:
        panel.draw_rows = _watched(panel.__name__, panel.draw_rows)


def _watched(name: str, draw: Callable) -> Callable:
    calls = 0

    def watched(*arguments):
        nonlocal calls
        began = time.thread_time()
        try:
            return draw(*arguments)
        finally:
            calls += 1
            took = round((time.thread_time() - began) * 1000, 1)
            key = name if calls > 1 else f"{name}, first"
            walk["drawing"][key] = max(took, walk["drawing"].get(key, 0.0))

    return watched


def shoot(name: str) -> None:
    subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=True)


def _step(steps: Iterator[float]) -> float | None:
    try:
        return next(steps)
    except StopIteration:
        walk["done"] = True
    except Exception:
        walk["error"] = traceback.format_exc()
    OUT.joinpath("walk.json").write_text(json.dumps(walk, indent=1), "utf-8")
    return None


OUT.mkdir(parents=True, exist_ok=True)
_steps = way()
bpy.app.timers.register(lambda: _step(_steps), first_interval=1.0, persistent=True)
