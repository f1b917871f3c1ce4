"""Equirectangular pictures become flat views whose cameras are known."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.bodies import bodies_of
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.frames.spheres import views_of_sphere
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.gpano import SpherePart, whole_sphere
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.raster.lazy import Coded
from edf_stitch.core.system.errors import BadRequest, UnreadableImage

from ..textured_room import sphere_rays

HEIGHT = 160


def smooth(rays: np.ndarray) -> np.ndarray:
    """Levels 0 to 1 (…, 3) that change slowly with direction."""
    waves = 2 * np.array([[4.0, 1, 2], [-1, 3, 2], [2, -3, 3]])
    return 0.5 + 0.4 * np.sin(rays @ waves.T)


LEVELS = smooth(sphere_rays(HEIGHT))


def views(picture: Picture, part: SpherePart | None = None) -> list:
    height, width = picture.view.shape[:2]
    return list(views_of_sphere(picture, part or whole_sphere((width, height)), 0))


def rays_of(camera) -> np.ndarray:
    """Rays of a view's pixels (h, w, 3) in the sphere's axes."""
    width, height = camera.size
    v, u = np.mgrid[:height, :width].astype(float)
    return np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(camera.K).T @ camera.view_of.R


def worst(picture: Picture, part: SpherePart | None = None) -> float:
    """By how much a view's view differs at most from what its pixels look at."""
    off = []
    for view, camera in views(picture, part):
        rays = rays_of(camera)
        true = smooth(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
        shown = np.ones(true.shape[:2], bool) if view.alpha is None else view.alpha > 0
        off.append(np.abs(view.view / 255 - true)[shown].max())
    return max(off)


def test_every_pixel_of_a_view_shows_what_it_looks_at() -> None:
    eight = picture_from_array(np.rint(255 * LEVELS).astype(np.uint8), "s.jpg")
    assert worst(eight) < 0.01, "over ±180° and the poles too"
    found = views(eight)
    assert [view.name for view, _ in found][:2] == ["s (front).jpg", "s (front right).jpg"] and len(found) == 8
    assert all(view.alpha is None for view, _ in found)
    assert np.allclose(found[0][1].view_of.R, np.eye(3))
    # each direction is in some view, a tenth of a view away from its border
    covered = np.zeros((HEIGHT, 2 * HEIGHT), bool)
    for _, camera in found:
        seen = sphere_rays(HEIGHT) @ camera.view_of.R.T @ camera.K.T
        inside = np.abs(seen[..., :2] / seen[..., 2:] * 2 / (np.array(camera.size) - 1) - 1).max(axis=-1) < 0.9
        covered |= inside & (seen[..., 2] > 0)
    assert covered.all()


def test_depths_of_bits_stay() -> None:
    sixteen = picture_from_array(np.rint(65535 * LEVELS).astype(np.uint16))
    assert worst(sixteen) < 0.01
    view = views(sixteen)[0][0]
    assert isinstance(view.light, Coded) and view.light.levels.dtype == np.uint16 and view.bits == 16
    lamp = LEVELS.astype(np.float32).copy()
    lamp[70:72, 100:102] = 5000.0
    floats = picture_from_array(lamp)
    for view, camera in views(floats):
        assert view.bits == 32 and view.light.shape[:2] == camera.size[::-1]
        assert view.pixels.min() > -0.5, "a lamp of 5000 leaves no dark ring"
    assert max(view.pixels.max() for view, _ in views(floats)) > 3000


def test_of_a_part_there_are_only_the_views_that_show_something() -> None:
    box = (40, 50, 150, 60)
    left, top, width, height = box
    part = picture_from_array(np.rint(255 * LEVELS[top : top + height, left : left + width]).astype(np.uint8), "p")
    found = views(part, SpherePart((2 * HEIGHT, HEIGHT), box))
    assert [view.name for view, _ in found] == ["p (front)", "p (front right)", "p (front left)"]
    assert worst(part, SpherePart((2 * HEIGHT, HEIGHT), box)) < 0.01
    front = found[0][1]
    assert np.degrees(np.arctan2(front.view_of.R[2, 0], front.view_of.R[2, 2])) == pytest.approx(
        360 * (left + width / 2) / (2 * HEIGHT) - 180
    )
    assert all(camera.size[1] < 100 for _, camera in found), "rows that show nothing are left out"


def little(full: tuple[int, int], box: tuple[int, int, int, int]) -> tuple[Picture, SpherePart]:
    """A picture of a small part of a sphere."""
    left, top, width, height = box
    v, u = np.mgrid[top : top + height, left : left + width] + 0.5
    heading, fall = 2 * np.pi * (u / full[0] - 0.5), np.pi * (v / full[1] - 0.5)
    rays = np.stack([np.cos(fall) * np.sin(heading), np.sin(fall), np.cos(fall) * np.cos(heading)], axis=-1)
    return picture_from_array(np.rint(255 * smooth(rays)).astype(np.uint8), "p.jpg"), SpherePart(full, box)


@pytest.mark.parametrize("full, box", [
    ((2000, 1000), (900, 450, 60, 40)), ((2000, 1000), (300, 130, 60, 40)), ((40000, 20000), (19000, 9000, 60, 40)),
])  # fmt: skip
def test_of_a_small_part_only_what_it_shows_is_worked_out(full: tuple[int, int], box: tuple) -> None:
    part = little(full, box)
    tracemalloc.start()
    found = views(*part)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found and peak < 50e6, "a view of 84° of the last one has 208 MB"
    assert worst(*part) < 0.01
    assert sum(view.view[..., 0].size for view, _ in found) < 3 * 60 * 40


@pytest.mark.parametrize("width", [10**6, 10**10, 10**200])
def test_a_sphere_that_is_absurdly_large_for_its_part_is_refused(width: int) -> None:
    picture = picture_from_array(np.full((30, 60, 3), 99, np.uint8), "far.jpg")
    with pytest.raises(UnreadableImage, match=r"far.jpg: it says that its 60×30 px are a part of a sphere of 1"):
        views(picture, SpherePart((width, width // 2), (0, 0, 60, 30)))


def test_a_thin_ring_of_a_large_sphere_is_refused() -> None:
    ring = picture_from_array(np.full((1, 24000, 3), 99, np.uint8), "ring.jpg")
    with pytest.raises(UnreadableImage, match="ring.jpg: .* too large for what it shows"):
        views(ring, SpherePart((24000, 12000), (0, 2000, 24000, 1)))


def test_a_sphere_of_which_nothing_is_left_is_refused() -> None:
    levels, wide = sphere_and_wide()
    whole = whole_sphere((2 * HEIGHT, HEIGHT))
    black = replace(picture_from_array(np.zeros_like(levels), "s.jpg"), part=whole)
    alpha = np.full(levels.shape[:2], 99, np.uint8)
    faint = replace(picture_from_array(np.dstack([levels, alpha]), "s.jpg"), part=whole)
    for nothing in (black, faint):
        with pytest.raises(UnreadableImage, match="s.jpg: as a sphere it shows nothing, .*; leave it out, or export"):
            read_frame([wide, nothing], StitchOptions())
    hidden = np.full(levels.shape[:2], 255, np.uint8)
    hidden[:3] = 0  # next to nothing around a pole
    with pytest.raises(UnreadableImage, match="black, transparent or ignored"):
        read_frame([wide, picture_from_array(levels, "s.jpg")], StitchOptions(ignore=(None, hidden)))


def test_poles_that_are_missing_are_not_shown() -> None:
    """Black where a file has no transparency, or transparent."""
    levels = np.rint(255 * LEVELS).astype(np.uint8)
    levels[:30] = 0
    black = picture_from_array(cv2.imdecode(cv2.imencode(".jpg", levels)[1], cv2.IMREAD_COLOR))
    alpha = np.full(levels.shape[:2], 255, np.uint8)
    alpha[:30] = 0
    clear = picture_from_array(np.dstack([levels, alpha]))
    for picture in (black, clear):
        found = views(picture)
        assert len(found) == 8
        up = next((view, camera) for view, camera in found if camera.view_of.R[2, 1] < -0.9)
        assert up[0].alpha is not None
        fall = np.degrees(np.arcsin((rays := rays_of(up[1]))[..., 1] / np.linalg.norm(rays, axis=-1)))
        assert not up[0].alpha[fall < -90 + 30 * 180 / HEIGHT].any()
        assert up[0].alpha[fall > -90 + 45 * 180 / HEIGHT].all()


def sphere_and_wide() -> tuple[np.ndarray, np.ndarray]:
    levels = np.rint(255 * LEVELS).astype(np.uint8)
    wide = np.random.default_rng(0).integers(0, 255, (100, 200, 3), np.uint8)
    return levels, cv2.GaussianBlur(wide, (0, 0), 2)


def test_a_frame_holds_a_spheres_views_and_what_is_flat_as_it_is() -> None:
    levels, wide = sphere_and_wide()
    frame = read_frame([wide, levels], StitchOptions())
    assert len(frame.pictures) == 9 and frame.shown_by == (0, 1)
    assert frame.known[0] is None, "a photograph of 2:1 whose ends do not meet"
    assert frame.called[:3] == ["array", "array", "array (front right)"]
    assert bodies_of([one for one in frame.known if one]).of.tolist() == [0] * 8
    assert frame.only([0, 3]).known == (None, frame.known[3])


def test_a_mask_of_a_sphere_is_one_of_its_views() -> None:
    levels, wide = sphere_and_wide()
    mask = np.zeros(levels.shape[:2], np.uint8)
    mask[:, :80] = 255  # a quarter of the turn, to the left of straight behind
    frame = read_frame([wide, levels], StitchOptions(ignore=(None, mask)))
    assert frame.pictures[1].alpha is None, "the front"
    for picture, camera in zip(frame.pictures[1:], frame.known[1:], strict=True):
        rays = rays_of(camera)
        heading = np.degrees(np.arctan2(rays[..., 0], rays[..., 2]))
        shown = np.ones(heading.shape, bool) if picture.alpha is None else picture.alpha > 0
        assert not (shown & (heading < -90)).any()
        assert shown[(heading > -85) & (heading < 175)].all()


def test_too_many_spheres_and_what_is_for_pairs_only_are_refused() -> None:
    levels, wide = sphere_and_wide()
    spheres = [np.roll(levels, 40 * number, axis=1) for number in range(8)]
    with pytest.raises(BadRequest, match="64 pictures given .a sphere counts as its eight views"):
        read_frame(spheres, StitchOptions())
    with pytest.raises(BadRequest, match="'rew' is for two pictures only"):
        read_frame([wide, levels], StitchOptions(field="rew", fade="plane"))
