"""A rendered set with all that is true of it: made once, proved, kept, and found again by what it was made of."""

from __future__ import annotations

import hashlib
import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.pictures.encoding import encode_picture
from ...core.pictures.picture import load_picture, picture_from_array
from ...core.raster.colour import decode
from ...core.system.output_files import OutputFiles
from ..blender_process import RenderFailed, run_job
from ..passes import read_passes
from ..rendered import blenders_camera, expose, npy_bytes
from ..scene_camera import SceneCamera
from .bent_lens import bent_camera, bent_picture, ideal_camera, through_lens
from .places import shown_name
from .recipes import SetRecipe
from .set_proof import SphereProof
from .sphere_camera import SphereCamera

SAMPLES = 16
# Width of the true sphere in widths of a picture: about two thirds of the pictures' own scale at 24 mm.
SPHERE_WIDTH = 2.5
# Whatever decides about pixels: a change in one of these files makes every kept set a stranger.
SOURCES = (
    "render_set.py", "worlds.py", "places.py", "sphere_camera.py", "bent_lens.py", "rendered_set.py", "set_proof.py",
    "../camera_render.py", "../stage.py", "../worlds.py", "../passes.py", "../proof.py", "../rendered.py",
    "../../core/cameras/blender_camera.py",
)  # fmt: skip


@dataclass(frozen=True)
class RenderedSet:
    """Pictures of a world, and the truth about them.

    pictures: files, in order, 8 bit, their linear light beside them as EXR; cameras and depths
    (H, W) float32, inf where there is nothing, of the same; sphere: what is seen from the first one's place, shown (H,
    W, 3) float32 as pictures are decoded, in the same view without noise, distance (H, W) float32, inf where there is
    nothing; proof: see `set_proof`. things: where (H, W) uint8 each picture shows things that the world numbers, from
    1, and the sphere last; lines (N, 2, 3): ends of straight edges in the world; brackets: every picture's files by
    exposure, where it is exposed more than once.
    """

    pictures: tuple[Path, ...]
    cameras: tuple[SceneCamera, ...]
    depths: tuple[NDArray[np.float32], ...]
    sphere: SphereCamera
    shown: NDArray[np.float32]
    distance: NDArray[np.float32]
    proof: dict[str, float]
    blender: str
    things: tuple[NDArray[np.uint8], ...] = ()
    lines: NDArray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    brackets: tuple[tuple[Path, ...], ...] = ()


def rendered_set(recipe: SetRecipe, size: tuple[int, int], folder: Path) -> RenderedSet:
    """The set in a folder of pictures, rendered where it is not there yet.

    size: (W, H) px of its pictures. Raises RenderFailed, UnwritableOutput.
    """
    cameras = recipe.cameras(size)
    first = next(iter(cameras.values()))
    rendered = {name: ideal_camera(camera)[0] for name, camera in cameras.items()}
    job = {
        "world": recipe.world, "seed": recipe.seed, "samples": SAMPLES,
        "views": {name: {"K": c.K.tolist(), "R": c.R.tolist(), "t": c.t.tolist(), "size": list(c.size)}
                  for name, c in rendered.items()},
        "sphere": {"place": first.place.tolist(), "width": 2 * round(SPHERE_WIDTH * max(size) / 2)},
        "exposures": recipe.exposures if recipe.agx else [],
    }  # fmt: skip
    place = folder / f"{recipe.name}-{_key(job, recipe, cameras)}"
    if not (place / "cameras.json").is_file():
        with tempfile.TemporaryDirectory(prefix="edf-render-") as temporary:
            run_job(job, Path(temporary))
            _keep(Path(temporary), place, recipe, cameras)
    return _load(place)


def _key(job: dict[str, Any], recipe: SetRecipe, cameras: dict[str, SceneCamera]) -> str:
    bends = [camera.k1 for camera in cameras.values()]
    made = [job, recipe.seed, recipe.noise, recipe.agx, recipe.exposures, bends]
    content = hashlib.sha256(json.dumps(made, sort_keys=True).encode())
    for name in SOURCES:
        content.update((Path(__file__).parent / name).read_bytes())
    return content.hexdigest()[:16]


def _keep(rendered: Path, place: Path, recipe: SetRecipe, cameras: dict[str, SceneCamera]) -> None:
    """Proves what was rendered, makes the pictures of it, and puts all in place; cameras.json last, as the seal."""
    entries = json.loads((rendered / "cameras.json").read_text("utf-8"))
    sphere, passes = _sphere_of(entries["sphere"]), read_passes(rendered / "sphere.exr")
    proof = SphereProof(sphere, passes, np.array(entries["sphere"].pop("rays")))
    random = np.random.default_rng(recipe.seed)
    with OutputFiles(overwrite=True) as files:
        for name, entry in entries["views"].items():  # one at a time: many pictures' passes are large
            seen = read_passes(rendered / f"{name}.exr")
            proof.add(seen, blenders_camera(entry), np.array(entry.pop("rays")))
            corner = ideal_camera(cameras[name])[1]
            entry["picture"] = {"corner": corner, "size": cameras[name].size, "k1": cameras[name].k1}
            camera = _camera_of(entry)
            light, depth = through_lens(seen, camera, corner)
            if camera.k1:
                proof.add_bent(light, depth, camera)
            for exposure in recipe.exposures:
                file = shown_name(name, exposure)
                gain, shown = 2.0**exposure, light
                if recipe.agx:
                    gain, shown = 1.0, bent_picture(_shown(rendered / file), camera, corner, cv2.INTER_CUBIC)
                taken = expose(np.maximum(shown, 0), (gain, gain, gain), recipe.noise, False, random)
                data, _ = encode_picture(picture_from_array(taken).pixels, None, 8, ".png")
                files.add_to_folder(place, file, data)
            things = bent_picture(seen.things[..., None], camera, corner, cv2.INTER_NEAREST)[..., 0]
            files.add_to_folder(place, f"{name}.exr", encode_picture(light, None, 32, ".exr")[0])
            files.add_to_folder(place, f"{name}_depth.npy", npy_bytes(depth))
            files.add_to_folder(place, f"{name}_things.npy", npy_bytes(things))
        files.add_to_folder(place, "sphere.exr", encode_picture(passes.light, None, 32, ".exr")[0])
        if recipe.agx:
            files.add_to_folder(place, "sphere.png", (rendered / "sphere.png").read_bytes())
        files.add_to_folder(place, "sphere_distance.npy", npy_bytes(proof.distance))
        files.add_to_folder(place, "sphere_things.npy", npy_bytes(passes.things))
        entries["exposures"] = recipe.exposures
        entries["proof"] = proof.figures()
        files.add_to_folder(place, "cameras.json", json.dumps(entries, indent=1).encode())


def _shown(path: Path) -> NDArray[np.float32]:
    """A picture (H, W, 3) as the engine decodes it: what a screen shows, whatever view it was saved in."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise RenderFailed(f"Blender saved no {path.name}")
    return decode(np.ascontiguousarray(picture[..., 2::-1]))


def _camera_of(entry: dict[str, Any]) -> SceneCamera:
    """The camera of a picture: Blender's, through the picture's own lens."""
    picture = entry["picture"]
    (left, top), (width, height) = picture["corner"], picture["size"]
    return bent_camera(blenders_camera(entry), (left, top), (width, height), picture["k1"])


def _sphere_of(entry: dict[str, Any]) -> SphereCamera:
    width, height = entry["size"]
    return SphereCamera(np.array(entry["place"]), (width, height))


def _load(place: Path) -> RenderedSet:
    entries = json.loads((place / "cameras.json").read_text("utf-8"))
    names = list(entries["views"])
    agx = place / "sphere.png"
    taken = [tuple(place / shown_name(name, exposure) for exposure in entries["exposures"]) for name in names]
    return RenderedSet(
        tuple(files[0] for files in taken),
        tuple(_camera_of(entries["views"][name]) for name in names),
        tuple(np.load(place / f"{name}_depth.npy") for name in names),
        _sphere_of(entries["sphere"]), _shown(agx) if agx.exists() else load_picture(place / "sphere.exr").pixels,
        np.load(place / "sphere_distance.npy"), entries["proof"], entries["blender"],
        tuple(np.load(place / f"{name}_things.npy") for name in (*names, "sphere")),
        np.array(entries["lines"], np.float64).reshape(-1, 2, 3), tuple(taken) if len(taken[0]) > 1 else (),
    )  # fmt: skip
