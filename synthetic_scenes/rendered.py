"""A rendered pair with all that is true of it: made once, proved, kept, and found again by what it was made of."""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.cameras.blender_camera import BlenderLens, pose_of
from ..core.pictures.encoding import encode_picture
from ..core.pictures.picture import load_picture, picture_from_array
from ..core.raster.colour import encode
from ..core.system.output_files import OutputFiles
from .blender_process import run_job
from .ground_truth import TrueGeometry
from .passes import read_passes
from .proof import prove
from .recipes import Difficulty, Recipe
from .scene_camera import SceneCamera

SAMPLES = 24
VIEWS = ("reference", "target", "wide")
# Whatever decides about pixels: a change in one of these files makes every cached picture a stranger.
SOURCES = (
    "render.py", "camera_render.py", "stage.py", "worlds.py", "rendered.py", "passes.py", "proof.py",
    "../core/cameras/blender_camera.py",
)  # fmt: skip


@dataclass(frozen=True)
class RenderedPair:
    """Two pictures of a world, and the truth about them.

    reference, target: uint8 RGB, or float32 scene-linear (hdr); wide: what the reference camera would see with a larger
    sensor, float32 scene-linear, without noise; wide_camera is that camera, `corner` (x, y) the reference's pixel that
    is its first; wide_depth, target_depth (H, W) float32, inf where there is nothing. proof: see `proof.prove`. things:
    by view, where (H, W) it shows things that the world names, uint8 numbers from 1; empty where it names none.
    """

    reference: NDArray
    target: NDArray
    wide: NDArray[np.float32]
    cameras: dict[str, SceneCamera]
    corner: tuple[int, int]
    wide_depth: NDArray[np.float32]
    target_depth: NDArray[np.float32]
    proof: dict[str, float]
    blender: str
    things: dict[str, NDArray[np.uint8]] = field(default_factory=dict)

    @property
    def geometry(self) -> TrueGeometry:
        """Of reference and target."""
        return TrueGeometry.of(self.cameras["reference"], self.cameras["target"])

    @property
    def frame(self) -> tuple[slice, slice]:
        """Rows and columns of `wide` that are the reference's."""
        width, height = self.cameras["reference"].size
        left, top = -self.corner[0], -self.corner[1]
        return np.s_[top : top + height, left : left + width]


def rendered_pair(recipe: Recipe, difficulty: Difficulty, size: tuple[int, int], folder: Path) -> RenderedPair:
    """The pair in a folder of pictures, rendered where it is not there yet.

    size: (W, H) px of the recipe's pictures. Raises RenderFailed, BadRequest, UnwritableOutput.
    """
    reference, target = recipe.cameras(size, difficulty)
    job = {
        "world": recipe.world, "seed": recipe.seed, "samples": SAMPLES,
        "cameras": [{"K": c.K.tolist(), "R": c.R.tolist(), "t": c.t.tolist(), "size": list(c.size)}
                    for c in (reference, target)],
    }  # fmt: skip
    place = folder / f"{recipe.name}-{_key(job, recipe, difficulty)}"
    if not (place / "cameras.json").is_file():
        with tempfile.TemporaryDirectory(prefix="edf-render-") as temporary:
            run_job(job, Path(temporary))
            _keep(Path(temporary), place, recipe, difficulty)
    return _load(place, recipe.hdr)


def _key(job: dict[str, Any], recipe: Recipe, difficulty: Difficulty) -> str:
    content = hashlib.sha256(json.dumps([job, asdict(recipe), asdict(difficulty)], sort_keys=True).encode())
    for name in SOURCES:
        content.update((Path(__file__).parent / name).read_bytes())
    return content.hexdigest()[:16]


def _keep(rendered: Path, place: Path, recipe: Recipe, difficulty: Difficulty) -> None:
    """Proves what was rendered, makes the pictures of it, and puts all in place; cameras.json last, as the seal."""
    entries = json.loads((rendered / "cameras.json").read_text("utf-8"))
    passes = {name: read_passes(rendered / f"{name}.exr") for name in VIEWS}
    cameras = {name: blenders_camera(entries[name]) for name in VIEWS}
    rays = {name: np.array(entries[name].pop("rays")) for name in VIEWS}
    entries["proof"] = prove(passes, cameras, rays, (entries["box"][0], entries["box"][1]))
    random = np.random.default_rng(recipe.seed)
    with OutputFiles(overwrite=True) as files:
        for name, gain in (("reference", (1.0, 1.0, 1.0)), ("target", recipe.gain)):
            taken = expose(passes[name].light, gain, difficulty.noise, recipe.hdr, random, recipe.vignetting)
            suffix, bits = (".exr", 32) if recipe.hdr else (".png", 8)
            data, _ = encode_picture(picture_from_array(taken).pixels, None, bits, suffix)
            files.add_to_folder(place, name + suffix, data)
        data, _ = encode_picture(passes["wide"].light, None, 32, ".exr")
        files.add_to_folder(place, "wide.exr", data)
        for name in ("target", "wide"):
            files.add_to_folder(place, f"{name}_depth.npy", npy_bytes(passes[name].depth))
        if passes["wide"].things.any():
            for name in VIEWS:
                files.add_to_folder(place, f"{name}_things.npy", npy_bytes(passes[name].things))
        files.add_to_folder(place, "cameras.json", json.dumps(entries, indent=1).encode())


def npy_bytes(array: NDArray) -> bytes:
    """An array as a file of NumPy's own."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def _load(place: Path, hdr: bool) -> RenderedPair:
    entries = json.loads((place / "cameras.json").read_text("utf-8"))
    pictures = [load_picture(place / f"{name}.{'exr' if hdr else 'png'}") for name in ("reference", "target")]
    reference, target = (picture.pixels if hdr else picture.view for picture in pictures)
    return RenderedPair(
        reference, target, load_picture(place / "wide.exr").pixels,
        {name: blenders_camera(entries[name]) for name in VIEWS}, (entries["box"][0], entries["box"][1]),
        np.load(place / "wide_depth.npy"), np.load(place / "target_depth.npy"), entries["proof"], entries["blender"],
        {path.stem.partition("_")[0]: np.load(path) for path in sorted(place.glob("*_things.npy"))},
    )  # fmt: skip


def blenders_camera(entry: dict[str, Any]) -> SceneCamera:
    """The camera that Blender says it rendered with, not the one that was asked for."""
    width, height = entry["resolution"]
    lens = BlenderLens(
        lens=entry["lens"], sensor_width=entry["sensor_width"], sensor_height=entry["sensor_height"],
        sensor_fit=entry["sensor_fit"], shift_x=entry["shift_x"], shift_y=entry["shift_y"], resolution=(width, height),
    )  # fmt: skip
    R, t = pose_of(np.array(entry["matrix_world"]))
    return SceneCamera(lens.intrinsics, R, t, lens.size)


def expose(
    light: NDArray[np.float32], gain: tuple[float, float, float], noise: float, hdr: bool, random: np.random.Generator,
    vignetting: float = 0.0,
) -> NDArray:  # fmt: skip
    """The picture that a sensor takes: uint8 sRGB (Blender's view transform Standard), or the light itself where hdr.

    noise: σ in levels of 8 bit, of hdr pictures in 255ths of white; vignetting: share of the light that the corners
    lose, by the square of the distance from the middle.
    """
    y, x = (np.linspace(-1, 1, side, dtype=np.float32) for side in light.shape[:2])
    falloff = 1 - np.float32(vignetting / 2) * (y[:, None] ** 2 + x**2)
    taken = light * np.array(gain, np.float32) * falloff[..., None]
    grain = noise * random.standard_normal(light.shape).astype(np.float32) if noise else np.float32(0)
    if hdr:
        return np.maximum(taken + grain / np.float32(255), 0)
    coded = encode(taken, 16).astype(np.float32) / np.float32(257)
    return np.clip(np.rint(coded + grain), 0, 255).astype(np.uint8)
