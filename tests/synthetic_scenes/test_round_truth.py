"""Equirectangular panoramas against Blender: what its panoramic camera sees, and what a camera sees of them as a
World."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.blender_camera import lens_for, matrix_world_of
from edf_stitch.core.cameras.blender_world import world_rotation
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import stitch
from edf_stitch.core.raster.colour import encode
from edf_stitch.synthetic_scenes.recipes import RECIPES
from edf_stitch.synthetic_scenes.rendered import RenderedPair

from ..pairs import ON_REFERENCE

pytestmark = pytest.mark.slow
SCRIPT = Path(__file__).with_name("round_render.py")


def rendered_by_blender(job: dict[str, Any], folder: Path) -> np.ndarray:
    """The picture (H, W, 3), scene-linear."""
    path = folder / "job.json"
    path.write_text(json.dumps({"seed": 0, "samples": 16, **job, "out": str(folder / "out.exr")}), "utf-8")
    done = subprocess.run([sys.executable, str(SCRIPT), str(path)], capture_output=True, text=True)
    assert (folder / "out.exr").exists(), done.stdout[-500:] + done.stderr[-1500:]
    return load_picture(folder / "out.exr").pixels


def panorama_options(pair: RenderedPair, **options: Any) -> StitchOptions:
    K, K_prime = (pair.cameras[name].K for name in ("reference", "target"))
    middles = tuple(float(v) for v in (*K[:2, 2], *K_prime[:2, 2]))
    camera = CameraRequest(focal_px=(float(K[0, 0]), float(K_prime[0, 0])), principal=middles)
    return replace(ON_REFERENCE, projection="equirectangular", camera=camera, measure=False, **options)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Mean difference of two scene-linear pictures in 8-bit levels."""
    return float(np.abs(encode(a, 8).astype(float) - encode(b, 8)).mean())


def test_it_is_what_blenders_panoramic_camera_sees(rendered: RenderedPair, tmp_path: Path) -> None:
    result = stitch((rendered.reference, rendered.target), panorama_options(rendered, level="none"))
    height, width = result.alpha.shape
    left, top, _, _ = result.spread
    box = (-left, -top, result.warp.canvas.width, result.warp.canvas.height)
    recipe, camera = RECIPES["tabletop"], rendered.cameras["reference"]
    true = rendered_by_blender({
        "world": recipe.world, "seed": recipe.seed, "size": [width, height], "box": box,
        "matrix_world": matrix_world_of(camera.R, camera.t).tolist(),
    }, tmp_path)  # fmt: skip
    part = np.s_[box[1] : box[1] + box[3], box[0] : box[0] + box[2]]
    assert true.shape == result.pixels[part].shape
    own, both = result.layers[0].alpha == 1, result.layers[1].alpha == 1
    off = apart(result.layers[0].pixels[own], true[own])
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        assert apart(np.roll(result.layers[0].pixels, step, axis)[own], true[own]) > 1.8 * off
    assert off < 4, "two renders of 16 and 24 samples"
    # the target beyond the reference hangs on the field's plane there, as in a flat panorama
    assert apart(result.layers[1].pixels[both & own], true[both & own]) < 8
    assert apart(result.layers[1].pixels[both & ~own], true[both & ~own]) < 20


@pytest.mark.parametrize("level", ["none", (25.0, -12.0, 6.0)])
def test_as_a_world_the_reference_camera_sees_the_reference(
    rendered: RenderedPair, tmp_path: Path, level: object
) -> None:
    """The camera as Create Cameras places it, at the origin along +y with z up; and any other place and turn."""
    result = stitch((rendered.reference, rendered.target), panorama_options(rendered, level=level))
    image = tmp_path / "panorama.exr"
    alone = result.layers[0].within(result.spread).pixels
    image.write_bytes(encode_picture(alone, None, 32, ".exr")[0])
    rotation = np.array(result.report["canvas"]["projection"]["rotation"])
    upright = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    R, t = (upright, np.zeros(3)) if level == "none" else (upright @ rotation, np.ones(3))
    matrix = matrix_world_of(R, t)
    camera = rendered.cameras["reference"]
    seen = rendered_by_blender({
        "image": str(image), "size": list(camera.size), "matrix_world": matrix.tolist(),
        "rotation": world_rotation(matrix, rotation).tolist(), **asdict(lens_for(camera.K, camera.size)),
    }, tmp_path)  # fmt: skip
    inner = np.s_[3:-3, 3:-3]
    ours, theirs = (picture[inner].astype(np.float32).mean(axis=2) for picture in (encode(seen, 8), rendered.reference))
    assert np.abs(ours - theirs).mean() < 7, "resampled twice, which smoothes its grain"
    moved, _ = cv2.phaseCorrelate(ours, theirs)
    assert np.abs(moved).max() < 0.05, "px"
