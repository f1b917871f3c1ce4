"""Scene cameras on their way to the engine, against Blender's own projection matrix."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.commands.worker import cameras_of

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.bridge import cameras, images  # noqa: E402


def new_camera(scene, name: str, random) -> "bpy.types.Object":
    data = bpy.data.cameras.new(name)
    data.lens, data.sensor_width, data.sensor_height = random.uniform((12, 20, 15), (85, 40, 30))
    data.sensor_fit = random.choice(["AUTO", "HORIZONTAL", "VERTICAL"])
    data.shift_x, data.shift_y = random.uniform(-0.4, 0.4, 2)
    camera = bpy.data.objects.new(name, data)
    camera.location, camera.rotation_euler = random.uniform(-5, 5, 3), random.uniform(-3.2, 3.2, 3)
    camera.scale = random.uniform(0.3, 3, 3) if random.random() < 0.3 else (1, 1, 1)
    scene.collection.objects.link(camera)
    return camera


def picture(name: str, size: tuple[int, int]) -> SimpleNamespace:
    """All of a picture that counts here."""
    return SimpleNamespace(name=name, light=np.empty((size[1], size[0], 0)))


def by_blender(camera, size: tuple[int, int], points: np.ndarray) -> np.ndarray:
    """Pixels (N, 2), integer centres, rows from the top, where world points (N, 3) are seen."""
    aspect = bpy.context.scene.render
    matrix = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(), x=size[0], y=size[1], scale_x=aspect.pixel_aspect_x,
        scale_y=aspect.pixel_aspect_y,
    )  # fmt: skip
    world = np.linalg.inv(np.array(camera.matrix_world.normalized(), np.float64))
    clip = homogeneous(points) @ (np.array(matrix) @ world).T
    ndc = clip[:, :2] / clip[:, 3:]
    return np.stack([(ndc[:, 0] + 1) / 2 * size[0] - 0.5, (1 - ndc[:, 1]) / 2 * size[1] - 0.5], axis=-1)


def test_two_hundred_cameras_see_what_blender_says(blender):
    """Any fit, shift, pixel aspect, size of picture, place and scale: within a thousandth of a pixel."""
    random = np.random.default_rng(5)
    worst = 0.0
    for _ in range(100):
        pair = {side: new_camera(blender.scene, side, random) for side in ("reference", "target")}
        aspect = random.choice([1.0, 1.0, 1.5, 0.8])
        blender.scene.render.pixel_aspect_x, blender.scene.render.pixel_aspect_y = max(1, aspect), max(1, 1 / aspect)
        sizes = [tuple(int(side) for side in random.integers(50, 2000, 2)) for _ in pair]
        settings = blender.settings
        settings.reference_camera, settings.target_camera = pair.values()
        bpy.context.view_layer.update()
        entries = cameras.describe_both(settings, blender.scene, bpy.context.evaluated_depsgraph_get())
        pictures = tuple(picture(name, size) for name, size in zip("ab", sizes, strict=True))
        table = cameras_of(json.loads(json.dumps(entries)), pictures)
        for name, camera, size in zip("ab", pair.values(), sizes, strict=True):
            R, t, K = (np.array(table[name][key], np.float64) for key in "RtK")
            corners = np.array([(x, y) for x in (0, size[0]) for y in (0, size[1])], np.float64)
            rays = homogeneous(corners) @ np.linalg.inv(K).T * random.uniform(1, 20, (4, 1))
            points = (rays - t) @ np.linalg.inv(R).T  # R was single precision once
            found = by_blender(camera, size, points)
            worst = max(worst, float(np.abs(found - corners).max()))
        for camera in pair.values():
            bpy.data.objects.remove(camera)
    assert worst <= 1e-3, worst


def test_a_reference_called_target_keeps_its_own_camera(blender):
    random = np.random.default_rng(6)
    settings = blender.settings
    settings.reference_camera, settings.target_camera = (new_camera(blender.scene, name, random) for name in "ab")
    bpy.context.view_layer.update()
    entries = cameras.describe_both(settings, blender.scene, bpy.context.evaluated_depsgraph_get())
    here, there = (picture(name, (8, 8)) for name in ("target", "reference"))
    first = cameras_of(entries, (here, there))["target"]["t"]
    assert np.allclose(-first @ cameras_of(entries, (here, there))["target"]["R"], settings.reference_camera.location,
                       atol=1e-5)  # fmt: skip


@pytest.mark.parametrize(("kind", "words"), [("ORTHO", "orthographic"), ("PANO", "panoramic")])
def test_cameras_that_take_no_flat_photographs_are_refused(blender, kind, words):
    camera = new_camera(blender.scene, "wide", np.random.default_rng(7))
    camera.data.type = kind
    with pytest.raises(images.Unusable, match=f"“wide” is {words}"):
        cameras.describe(camera, blender.scene, bpy.context.evaluated_depsgraph_get())


def test_one_camera_for_both_pictures_is_refused(blender):
    settings = blender.settings
    settings.reference_camera = settings.target_camera = new_camera(blender.scene, "one", np.random.default_rng(8))
    with pytest.raises(images.Unusable, match="for both pictures"):
        cameras.describe_both(settings, blender.scene, bpy.context.evaluated_depsgraph_get())
