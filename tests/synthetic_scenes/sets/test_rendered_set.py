"""Rendered sets: proved against Blender, kept by content."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.raster.colour import encode
from edf_stitch.synthetic_scenes.ground_truth import visible
from edf_stitch.synthetic_scenes.sets import rendered_set as module
from edf_stitch.synthetic_scenes.sets.recipes import SETS
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet, rendered_set
from edf_stitch.synthetic_scenes.sets.set_thresholds import PROOF
from edf_stitch.synthetic_scenes.sets.sphere_truth import in_frame, seen_by

RECIPE, SIZE = replace(SETS["small_room"], count=3, noise=0.0), (240, 180)


@pytest.fixture(scope="module")
def room(rendered_folder: Path) -> RenderedSet:
    return rendered_set(RECIPE, SIZE, rendered_folder)


def test_the_truth_is_proved(room: RenderedSet) -> None:
    # at this size a sphere's pixel is too large for the colours of a bar that holds for 640 pixels
    limits = [limit for limit in PROOF if limit.unit != "dB"]
    assert all(limit.holds(room.proof[limit.measure]) for limit in limits), room.proof
    assert room.proof["half_pixel_loss_db"] > 0.5


def test_cameras_pictures_and_depths_belong_together(room: RenderedSet) -> None:
    asked = list(RECIPE.cameras(SIZE).values())
    assert len(room.pictures) == len(room.cameras) == len(room.depths) == 3
    for had, camera, path, depth in zip(room.cameras, asked, room.pictures, room.depths, strict=True):
        assert np.allclose(had.K, camera.K, atol=1e-4) and np.allclose(had.R, camera.R, atol=1e-6)
        assert load_picture(path).view.shape == (180, 240, 3) and depth.shape == (180, 240)
    assert np.allclose(room.sphere.place, asked[0].place, atol=1e-6)
    assert room.light.shape == (300, 600, 3) and room.distance.shape == (300, 600)


def test_the_sphere_shows_what_the_first_camera_sees_ahead(room: RenderedSet) -> None:
    camera = room.cameras[0]
    directions = np.stack([camera.R.T @ np.linalg.inv(camera.K) @ [x, y, 1] for x, y in ((80, 60), (160, 120))])
    x, y = (np.rint(part).astype(int) for part in room.sphere.pixels(directions))
    along = directions @ camera.R[2] / np.linalg.norm(directions, axis=-1)
    assert room.distance[y, x] * along == pytest.approx(room.depths[0][[60, 120], [80, 160]], rel=0.02)
    picture = load_picture(room.pictures[0]).view.astype(float)
    middle = encode(room.light[y[0] - 3 : y[0] + 4, x[0] - 3 : x[0] + 4], 8).mean(axis=(0, 1))
    assert np.abs(middle - picture[55:66, 75:86].mean(axis=(0, 1))).max() < 12


def test_who_walks_through_is_in_a_picture_and_not_on_the_sphere(rendered_folder: Path) -> None:
    recipe = replace(SETS["mover"], count=3, noise=0.0)
    rendered = rendered_set(recipe, SIZE, rendered_folder)
    limits = [limit for limit in PROOF if limit.unit != "dB"]
    assert all(limit.holds(rendered.proof[limit.measure]) for limit in limits), rendered.proof
    # of what the first sees, what the second has somebody before
    hidden = []
    for number in (1, 2):
        pixels, there = seen_by(rendered.cameras[number], rendered.sphere, rendered.sphere.all_directions(),
                                rendered.distance)  # fmt: skip
        nearer = in_frame(pixels, rendered.cameras[number]) & ~visible(pixels, there, rendered.depths[number])
        columns = np.flatnonzero(nearer.sum(axis=0) > 40)
        hidden.append(np.median(columns) / rendered.sphere.size[0] * 360 - 180)
    assert hidden == pytest.approx([7, -12], abs=5), "at two places"


def test_a_set_is_rendered_once_and_again_when_anything_about_it_changes(
    room: RenderedSet, rendered_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Asked(Exception):
        pass

    def ask(*_: object) -> None:
        raise Asked

    monkeypatch.setattr(module, "run_job", ask)
    again = rendered_set(RECIPE, SIZE, rendered_folder)
    assert np.array_equal(again.light, room.light) and again.proof == room.proof
    for other, size in ((replace(RECIPE, seed=9), SIZE), (replace(RECIPE, noise=2.0), SIZE), (RECIPE, (320, 240)),
                        (replace(RECIPE, count=4), SIZE), (replace(RECIPE, spread=0.2), SIZE)):  # fmt: skip
        with pytest.raises(Asked):
            rendered_set(other, size, rendered_folder)
