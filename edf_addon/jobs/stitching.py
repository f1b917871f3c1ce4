"""From the settings to a job, and from a finished job into the file: what the stitching operators share."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from pathlib import Path, PurePath
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import bpy

from .. import engine_options, explain, offered, pair, pictures, properties
from ..bridge import cameras, compat, images, ownership, result
from ..bridge.images import Unusable

if TYPE_CHECKING:
    import numpy as np

# The worker's pictures that lie over the panorama: kept with it, out of the artist's lists of images.
HIDDEN = ("heat", "difference")
# Those that are values and no colours.
VALUES = ("occluded", "inpainted", "seam", "labels", "confidence", "inverse depth")


def why_not(settings: Any) -> str:
    """Why nothing can be stitched as things stand, in words; "" where it can."""
    if pictures.is_set(settings):
        return _why_no_set(settings)
    if None in (settings.reference, settings.target):
        return "a panorama takes two pictures or more: add some to the list, or switch on the eyes of their rows"
    if settings.reference == settings.target:
        name = settings.target.name
        return f"“{name}” is both reference and target: choose two photographs taken from different places"
    if settings.edited_matches and not any(match.enabled for match in settings.matches):
        return "the list of matches has none that is switched on: add some, or search for new ones"
    return ""


def _why_no_set(settings: Any) -> str:
    if None in pictures.images(settings):
        return "a picture of the list is no longer in the file: remove its row"
    if settings.camera == "CAMERAS":
        return "Scene Cameras are for two pictures: take the focal length from elsewhere, under Camera"
    if settings.field not in offered.ROUND_FIELDS:
        return "more than two pictures need a field that knows depth everywhere: choose Slack or Strict under Field"
    if settings.fade == "INFINITY":
        return "more than two pictures go on by the depth around them: choose another Outside under Field"
    return ""


def make_job(
    context: bpy.types.Context, folder: Path, scale: float | None = None, found: dict[str, Any] | None = None,
    instead: Mapping[str, Any] | None = None,
) -> tuple[dict[str, Any], dict[str, Any]]:  # fmt: skip
    """The job for the scene's settings, its files in `folder`; and what has to be remembered until it is done.

    scale: instead of the settings' own; found: a result whose matches are used, instead of a search; instead: settings
    by name that are others this time. Raises Unusable.
    """
    scene = context.scene
    settings = properties.settings_of(scene)
    if reason := why_not(settings):
        raise Unusable(reason)
    chosen, is_set = pictures.images(settings), pictures.is_set(settings)
    editor = context.space_data if isinstance(context.space_data, bpy.types.SpaceImageEditor) else None
    user = None if editor is None else editor.image_user
    kept = {**properties.keep(settings), **(instead or {})}
    wanted = [name for name in ("layers", "masks", "depth") if getattr(settings, f"take_{name}")]
    job: dict[str, Any] = {
        "pictures": [
            # neither a render nor a sequence, which is many pictures, has a content that it is known by
            {**images.describe(image, f"picture_{number}", folder, scene, user),
             "digest": image.type != "RENDER_RESULT" and image.source != "SEQUENCE"}
            for number, image in enumerate(chosen)
        ],
        "options": engine_options.options_of(SimpleNamespace(**kept), scale, is_set),
        "take": wanted if scale is None else [],
        "exr": engine_options.exr_form_of(settings),
    }  # fmt: skip
    _add_masks(job, settings, folder)
    if is_set:
        job["options"]["viewpoint"] = pictures.viewpoint(settings)
        job["kept"] = secrets.token_hex(8)
    else:
        _add_what_a_pair_has(job, context, folder, found)
    memory = {
        "scene": scene.session_uid, "settings": kept,
        "pictures": job["pictures"], "cameras": job.get("cameras"), "kept": job.get("kept"),
        # a reference to any of these would not survive an undo while the work goes on
        "held": [image.session_uid for image in chosen],
        "chosen": {
            name: one.session_uid
            for name, one in (properties.pointers(settings) | pictures.masks(settings)).items() if one is not None
        },
        "space": chosen[0].colorspace_settings.name, "edited": settings.edited_matches,
        "pack": settings.pack, "fake_user": settings.fake_user, "places": job["places"],
        "guides": job["guides"],
    }  # fmt: skip
    return job, memory


def _add_masks(job: dict[str, Any], settings: Any, folder: Path) -> None:
    """What of each picture is never used, what is to be shown, and the lines that level holds to."""
    import numpy as np

    entries = pictures.used(settings)
    masks = {kind: [getattr(entry, kind) for entry in entries] for kind in pictures.MASKS}
    if not pictures.is_set(settings):
        of_pair = [getattr(settings, f"ignore_{side}") for side in ownership.SIDES]
        masks["ignore"] = [one or other for one, other in zip(of_pair, masks["ignore"], strict=True)]
    for key, kind in (("masks", "ignore"), ("shown", "show")):
        job[key] = [None if mask is None else f"{kind}_{number}.npy" for number, mask in enumerate(masks[kind])]
        for name, mask in zip(job[key], masks[kind], strict=True):
            if mask is not None:
                np.save(folder / name, images.read(mask))
    job |= {"places": pictures.places(settings), "guides": pictures.guides(settings)}


def _add_what_a_pair_has(
    job: dict[str, Any], context: bpy.types.Context, folder: Path, found: dict[str, Any] | None
) -> None:
    """The painted seam, scene cameras and matches; found: see `make_job`."""
    import numpy as np

    settings = properties.settings_of(context.scene)
    if settings.seam_mask is not None:
        job["seam"] = "seam.npy"
        np.save(folder / job["seam"], images.read(settings.seam_mask))
    if settings.camera == "CAMERAS":
        job["cameras"] = cameras.describe_both(settings, context.scene, context.evaluated_depsgraph_get())
    file = untouched_matches(settings) if settings.edited_matches else (found or {"matches": {}})["matches"].get("file")
    if file:
        job["matches"] = "matches.csv"
        (folder / job["matches"]).write_text(file, "utf-8")
    elif settings.edited_matches:
        job["matches"] = "matches.npy"
        np.save(folder / job["matches"], match_rows(settings))


def match_rows(settings: Any) -> np.ndarray:
    """The list's matches (N, 5): x, y, x2, y2, weight, which is 0 where one is switched off."""
    import numpy as np

    rows = [[m.x, m.y, m.x2, m.y2, m.weight if m.enabled else 0.0] for m in settings.matches]
    return np.array(rows, np.float64)


def untouched_matches(settings: Any) -> str:
    """The file of the matches that a panorama's stitch found, where the list still shows them as they were: from it
    the same panorama comes again, which the list's single floats could not promise. "" for a list that was edited."""
    chosen = [getattr(settings, side) for side in ownership.SIDES]
    for image in bpy.data.images:
        found = result.read(image)
        if found is None or ownership.pictures(image) != chosen or "file" not in found.get("matches", ()):
            continue
        matches = found["matches"]
        if len(matches["rows"]) == len(settings.matches) and all(
            match.enabled == (state == "USED") and abs(match.weight - weight) < 1e-6 and _lies_at(match, row)
            for match, row, weight, state in zip(
                settings.matches, matches["rows"], matches["weights"], matches["states"], strict=True
            )
        ):
            return str(matches["file"])
    return ""


def _lies_at(match: Any, row: Any) -> bool:
    """Whether an entry of the list is where a stitch had it: x, y, x2, y2 px."""
    return max(abs(match.x - row[0]), abs(match.y - row[1]), abs(match.x2 - row[2]), abs(match.y2 - row[3])) < 0.01


def take_over(
    context: bpy.types.Context, folder: Path, found: dict[str, Any], memory: dict[str, Any], kind: str,
    spaces: list[bpy.types.SpaceImageEditor] | None = None,
) -> str:  # fmt: skip
    """Makes the panorama an image of the file, with all that belongs to it, or leaves the file as it was. kind:
    "panorama" or "preview" (which takes the place of the last one); spaces: where it is shown, instead of where the
    work was started from. Returns words about it."""
    made: list[bpy.types.Image] = []
    try:
        image = _bring_all(folder, found, memory, kind, made)
    except Exception:
        for one in made:
            bpy.data.images.remove(one)
        raise
    words = _in_words(image, found)
    scene = compat.by_uid(bpy.data.scenes, memory["scene"])
    if scene is not None:
        settings = properties.settings_of(scene)
        settings.result = image
        _leave_the_slide(settings, memory, found["report"])
        if [one and one.session_uid for one in pictures.images(settings)] == memory["held"]:
            if spaces is None:  # else that was done before, by the stitch that it follows
                pictures.mark(settings, pictures.fates([one["name"] for one in memory["pictures"]], found["report"]))
            if "matches" in found:
                fill_matches(settings, found["matches"], memory["edited"])
        else:
            words += " Other pictures are chosen by now: Restore Settings brings its own, and their matches."
    if spaces is None:
        show(context, image)
    for space in spaces or ():
        space.image = image
    return words


def _leave_the_slide(settings: Any, memory: dict[str, Any], report: dict[str, Any]) -> None:
    """A viewpoint that was chosen is where the slider starts when an artist takes it over."""
    slide = report.get("slide") or {}
    if settings.slide_auto and memory["settings"]["slide_auto"] and slide.get("s1") is not None:
        settings.slide, settings.slide_part = slide["s1"], slide.get("part", (0.0, 1.0))


def _bring_all(
    folder: Path, found: dict[str, Any], memory: dict[str, Any], kind: str, made: list[bpy.types.Image]
) -> bpy.types.Image:
    """The panorama, holding everything that belongs to it; `made` gets each image as soon as it is there."""
    name = f"{PurePath(memory['pictures'][0]['name']).stem} {kind}"
    last = bpy.data.images.get(name) if kind == "preview" else None
    if last is not None and result.read(last) is None:
        last = None  # somebody else's
    pack, fake_user = memory["pack"], memory["fake_user"] and kind != "preview"

    def bring(what: str, called: str, keep: bool, space: str | None) -> bpy.types.Image:
        one = images.bring(folder / found["files"][what], called, pack, keep)
        made.append(one)
        if space is not None:
            compat.set_colour_space(one, space)
        return one

    panorama = bring("panorama", name, fake_user, None)
    if not panorama.is_float or memory["space"] == compat.DATA:
        compat.set_colour_space(panorama, memory["space"])
    others = {
        what: bring(
            what, f"{'.' * (what in HIDDEN)}{panorama.name} {what}", fake_user and what not in HIDDEN,
            compat.DATA if what in VALUES or what.endswith(" mask") else None,
        )
        for what in found["files"] if what != "panorama"
    }  # fmt: skip
    for what, one in others.items():
        result.attach(panorama, what, one)
    kept = {key: value for key, value in found.items() if key not in ("files", "digests")}
    remembered = {name: memory[name] for name in ("settings", "cameras", "kept", "places", "guides")}
    digests = found.get("digests") or [""] * len(memory["pictures"])
    described = ownership.describe(memory["pictures"], digests)
    result.store(panorama, {**kept, "kind": kind, "pictures": described, **remembered})
    if (folder / "depth.npz").exists():
        panorama[result.DEPTH] = (folder / "depth.npz").read_bytes()
    everything = [*bpy.data.images, *bpy.data.objects]
    chosen = {name: compat.by_uid(everything, uid) for name, uid in memory["chosen"].items()}
    ownership.hold(panorama, [compat.by_uid(bpy.data.images, uid) for uid in memory["held"]], chosen)
    if last is not None:
        _replace(last, panorama, others, name)
    return panorama


def _replace(
    last: bpy.types.Image, panorama: bpy.types.Image, others: dict[str, bpy.types.Image], name: str
) -> None:
    """Puts a new preview where the last one was shown, under its name."""
    for one in result.companions(last).values():
        bpy.data.images.remove(one)
    last.user_remap(panorama)
    bpy.data.images.remove(last)
    panorama.name = name
    for what, one in others.items():
        one.name = f"{'.' * (what in HIDDEN)}{name} {what}"


def fill_matches(settings: Any, matches: dict[str, Any], edited: bool) -> None:
    """The list shows what the stitch knows of each match. Edited ones stay as they are, and those that were moved
    meanwhile unmeasured; new ones that the stitch left out are switched off, so that stitching with the list does the
    same."""
    rows, states, errors = matches["rows"], matches["states"], matches["errors"]
    if edited:
        if len(rows) != len(settings.matches):
            return
    else:
        settings.matches.clear()
        for (x, y, x2, y2), weight, state in zip(rows, matches["weights"], states, strict=True):
            match = settings.matches.add()
            match.x, match.y, match.x2, match.y2 = x, y, x2, y2
            match.weight, match.enabled = weight or 1.0, state == "USED"
        settings.match_index = -1
    for match, row, error, state in zip(settings.matches, rows, errors, states, strict=True):
        if _lies_at(match, row):
            match.error = -1.0 if error is None else error
            match.state = state
    pair.owns_matches(settings)


def show(context: bpy.types.Context, image: bpy.types.Image) -> None:
    """The image in the editor that the work was started from, else in the first Image Editor of the window, else of any
    other."""
    windows = [*((context.window,) if context.window else ()), *context.window_manager.windows]
    areas = [context.area, *(area for window in windows for area in window.screen.areas)]
    for area in areas:
        if area is not None and area.type == "IMAGE_EDITOR" and area.spaces.active.mode != "MASK":
            area.spaces.active.image = image
            return


def _in_words(image: bpy.types.Image, found: dict[str, Any]) -> str:
    width, height = image.size
    warnings = len(found["warnings"])
    said = f", {warnings} warning{'s' * (warnings > 1)}" if warnings else ""
    left_out = [one["name"] for one in found["report"].get("left_out", ())]
    said += f"; left out: {', '.join(left_out)}" if left_out else ""
    verdict = explain.verdict_in_short(found["report"])
    said += f"; {verdict}" if verdict else ""
    return f"{image.name}: {width} × {height} px in {sum(found['seconds'].values()):.1f} s{said}."
