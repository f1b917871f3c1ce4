"""What is taken along, rendered: Cycles sees through the cameras what the panorama and the reference show."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.core.pictures.picture import load_picture  # noqa: E402
from edf_stitch.edf_addon.bridge import compat  # noqa: E402
from edf_stitch.edf_addon.scene import take_along  # noqa: E402

pytestmark = pytest.mark.slow


@pytest.fixture
def render(blender, tmp_path):
    """Renders through a panorama's camera: display-encoded levels (H, W, 3), and where something is seen."""
    render = blender.scene.render
    try:
        render.engine = "CYCLES"
    except TypeError:
        pytest.skip("this Blender has no Cycles")
    blender.scene.cycles.samples, blender.scene.cycles.use_denoising = 1, False
    blender.scene.view_settings.view_transform = "Standard"
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGBA"
    render.film_transparent = True
    render.filepath = str(tmp_path / "render.png")

    def through(role: str) -> tuple[np.ndarray, np.ndarray]:
        take_along.look_through(blender.scene, take_along.find(blender.settings.result, role))
        bpy.ops.render.render(write_still=True)
        picture = load_picture(tmp_path / "render.png")
        alpha = np.ones(picture.view.shape[:2]) if picture.alpha is None else picture.alpha
        return picture.view.astype(float), alpha == 1

    return through


def apart(one: np.ndarray, other: np.ndarray, where: np.ndarray) -> float:
    return float(np.abs(one - other)[where].mean())


@pytest.mark.parametrize("projection", ["REFERENCE", "PERSPECTIVE", "CYLINDRICAL", "EQUIRECTANGULAR"])
def test_the_panoramas_camera_sees_the_panorama_on_its_mesh(chosen, render, pixels_of, projection):
    if projection == "CYLINDRICAL" and not compat.sees_cylinders():
        pytest.skip("this Blender has no cylindrical lens")
    settings = chosen.settings
    settings.projection, settings.crop = projection, "FULL"
    settings.slide_auto = False  # a camera sees from one place
    bpy.ops.edf.stitch()
    bpy.ops.edf.create_cameras(baseline=0.5)
    bpy.ops.edf.depth_mesh()
    seen, there = render("PANORAMA")
    true = pixels_of(settings.result)
    shown = true[..., :3] * 255
    inside = there & (true[..., 3] == 1)
    assert inside.mean() > (0.001 if projection == "EQUIRECTANGULAR" else 0.5)
    assert apart(seen, shown, inside) < 2
    assert apart(np.roll(seen, 1, 1), shown, inside) > 3 * apart(seen, shown, inside)


def test_the_reference_camera_sees_the_reference_in_the_world(chosen, render, pixels_of):
    settings = chosen.settings
    settings.projection, settings.crop, settings.slide_auto = "EQUIRECTANGULAR", "FULL", False
    bpy.ops.edf.stitch()
    bpy.ops.edf.create_cameras()
    bpy.ops.edf.use_as_world()
    chosen.scene.render.film_transparent = False
    seen, there = render("REFERENCE")
    true = pixels_of(settings.reference)[..., :3] * 255
    inner = np.zeros(there.shape, bool)
    inner[3:-3, 3:-3] = True
    assert apart(seen, true, inner) < 5
    assert apart(np.roll(seen, 2, 1), true, inner) > 1.8 * apart(seen, true, inner)
