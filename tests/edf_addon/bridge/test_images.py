"""Blender's images to the worker's arrays and files, and back: values kept, top is top."""

import struct
import subprocess
import sys

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import picture_from_array

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.bridge import images  # noqa: E402

from .. import picture_files  # noqa: E402

WIDTH, HEIGHT = 6, 4


def gradient(channels: int = 3, dtype=np.uint8) -> np.ndarray:
    """Differs in every pixel, and from its mirror images."""
    full = np.iinfo(dtype).max
    steps = np.linspace(0.1, 1, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
    out = np.stack([steps, 1 - steps, steps**2, 0.25 + 0.5 * steps][:channels], axis=-1)
    return np.rint(out * full).astype(dtype)


def write(path, array):
    order = [2, 1, 0, 3][: array.shape[2]]
    cv2.imwrite(str(path), np.ascontiguousarray(array[..., order]))
    return str(path)


def set_pixels(image, rgba):
    image.pixels.foreach_set(np.ascontiguousarray(rgba[::-1], np.float32).ravel())
    image.update()


def entry(image, tmp_path):
    return images.describe(image, "reference", tmp_path, bpy.context.scene)


@pytest.mark.parametrize("channels", [3, 4])
def test_bytes_come_as_they_are_and_upright(blender, tmp_path, channels):
    array = gradient(channels)
    image = bpy.data.images.load(write(tmp_path / "a.png", array))
    assert np.array_equal(images.read(image), array)


def test_a_16_bit_file_comes_as_straight_light(blender, tmp_path):
    array = gradient(4, np.uint16)
    image = bpy.data.images.load(write(tmp_path / "a.png", array))
    ours = picture_files.read(tmp_path / "a.png")
    found = images.read(image)
    assert np.abs(found[..., :3] - ours.pixels).max() < 2e-4  # Blender's own curve
    assert np.abs(found[..., 3] - ours.alpha).max() < 1e-6


def test_an_exr_comes_as_it_is_with_straight_colours(blender, tmp_path):
    light = gradient().astype(np.float32) / 50
    alpha = np.linspace(0.2, 1, WIDTH * HEIGHT, dtype=np.float32).reshape(HEIGHT, WIDTH)
    found = images.read(bpy.data.images.load(picture_files.write(tmp_path / "a.exr", light, alpha)))
    assert found.dtype == np.float32
    assert np.allclose(found, np.dstack([light, alpha]), rtol=1e-5, atol=1e-7)


def test_a_files_own_pixels_go_by_the_file(blender, tmp_path):
    image = bpy.data.images.load(write(tmp_path / "a.png", gradient()))
    assert entry(image, tmp_path) == {"name": "a.png", "path": str(tmp_path / "a.png")}


def test_a_radiance_file_goes_by_itself_and_shows_the_same_light(blender, tmp_path):
    image = bpy.data.images.load(write(tmp_path / "a.hdr", gradient().astype(np.float32) / 50))
    assert entry(image, tmp_path) == {"name": "a.hdr", "path": str(tmp_path / "a.hdr")}
    ours = picture_files.read(tmp_path / "a.hdr").pixels
    step = ours.max(axis=2, keepdims=True) / 128  # Blender reads the lower end of a mantissa's step, we its middle
    assert (np.abs(images.read(image)[..., :3] - ours) <= 0.51 * step).all()


def test_painted_pixels_go_as_an_array_with_the_files_exif(blender, tmp_path):
    image = bpy.data.images.load(write(tmp_path / "a.png", gradient()))
    painted = np.dstack([gradient()[::-1] / 255, np.ones((HEIGHT, WIDTH))])
    set_pixels(image, painted)
    assert image.is_dirty
    found = entry(image, tmp_path)
    assert found == {"name": "a.png", "array": "reference.npy", "exif_of": str(tmp_path / "a.png")}
    assert np.array_equal(np.load(tmp_path / "reference.npy"), gradient()[::-1])


def test_generated_images_go_as_arrays(blender, tmp_path):
    rgba = np.dstack([gradient().astype(np.float32) / 100, np.ones((HEIGHT, WIDTH), np.float32)])
    image = bpy.data.images.new("made", WIDTH, HEIGHT, float_buffer=True)
    set_pixels(image, rgba)
    assert entry(image, tmp_path) == {"name": "made", "array": "reference.npy"}
    assert np.array_equal(np.load(tmp_path / "reference.npy"), rgba[..., :3])


def test_packed_bytes_go_as_the_file_that_was_packed(blender, tmp_path):
    path = tmp_path / "a.png"
    image = bpy.data.images.load(write(path, gradient()))
    image.pack()
    content = path.read_bytes()
    path.unlink()
    found = entry(image, tmp_path)
    assert found == {"name": "a.png", "path": "reference.packed"}
    assert (tmp_path / "reference.packed").read_bytes() == content


def test_a_packed_and_painted_image_goes_as_it_was_painted(blender, tmp_path):
    image = bpy.data.images.load(write(tmp_path / "a.png", gradient()))
    image.pack()
    set_pixels(image, np.dstack([gradient()[::-1] / 255, np.ones((HEIGHT, WIDTH))]))
    found = entry(image, tmp_path)
    assert found["array"] == "reference.npy" and found["exif_of"] == "reference.packed"
    assert np.array_equal(np.load(tmp_path / "reference.npy"), gradient()[::-1])


def test_a_float_image_of_another_colour_space_goes_as_blender_converts_it(blender, tmp_path):
    image = bpy.data.images.load(picture_files.write(tmp_path / "a.exr", gradient() / np.float32(255)))
    assert "path" in entry(image, tmp_path)
    image.colorspace_settings.name = "Linear Rec.2020"
    assert "array" in entry(image, tmp_path)
    assert np.abs(np.load(tmp_path / "reference.npy") - gradient() / 255).max() > 0.01


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_portrait_photographs_end_upright_by_file_and_by_array(blender, tmp_path, orientation):
    """Blender shows them as they are stored; the engine's picture of the array is turned as that of the file."""
    from edf_stitch.core.commands.worker import _picture

    stored = cv2.resize(gradient()[..., ::-1], (60, 40), interpolation=cv2.INTER_LINEAR)
    tiff = b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHII", 0x112, 3, 1, orientation) + b"\0\0\0\0"
    data = cv2.imencode(".jpg", stored)[1].tobytes()
    block = b"Exif\0\0" + tiff
    (tmp_path / "a.jpg").write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + data[2:])
    image = bpy.data.images.load(str(tmp_path / "a.jpg"))
    assert tuple(image.size) == (60, 40), "Blender turns it by itself now: images.py must not"
    by_file, turned = _picture(tmp_path, entry(image, tmp_path))
    image.pixels[0] = image.pixels[0]
    image.update()
    assert image.is_dirty
    by_array, turned_too = _picture(tmp_path, entry(image, tmp_path))
    assert turned == turned_too == orientation
    assert by_file.view.shape[:2] == ((60, 40) if orientation >= 5 else (40, 60))
    assert np.abs(by_file.view.astype(int) - by_array.view.astype(int)).max() <= 3  # two JPEG decoders
    image = bpy.data.images.load(str(tmp_path / "a.jpg"))
    image.pack()
    image.pixels[0] = image.pixels[0]
    image.update()
    found = entry(image, tmp_path)
    assert found["exif_of"] == "reference.packed" and _picture(tmp_path, found)[1] == orientation


def test_a_missing_file_is_named(blender, tmp_path):
    path = tmp_path / "a.png"
    image = bpy.data.images.load(write(path, gradient()))
    path.unlink()
    with pytest.raises(images.Unusable, match="a.png.*not there.*Find Missing Files"):
        entry(image, tmp_path)


def test_an_image_without_data_is_refused(blender, tmp_path):
    image = bpy.data.images.new("empty", 8, 8)
    image.source = "FILE"
    with pytest.raises(images.Unusable, match="“empty” has no pixels"):
        entry(image, tmp_path)


def test_movies_are_refused_with_advice(blender, tmp_path):
    image = bpy.data.images.new("film", 8, 8)
    image.source = "MOVIE"
    with pytest.raises(images.Unusable, match="movie.*save the frame"):
        entry(image, tmp_path)


def test_a_sequence_gives_its_file(blender, tmp_path):
    image = bpy.data.images.load(write(tmp_path / "a_0001.png", gradient()))
    image.source = "SEQUENCE"
    assert entry(image, tmp_path)["path"] == str(tmp_path / "a_0001.png")


RENDER = """
import bpy, sys
from pathlib import Path
from edf_stitch.edf_addon.bridge import images
scene = bpy.data.scenes.new("rendered")
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising = 1, False
scene.render.resolution_x, scene.render.resolution_y = 16, 8
scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(scene.camera)
scene.world = bpy.data.worlds.new("sky")
scene.world.color = (3.0, 0.2, 0.1)
for node in scene.world.node_tree.nodes if scene.world.node_tree else ():  # 5.0: a world always has nodes
    if node.type == "BACKGROUND":
        node.inputs["Color"].default_value = (3.0, 0.2, 0.1, 1.0)
bpy.ops.render.render(scene=scene.name)
image = next(image for image in bpy.data.images if image.type == "RENDER_RESULT")
assert images.describe(image, "reference", Path(FOLDER), scene) == {"name": image.name, "path": "reference.exr"}
assert scene.render.image_settings.file_format == "PNG", "the artist's own format is back"
try:
    images.describe(image, "target", Path(FOLDER), bpy.data.scenes.new("other"))
except images.Unusable as error:
    assert "render something first" in str(error)
else:
    raise AssertionError("a scene that was not rendered")
"""


def test_the_last_render_keeps_its_light(blender, tmp_path):
    code = f"FOLDER = {str(tmp_path)!r}\n{RENDER}"
    if bpy.app.binary_path:
        exec(code, {})
    else:  # as a module, Blender never ends when Cycles has rendered and other libraries' threads came after it
        subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
    picture = picture_files.read(tmp_path / "reference.exr")
    assert picture.view.shape[:2] == (8, 16)
    assert np.allclose(picture.pixels[2, 3], (3.0, 0.2, 0.1), rtol=1e-3)


@pytest.mark.parametrize("pack", [True, False])
@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_a_picture_of_the_worker_becomes_an_image_with_its_values(blender, tmp_path, pixels_of, pack, suffix):
    alpha = np.linspace(0, 1, WIDTH * HEIGHT, dtype=np.float32).reshape(HEIGHT, WIDTH)
    light = picture_from_array(gradient()).pixels * (1 if suffix == ".png" else 5)
    picture_files.write(tmp_path / f"x{suffix}", light, alpha)
    image = images.bring(tmp_path / f"x{suffix}", "left panorama", pack, fake_user=True)
    (tmp_path / f"x{suffix}").unlink()
    assert (image.name, image.use_fake_user, image.is_float) == ("left panorama", True, suffix == ".exr")
    assert image.is_dirty != pack, "what is not packed is unsaved, and Blender asks before it is lost"
    found = pixels_of(image)
    if suffix == ".png":
        assert np.array_equal(np.rint(found * 255)[..., :3], gradient())
    else:
        assert np.allclose(found[..., :3], light * alpha[..., None], atol=1e-6)
    assert np.allclose(found[..., 3], alpha, atol=0.5 / 255)
    again = images.read(image)
    assert np.allclose(again[..., 3] / (255 if suffix == ".png" else 1), alpha, atol=0.5 / 255)


@pytest.mark.parametrize("make", ["packed", "painted", "generated"])
@pytest.mark.parametrize("suffix", [".exr", ".png", ".tif"])
def test_saving_keeps_the_values(blender, tmp_path, make, suffix):
    """Read back by the engine, value by value; the scene's view transform has no say."""
    blender.scene.view_settings.view_transform = "AgX"
    light = picture_from_array(gradient()).pixels * np.float32(0.9)
    picture_files.write(tmp_path / "x.exr", light)
    image = images.bring(tmp_path / "x.exr", "x", make != "generated", False)
    if make == "painted":
        image.pixels[0] = image.pixels[0]
        image.update()
        assert image.is_dirty
    images.save(image, tmp_path / f"out{suffix}")
    saved = picture_files.read(tmp_path / f"out{suffix}")
    assert saved.bits == (32 if suffix == ".exr" else 16)
    assert np.abs(saved.pixels - light).max() < (1e-6 if suffix == ".exr" else 1e-4)
    assert not [path for path in tmp_path.iterdir() if ".part" in path.name]


@pytest.mark.parametrize("make", ["packed", "generated"])
def test_saving_as_radiance_keeps_light_brighter_than_white(blender, tmp_path, make):
    light = picture_from_array(gradient()).pixels * np.float32(40)
    picture_files.write(tmp_path / "x.exr", light)
    image = images.bring(tmp_path / "x.exr", "x", make == "packed", False)
    images.save(image, tmp_path / "out.hdr")
    saved = picture_files.read(tmp_path / "out.hdr")
    assert saved.bits == 32 and (tmp_path / "out.hdr").read_bytes().startswith(b"#?RADIANCE")
    # eight bits of the brightest channel
    assert (np.abs(saved.pixels - light).max(axis=2) <= light.max(axis=2) / 120).all() and saved.pixels.max() > 30


@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr"])
@pytest.mark.parametrize("channels", [3, 4])
def test_saving_bytes_keeps_every_level(blender, tmp_path, suffix, channels):
    array = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(channels, axis=2)
    array[..., -1] = array[..., -1] if channels == 3 else 200
    image = bpy.data.images.new("x", 16, 16, alpha=channels == 4)
    set_pixels(image, np.dstack([array / 255, np.ones((16, 16))])[..., :4])
    images.save(image, tmp_path / f"out{suffix}")
    saved = picture_files.read(tmp_path / f"out{suffix}")
    if suffix == ".exr":
        ours = picture_from_array(array)
        assert np.abs(saved.pixels - ours.pixels).max() < 1e-4
    else:
        assert saved.bits == 8
        assert np.array_equal(saved.view, array[..., :3])
    assert (saved.alpha is None) == (channels == 3)
    assert saved.alpha is None or np.allclose(saved.alpha, 200 / 255, atol=1e-6)


def test_saving_refuses_what_it_cannot_do(blender, tmp_path):
    image = bpy.data.images.new("x", 8, 8)
    with pytest.raises(images.Unusable, match="not saved as .jpx"):
        images.save(image, tmp_path / "x.jpx")
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(images.Unusable, match="file"):
        images.save(image, tmp_path / "file" / "x.png")


def test_a_png_of_the_workers_is_not_decoded_until_it_is_looked_at_and_half_a_one_is_refused(blender, tmp_path):
    path = tmp_path / "0.png"
    picture_files.write(path, np.full((30, 40, 3), 0.5, np.float32))
    image = images.bring(path, "difference", pack=True, fake_user=False)
    assert not image.has_data and image.packed_file is not None
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(images.Unusable, match="is the disk full"):
        images.bring(path, "half", pack=True, fake_user=False)
    assert "half" not in bpy.data.images and tuple(image.size) == (40, 30), "it is packed"
    path.write_bytes(b"")
    with pytest.raises(images.Unusable, match="is the disk full"):
        images.bring(path, "nothing", pack=True, fake_user=False)


@pytest.mark.parametrize("suffix", [".png", ".exr"])
@pytest.mark.parametrize("pack", [True, False])
def test_a_place_that_cannot_be_written_is_said_and_nothing_is_left(blender, tmp_path, pack, suffix):
    picture_files.write(tmp_path / f"x{suffix}", np.full((30, 40, 3), 0.5, np.float32))
    image = images.bring(tmp_path / f"x{suffix}", "panorama", pack, fake_user=False)
    blender.settings.result = image
    (tmp_path / "file").touch()
    there = sorted(tmp_path.iterdir())
    with pytest.raises(RuntimeError, match=r"file/out.* cannot be written: .*; choose another place"):
        bpy.ops.edf.save(image=image.name, filepath=str(tmp_path / "file" / f"out{suffix}"))
    with pytest.raises(RuntimeError, match=r"beside the \.blend file, which is nowhere yet"):
        bpy.ops.edf.save(image=image.name, filepath=f"//out{suffix}")
    assert sorted(tmp_path.iterdir()) == there
