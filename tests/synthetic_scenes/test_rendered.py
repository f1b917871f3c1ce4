"""Rendered pairs: proved against Blender, kept by content, exposed as a sensor would."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.raster.colour import encode
from edf_stitch.synthetic_scenes import rendered as module
from edf_stitch.synthetic_scenes.blender_process import RenderFailed
from edf_stitch.synthetic_scenes.recipes import RECIPES, Difficulty
from edf_stitch.synthetic_scenes.rendered import RenderedPair, blenders_camera, expose, rendered_pair
from edf_stitch.synthetic_scenes.thresholds import PROOF

from_seed = np.random.default_rng
LIGHT = np.linspace(0, 3, 4 * 5 * 3, dtype=np.float32).reshape(4, 5, 3)


def proved(proof: dict[str, float]) -> bool:
    loss = proof["warp_psnr_db"] - proof["half_pixel_psnr_db"]
    return all(limit.holds({**proof, "half_pixel_loss_db": loss}[limit.measure]) for limit in PROOF)


def test_the_truth_is_proved(rendered: RenderedPair) -> None:
    assert proved(rendered.proof), rendered.proof


def test_the_cameras_are_blenders_and_those_that_were_asked_for(rendered: RenderedPair) -> None:
    asked = RECIPES["tabletop"].cameras((320, 240), Difficulty())
    for camera, name in zip(asked, ("reference", "target"), strict=True):
        had = rendered.cameras[name]
        assert had.size == camera.size and np.allclose(had.K, camera.K, atol=1e-4)
        assert np.allclose(had.R, camera.R, atol=1e-6) and np.allclose(had.t, camera.t, atol=1e-6)


def test_the_wide_picture_holds_the_reference_where_it_says(rendered: RenderedPair) -> None:
    inside = encode(rendered.wide[rendered.frame], 8)
    assert inside.shape == rendered.reference.shape
    apart = np.abs(inside.astype(int) - rendered.reference)
    moved = np.abs(np.roll(inside, 1, axis=1).astype(int) - rendered.reference)
    assert apart.mean() < 2 and moved.mean() > 3 * apart.mean()


def test_a_pair_is_rendered_once_and_again_when_anything_about_it_changes(
    rendered: RenderedPair, rendered_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Asked(Exception):
        pass

    def ask(*_: object) -> None:
        raise Asked

    monkeypatch.setattr(module, "run_job", ask)
    recipe = RECIPES["tabletop"]
    again = rendered_pair(recipe, Difficulty(), (320, 240), rendered_folder)
    assert np.array_equal(again.reference, rendered.reference) and again.proof == rendered.proof
    for other, difficulty, size in (
        (replace(recipe, seed=9), Difficulty(), (320, 240)), (recipe, Difficulty(noise=2), (320, 240)),
        (recipe, Difficulty(baseline=2), (320, 240)), (recipe, Difficulty(), (240, 320)),
        (replace(recipe, gain=(0.5, 0.5, 0.5)), Difficulty(), (320, 240)),
    ):  # fmt: skip
        with pytest.raises(Asked):
            rendered_pair(other, difficulty, size, rendered_folder)
    monkeypatch.setattr(module, "SAMPLES", 3)
    with pytest.raises(Asked):
        rendered_pair(recipe, Difficulty(), (320, 240), rendered_folder)


def test_a_pair_without_its_seal_is_rendered_again(
    rendered: RenderedPair, rendered_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that was killed while it wrote leaves pictures without cameras.json."""
    (place,) = rendered_folder.glob("tabletop-*")
    half = tmp_path / place.name
    half.mkdir()
    (half / "reference.png").write_bytes((place / "reference.png").read_bytes())

    def fail(*_: object) -> None:
        raise RenderFailed("asked")

    monkeypatch.setattr(module, "run_job", fail)
    with pytest.raises(RenderFailed, match="asked"):
        rendered_pair(RECIPES["tabletop"], Difficulty(), (320, 240), tmp_path)


def test_exposing_is_blenders_standard_view_with_gain(rendered: RenderedPair) -> None:
    plain = expose(LIGHT, (1, 1, 1), 0, False, from_seed(0))
    assert plain.dtype == np.uint8 and np.abs(plain.astype(int) - encode(LIGHT, 8)).max() <= 1
    warm = expose(LIGHT, (1, 0.5, 0.25), 0, False, from_seed(0))
    assert np.abs(warm.astype(int) - encode(LIGHT * np.float32([1, 0.5, 0.25]), 8)).max() <= 1
    kept = expose(LIGHT, (0.5, 0.5, 0.5), 0, True, from_seed(0))
    assert kept.dtype == np.float32 and np.allclose(kept, LIGHT / 2) and kept.max() > 1


def test_corners_lose_the_light_that_was_asked_for() -> None:
    gray = np.full((21, 31, 3), 0.5, np.float32)
    taken = expose(gray, (1, 1, 1), 0, True, from_seed(0), vignetting=0.4)
    assert np.allclose(taken[[0, 0, -1], [0, -1, -1]], 0.3) and np.allclose(taken[10, 15], 0.5)
    assert np.allclose(taken[10, 0], 0.4), "half-way by the square of the distance"


@pytest.mark.parametrize("sigma", [1.0, 5.0])
def test_noise_has_the_sigma_that_was_asked_for(sigma: float) -> None:
    gray = np.full((200, 200, 3), 0.2, np.float32)
    taken = expose(gray, (1, 1, 1), sigma, False, from_seed(1)).astype(float)
    assert taken.std() == pytest.approx(np.hypot(sigma, 1 / np.sqrt(12)), rel=0.02)
    assert taken.mean() == pytest.approx(float(encode(gray, 8)[0, 0, 0]), abs=0.6)
    assert np.array_equal(taken, expose(gray, (1, 1, 1), sigma, False, from_seed(1)))


def test_a_camera_as_blender_tells_it() -> None:
    entry = {
        "lens": 50.0, "sensor_width": 36.0, "sensor_height": 24.0, "sensor_fit": "HORIZONTAL", "shift_x": 0.1,
        "shift_y": 0.0, "resolution": [360, 240], "matrix_world": np.eye(4).tolist(),
    }  # fmt: skip
    camera = blenders_camera(entry)
    assert camera.size == (360, 240) and np.allclose(camera.K, [[500, 0, 143.5], [0, 500, 119.5], [0, 0, 1]])
    assert np.allclose(camera.R, np.diag([1, -1, -1])), "Blender's camera looks along −z with y up"


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in RECIPES if name != "tabletop"])
def test_every_recipe_renders_and_is_proved(name: str, rendered_folder: Path) -> None:
    recipe = RECIPES[name]
    pair = rendered_pair(recipe, Difficulty(), recipe.size(240, 180), rendered_folder)
    assert proved(pair.proof), pair.proof
    assert (pair.reference.dtype == np.float32) == recipe.hdr
    assert not recipe.hdr or pair.reference.max() > 20
    # the border of one picture cuts the thing, the other shows it whole
    cut = {"cut_branch": ("reference", np.s_[:, -1]), "cut_person": ("target", np.s_[:, 0])}
    assert bool(pair.things) == (name in cut)
    for view, border in [cut[name]] if name in cut else []:
        other = {"reference": "target", "target": "reference"}[view]
        assert pair.things[view][border].any() and pair.things["wide"].any()
        inner = pair.things[other][1:-1, 1:-1]
        assert inner.sum() == pair.things[other].sum()
