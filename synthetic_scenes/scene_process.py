"""One scene, from rendering to figures, in a process of its own: `python -m ….scene_process SCENE WIDTH HEIGHT FOLDER`.

It leaves FOLDER/scenes/NAME.json, last, and the scene's pictures; `validation` reads them. A crash in a native library
ends this process and no other.
"""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..core.choices import RIVALS
from ..core.output.json_file import json_bytes
from ..core.system.errors import StitchError
from ..core.system.json_values import plain
from ..core.system.output_files import OutputFiles
from .finished import finished, target_only, target_only_together
from .measures import Truth, composition, figures, meeting, on_the_wide_canvas, truth_of, whole_picture
from .recipes import parse_scene
from .rendered import RenderedPair, rendered_pair
from .scene_pictures import scene_pictures
from .sets.measured_set import measured_set
from .sets.recipes import parse_set
from .sets.rendered_set import rendered_set
from .sliding import pair_beside_rays
from .stitches import SLIDES, WAYS, Shared, delivered, slid, stitched
from .suites import heading, is_set

SCHEMA = 1
# The stitch that the report shows, and that whose composition is judged: of the default field.
SHOWN, COMPOSED = "known/strict", "known/slack"


def file_name(scene: str) -> str:
    """A scene's name for files: `street:noise=2` has a sign that some systems refuse."""
    return re.sub(r"[^A-Za-z0-9_.=-]", "_", scene)


def measure_scene(scene: str, size: tuple[int, int], folder: Path, made_from: str) -> dict[str, float]:
    """Renders (or finds) a scene, stitches it every way, writes its figures and pictures; returns seconds by stage.

    size: (W, H) px of landscape pictures; made_from: a mark to be kept with the figures. Raises StitchError.
    """
    recipe, difficulty = parse_scene(scene)
    pair = rendered_pair(recipe, difficulty, recipe.size(*size), folder / "pictures")
    truth = truth_of(pair)
    results, runs = {}, {}
    shared: Shared = {}
    for way in WAYS:
        try:
            results[way] = stitched(pair, way, shared)
        except StitchError as refusal:
            runs[way] = _run(refused=str(refusal))
    placed = {way: on_the_wide_canvas(result, truth) for way, result in results.items()}
    # the same pixels for all: whoever shows less must not gain by it
    common = None
    for _, shown in placed.values():
        common = shown if common is None else common & shown
    seconds: dict[str, float] = {}
    for way, result in results.items():
        view = result.edges[0].two_view
        measured = figures(result, truth) | target_only(result, truth)
        if common is not None:
            measured |= whole_picture(placed[way][0], common, truth)
            measured |= target_only_together(placed[way][0], common, truth)
        if way == COMPOSED:
            measured |= composition(result, truth) | finished(delivered(pair, way, shared), pair, truth)
            measured |= _slid_figures(pair, truth, shared)
        said = any("not determined" in text for text in (view.focal_source, *result.warnings))
        # in a rival's hands the model is no decision
        model = None if way.endswith(RIVALS) else view.model
        runs[way] = _run(model=model, undetermined_said=said, warnings=list(result.warnings), figures=measured)
        seconds |= {f"{way} {stage}": value for stage, value in result.seconds.items()}
    name = file_name(scene)
    pictures = scene_pictures(pair, truth, results[SHOWN], placed[SHOWN][0]) if SHOWN in results else {}
    entry = {
        "schema": SCHEMA, **heading(scene, size), "status": "done", "message": "", "blender": pair.blender,
        "made_from": made_from, "proof": pair.proof, "runs": {way: runs[way] for way in WAYS},
        "pictures": {kind: f"scenes/{name}/{kind}.jpg" for kind in pictures},
    }  # fmt: skip
    _write(folder, name, entry, pictures, seconds)
    return seconds


def measure_set(scene: str, size: tuple[int, int], folder: Path, made_from: str) -> dict[str, float]:
    """The same of a set of many pictures. Raises StitchError."""
    rendered = rendered_set(parse_set(scene), size, folder / "sets")  # in `pictures` lie pairs, for `edf compare`
    measured = measured_set(rendered)
    name = file_name(scene)
    entry = {
        "schema": SCHEMA, **heading(scene, size), "status": "done", "message": "", "blender": rendered.blender,
        "made_from": made_from, "proof": rendered.proof, "runs": measured.runs,
        "pictures": {kind: f"scenes/{name}/{kind}.jpg" for kind in measured.pictures},
    }  # fmt: skip
    _write(folder, name, entry, measured.pictures, measured.seconds)
    return measured.seconds


def _write(
    folder: Path, name: str, entry: dict[str, Any], pictures: dict[str, bytes], seconds: dict[str, float]
) -> None:
    with OutputFiles(overwrite=True) as files:
        for kind, data in pictures.items():
            files.add_to_folder(folder / "scenes" / name, f"{kind}.jpg", data)
        files.add_to_folder(folder / "scenes", f"{name}.timing.json", json_bytes(seconds))
        files.add_to_folder(folder / "scenes", f"{name}.json", json_bytes(plain(entry)))


def _slid_figures(pair: RenderedPair, truth: Truth, shared: Shared) -> dict[str, float]:
    """`measures.meeting` and `sliding.pair_beside_rays` of the default field by how far the viewpoint slides,
    slid_auto_px, slid_auto_target_px and so on; a slide that is refused has no figures."""
    out: dict[str, float] = {}
    for name, slide in SLIDES.items():
        with suppress(StitchError):
            result = slid(pair, COMPOSED, slide, shared)
            found = {key.removeprefix("meeting_"): value for key, value in meeting(result, pair, truth).items()}
            found |= pair_beside_rays(result, pair, truth)
            out |= {f"slid_{name}_{key}": value for key, value in found.items()}
    return out


def _run(
    model: str | None = None, undetermined_said: bool = False, refused: str = "", warnings: list[str] | None = None,
    figures: dict[str, float] | None = None,
) -> dict[str, Any]:
    return {
        "model": model, "undetermined_said": undetermined_said, "refused": refused, "warnings": warnings or [],
        "figures": figures or {},
    }  # fmt: skip


def main(arguments: list[str]) -> int:
    """Exit code: 0, or the error's; its message goes to stderr."""
    scene, width, height, folder, made_from = arguments
    try:
        measure = measure_set if is_set(scene) else measure_scene
        measure(scene, (int(width), int(height)), Path(folder), made_from)
    except StitchError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
