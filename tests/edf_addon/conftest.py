"""An empty scene with the extension on, for each test: in bpy as a module, or in a whole Blender that has it on."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")


@pytest.fixture
def blender() -> Iterator[SimpleNamespace]:
    """scene, settings, window_manager of a file that was just begun."""
    import edf_stitch

    if not hasattr(bpy.types.Scene, "edf_stitch"):
        edf_stitch.register()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    yield SimpleNamespace(scene=scene, settings=scene.edf_stitch, window_manager=bpy.context.window_manager)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not leftovers(), "a job's folder was left behind"


def leftovers() -> list[Path]:
    """Folders of jobs in Blender's temporary folder."""
    return list(Path(bpy.app.tempdir).glob("edf_stitch_*"))


@pytest.fixture
def chosen(blender: SimpleNamespace, folder: Path, with_cache: None) -> SimpleNamespace:
    """The small pair's two files, chosen in the scene; to be stitched with what an earlier test's stitch has found."""
    for side in ("reference", "target"):
        setattr(blender.settings, side, bpy.data.images.load(str(folder / f"{side}.png")))
    return blender


@pytest.fixture(scope="session")
def set_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pictures that belong together, and one that belongs to none."""
    from ..sets import make_set
    from . import picture_files

    folder = tmp_path_factory.mktemp("set") / "pictures"
    folder.mkdir()
    noise = np.random.default_rng(2).random((240, 320, 3))
    pictures = {picture.name: picture.pixels for picture in make_set(3).pictures} | {"4.png": noise}
    for name, pixels in pictures.items():
        picture_files.write(folder / name, pixels.astype(np.float32))
    return folder


@pytest.fixture
def listed(blender: SimpleNamespace, set_folder: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Those that belong together in the list; to be stitched soon, with what an earlier test's stitch has found."""
    monkeypatch.setenv("EDF_CACHE", str(set_folder.parent / "cache"))
    assert bpy.ops.edf.add_folder(directory=str(set_folder)) == {"FINISHED"}
    blender.settings.pictures[3].use = blender.settings.dense = False
    return blender


@pytest.fixture(scope="session")
def pixels_of():
    """An image's pixels (H, W, 4) as Blender holds them, but with row 0 on top."""

    def pixels(image) -> np.ndarray:
        flat = np.empty(image.size[0] * image.size[1] * 4, np.float32)
        image.pixels.foreach_get(flat)
        return flat.reshape(image.size[1], image.size[0], 4)[::-1]

    return pixels


@pytest.fixture(scope="session")
def fingerprint(tmp_path_factory):
    """What a panorama would know a picture's content by."""
    from edf_stitch.core.commands.digests import digests_of
    from edf_stitch.edf_addon.bridge import images

    def known_by(image) -> str:
        folder = tmp_path_factory.mktemp("described")
        entry = images.describe(image, "picture", folder, bpy.context.scene)
        return images.fingerprint(entry, digests_of(folder, {"pictures": [{**entry, "digest": True}]})[0])

    return known_by
