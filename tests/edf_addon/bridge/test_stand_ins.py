"""Camera RAW and HEIC in Blender, which cannot open them: what stands in for them, and what the worker reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.core.raster.colour import decode  # noqa: E402
from edf_stitch.edf_addon.bridge import images, photo, stand_ins  # noqa: E402
from edf_stitch.synthetic_scenes.two_planes import Pair  # noqa: E402

from ...core.pictures.raw_and_heic import dng, heic, mosaic  # noqa: E402


@pytest.fixture
def photographs(blender: SimpleNamespace, tmp_path: Path, small_pair: Pair) -> list[Path]:
    """A RAW file that was held upright, and a HEIC file, opened as a pair."""
    paths = [tmp_path / "a.dng", tmp_path / "b.heic"]
    lying = np.rot90(small_pair.reference)
    paths[0].write_bytes(dng(mosaic(decode(lying)), orientation=6, focal_mm=35))
    paths[1].write_bytes(heic(small_pair.target))
    opened = bpy.ops.edf.open_pair(directory=str(tmp_path), files=[{"name": path.name} for path in paths])
    assert opened == {"FINISHED"}
    return paths


def test_what_blender_cannot_open_is_known_by_what_it_holds(tmp_path: Path, folder: Path) -> None:
    raw = tmp_path / "a.tif"
    raw.write_bytes(dng(np.zeros((8, 8), np.uint16)))
    assert stand_ins.is_needed(raw) and not stand_ins.is_needed(folder / "reference.png")
    assert not stand_ins.is_needed(tmp_path / "missing.nef")
    assert "*.heic" in stand_ins.endings() and "*.nef" in stand_ins.endings()


def test_a_picture_stands_in_upright_and_the_worker_gets_the_file(
    blender: SimpleNamespace, photographs: list[Path], small_pair: Pair, tmp_path: Path, pixels_of
) -> None:
    chosen = [blender.settings.reference, blender.settings.target]
    for image, path, true in zip(chosen, photographs, (small_pair.reference, small_pair.target), strict=True):
        assert image.name == path.name and tuple(image.size) == true.shape[1::-1] and not image.filepath_raw
        assert images.describe(image, "reference", tmp_path, blender.scene) == {"name": path.name, "path": str(path)}
        assert photo.orientation(image) == 1 and photo.upright_size(image) == tuple(image.size)
    shown = pixels_of(chosen[1])[..., :3]
    assert np.abs(shown - small_pair.target / 255).mean() < 0.03
    assert photo._exif(chosen[0]).focal_mm == 35, "what the panel says of the focal length is the file's"


def test_the_same_photographs_again_are_the_same_images(
    blender: SimpleNamespace, photographs: list[Path], tmp_path: Path, small_pair: Pair
) -> None:
    files = [{"name": path.name} for path in photographs]
    bpy.ops.edf.open_pair(directory=str(tmp_path), files=files)
    assert [image.name for image in bpy.data.images] == ["a.dng", "b.heic"]
    photographs[1].write_bytes(heic(255 - small_pair.target))
    bpy.ops.edf.open_pair(directory=str(tmp_path), files=files)
    assert blender.settings.target.name == "b.heic.001", "a panorama may still hold the one before"


def test_a_stitch_of_them_is_float(blender: SimpleNamespace, photographs: list[Path]) -> None:
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    assert blender.settings.result.is_float


def test_a_photograph_that_changed_or_is_gone_is_noticed(
    blender: SimpleNamespace, photographs: list[Path], tmp_path: Path, fingerprint: Callable[[object], str]
) -> None:
    image = blender.settings.reference
    known = fingerprint(image)
    assert not images.has_changed(image, known)
    photographs[0].write_bytes(photographs[0].read_bytes() + b"\0")
    assert images.has_changed(image, known)
    photographs[0].unlink()
    assert images.has_changed(image, known)
    with pytest.raises(images.Unusable, match="its photograph .*a.dng is not there"):
        images.describe(image, "reference", tmp_path, blender.scene)


def test_what_was_painted_over_goes_as_it_is_shown(
    blender: SimpleNamespace, photographs: list[Path], tmp_path: Path
) -> None:
    image = blender.settings.target
    image.pixels[0] = 0.5
    image.update()
    assert image.is_dirty
    assert images.describe(image, "target", tmp_path, blender.scene)["array"] == "target.npy"
    image.pack()
    assert not image.is_dirty
    assert images.describe(image, "target", tmp_path, blender.scene)["path"] == "target.packed"


def test_what_blender_opened_itself_is_refused_with_what_to_do(
    blender: SimpleNamespace, photographs: list[Path], tmp_path: Path
) -> None:
    image = bpy.data.images.load(str(photographs[1]))
    with pytest.raises(images.Unusable, match="open it with Add Pictures"):
        images.describe(image, "target", tmp_path, blender.scene)


def test_a_damaged_one_is_refused_and_nothing_is_chosen(blender: SimpleNamespace, tmp_path: Path) -> None:
    for name in ("a.dng", "b.dng"):
        (tmp_path / name).write_bytes(dng(np.zeros((64, 64), np.uint16))[:-100])
    with pytest.raises(RuntimeError, match="a.dng: the camera RAW file is damaged"):
        bpy.ops.edf.open_pair(directory=str(tmp_path), files=[{"name": "a.dng"}, {"name": "b.dng"}])
    assert blender.settings.reference is None and not bpy.data.images
