"""Rendered sets: proved against Blender, kept by content."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.raster.colour import encode
from edf_stitch.synthetic_scenes.ground_truth import visible
from edf_stitch.synthetic_scenes.sets import rendered_set as module
from edf_stitch.synthetic_scenes.sets.recipes import SETS
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet, rendered_set
from edf_stitch.synthetic_scenes.sets.set_radiance import radiance_error
from edf_stitch.synthetic_scenes.sets.set_stitches import ON_SPHERE, told_pictures
from edf_stitch.synthetic_scenes.sets.set_thresholds import PROOF
from edf_stitch.synthetic_scenes.sets.sphere_truth import in_frame, seen_by

RIGHT, FRONT, HEIGHT = 3.6, 4.0, 2.8  # of the room, m
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
    assert room.shown.shape == (300, 600, 3) and room.distance.shape == (300, 600)


def test_the_sphere_shows_what_the_first_camera_sees_ahead(room: RenderedSet) -> None:
    camera = room.cameras[0]
    directions = np.stack([camera.R.T @ np.linalg.inv(camera.K) @ [x, y, 1] for x, y in ((80, 60), (160, 120))])
    x, y = (np.rint(part).astype(int) for part in room.sphere.pixels(directions))
    along = directions @ camera.R[2] / np.linalg.norm(directions, axis=-1)
    assert room.distance[y, x] * along == pytest.approx(room.depths[0][[60, 120], [80, 160]], rel=0.02)
    picture = load_picture(room.pictures[0]).view.astype(float)
    middle = encode(room.shown[y[0] - 3 : y[0] + 4, x[0] - 3 : x[0] + 4], 8).mean(axis=(0, 1))
    assert np.abs(middle - picture[55:66, 75:86].mean(axis=(0, 1))).max() < 12


def test_things_and_straight_edges_of_the_world_are_known(room: RenderedSet) -> None:
    ball = np.array([-0.9, 2.0, 1.35])
    x, y = (int(np.rint(part)) for part in room.sphere.pixels(ball - room.sphere.place))
    assert room.things[-1][y, x] == 4 and room.things[-1].shape == room.distance.shape
    camera = room.cameras[0]
    u, v, w = camera.K @ (camera.R @ ball + camera.t)
    assert room.things[0][round(v / w), round(u / w)] == 4
    assert set(np.unique(room.things[-1])) == set(range(11)), "ten things, and what is none"
    corner = np.array([[RIGHT, FRONT, 0], [RIGHT, FRONT, HEIGHT]])
    assert np.abs(room.lines - corner).max(axis=(1, 2)).min() < 1e-5, "where two walls meet"


@pytest.fixture(scope="module")
def brackets(rendered_folder: Path) -> RenderedSet:
    return rendered_set(replace(SETS["brackets"], count=3, noise=0.0), SIZE, rendered_folder)


def test_pictures_show_their_light_as_their_view_does(
    room: RenderedSet, brackets: RenderedSet, rendered_folder: Path
) -> None:
    taken, light = load_picture(room.pictures[0]).view, load_picture(room.pictures[0].with_suffix(".exr")).pixels
    assert np.abs(taken - encode(light, 8).astype(float)).max() <= 1
    by_agx = rendered_set(replace(RECIPE, count=1, agx=True), SIZE, rendered_folder)
    taken, light = load_picture(by_agx.pictures[0]), load_picture(by_agx.pictures[0].with_suffix(".exr")).pixels
    standard = encode(light, 8).astype(float)
    apart = np.abs(taken.view - standard).mean()
    assert apart > 3, "not the view Standard"
    # AgX is darker in the lights, and keeps what is brighter brighter
    gray, true = taken.view.mean(axis=-1).ravel(), light.mean(axis=-1).ravel()
    order = np.argsort(true)
    tenths = [gray[part].mean() for part in np.array_split(order, 10)]
    assert (np.diff(tenths) > 0).all() and tenths[-1] < standard.mean(axis=-1).ravel()[
        order[-len(order) // 10 :]
    ].mean()


def test_brackets_are_all_rendered_and_merged_to_their_light(brackets: RenderedSet) -> None:
    assert [[path.name for path in files] for files in brackets.brackets][1] == ["01.png", "01_-4ev.png", "01_+2ev.png"]
    frame = read_frame(told_pictures(brackets), ON_SPHERE)
    assert frame.names == ["00.png", "01.png", "02.png"]
    for path, merged in zip(brackets.pictures, frame.pictures, strict=True):
        figures = radiance_error(merged.pixels, load_picture(path.with_suffix(".exr")).pixels)
        assert figures["radiance_percent"] < 1 and figures["radiance_stops"] >= 4, "without grain"
    assert brackets.pictures == tuple(files[0] for files in brackets.brackets)
    middle, darker, brighter = (load_picture(path).view.astype(int) for path in brackets.brackets[0])
    assert (darker <= middle).all() and (middle <= brighter).all()
    assert darker.mean() + 20 < middle.mean() < brighter.mean() - 20
    assert load_picture(brackets.pictures[0].with_suffix(".exr")).pixels.max() > 5, "its window is far brighter"
    # the floor is brown, but where it mirrors the window
    eye = brackets.sphere.place
    window = np.array([1.3, FRONT, -1.75])
    mirrored = eye + (window - eye) * eye[2] / (eye[2] - window[2])
    light = load_picture(brackets.pictures[0].with_name("sphere.exr")).pixels

    def bluer(place: np.ndarray) -> bool:
        x, y = (int(np.rint(part)) for part in brackets.sphere.pixels(place - eye))
        return bool(light[y - 1 : y + 2, x - 1 : x + 2, 2].mean() > light[y - 1 : y + 2, x - 1 : x + 2, 0].mean())

    assert bluer(mirrored) and not bluer(mirrored - [1.2, 0.3, 0])


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
    assert np.array_equal(again.shown, room.shown) and again.proof == room.proof
    for other, size in ((replace(RECIPE, seed=9), SIZE), (replace(RECIPE, noise=2.0), SIZE), (RECIPE, (320, 240)),
                        (replace(RECIPE, count=4), SIZE), (replace(RECIPE, spread=0.2), SIZE)):  # fmt: skip
        with pytest.raises(Asked):
            rendered_set(other, size, rendered_folder)
